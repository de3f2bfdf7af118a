"""Obstacles around the arm, and which shapes are kept how far apart.

Obstacles stand still in the base frame. The arm brings its own shapes: the collision shapes of its description.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.ik import targets
from jacokin.ik.tracking.checks import listed, number
from jacokin.model import poses
from jacokin.model.robot import Robot

Array = NDArray[np.float64]

CLEARANCE = 0.01  # [m] kept between shapes unless told otherwise


class Obstacle(Protocol):
    """A shape that stands still."""

    @property
    def name(self) -> str:
        """Name of the shape."""

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add the shape to the base body."""


@dataclass(frozen=True, slots=True, eq=False)
class Box:
    """A box.

    Attributes:
        name: name of the shape.
        size: (3,) edge lengths [m].
        pose: where its centre is: T_base_box, or a position (3,) [m].
    """

    name: str
    size: ArrayLike
    pose: pin.SE3 | ArrayLike

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add the shape to the base body."""
        _add(body, self.name, mujoco.mjtGeom.mjGEOM_BOX, 0.5 * _lengths(f"{self.name}: size", self.size, 3), self.pose)


@dataclass(frozen=True, slots=True, eq=False)
class Sphere:
    """A sphere.

    Attributes:
        name: name of the shape.
        radius: [m].
        position: (3,) centre [m].
    """

    name: str
    radius: float
    position: ArrayLike

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add the shape to the base body."""
        size = _lengths(f"{self.name}: radius", [self.radius], 1)
        _add(body, self.name, mujoco.mjtGeom.mjGEOM_SPHERE, size, self.position)


@dataclass(frozen=True, slots=True, eq=False)
class Capsule:
    """A cylinder along its z axis with a half sphere on each end.

    Attributes:
        name: name of the shape.
        radius: [m].
        length: of the cylinder, without the half spheres [m].
        pose: where its centre is: T_base_capsule, or a position (3,) [m].
    """

    name: str
    radius: float
    length: float
    pose: pin.SE3 | ArrayLike

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add the shape to the base body."""
        radius, length = _lengths(f"{self.name}: radius and length", [self.radius, self.length], 2)
        _add(body, self.name, mujoco.mjtGeom.mjGEOM_CAPSULE, np.array([radius, 0.5 * length]), self.pose)


@dataclass(frozen=True, slots=True)
class Floor:
    """A horizontal plane; everything below it is solid.

    Attributes:
        height: its z in the base frame [m].
        name: name of the shape.
    """

    height: float = 0.0
    name: str = "floor"

    def add_to(self, body: mujoco.MjsBody) -> None:
        """Add the shape to the base body."""
        # A plane has no end; the size only says how it is drawn.
        _add(body, self.name, mujoco.mjtGeom.mjGEOM_PLANE, np.array([1.0, 1.0, 0.1]), [0.0, 0.0, self.height])


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """What the tracker keeps apart.

    Attributes:
        distance: smallest distance allowed [m].
        obstacles: shapes around the arm.
        self_collision: keep the arm's own shapes apart too, in the pairs MuJoCo would test for contact.
        pairs: exactly these pairs of shapes by name, instead of all.
    """

    distance: float = CLEARANCE
    obstacles: Sequence[Obstacle] = ()
    self_collision: bool = True
    pairs: Sequence[tuple[str, str]] | None = None

    def __post_init__(self) -> None:
        """Check what needs no robot."""
        number("distance", self.distance, "m")
        object.__setattr__(self, "obstacles", listed("obstacles", self.obstacles))
        for obstacle in self.obstacles:
            name = getattr(obstacle, "name", None)
            if not callable(getattr(obstacle, "add_to", None)) or not isinstance(name, str) or not name:
                raise InvalidInputError(
                    f"obstacles must each be a Box, Sphere, Capsule or Floor with a name, got {obstacle!r}"
                )
        if self.pairs is not None:
            object.__setattr__(self, "pairs", listed("pairs", self.pairs))


def compile_with(
    spec: mujoco.MjSpec, robot: Robot, clearance: Clearance
) -> tuple[mujoco.MjModel, list[tuple[int, int]]]:
    """Add the obstacles to the robot's twin, compile it, and list the pairs of shapes to keep apart.

    Raises:
        InvalidInputError: an obstacle is malformed or its name is taken, or a pair cannot move apart.
        UnknownNameError: a pair names a shape that does not exist.
        ModelError: the description has no shapes.
    """
    taken = {geom.name for geom in spec.geoms}
    if not taken:
        raise ModelError(f"{robot.name}: the description has no collision shapes, so nothing can be kept apart")
    for obstacle in clearance.obstacles:
        if obstacle.name in taken:
            raise InvalidInputError(f"the name {obstacle.name!r} is used by two shapes; names must differ")
        taken.add(obstacle.name)
        obstacle.add_to(spec.worldbody)
    model = spec.compile()
    return model, _pairs(model, clearance, {obstacle.name for obstacle in clearance.obstacles})


def _pairs(model: mujoco.MjModel, clearance: Clearance, obstacles: set[str]) -> list[tuple[int, int]]:
    """Pairs by number, the shape nearer to the base first."""
    names = [model.geom(index).name for index in range(model.ngeom)]
    if clearance.pairs is not None:
        found = [_named_pair(model, names, pair) for pair in clearance.pairs]
    else:
        fixed = [index for index, name in enumerate(names) if name in obstacles]
        moving = [index for index in range(model.ngeom) if model.body_weldid[model.geom_bodyid[index]] > 0]
        found = [(a, b) for a in fixed for b in moving]
        if clearance.self_collision:
            pairs = zip(model.pair_geom1.tolist(), model.pair_geom2.tolist(), strict=True)
            found.extend((int(a), int(b)) for a, b in pairs)
    # The chain is serial and bodies are numbered along it.
    return [(a, b) if model.geom_bodyid[a] <= model.geom_bodyid[b] else (b, a) for a, b in found]


def _named_pair(model: mujoco.MjModel, names: list[str], pair: tuple[str, str]) -> tuple[int, int]:
    if not isinstance(pair, tuple | list) or len(pair) != 2 or not all(isinstance(name, str) for name in pair):
        raise InvalidInputError(f"pairs must hold pairs of shape names, got {pair!r}")
    for name in pair:
        if name not in names:
            raise UnknownNameError("shape", name, names)
    first, second = (names.index(name) for name in pair)
    if model.body_weldid[model.geom_bodyid[first]] == model.body_weldid[model.geom_bodyid[second]]:
        raise InvalidInputError(f"the shapes {pair[0]!r} and {pair[1]!r} sit on the same link and cannot move apart")
    return first, second


def _lengths(name: str, value: ArrayLike, count: int) -> Array:
    """Positive lengths [m]."""
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name} must be positive [m], got {value!r}") from error
    if array.shape != (count,) or not np.isfinite(array).all() or not (array > 0.0).all():
        raise InvalidInputError(f"{name} must be {count} positive and finite number(s) [m], got {array.tolist()}")
    return array


def _add(body: mujoco.MjsBody, name: str, kind: mujoco.mjtGeom, size: Array, pose: pin.SE3 | ArrayLike) -> None:
    place = targets.checked(pose, f"{name}: pose")
    full = np.zeros(3)
    full[: size.size] = size
    body.add_geom(
        name=name,
        type=kind,
        size=full,
        pos=place.position,
        quat=poses.quat_wxyz(place.rotation),
        contype=0,
        conaffinity=0,
    )
