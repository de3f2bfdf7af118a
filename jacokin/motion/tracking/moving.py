"""Obstacles that move: where they are, how fast, and where they will be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence, Set
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.kernels.contact.shapes import CENTRE, RADIUS
from jacokin.model import checks, poses
from jacokin.model.contact import Contact
from jacokin.model.descriptions.shapes import Shape
from jacokin.model.obstacles import Obstacle, pose_of

Whereabout: TypeAlias = pin.SE3 | ArrayLike | Obstacle
"""T_base_shape or a position (3,) [m] of a known obstacle; or an obstacle, where it is now."""

Motion: TypeAlias = Whereabout | tuple[Whereabout, ArrayLike]
"""Where an obstacle stands; or that and its twist (6,) [m/s, rad/s]."""

STILL = (0.0,) * 6


class Whereabouts(NamedTuple):
    """Obstacles at one time, those of `MovableShapes` in order."""

    poses: Array
    """(k, 3, 4) T_base_shape."""
    twists: Array
    """(k, 6) velocity of the shape's origin [m/s], then angular [rad/s], in base axes."""
    speeds: Array
    """(k,) largest speed of any point of each shape, at most [m/s]."""
    moving: bool
    """Whether any twist is not zero."""

    def after(self, time: float) -> Whereabouts:
        """These obstacles when they have moved on for a time [s]."""
        if not self.moving:
            return self
        moved = self.poses.copy()
        moved[:, :, 3] += time * self.twists[:, :3]
        turns = self.twists[:, 3:]
        if turns.any():
            for row in np.flatnonzero(turns.any(axis=1)).tolist():
                moved[row, :, :3] = pin.exp3(time * turns[row]) @ moved[row, :, :3]
        return Whereabouts(moved, self.twists, self.speeds, self.moving)


class News(NamedTuple):
    """What a tick is told about obstacles."""

    leaving: Set[str]
    """Names of those that are gone, or that something else of their name replaces."""
    coming: Mapping[str, Obstacle]
    """Those that were not there."""
    motions: Mapping[str, Motion]
    """Where obstacles are, once these have come and gone: poses, with or without twists."""


