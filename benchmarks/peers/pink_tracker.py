"""pink: the loop that its example of a UR5 shows, one `solve_ik` a tick, with limits of velocity."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib.metadata import version

import numpy as np
import pink
import pinocchio as pin
from pink.tasks import FrameTask, PostureTask


class Peer:
    version = f"pin-pink {version('pin-pink')}, daqp {version('daqp')}, pin {version('pin')}"

    def __init__(self, setup):
        self.model = pin.buildModelFromUrdf(setup["urdf"])
        self.model.velocityLimit[:] = setup["velocity_limit"]
        self.frame, self.dt = setup["frame"], setup["dt"]
        start = np.array(setup["start"])
        self.configuration = pink.Configuration(self.model, self.model.createData(), start, forward_kinematics=True)
        self.task = FrameTask(self.frame, position_cost=1.0, orientation_cost=1.0)
        posture = PostureTask(cost=1e-3)
        posture.set_target(start)
        self.tasks = [self.task, posture]

    def forward(self, q):
        configuration = pink.Configuration(self.model, self.model.createData(), q, forward_kinematics=True)
        return configuration.get_transform_frame_to_world(self.frame).homogeneous

    def prepare(self, T):
        return pin.SE3(T[:3, :3].copy(), T[:3, 3].copy())

    def solve(self, target):
        self.task.set_target(target)
        velocity = pink.solve_ik(self.configuration, self.tasks, self.dt, solver="daqp", safety_break=False)
        self.configuration.integrate_inplace(velocity, self.dt)
        return self.configuration.q

    def answers(self, raw):
        return [raw]
