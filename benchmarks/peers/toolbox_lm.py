"""roboticstoolbox-python: `ik_LM`, its compiled Levenberg-Marquardt, up to 100 restarts."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib.metadata import version

import numpy as np
import roboticstoolbox as rtb

# Its error measure is half the squared norm of the six-vector of errors: 1e-13 is 4.5e-7 in metres or radians.
TOLERANCE = 1e-13


class Peer:
    version = f"roboticstoolbox-python {version('roboticstoolbox-python')}"

    def __init__(self, setup):
        robot = rtb.Robot.URDF(setup["urdf"])
        self.ets = robot.ets(start="link_base", end="end_effector")
        self.home = np.array(setup["home"])

    def forward(self, q):
        return self.ets.eval(q)

    def prepare(self, T):
        return T

    def solve(self, target):
        return self.ets.ik_LM(target, q0=self.home, slimit=100, tol=TOLERANCE)

    def answers(self, raw):
        return [raw.q] if raw.success else []
