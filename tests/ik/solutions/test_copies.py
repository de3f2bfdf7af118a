"""Families and results of families in other processes and as copies."""

from __future__ import annotations

import copy
import pickle
from collections.abc import Callable

import numpy as np
import pytest

from jacokin import FreeAxis, IKSolver, Robot
from jacokin.ik import SolutionSet

COPIES: dict[str, Callable[[SolutionSet], SolutionSet]] = {
    "pickle": lambda family: pickle.loads(pickle.dumps(family)),
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
}


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", COPIES)
@pytest.mark.parametrize("axis", [None, (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_a_copy_of_a_family_has_the_same_members(
    bundled: Callable[[str], Robot], rng: np.random.Generator, axis: tuple[float, float, float] | None, kind: str
) -> None:
    robot = bundled("j2s7s300" if axis is None else "j2n6s300")
    q, seed = robot.sample(rng, 2)
    T = robot.forward_kinematics(q)
    target = T if axis is None else FreeAxis(T, axis=axis)
    solver = IKSolver(robot, collision="ignore")
    family = solver.solve_all(target)
    again = COPIES[kind](family)
    assert (len(again), again.branches, again.complete) == (len(family), family.branches, family.complete)
    assert list(map(repr, again.intervals)) == list(map(repr, family.intervals))
    np.testing.assert_array_equal(again.sample(20), family.sample(20))
    np.testing.assert_array_equal(again.nearest(seed), family.nearest(seed))
    np.testing.assert_array_equal(again.best("margin"), family.best("margin"))
    interval = pickle.loads(pickle.dumps(family.intervals[0]))
    np.testing.assert_array_equal(interval.at(interval.start), family.intervals[0].at(interval.start))
    result = solver.solve(target, seed=seed)
    for other in (pickle.loads(pickle.dumps(result)), copy.deepcopy(result)):
        assert other.parameter == result.parameter
        np.testing.assert_array_equal(other.q, result.q)
