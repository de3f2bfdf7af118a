"""The example that grasps a cube: held up by contact alone, nothing written but the controls."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.programs import python
from tests.scripts import load_script

EXAMPLE = Path(__file__).parents[2] / "examples" / "grasp_cube.py"
LIFTED = 0.05  # [m] above where it lay
HELD = 1.0  # [s]


def test_the_cube_is_lifted_and_held_by_the_controls_alone() -> None:
    example = load_script(EXAMPLE)
    scene = example.Scene()
    physics, model = scene.physics, scene.physics.model
    assert model.neq == 0
    start = scene.cube_height()
    initial = physics.get_state()
    controls, heights = [], []
    for _ in scene.perform():
        controls.append(physics.data.ctrl.copy())
        heights.append(scene.cube_height())
    steps = round(HELD / (example.STEPS * physics.timestep))
    assert min(heights[-steps:]) >= start + LIFTED
    assert start == pytest.approx(example.HALF, abs=1e-4)

    # MuJoCo alone, fed with the same controls from the same first frame, ends in the same state bit by bit.
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, initial, int(mujoco.mjtState.mjSTATE_INTEGRATION))
    mujoco.mj_forward(model, data)
    data.qacc_warmstart[:] = initial[1 + model.nq + model.nv :][: model.nv]
    for ctrl in controls:
        data.ctrl[:] = ctrl
        mujoco.mj_step2(model, data)
        mujoco.mj_step(model, data, example.STEPS - 1)
        mujoco.mj_step1(model, data)
    np.testing.assert_array_equal(data.qpos, physics.data.qpos)
    np.testing.assert_array_equal(data.qvel, physics.data.qvel)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="MUJOCO_GL=egl and osmesa are Linux's")
def test_the_example_draws_its_pictures(tmp_path: Path) -> None:
    """Needs Debian's libegl1 and libegl-mesa0 (egl), or libosmesa6 (osmesa)."""
    from PIL import Image

    drawing = {"MUJOCO_GL": os.environ.get("MUJOCO_GL") or "egl"}
    words = (EXAMPLE, "--width", "64", "--height", "48", "--folder", tmp_path)
    done = python(*words, timeout=120.0, environment=drawing)
    assert "cube at 0.1" in done.stdout
    with Image.open(tmp_path / "grasp_cube.png") as strip:
        assert strip.size == (64 * load_script(EXAMPLE).STRIP, 48)
        pixels = np.asarray(strip)
    assert pixels.std() > 10.0  # not a blank picture
    assert np.abs(pixels[:, :64].astype(int) - pixels[:, -64:].astype(int)).mean() > 1.0  # and the arm has moved
    with Image.open(tmp_path / "grasp_cube.gif") as animation:
        animation.seek(20)  # there are that many
