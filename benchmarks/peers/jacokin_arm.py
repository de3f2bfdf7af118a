"""jacokin itself, through the same worker as its peers; "variant" picks the call."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib.metadata import version

import pinocchio as pin

import jacokin


class Peer:
    version = f"jacokin {jacokin.__version__}, pin {version('pin')}"

    def __init__(self, setup):
        self.robot = jacokin.load_robot(setup["robot"])
        self.variant = setup["variant"]
        self.solver = jacokin.IKSolver(self.robot, method="qp" if self.variant == "qp" else "auto", collision="ignore")
        self.call = self.solver.solve_all if self.variant == "solve_all" else self.solver.solve

    def forward(self, q):
        return self.robot.forward_kinematics(q).homogeneous

    def prepare(self, T):
        return pin.SE3(T[:3, :3].copy(), T[:3, 3].copy())

    def solve(self, target):
        return self.call(target)  # from home, which is the default

    def answers(self, raw):
        if self.variant == "solve_all":
            return raw.q_within_limits
        return [raw.q] if raw.success else []
