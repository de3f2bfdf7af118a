"""mink: the loop a user writes with `solve_ik`, limits built once, daqp, restarts."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib.metadata import version

import mink
import mujoco
import numpy as np
from restarts import ITERATIONS, TOLERANCE, Starts, multi_start


class Peer:
    version = f"mink {version('mink')}, daqp {version('daqp')}, mujoco {version('mujoco')}"

    def __init__(self, setup):
        self.model = mujoco.MjModel.from_xml_path(setup["arm_mjcf"])
        self.configuration = mink.Configuration(self.model)
        self.limits = [mink.ConfigurationLimit(self.model)]
        self.task = mink.FrameTask("end_effector", "site", 1.0, 1.0, lm_damping=1e-2)
        self.starts = Starts(setup)

    def forward(self, q):
        self.configuration.update(q)
        return self.configuration.get_transform_frame_to_world("end_effector", "site").as_matrix()

    def prepare(self, T):
        return mink.SE3.from_matrix(T)

    def solve(self, target):
        self.task.set_target(target)
        return multi_start(self.starts, self._descend)

    def _descend(self, start):
        self.configuration.update(start)
        for _ in range(ITERATIONS):
            error = self.task.compute_error(self.configuration)
            if np.linalg.norm(error[:3]) < TOLERANCE and np.linalg.norm(error[3:]) < TOLERANCE:
                return self.configuration.q
            velocity = mink.solve_ik(self.configuration, [self.task], 1.0, "daqp", limits=self.limits)
            self.configuration.integrate_inplace(velocity, 1.0)
        return None

    def answers(self, raw):
        return [] if raw is None else [raw]
