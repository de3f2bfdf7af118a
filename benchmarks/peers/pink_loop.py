"""pink: the loop a user writes with `solve_ik` on the URDF, limits built once, daqp, restarts."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib.metadata import version

import numpy as np
import pink
import pinocchio as pin
from pink.limits import ConfigurationLimit
from pink.tasks import FrameTask
from restarts import ITERATIONS, TOLERANCE, Starts, multi_start


class Peer:
    version = f"pin-pink {version('pin-pink')}, daqp {version('daqp')}, pin {version('pin')}"

    def __init__(self, setup):
        full = pin.buildModelFromUrdf(setup["urdf"])
        arm = set(setup["joints"])
        fingers = [i for i, name in enumerate(full.names) if i and name not in arm]
        self.model = pin.buildReducedModel(full, fingers, pin.neutral(full))
        self.joints = [self.model.joints[self.model.getJointId(name)] for name in setup["joints"]]
        self.limits = [ConfigurationLimit(self.model)]
        self.task = FrameTask("end_effector", position_cost=1.0, orientation_cost=1.0, lm_damping=1e-2)
        self.starts = Starts(setup)
        self.configuration = pink.Configuration(
            self.model, self.model.createData(), pin.neutral(self.model), forward_kinematics=True
        )

    def _packed(self, angles):
        """Pinocchio's q: (cos, sin) for a continuous joint."""
        q = np.empty(self.model.nq)
        for joint, angle in zip(self.joints, angles, strict=True):
            q[joint.idx_q : joint.idx_q + joint.nq] = (np.cos(angle), np.sin(angle)) if joint.nq == 2 else angle
        return q

    def forward(self, q):
        self.configuration.update(self._packed(q))
        return self.configuration.get_transform_frame_to_world("end_effector").homogeneous

    def prepare(self, T):
        return pin.SE3(T[:3, :3].copy(), T[:3, 3].copy())

    def solve(self, target):
        self.task.set_target(target)
        return multi_start(self.starts, self._descend)

    def _descend(self, start):
        self.configuration.update(self._packed(start))
        for _ in range(ITERATIONS):
            error = self.task.compute_error(self.configuration)
            if np.linalg.norm(error[:3]) < TOLERANCE and np.linalg.norm(error[3:]) < TOLERANCE:
                return self.configuration.q
            velocity = pink.solve_ik(self.configuration, [self.task], 1.0, solver="daqp", limits=self.limits)
            self.configuration.integrate_inplace(velocity, 1.0)
        return None

    def answers(self, raw):
        if raw is None:
            return []
        pairs = [raw[joint.idx_q : joint.idx_q + joint.nq] for joint in self.joints]
        return [[np.arctan2(pair[1], pair[0]) if len(pair) == 2 else pair[0] for pair in pairs]]
