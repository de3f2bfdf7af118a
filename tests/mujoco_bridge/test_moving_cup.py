"""The example that grasps a cup that moves: planned anew from the motion under way, done by contact."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.programs import run_drawing
from tests.scripts import load_script

EXAMPLE = Path(__file__).parents[2] / "examples" / "moving_cup.py"


def test_a_scene_says_where_the_cup_is_and_how_fast() -> None:
    module = load_script(EXAMPLE)
    bench = module.Bench()
    bench.look()
    for _ in range(module.SCENE_EVERY):
        bench.command(bench.robot.home, np.zeros(6))
    seen = bench.look()
    np.testing.assert_allclose(seen.velocity, module.PUSHES[0][1], atol=1e-3)
    np.testing.assert_allclose(seen.after(1.0), seen.position + module.PUSHES[0][1], atol=1e-3)


@pytest.mark.slow
def test_the_moving_cup_is_lifted_and_the_board_not_touched(capsys: pytest.CaptureFixture[str]) -> None:
    module = load_script(EXAMPLE)
    touched = set[str]()
    speeds: list[Any] = []

    bench = module.Bench()

    def watch() -> None:
        model, data = bench.physics.model, bench.physics.data
        for contact in data.contact[: data.ncon]:
            names = [model.geom(int(geom)).name for geom in contact.geom]
            if any("board" in name for name in names):
                touched.update(names)
        speeds.append(np.array(bench.physics.bind(bench.arm.joints).qvel))

    bench.watch = watch
    happened = module.Run(bench).perform()
    assert not {name for name in touched if "board" not in name and "floor" not in name and "ground" not in name}
    assert happened.height > 0.1
    assert happened.seconds < 15.0
    assert happened.plans > 40
    assert happened.going_on > 0.6 * happened.plans
    assert happened.failed == 0
    # The arm is never jerked: the simulated joints follow what was planned, whose accelerations are 2 rad/s^2.
    assert np.abs(np.diff(speeds, axis=0)).max() < 0.15
    assert np.abs(speeds).max() < 1.1 * bench.robot.velocity_limit.max()
    assert "the hand is closed" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="MUJOCO_GL=egl and osmesa are Linux's")
def test_a_picture_is_written(tmp_path: Path) -> None:
    from PIL import Image

    file = tmp_path / "cup.gif"
    run_drawing(EXAMPLE, "--picture", file, PYTHONPATH=str(EXAMPLE.parents[1]))
    with Image.open(file) as picture:
        assert getattr(picture, "n_frames", 1) > 20
