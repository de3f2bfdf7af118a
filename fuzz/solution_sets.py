"""Targets with one free parameter: poses of seven joints, and free axes of six, checked member by member."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np

from fuzz.findings import Finding
from fuzz.kinematics import rotation_error
from jacokin import FreeAxis, IKSolver, Status
from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik import SolutionSet
from jacokin.model import Robot
from jacokin.model.angles import wrap_to_pi

TARGETS = 50  # in one case
CLOSURE = 1e-9  # [m] and [rad]: what jacokin promises of members
ROUNDING = 1e-10  # [m] and [rad] by which two forward kinematics may differ
OWN = 1e-5  # [rad] the generating configuration is met this well; on a fold it is known to the root of rounding
SAME_DISTANCE = 1e-8  # [rad] where two limits meet, the nearest member is known no better
MEMBERS = 5  # of an interval that are looked at


def check(
    solver: IKSolver, forward: Callable[[Array], Array], kind: str, q: Array, rng: np.random.Generator
) -> Iterator[Finding]:
    """Sets of targets made from configurations (n, dof); those within the limits must be members.

    Args:
        solver: of six or seven joints.
        forward: independent kinematics, (n, dof) to (n, 4, 4).
        kind: class of the configurations.
        q: (n, dof) [rad].
        rng: seeds and axes.
    """
    robot = solver.robot
    seeds = robot.sample(rng, len(q)) + 2.0 * math.pi * rng.integers(-3, 4, q.shape) * robot.unlimited
    for own, T, seed in zip(q, forward(q), seeds, strict=True):
        target = T if robot.dof == 7 else _free_axis(T, rng)
        label = f"set of {robot.name}, {solver.frame}, {kind}"
        try:
            found = solver.solve_all(target, seed)
            result = solver.solve(target, seed, closest=False)
        except JacokinError as error:
            yield Finding("wrong", label, f"{error} for q = {own.tolist()}, target {target}")
            continue
        yield from _members(robot, label, found, target, forward, own)
        inside = robot.within_limits(own)
        if inside and found.complete and not _holds(found, own, robot.dof):
            yield Finding("lost", label, f"q = {own.tolist()} is in none of {len(found)} intervals, {target}")
        if inside and not result.success:
            yield Finding("lost", label, f"{result.status.name} for q = {own.tolist()}: {result.message}, {target}")
        if not inside and result.status is Status.UNREACHABLE:
            yield Finding("wrong", label, f"UNREACHABLE, but reached beyond the limits by q = {own.tolist()}, {target}")
        if result.success:
            nearest = found.nearest(seed)
            farther = 0.0 if nearest is None else _apart(result.q, seed) - _apart(nearest, seed)
            if farther > SAME_DISTANCE or (found.complete and farther < -SAME_DISTANCE):
                yield Finding("wrong", label, f"solve and nearest differ for q = {own.tolist()}, seed {seed.tolist()}")


def _free_axis(T: Array, rng: np.random.Generator) -> FreeAxis:
    """An axis across the tool, along the last joint's, or skew; a full turn or a part of it that holds 0."""
    axis = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), tuple(rng.normal(size=3).tolist()))[int(rng.integers(3))]
    limits = (-math.pi, math.pi) if rng.random() < 0.7 else (-rng.uniform(0.01, 3.0), rng.uniform(0.01, 3.0))
    return FreeAxis(T, axis=axis, range=limits)


def _members(
    robot: Robot,
    label: str,
    found: SolutionSet,
    target: FreeAxis | Array,
    forward: Callable[[Array], Array],
    own: Array,
) -> Iterator[Finding]:
    """Members all along every interval are within the limits and at the target."""
    for interval in found.intervals:
        parameters = np.linspace(interval.start, interval.stop, MEMBERS)
        rows = np.array([interval.at(p) for p in parameters])
        wanted = np.array([target.matrix_at(p) if isinstance(target, FreeAxis) else target for p in parameters])
        reached = forward(rows)
        error = np.linalg.norm(reached[:, :3, 3] - wanted[:, :3, 3], axis=1)
        error = np.maximum(error, rotation_error(reached[:, :3, :3], wanted[:, :3, :3]))
        if error.max() > CLOSURE + ROUNDING:
            yield Finding("wrong", label, f"a member is {error.max():.3g} off, q = {own.tolist()}, {target}")
        if (rows < robot.lower).any() or (rows > robot.upper).any():
            yield Finding("wrong", label, f"a member is outside the limits, q = {own.tolist()}, {target}")


def _holds(found: SolutionSet, own: Array, dof: int) -> bool:
    """Whether a configuration is a member, at its own parameter or next to it."""
    parameter = own[2] if dof == 7 else 0.0
    if any(
        interval.contains(parameter) and np.abs(wrap_to_pi(interval.at(parameter) - own)).max() < OWN
        for interval in found.intervals
    ):
        return True
    nearest = found.nearest(own)  # where it is an end of an interval
    return nearest is not None and float(np.abs(wrap_to_pi(nearest - own)).max()) < OWN


def _apart(q: Array, seed: Array) -> float:
    return float(np.linalg.norm(q - seed))
