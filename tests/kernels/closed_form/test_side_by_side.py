"""Starts refined side by side, against the same one by one."""

from __future__ import annotations

import numpy as np

from jacokin import Robot
from jacokin.kernels.branches import ABREAST, FOUND, LANE_ROWS
from jacokin.kernels.closed_form.arm import pose_of, unpack_arm
from jacokin.kernels.closed_form.roots import make_roots
from jacokin.kernels.closed_form.wrist import (
    MAX_STARTS,
    Q6,
    STARTED,
    Starts,
    complete,
    fill_starts,
    refine,
    refine_abreast,
    starts_at_q6,
)
from tests.kernels.closed_form.tools import closed_form, target


def test_starts_side_by_side_end_where_each_does_alone(robot: Robot, rng: np.random.Generator) -> None:
    """To the last bit: at the joint 6 of branches, beside it, and anywhere, where most iterations are needed."""
    form = closed_form(robot)
    _, arm, _ = form.constants
    k, q = unpack_arm(arm), np.empty(6)
    starts, work, rows = (
        Starts(np.empty((MAX_STARTS, 4)), np.zeros(1, np.int64)),
        make_roots(),
        np.zeros((LANE_ROWS, 8)),
    )
    for each in robot.sample(rng, 10):
        T = target(robot, each)
        pose = pose_of(arm, k, T)
        rows[Q6] = each[5] + np.array([0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 3.0])
        wanted = rows[Q6].copy()
        fill_starts(k, pose, rows)
        refine_abreast(k, pose, rows)
        for n in range(ABREAST):
            starts.filled[0] = 0
            starts_at_q6(k, pose, wanted[n], 0.0, starts, work)
            assert (rows[STARTED, n] > 0.0) == (starts.filled[0] > 0)
            first = starts.rows[0]
            q1, q5, q6, _ = refine(k, pose, first[0], first[1], first[2], 0.0)
            complete(k, pose, q1, q5, q6, q)
            np.testing.assert_array_equal(rows[FOUND : FOUND + 6, n], q)
