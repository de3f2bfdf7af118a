"""ssik: `jaco2_ik` (every branch inside the limits) or `j2s7s300_ik` (samples of the self-motion), which it ships."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib import import_module
from importlib.metadata import version


class Peer:
    version = f"ssik {version('ssik')}"

    def __init__(self, setup):
        self.solver = import_module(f"ssik.prebuilt.kinova.{setup['variant']}")
        self.solver.solve(self.solver.T_HOME)  # load what it loads on the first call

    def forward(self, q):
        return self.solver.fk(q)

    def prepare(self, T):
        return T

    def solve(self, target):
        return self.solver.solve(target)

    def answers(self, raw):
        return [solution.q for solution in raw]
