"""`own_shapes`: the collision shapes of an arm, read once a robot, as the kernels of contact take them.

They are made when contact is first looked for, and shared by all that look: home, solvers, trackers, planners. They go
with the robot where it is pickled.
"""

from __future__ import annotations

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

    def named(self, chosen: NDArray[np.bool_]) -> frozenset[frozenset[str]]:
        """Names of the chosen ones (n,) of the pairs of the arrays."""
        numbers = self.arrays.numbers[self.arrays.arm.pairs[chosen]].tolist()
        return frozenset(frozenset((self.names[a], self.names[b])) for a, b in numbers)


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


def never_apart(robot: Robot, finger_angle: float | None, clearance: float) -> frozenset[frozenset[str]]:
    """Pairs of names of the arm's own shapes that are nearer than a clearance everywhere, and touch nowhere.

    No configuration keeps them apart, and none brings them together: their nearness says nothing. Where no two shapes
    of two links, but some of them are near in every configuration, such as convex parts of one mesh, it is all of them.

    Args:
        robot: the arm.
        finger_angle: as in `own_shapes`.
        clearance: [m].

    Raises:
        InvalidInputError, ShapeError: as of `own_shapes`.
    """
    return robot.once(_never_apart, finger_angle, clearance)


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
    """Names of shapes that touch in every configuration."""
    listed = _Listed(robot, own.arrays, 0.0)
    return own.named(_everywhere(robot, listed, np.arange(len(listed.pairs)), np.zeros(len(listed.pairs), np.bool_)))


def _never_apart(robot: Robot, finger_angle: float | None, clearance: float) -> frozenset[frozenset[str]]:
    """Names of shapes; see `never_apart`."""
    own = own_shapes(robot, finger_angle)
    near, touching = (_Listed(robot, own.arrays, margin) for margin in (clearance + MORE_THAN_CLEAR, 0.0))
    _, links = np.unique(own.arrays.shapes.integers[:, LINK][near.pairs], axis=0, return_inverse=True)
    found = np.zeros(len(near.pairs), dtype=np.bool_)
    for together in (np.arange(len(found)), links.reshape(-1)):  # shapes by themselves, then links by what is left
        always = _everywhere(robot, near, together, found)
        if always.any():
            for q in spread(robot, 1000):
                always &= ~np.isin(together, together[touching.at(q)])
        found |= always
    return own.named(found)


def _everywhere(
    robot: Robot, listed: _Listed, together: NDArray[np.int64], but: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Which pairs (n,) are listed in every configuration, or others with the same number `together`; but some.

    In all of so many random ones, and in the middle of the limits, that they are taken to be so everywhere.
    """
    found = ~but
    for q in (middle(robot), *spread(robot, 200)):
        found &= np.isin(together, together[listed.at(q) & ~but])
        if not found.any():
            break
    return found


class _Listed:
    """Which pairs of an arm's shapes are nearer than a margin.

    Attributes:
        pairs: (n, 2) numbers of the shapes.
    """

    def __init__(self, robot: Robot, arrays: ArmArrays, margin: float) -> None:
        """Take the shapes, and the margin [m]."""
        geometry = joined(arrays, NO_WORLD)
        self._call, self._dof, self.pairs = (
            Call(run_contact, make_contact_work(geometry, 1)),
            robot.dof,
            arrays.arm.pairs,
        )
        self._call.work.integers[ContactInteger.TASK] = ContactTask.LIST_TOUCHING
        self._call.work.numbers[ContactNumber.MARGIN_KEPT] = margin
        self._count = len(arrays.numbers)
        self._numbers = self._numbered(self.pairs)

    def at(self, q: Array) -> NDArray[np.bool_]:
        """Which of them (n,) at a configuration (dof,) [rad]."""
        self._call.work.q[: self._dof] = q
        return np.isin(self._numbers, self._numbered(self._call.work.hits.pairs[: self._call()]))

    def _numbered(self, pairs: NDArray[np.int64]) -> NDArray[np.int64]:
        """A number for each pair (n, 2)."""
        return np.asarray(pairs[:, 0] * self._count + pairs[:, 1])
