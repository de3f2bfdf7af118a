"""placo: the loop that its examples of arms show, one step of `KinematicsSolver` a tick, with limits of velocity."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

import contextlib
from importlib.metadata import version

import numpy as np
import placo


class Peer:
    version = f"placo {version('placo')}, pin {version('pin')}"

    def __init__(self, setup):
        self.joints = setup["joints"]
        self.frame = setup["frame"]
        self.robot = placo.RobotWrapper(setup["urdf"], placo.Flags.ignore_collisions)
        for joint, limit in zip(self.joints, setup["velocity_limit"], strict=True):
            self.robot.set_velocity_limit(joint, limit)
        self._put(setup["start"])
        self.solver = placo.KinematicsSolver(self.robot)
        self.solver.mask_fbase(True)
        self.solver.enable_velocity_limits(True)
        self.solver.dt = setup["dt"]
        self.task = self.solver.add_frame_task(self.frame, self.robot.get_T_world_frame(self.frame))
        self.task.configure("tool", "soft", 1.0, 1.0)
        self.solver.add_regularization_task(1e-4)

    def _put(self, q):
        for joint, angle in zip(self.joints, q, strict=True):
            self.robot.set_joint(joint, angle)
        self.robot.update_kinematics()

    def forward(self, q):
        now = [self.robot.get_joint(joint) for joint in self.joints]
        self._put(q)
        T = np.array(self.robot.get_T_world_frame(self.frame))
        self._put(now)
        return T

    def prepare(self, T):
        return T

    def solve(self, target):
        self.task.T_world_frame = target
        with contextlib.suppress(RuntimeError):  # its QP has no solution in this tick: the arm stays
            self.solver.solve(True)
        self.robot.update_kinematics()
        return [self.robot.get_joint(joint) for joint in self.joints]

    def answers(self, raw):
        return [raw]
