"""The same arm in MuJoCo."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.ik import Scene
from jacokin.model import to_mujoco
from tests.robot_files import load_text, urdf_text


def test_twin_in_mujoco_has_every_frame(robot: Robot, rng: np.random.Generator) -> None:
    model = to_mujoco(robot)
    data = mujoco.MjData(model)
    assert [model.joint(i).name for i in range(model.njnt)] == list(robot.joint_names)
    for q in robot.sample(rng, 50):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        for frame in robot.frames:
            placement = robot.forward_kinematics(q, frame)
            np.testing.assert_allclose(data.site(frame).xpos, placement.translation, atol=1e-12)
            np.testing.assert_allclose(data.site(frame).xmat.reshape(3, 3), placement.rotation, atol=1e-12)


@pytest.mark.parametrize("link", ["link_base", "link_3", "hand", "link_finger_2"])
def test_any_link_may_be_called_world(link: str, tmp_path: Path, rng: np.random.Generator) -> None:
    """MuJoCo takes every body of that name for the root: it loses the shapes of a link that is none."""
    text = urdf_text()
    both = [
        load_text(tmp_path / f"{k}.urdf", each) for k, each in enumerate((text, text.replace(f'"{link}"', '"world"')))
    ]
    q = both[0].sample(rng, 100)
    plain, renamed = (robot.clearance(q, Scene([]), self_collision=True) for robot in both)
    np.testing.assert_array_equal(renamed, plain)
    assert jacokin.crosscheck(both[1], samples=20, rng=rng).within()
