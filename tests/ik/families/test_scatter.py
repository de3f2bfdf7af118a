"""Members for a first look: exact at the steps, guesses near the ends of intervals."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from jacokin.ik.solutions.family import Family

from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model.angles import wrap_to_pi

STEP = math.radians(10.0)


def away(rows: Array, q: Array) -> float:
    """From a configuration (dof,) to the nearest of some rows, the farthest joint [rad]."""
    return float(np.abs(wrap_to_pi(rows - q)).max(axis=1).min(initial=math.inf))


def check_ends(family: Family, rows: np.ndarray) -> tuple[int, int]:
    """Of intervals longer than two steps: how many ends that a row is near, and how many there are."""
    near = count = 0
    for interval in family:
        if interval.length < 2.0 * STEP or interval.ends[0].kind == "circle":
            continue
        for p in (interval.start, interval.stop):
            near += away(rows, interval.at(p)) < 0.1
            count += 1
    return near, count


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_a_first_look_sees_members_and_about_where_intervals_end(bundled: Callable[[str], Robot], name: str) -> None:
    robot, rng = bundled(name), np.random.default_rng(3)
    solver = IKSolver(robot, collision="ignore")
    near = count = 0
    for number in range(6):
        pose = robot.forward_kinematics(robot.sample(rng))
        span = (-math.pi, math.pi) if number % 2 else (-1.0, 0.7)
        target = FreeAxis(pose, axis=rng.normal(size=3), range=span) if robot.dof == 6 else pose
        seen = solver.scatter(target, STEP)
        assert seen is not None
        assert seen.reached
        family = solver.family(target)
        for q, p in zip(seen.q[~seen.guessed], seen.parameters[~seen.guessed], strict=True):
            assert robot.within_limits(q)
            wanted = target.at(float(p)) if isinstance(target, FreeAxis) else target
            found = robot.forward_kinematics(q)
            assert np.abs(found.homogeneous - wanted.homogeneous).max() < 1e-9
        for interval in family:
            inner = STEP * np.arange(math.ceil(interval.start / STEP + 1e-6), interval.stop / STEP - 1e-6)
            for p in inner:
                assert away(seen.q[~seen.guessed], interval.at(float(p))) < 1e-6
        at_ends = check_ends(family, seen.q)
        near, count = near + at_ends[0], count + at_ends[1]
    assert count > 20
    assert near >= 0.9 * count


def test_more_values_than_there_is_room_for_are_not_looked_at(robot: Robot) -> None:
    pose = robot.forward_kinematics(robot.home)
    solver = IKSolver(robot, collision="ignore")
    assert solver.scatter(FreeAxis(pose, axis=(1, 0, 0)), 0.01) is None
    assert solver.scatter(FreeAxis(pose, axis=(1, 0, 0), range=(-0.2, 0.2)), 0.01) is not None
    assert solver.scatter(pose, STEP) is None  # no parameter is free


@pytest.mark.parametrize("step", [0.0, -0.1, math.nan, "wide"])
def test_a_step_is_a_positive_number(robot: Robot, step: Any) -> None:
    with pytest.raises(InvalidInputError, match="step"):
        IKSolver(robot).scatter(FreeAxis(robot.forward_kinematics(robot.home), axis=(0, 0, 1)), step)
