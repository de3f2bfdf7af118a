"""The problems of free motions: the same in each run, with clear ends, and a referee that finds what is wrong."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from benchmarks.motion import KINDS, faults, problems, run
from jacokin import Robot, plan_motion


@pytest.mark.parametrize("kind", KINDS)
def test_problems_have_clear_ends_and_repeat(robot: Robot, kind: str) -> None:
    first, again = next(problems(robot, kind, 1)), next(problems(robot, kind, 1))
    np.testing.assert_array_equal(first.start, again.start)
    np.testing.assert_array_equal(first.goal.homogeneous, again.goal.homogeneous)
    assert np.min(robot.clearance(first.start, first.scene, self_collision=True)) > 0.0
    assert first.solver.solve(first.goal).success


def test_the_referee_sees_contact_and_speed(robot: Robot) -> None:
    problem = next(problems(robot, "table under pick", 1))
    motion = plan_motion(problem.solver, problem.start, problem.goal, time_limit=10.0)
    assert faults(robot, problem, motion, 0.05) == []
    ends = motion.q[[0, -1]]
    straight = dataclasses.replace(motion, t=np.array([0.0, 0.1]), q=ends, v=np.zeros_like(ends))
    assert {"contact", "velocity limit"} <= set(faults(robot, problem, straight, 0.05))


def test_a_row_of_the_table(robot: Robot) -> None:
    row = run(robot, "box", 2, 10.0, 0.05)
    assert row.startswith("| j2n6s300 | box | 2 of 2 |")
    assert row.endswith("| 0 |")
