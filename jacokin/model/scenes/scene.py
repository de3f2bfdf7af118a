"""`Scene`: the obstacles around an arm, and how far the arm is from them."""

from __future__ import annotations

import weakref
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Self

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.model.mujoco_twin.distance import ShapeDistances
from jacokin.model.obstacles import Obstacle, checked_obstacles
from jacokin.model.robot import Robot
from jacokin.model.scenes import compiled, files

if TYPE_CHECKING:
    import mujoco
    import pinocchio as pin


class Scene:
    """Obstacles that stand still in the base frame; immutable.

    Attributes:
        obstacles: the shapes.
        finger_angle: angle at which the fingers stand when contact is looked for [rad]; None for the angle that the
            robot was loaded with.
    """

    __slots__ = ("_measured", "finger_angle", "obstacles")

    obstacles: tuple[Obstacle, ...]
    finger_angle: float | None

    def __init__(self, obstacles: Iterable[Obstacle] = (), *, finger_angle: float | None = None) -> None:
        """Check the shapes.

        Args:
            obstacles: `Box`, `Sphere`, `Capsule`, `Cylinder`, `Floor`, or other shapes with `name` and `add_to`.
            finger_angle: angle at which the fingers stand when contact is looked for [rad]; None for the angle that
                the robot was loaded with.

        Raises:
            InvalidInputError: not shapes, two of the same name, or an angle that is not a number.
        """
        angle = None if finger_angle is None else checks.number("finger_angle", finger_angle, "rad")
        object.__setattr__(self, "obstacles", checked_obstacles(obstacles))
        object.__setattr__(self, "finger_angle", angle)
        object.__setattr__(self, "_measured", weakref.WeakKeyDictionary())

    def __setattr__(self, name: str, value: object) -> None:
        """Refuse changes after construction."""
        raise AttributeError(f"a Scene does not change; make another one instead of setting {name!r}")

    def __repr__(self) -> str:
        """The names of the shapes."""
        return f"Scene({', '.join(self.names) or 'empty'})"

    def __len__(self) -> int:
        """Number of obstacles."""
        return len(self.obstacles)

    def __iter__(self) -> Iterator[Obstacle]:
        """The obstacles in order."""
        return iter(self.obstacles)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Pickle the shapes; what was compiled is made anew."""
        return _rebuilt, (self.obstacles, self.finger_angle)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the obstacles."""
        return tuple(obstacle.name for obstacle in self.obstacles)

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a .yaml, .yml or .json file; `docs/planning.md` has an example.

        Raises:
            InvalidInputError: no such file, another ending, malformed, or wrong numbers; names the entry.
            UnknownNameError: an unknown shape or key.
        """
        obstacles, finger_angle = files.read(path)
        return cls(obstacles, finger_angle=finger_angle)

    @classmethod
    def from_mujoco(
        cls,
        model: mujoco.MjModel,
        *,
        base: str | pin.SE3 | None = None,
        exclude: Iterable[str] = (),
        finger_angle: float | None = None,
    ) -> Self:
        """The geoms of a compiled MuJoCo model that stand still and can collide.

        Meshes, height fields and ellipsoids become their bounding boxes. The body that carries an arm's first joint is
        left out, as part of that arm.

        Args:
            model: the model, for example `physics.model`.
            base: where the arm's base is: name of a body or site, or T_world_base; None for the world's origin.
            exclude: names of geoms, or of bodies with all their geoms, to be left out.
            finger_angle: as in `Scene`.

        Raises:
            InvalidInputError: not a model, or a plane that is not horizontal in the base frame.
            UnknownNameError: no such body, site or geom.
        """
        return cls(compiled.obstacles(model, base, checks.listed("exclude", exclude)), finger_angle=finger_angle)

    def measure(self, robot: Robot, rows: Array, *, self_collision: bool = False) -> Array:
        """Distances (n,) [m] for checked configurations (n, dof); `Robot.clearance` is the public way."""
        return np.array([found[0] for found in self.nearest(robot, rows, self_collision=self_collision)])

    def nearest(
        self, robot: Robot, rows: Array, *, self_collision: bool = False
    ) -> list[tuple[float, tuple[str, str]]]:
        """As `measure`, with the names of the two nearest shapes."""
        prepared: dict[bool, ShapeDistances] = self._measured.setdefault(robot, {})
        if self_collision not in prepared:
            prepared[self_collision] = ShapeDistances(
                robot, self.obstacles, self_collision=self_collision, finger_angle=self.finger_angle
            )
        return [prepared[self_collision].least(q) for q in rows]

    _measured: weakref.WeakKeyDictionary[Robot, dict[bool, ShapeDistances]]


def _rebuilt(obstacles: tuple[Obstacle, ...], finger_angle: float | None) -> Scene:
    return Scene(obstacles, finger_angle=finger_angle)


def checked_scene(name: str, value: object) -> Scene:
    """A scene, or an error that names the argument.

    Raises:
        InvalidInputError: not a `Scene`.
    """
    if not isinstance(value, Scene):
        raise InvalidInputError(f"{name} must be a Scene, for example Scene([Floor(0.0)]), got {shown(value)}")
    return value
