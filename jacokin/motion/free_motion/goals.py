"""Goals of a free motion: the configurations that reach what is asked for, and what each of them reaches."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.seeds import checked_start, random_configurations
from jacokin.ik.solver import SEVEN, IKSolver
from jacokin.ik.targets import PartialTarget, Target, TargetPose, interpret
from jacokin.model import angles, checks
from jacokin.model.angles import TURN
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot
from jacokin.motion.grasps import Grasp
from jacokin.motion.trajectory import Aim, Goal

SPREAD = float(np.radians(20.0))  # between members of a family that are tried
TURNED = float(np.radians(30.0))  # between angles about a free axis that are tried on seven joints
STARTS = 8  # of descents to a goal without a closed form
MOST_COPIES = 64  # of one configuration, whole turns away within the limits


def list_aims(robot: Robot, goal: Any) -> tuple[Any, ...]:
    """The goals of a list, or the only one.

    Raises:
        InvalidInputError: an empty list.
    """
    is_list = isinstance(goal, list | tuple) and not all(isinstance(each, PartialTarget) for each in goal)
    if isinstance(goal, list | tuple) and not goal:
        raise InvalidInputError("goal is empty; give a configuration, a pose, a FreeAxis, or a list of them")
    if is_list and not isinstance(goal[0], int | float | np.number) and not _is_matrix(goal):
        return tuple(goal)
    if isinstance(goal, np.ndarray) and goal.ndim == 3:
        return tuple(goal)
    if isinstance(goal, np.ndarray) and goal.ndim == 2 and goal.shape != (4, 4):
        return tuple(goal)
    return (goal,)


def _is_matrix(goal: Sequence[Any]) -> bool:
    """Whether a list is the rows of one homogeneous matrix."""
    return len(goal) == 4 and all(isinstance(row, list | tuple) and len(row) == 4 for row in goal)


class GoalFinder:
    """Finds the configurations that reach goals; those that are nearer to the start of the motion come first."""

    def __init__(self, solver: IKSolver, start: Array, rng: np.random.Generator) -> None:
        """Take a checked start (dof,) [rad]."""
        self._solver, self._start, self._rng = solver, start, rng
        self._robot = solver.robot

    def find(self, number: int, aim: Any) -> tuple[list[Goal], str]:
        """Configurations that reach one goal within the limits, in contact or not; and why there is none.

        Raises:
            InvalidInputError: not a goal, or malformed; a configuration outside the limits.
        """
        robot = self._robot
        if not isinstance(aim, pin.SE3 | FreeAxis | PartialTarget | Grasp | list | tuple):
            aim = checks.array(f"goal {number}", aim, "a configuration, a pose, a FreeAxis or a grasp")
        if isinstance(aim, list | tuple) and aim and not isinstance(aim[0], PartialTarget):
            aim = checks.array(f"goal {number}", aim, "a configuration, a pose, a FreeAxis or a grasp")
        if isinstance(aim, np.ndarray) and aim.ndim == 1 and (aim.shape == (robot.dof,) or aim.shape != (3,)):
            q = checked_start(robot, aim, "goal" if number == 0 else f"goal {number}", noise=0.0)
            return self._goals([(q, None)], number, None), ""
        wanted = interpret(aim.target if isinstance(aim, Grasp) else aim, self._solver.frame)
        found = list(self._configurations(wanted))
        if found:
            return self._goals(found, number, aim), ""
        if wanted.free_axis is not None and self._robot.dof == SEVEN:
            return [], "no configuration within the limits was found at any of the angles that were tried"
        return [], self._solver.solve(self._pose_of(wanted), seed=self._start, closest=False).message

    def _pose_of(self, wanted: TargetPose) -> Target:
        if wanted.free_axis is not None:
            return wanted.free_axis
        return wanted.position if wanted.position_only else wanted.matrix

    def _configurations(self, wanted: TargetPose) -> Iterator[tuple[Array, float | None]]:
        """Configurations that reach a target, each with its parameter."""
        solver, verifier = self._solver, self._solver.verifier
        if wanted.free_axis is not None and solver.has_families and self._robot.dof == SEVEN:
            yield from self._turned(wanted)
        elif wanted.free_axis is not None or (solver.has_families and not wanted.position_only):
            yield from self._members(wanted)
        elif solver.has_closed_form and not wanted.position_only:
            rows = solver.closed_form().solve_all(wanted.matrix, self._start)
            for q in rows.q[verifier.reached_rows(rows)]:
                yield q, None
        else:
            seeds = [self._start, self._robot.home, *random_configurations(self._robot, STARTS - 2, self._rng)]
            for seed in seeds:
                result = solver.solve(self._pose_of(wanted), seed=seed, rng=self._rng, closest=False)
                if verifier.reached(result.q, (result.position_error, result.orientation_error)):
                    yield result.q, None

    def _members(self, wanted: TargetPose) -> Iterator[tuple[Array, float | None]]:
        """Of each interval of a family the member nearest to the start, and some all along it."""
        family = self._solver.family(self._pose_of(wanted), seed=self._start)
        for interval in family:
            nearest = interval.nearest(self._start)
            yield nearest, family.parameter(nearest)
            parameters, rows = interval.sample(max(2, int(np.ceil(interval.length / SPREAD))))
            yield from zip(rows, parameters.tolist(), strict=True)

    def _turned(self, wanted: TargetPose) -> Iterator[tuple[Array, float | None]]:
        """On seven joints, the members nearest to the start at some angles about a free axis."""
        assert wanted.free_axis is not None
        low, high = wanted.free_axis.range
        for angle in np.linspace(low, high, max(2, int(np.ceil((high - low) / TURNED)) + 1)).tolist():
            for interval in self._solver.family(wanted.at(angle).matrix, seed=self._start):
                yield interval.nearest(self._start), angle

    def _goals(self, found: Sequence[tuple[Array, float | None]], number: int, aim: Aim | None) -> list[Goal]:
        robot = self._robot
        near = angles.nearest_copy(np.array([q for q, _ in found]), self._start, robot.unlimited)
        wide = np.flatnonzero(~robot.unlimited & ~robot.sliding & (robot.upper - robot.lower >= TURN)).tolist()
        return [
            Goal(checks.sealed(copy), number, aim, parameter)
            for q, (_, parameter) in zip(near, found, strict=True)
            for copy in (self._copies(q, wide) if wide else (q.copy(),))
        ]

    def _copies(self, near: Array, wide: list[int]) -> Iterator[Array]:
        """The copies of a configuration (dof,) within the limits, whole turns of some joints apart."""
        robot = self._robot
        each = [[value] for value in near.tolist()]
        for joint in wide:
            turns = np.arange(
                np.ceil((robot.lower[joint] - near[joint]) / TURN),
                np.floor((robot.upper[joint] - near[joint]) / TURN) + 1,
            )
            moved = near[joint] + TURN * turns
            each[joint] = moved[(moved >= robot.lower[joint]) & (moved <= robot.upper[joint])].tolist() or [near[joint]]
        for copy in itertools.islice(itertools.product(*each), MOST_COPIES):
            yield np.array(copy)
