"""ssik: the solver it ships for the seven-joint Jaco (`j2s7s300_ik`), samples of the self-motion inside the limits."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib.metadata import version

from ssik.prebuilt.kinova import j2s7s300_ik


class Peer:
    version = f"ssik {version('ssik')}"

    def __init__(self, setup):
        j2s7s300_ik.solve(j2s7s300_ik.T_HOME)  # load what it loads on the first call

    def forward(self, q):
        return j2s7s300_ik.fk(q)

    def prepare(self, T):
        return T

    def solve(self, target):
        return j2s7s300_ik.solve(target)

    def answers(self, raw):
        return [solution.q for solution in raw]
