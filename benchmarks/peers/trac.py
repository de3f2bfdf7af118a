"""pytracik: TRAC-IK, started at home, its own restarts until its time runs out."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib.metadata import version

import numpy as np
from trac_ik import TracIK


class Peer:
    version = f"pytracik {version('pytracik')}"

    def __init__(self, setup):
        # Four times its default time [s], which is too short for a few targets; a bound on each component of the
        # error [m, rad], 8.7e-7 on the norm.
        self.solver = TracIK("link_base", "end_effector", setup["urdf"], timeout=0.02, epsilon=5e-7)
        self.home = np.array(setup["home"])

    def forward(self, q):
        T = np.eye(4)
        T[:3, 3], T[:3, :3] = self.solver.fk(np.asarray(q))
        return T

    def prepare(self, T):
        return T[:3, 3].copy(), T[:3, :3].copy()

    def solve(self, target):
        return self.solver.ik(*target, self.home)

    def answers(self, raw):
        return [] if raw is None else [raw]