class MovableShapes:
    """The obstacles of a scene that have a pose.

    Attributes:
        start: where the scene has them, standing still.
        numbers: (k,) of their shapes.
        own_centres: (k, 3) of the spheres around them, in their frames [m].
    """

    def __init__(self, obstacles: Sequence[Obstacle], contact: Contact) -> None:
        """Read them; a floor and shapes of other classes cannot move."""
        self._rows: dict[str, int] = {}
        self._shapes: list[Obstacle] = []
        self._fixed: list[str] = []
        found = []
        for obstacle in obstacles:
            try:
                found.append(pose_of(obstacle).homogeneous[:3])
                self._rows[obstacle.name] = len(self._rows)
                self._shapes.append(obstacle)
            except InvalidInputError:
                self._fixed.append(obstacle.name)
        self.start = Whereabouts(
            np.array(found).reshape(-1, 3, 4), np.zeros((len(found), 6)), np.zeros(len(found)), moving=False
        )
        self.numbers = np.array([contact.names.index(name) for name in self._rows], dtype=np.intp)
        spheres = contact.geometry.shapes.numbers[self.numbers, CENTRE : RADIUS + 1]
        away = spheres[:, :3] - self.start.poses[:, :, 3]
        self.own_centres = np.einsum("kij,ki->kj", self.start.poses[:, :, :3], away)
        self._radii = spheres[:, 3]
        self._reach = self._radii + _lengths(self.own_centres)  # [m] of the shape from its origin
        self._is_centred = not self.own_centres.any()

    def sorted(self, given: Mapping[str, Motion | None]) -> News:
        """What is told of obstacles by name: a shape that is there already has only moved.

        Raises:
            InvalidInputError: a shape of another name than it is given for.
        """
        leaving, coming, motions = set[str](), dict[str, Obstacle](), dict[str, Motion]()
        for name, motion in given.items():
            place, *twist = _parts(motion)
            if place is None and not twist:
                leaving.add(name)
            elif not isinstance(place, np.ndarray) and hasattr(place, "add_to"):
                if getattr(place, "name", None) != name:
                    raise InvalidInputError(f"obstacles[{name!r}] has the name {getattr(place, 'name', None)!r}")
                if not self._has(place):
                    coming[name] = place
                if name not in coming or twist:
                    motions[name] = (pose_of(place), *twist) if twist else pose_of(place)
            else:
                motions[name] = motion
        return News(leaving | coming.keys(), coming, motions)

    def _has(self, shape: Obstacle) -> bool:
        """Whether the obstacle of that name differs from a shape by its pose alone."""
        row = self._rows.get(shape.name)
        if row is None or type(shape) is not type(self._shapes[row]):
            return False
        old, new = (getattr(each, "solid", None) for each in (self._shapes[row], shape))
        if not isinstance(old, Shape) or not isinstance(new, Shape) or new.cloud is not old.cloud:
            return False
        return old.kind == new.kind and np.array_equal(old.size, new.size)

    def told(self, before: Whereabouts, given: Mapping[str, Motion]) -> Whereabouts:
        """Where obstacles are now; those that are not named go on as before.

        Raises:
            UnknownNameError: no such obstacle in the scene.
            InvalidInputError: not a mapping, one that cannot move, or malformed poses or twists.
        """
        rows, places, twists = list[int](), list[float](), list[float]()
        for name, motion in given.items():
            pose, *twist = _parts(motion)
            rows.append(self._row(name))
            places += _pose_rows(name, pose)
            twists += _twist(name, twist[0]) if twist else STILL
        index, all_places, all_twists = np.array(rows, np.intp), before.poses.copy(), before.twists.copy()
        all_places[index] = np.fromiter(places, np.float64).reshape(-1, 3, 4)
        all_twists[index] = np.fromiter(twists, np.float64).reshape(-1, 6)
        return self._at(all_places, all_twists)

    def carried(self, before: MovableShapes, where: Whereabouts) -> Whereabouts:
        """Where these shapes are, if those that other shapes had go on as they did there."""
        places, twists = self.start.poses.copy(), self.start.twists.copy()
        for name, row in self._rows.items():
            old = before._rows.get(name)
            if old is not None and self._shapes[row] is before._shapes[old]:
                places[row], twists[row] = where.poses[old], where.twists[old]
        return self._at(places, twists)

    def _at(self, places: Array, twists: Array) -> Whereabouts:
        """The shapes at places (k, 3, 4), with twists (k, 6)."""
        # Turning about its origin, no point is faster than its farthest.
        speeds = _lengths(twists[:, :3])
        if twists[:, 3:].any():
            speeds += _lengths(twists[:, 3:]) * self._reach
        return Whereabouts(places, twists, speeds, bool(speeds.any()))

    def _row(self, name: str) -> int:
        """Number of an obstacle; errors as in `told`."""
        row = self._rows.get(name) if isinstance(name, str) else None
        if row is None:
            if name in self._fixed:
                raise InvalidInputError(f"the obstacle {name!r} has no pose and cannot move")
            if any(each.startswith(f"{name}/") for each in self._fixed):
                raise InvalidInputError(
                    f"the robot {name!r} stands still for this tracker; go on with "
                    f"Tracker(..., scene=scene.moving({{{name!r}: q}}), state=tracker.state)"
                )
            row = self._rows[checks.choice("obstacle", name, self._rows)]
        return row

    def centres(self, where: Whereabouts) -> Array:
        """(k, 3) centres of the spheres around the shapes [m]."""
        origins = where.poses[:, :, 3]
        if self._is_centred:
            return origins
        return np.asarray(np.einsum("kij,kj->ki", where.poses[:, :, :3], self.own_centres) + origins)

    def travel(self, before: Whereabouts, after: Whereabouts) -> Array:
        """(k,) farthest that any point of each shape has moved, at most [m]."""
        change = after.poses - before.poses
        # A turn by an angle moves a point at distance r by 2 r sin(angle / 2); the Frobenius norm is 2 sqrt(2) times
        # that sine.
        squares = np.einsum("kij,kij->kj", change, change)
        turn = np.sqrt(0.5 * squares[:, :3].sum(axis=1))
        if self._is_centred:
            return np.asarray(np.sqrt(squares[:, 3]) + turn * self._radii)
        return np.asarray(_lengths(self.centres(after) - self.centres(before)) + turn * self._radii)


def _parts(motion: Motion | None) -> tuple[Any, ...]:  # Any: checked where it is used
    """Where an obstacle is, and its twist if that is told."""
    return motion if isinstance(motion, tuple) and len(motion) == 2 else (motion,)


def _lengths(rows: Array) -> Array:
    """(k,) lengths of rows (k, n)."""
    return np.asarray(np.sqrt(np.einsum("ij,ij->i", rows, rows)))


def _pose_rows(name: str, pose: Any) -> list[float]:
    """The pose or position (3,) [m] of an obstacle by its name as (3, 4), row by row."""
    if not checks.is_vector(pose, 3):
        argument = f"obstacles[{name!r}]"
        if not isinstance(pose, pin.SE3):
            pose = checks.array(argument, pose, "a pose or a position", "m")
        if isinstance(pose, pin.SE3) or pose.ndim != 1:
            rows: list[float] = poses.checked_pose(pose, argument).homogeneous[:3].ravel().tolist()
            return rows
        pose = checks.vector(argument, pose, 3, "m")
    x, y, z = pose.tolist()
    return [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z]


def _twist(name: str, twist: Any) -> Sequence[float]:
    """The twist (6,) [m/s, rad/s] of an obstacle by its name."""
    if checks.is_listed(twist, 6):
        return twist
    checked: list[float] = checks.vector(f"obstacles[{name!r}]: twist", twist, 6, "m/s, rad/s").tolist()
    return checked
