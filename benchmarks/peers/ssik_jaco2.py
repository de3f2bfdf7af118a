"""ssik: the solver it ships for the Jaco (`jaco2_ik`), every branch inside the limits."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib.metadata import version

from ssik.prebuilt.kinova import jaco2_ik


class Peer:
    version = f"ssik {version('ssik')}"

    def __init__(self, setup):
        jaco2_ik.solve(jaco2_ik.T_HOME)  # load what it loads on the first call

    def forward(self, q):
        return jaco2_ik.fk(q)

    def prepare(self, T):
        return T

    def solve(self, target):
        return jaco2_ik.solve(target)

    def answers(self, raw):
        return [solution.q for solution in raw]
