"""The same arm in MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np

from jacokin import Robot
from jacokin.model import to_mujoco


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
