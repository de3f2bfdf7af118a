"""`own_shapes`: the collision shapes of an arm, read once a robot, as the kernels of contact take them.

They are made when contact is first looked for, and shared by all that look: home, solvers, trackers, planners. They go
with the robot where it is pickled.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.run import ContactInteger, ContactNumber, ContactTask, make_contact_work, run_contact
from jacokin.kernels.contact.shapes import LINK
from jacokin.kernels.library import Call
from jacokin.model.contact_arrays import NO_WORLD, ArmArrays, ShapeRow, arm_arrays, joined, joints_about_z, shape_rows
from jacokin.model.descriptions.shapes import NO_VERTICES, Shape, read_bundled
from jacokin.model.robot import Robot, middle, spread

MORE_THAN_CLEAR = 1e-3  # [m] than the clearance pairs must come apart: planners and trackers keep up to so much more
NEARLY_ALL = 0.9  # of the configurations: a pair that is too near in so many leaves hardly any answer
SHARE_KEPT = 0.1  # of their usual distance, by such a pair: more would divide what the joints can do into parts
NOTHING_KEPT = -math.inf  # [m] by pairs that are not looked at


class OwnShapes(NamedTuple):
    """The shapes of an arm, its base included, in the order of the joints that carry them."""

    shapes: list[Shape]
    pairs: list[tuple[int, int]]
    """Numbers of shapes whose contact counts."""
    overlapping: frozenset[frozenset[str]]
    """Names of those that touch in every configuration, which does not count."""
    rows: list[ShapeRow]
    arrays: ArmArrays
    names: tuple[str, ...]
    taken: frozenset[str]
    """Names of the shapes, which no obstacle may have."""

    def named(self, chosen: NDArray[np.bool_] | NDArray[np.int64]) -> list[frozenset[str]]:
        """Names of the chosen ones of the pairs of the arrays: whether each is (n,), or their numbers (k,)."""
        numbers = self.arrays.numbers[self.arrays.arm.pairs[chosen]].tolist()
        return [frozenset((self.names[a], self.names[b])) for a, b in numbers]


def own_shapes(robot: Robot, finger_angle: float | None = None) -> OwnShapes:
    """The shapes of a robot and the pairs of them whose contact counts, made once.

    Args:
        robot: the arm.
        finger_angle: angle of the joints off the arm [rad]; None for the one the robot was loaded with.

    Raises:
        InvalidInputError: a finger angle that no joint off the arm can take.
        ShapeError: the description's shapes cannot be loaded.
    """
    if finger_angle is None:
        return robot.once(_make_own_shapes, carried=True)
    return robot.once(_make_at_angle, finger_angle)


def may_collide(robot: Robot) -> bool:
    """Whether the description may have collision shapes: a URDF without them is not given to MuJoCo."""
    content = robot.source.content
    return not isinstance(content, str) or "<collision" in content


def overlapping(robot: Robot) -> frozenset[frozenset[str]]:
    """Pairs of names of the arm's own shapes that touch in every configuration, so that their contact says nothing.

    In all of some random configurations and in the middle of the limits. Bundled robots have none.

    Raises:
        ShapeError: the description's shapes cannot be loaded.
    """
    return own_shapes(robot).overlapping


def own_hulls(robot: Robot) -> frozenset[str]:
    """Names of the arm's own shapes that are the convex hulls of meshes, which may fill what these leave open.

    Raises:
        ShapeError: the description's shapes cannot be loaded.
    """
    if robot.source.decompose:
        return frozenset()
    return frozenset(shape.name for shape in own_shapes(robot).shapes if shape.kind == "mesh")


def kept_less(robot: Robot, finger_angle: float | None, clearance: float) -> Mapping[frozenset[str], float]:
    """Distances that some pairs of the arm's own shapes keep instead of a clearance [m], by the names of the two.

    Neighbours such as the first and the third link of a wrist may be a centimetre or two apart, whatever the joints do.
    Where they are nearer than the clearance in nine of ten configurations, they keep a tenth of the median of their
    distances, and at least do not touch. Pairs that are nowhere so near keep `NOTHING_KEPT`: they are not looked at.

    Where no two shapes of two links, but some of them are near, such as convex parts of one mesh, it is all of them.

    Args:
        robot: the arm.
        finger_angle: as in `own_shapes`.
        clearance: [m].

    Raises:
        InvalidInputError, ShapeError: as of `own_shapes`.
    """
    return robot.once(_kept_less, finger_angle, clearance)


def _make_own_shapes(robot: Robot) -> OwnShapes:
    """Read the description; a bundled one, and one without shapes, without MuJoCo, which takes long to load."""
    if robot.source.bundled is not None:
        links = {name: robot.frame_id(name) for name in robot.frames}
        shapes, pairs = read_bundled(robot.source.bundled, robot.pin_model, links)
        return _prepared(robot, shapes, pairs, frozenset(), shape_rows(robot.pin_model, shapes))
    if not may_collide(robot):
        return _prepared(robot, [], [], frozenset(), [])
    from jacokin.model.mujoco_twin import shapes_of_description

    shapes, pairs = shapes_of_description(robot)
    rows = shape_rows(robot.pin_model, shapes)
    everything = _prepared(robot, shapes, pairs, frozenset(), rows)
    always = _touching_everywhere(robot, everything)
    return _prepared(robot, shapes, pairs, always, rows) if always else everything


def _make_at_angle(robot: Robot, finger_angle: float) -> OwnShapes:
    """Those of the fingers stand elsewhere; the others are shared."""
    from jacokin.model.mujoco_twin import shapes_of_description

    own = own_shapes(robot)
    shapes, pairs = shapes_of_description(robot, finger_angle)
    here = {shape.name: (shape.placement.homogeneous, row) for shape, row in zip(own.shapes, own.rows, strict=True)}
    moved = [
        shape
        for shape in shapes
        if not np.allclose(here[shape.name][0], shape.placement.homogeneous, rtol=0.0, atol=1e-12)  # rounding
    ]
    there = dict(zip([shape.name for shape in moved], shape_rows(robot.pin_model, moved), strict=True))
    rows = [there.get(shape.name) or here[shape.name][1] for shape in shapes]
    return _prepared(robot, shapes, pairs, own.overlapping, rows)


def _prepared(
    robot: Robot,
    shapes: list[Shape],
    pairs: list[tuple[int, int]],
    always: frozenset[frozenset[str]],
    rows: list[ShapeRow],
) -> OwnShapes:
    """The arrays of shapes, without the pairs that touch in every configuration."""
    counted = [(a, b) for a, b in pairs if frozenset((shapes[a].name, shapes[b].name)) not in always]
    arrays = arm_arrays(joints_about_z(robot.pin_model), [shape.joint for shape in shapes], rows, counted)
    light = [shape._replace(vertices=NO_VERTICES) for shape in shapes]  # the hulls are in the rows
    names = tuple(shape.name for shape in shapes)
    return OwnShapes(light, counted, always, rows, arrays, names, frozenset(names))


def _touching_everywhere(robot: Robot, own: OwnShapes) -> frozenset[frozenset[str]]:
    """Names of shapes that touch in all of so many configurations that they are taken to touch everywhere."""
    looked_at, found = _LookedAt(robot, own.arrays), np.ones(len(own.arrays.arm.pairs), dtype=np.bool_)
    for q in _some(robot):
        found &= looked_at.nearer(q, 0.0)
        if not found.any():
            break
    return frozenset(own.named(found))


def _kept_less(robot: Robot, finger_angle: float | None, clearance: float) -> Mapping[frozenset[str], float]:
    """What pairs keep of a clearance; see `kept_less`."""
    own, rows = own_shapes(robot, finger_angle), _some(robot)
    looked_at, pairs = _LookedAt(robot, own.arrays), own.arrays.arm.pairs
    _, links = np.unique(own.arrays.shapes.integers[:, LINK][pairs], axis=0, return_inverse=True)
    links = links.reshape(-1)  # of each pair, a number for the two links
    near, far = np.zeros((len(rows), len(pairs)), dtype=np.bool_), np.zeros(links.max(initial=-1) + 1, dtype=np.int64)
    for k, q in enumerate(rows):
        near[k] = looked_at.nearer(q, clearance + MORE_THAN_CLEAR)
        far += np.bincount(links[near[k]], minlength=len(far)) == 0
        if far.min(initial=len(rows)) > (1.0 - NEARLY_ALL) * len(rows):
            return {}
    nearly_always = near.mean(axis=0) >= NEARLY_ALL
    groups = [np.array([pair]) for pair in np.flatnonzero(nearly_always)]
    others = [np.flatnonzero((links == number) & ~nearly_always) for number in range(len(far))]
    groups += [group for group in others if near[:, group].any(axis=1).mean() >= NEARLY_ALL]
    if not groups:
        return {}
    distances = looked_at.least_distances(rows, groups)
    kept = np.maximum(SHARE_KEPT * np.median(distances, axis=0), 0.0)
    never = distances.min(axis=0) > kept
    if never.any():
        never &= looked_at.least_distances(spread(robot, 1000), groups).min(axis=0) > kept
    found = dict[frozenset[str], float]()
    for group, length, nothing in zip(groups, kept.tolist(), never.tolist(), strict=True):
        if length < clearance:
            found.update(dict.fromkeys(own.named(group), NOTHING_KEPT if nothing else length))
    return found


def _some(robot: Robot) -> Array:
    """Configurations (n, dof) that stand for all: the middle of the limits, and random ones [rad]."""
    return np.vstack([middle(robot), spread(robot, 200)])


class _LookedAt:
    """How near the pairs of an arm's shapes are."""

    def __init__(self, robot: Robot, arrays: ArmArrays) -> None:
        """Take the shapes."""
        self._geometry, self._pairs, self._dof = joined(arrays, NO_WORLD), arrays.arm.pairs, robot.dof
        self._list = Call(run_contact, make_contact_work(self._geometry, 1))
        self._list.work.integers[ContactInteger.TASK] = ContactTask.LIST_TOUCHING
        self._count = len(arrays.numbers)
        self._numbers = self._numbered(self._pairs)

    def nearer(self, q: Array, margin: float) -> NDArray[np.bool_]:
        """Which of them (n,) are nearer than a margin [m] at a configuration (dof,) [rad]."""
        work = self._list.work
        work.q[: self._dof], work.numbers[ContactNumber.MARGIN_KEPT] = q, margin
        return np.isin(self._numbers, self._numbered(work.hits.pairs[: self._list()]))

    def least_distances(self, rows: Array, groups: Sequence[NDArray[np.int64]]) -> Array:
        """The least distances (n, groups) [m] of pairs, group by group of their numbers, at configurations (n, dof)."""
        chosen, starts = np.concatenate(groups), np.cumsum([0, *map(len, groups)])[:-1]
        measure = Call(run_contact, make_contact_work(self._geometry, 1, len(chosen)))
        work, found = measure.work, np.empty((len(rows), len(chosen)))
        work.integers[[ContactInteger.TASK, ContactInteger.ROWS]] = ContactTask.MEASURE_PAIRS, len(chosen)
        work.given[:], work.reach[:] = self._pairs[chosen], np.inf
        for row, q in zip(found, rows, strict=True):
            work.q[: self._dof] = q
            measure()
            row[:] = work.measured[:, 0]
        return np.asarray(np.minimum.reduceat(found, starts, axis=1))

    def _numbered(self, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
        """A number for each pair (n, 2)."""
        return np.asarray(pairs[:, 0] * self._count + pairs[:, 1])
