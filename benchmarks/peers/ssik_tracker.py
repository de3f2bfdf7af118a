"""ssik: `Manipulator.tracker`, one pose a tick, its joint speeds limited, other branches allowed."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib.metadata import version

from ssik import Manipulator


class Peer:
    version = f"ssik {version('ssik')}"

    def __init__(self, setup):
        self.arm = Manipulator.from_prebuilt(setup["variant"])
        self.dt, self.ticks = setup["dt"], 0
        self.tracker = self.arm.tracker(setup["home"], max_joint_speed=setup["velocity_limit"], allow_jump=True, t0=0.0)

    def forward(self, q):
        return self.arm.fk(q)

    def prepare(self, T):
        return T

    def solve(self, target):
        self.ticks += 1
        return self.tracker.update(target, self.ticks * self.dt)

    def answers(self, raw):
        return [raw.q]
