"""A box of space cut into cubes."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.robot import Robot

MOST_CELLS = 10**9  # one number for each is 8 GB
_ROUNDING = 1e-9  # of a cell, by which an edge may miss the box


class Grid:
    """Cubes of one size that fill a box in the base frame of the robot; immutable.

    Attributes:
        lower: (3,) lower corner [m].
        upper: (3,) upper corner [m]; the last cubes may stand out.
        spacing: length of an edge [m].
        shape: number of cubes along x, y and z.
    """

    __slots__ = ("lower", "shape", "spacing", "upper")

    def __init__(self, lower: ArrayLike, upper: ArrayLike, spacing: float) -> None:
        """Check the box.

        Raises:
            InvalidInputError: malformed corners, an empty box, a spacing that is not positive, or more than 1e9 cells.
        """
        self.lower = checks.read_only(checks.vector("lower", lower, 3, "m"))
        self.upper = checks.read_only(checks.vector("upper", upper, 3, "m"))
        self.spacing = checks.positive("spacing", spacing, "m")
        if not (self.upper > self.lower).all():
            raise InvalidInputError(
                f"upper must be above lower [m], got {self.upper.tolist()} and {self.lower.tolist()}"
            )
        with np.errstate(over="ignore"):  # infinitely many cells are too many
            edges = np.ceil((self.upper - self.lower) / self.spacing - _ROUNDING)
        numbers = np.maximum(edges, 1.0).tolist()
        if math.prod(numbers) > MOST_CELLS:
            raise InvalidInputError(
                f"the grid has {math.prod(numbers):.3g} cells ({' x '.join(f'{n:.0f}' for n in numbers)}), "
                f"more than {MOST_CELLS:.0e}: use a larger spacing or a smaller box"
            )
        self.shape = (int(numbers[0]), int(numbers[1]), int(numbers[2]))

    @classmethod
    def around(cls, robot: Robot, spacing: float) -> Grid:
        """The box that the robot can reach into at most: a cube about its first joint, as far as its links are long.

        Raises:
            InvalidInputError: not a robot, or a spacing as for a grid.
        """
        if not isinstance(robot, Robot):
            raise InvalidInputError(f"robot must be a Robot, got {checks.shown(robot)}")
        spacing = checks.positive("spacing", spacing, "m")
        placements = list(robot.pin_model.jointPlacements)[1:]
        frame = robot.pin_model.frames[robot.frame_id()].placement
        reach = sum(float(np.linalg.norm(placement.translation)) for placement in [*placements[1:], frame])
        steps = float(np.ceil(reach / spacing))
        edge = steps * spacing if math.isfinite(steps) else reach  # which then has too many cells
        return cls(placements[0].translation - edge, placements[0].translation + edge, spacing)

    def __repr__(self) -> str:
        """Corners, spacing and number of cells."""
        return f"Grid({self.lower.tolist()}, {self.upper.tolist()}, {self.spacing}): {' x '.join(map(str, self.shape))}"

    @property
    def cells(self) -> int:
        """Number of cells."""
        return math.prod(self.shape)

    def axis(self, index: int) -> Array:
        """Centres of the cells along x (0), y (1) or z (2) [m].

        Raises:
            InvalidInputError: another index.
        """
        index = checks.whole_number("index", index, 0, 2)
        return np.asarray(self.lower[index] + (np.arange(self.shape[index]) + 0.5) * self.spacing)

    def centres(self) -> Array:
        """(nx, ny, nz, 3) centres of the cells [m]."""
        return np.stack(np.meshgrid(*(self.axis(index) for index in range(3)), indexing="ij"), axis=-1)
