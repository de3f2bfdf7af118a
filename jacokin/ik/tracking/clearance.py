"""Which shapes the tracker keeps how far apart."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mujoco

from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.model import checks
from jacokin.model.mujoco_twin.export import to_spec
from jacokin.model.obstacles import Obstacle, add_to_spec, checked_obstacles, collision_pairs
from jacokin.model.robot import Robot

CLEARANCE = 0.01  # [m] kept between shapes unless told otherwise


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
        object.__setattr__(self, "distance", checks.non_negative("distance", self.distance, "m"))
        object.__setattr__(self, "obstacles", checked_obstacles(self.obstacles))
        object.__setattr__(self, "self_collision", checks.flag("self_collision", self.self_collision))
        if self.pairs is not None:
            object.__setattr__(self, "pairs", tuple(_checked_pair(p) for p in checks.listed("pairs", self.pairs)))


def compile_with(robot: Robot, clearance: Clearance) -> tuple[mujoco.MjModel, list[tuple[int, int]]]:
    """The robot's twin with its shapes and the obstacles, and the pairs of shapes to keep apart.

    Returns:
        The model, and pairs of shapes by number, the one nearer to the base first.

    Raises:
        InvalidInputError: an obstacle's name is taken, or a pair cannot move apart.
        UnknownNameError: a pair names a shape that does not exist.
        ModelError: the description has no shapes, or they cannot be loaded.
    """
    spec = to_spec(robot, geometry=True)
    if not spec.geoms:
        raise ModelError(f"{robot.name}: the description has no collision shapes, so nothing can be kept apart")
    add_to_spec(spec, clearance.obstacles)
    model = spec.compile()
    if clearance.pairs is None:
        found = collision_pairs(model, clearance.obstacles, self_collision=clearance.self_collision)
    else:
        names = [model.geom(index).name for index in range(model.ngeom)]
        found = [_named_pair(model, names, pair) for pair in clearance.pairs]
    # The chain is serial and bodies are numbered along it.
    return model, [(a, b) if model.geom_bodyid[a] <= model.geom_bodyid[b] else (b, a) for a, b in found]


def _checked_pair(pair: tuple[str, str]) -> tuple[str, str]:
    if not isinstance(pair, tuple | list) or len(pair) != 2 or not all(isinstance(name, str) for name in pair):
        raise InvalidInputError(f"pairs must hold pairs of shape names, got {checks.shown(pair)}")
    return pair[0], pair[1]


def _named_pair(model: mujoco.MjModel, names: list[str], pair: tuple[str, str]) -> tuple[int, int]:
    for name in pair:
        if name not in names:
            raise UnknownNameError("shape", name, names)
    first, second = (names.index(name) for name in pair)
    if model.body_weldid[model.geom_bodyid[first]] == model.body_weldid[model.geom_bodyid[second]]:
        raise InvalidInputError(f"the shapes {pair[0]!r} and {pair[1]!r} are on the same link and cannot move apart")
    return first, second
