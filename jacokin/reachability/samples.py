"""`Grid` and `Samples`: which poses a map is made of, and which of them stands for a given one.

A sample is a position and an orientation. Where joint 1 turns freely, positions are (r, 0, z), and a pose anywhere is
first turned about the z axis of the base into the half plane y = 0, x >= 0. Where the last joint rolls the tool freely,
an orientation stands for all that turn the axis of the tool into the same direction.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array, seal
from jacokin.errors import InvalidInputError
from jacokin.ik.files.targets import rotations_from_quats
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.many_configurations import Chain
from jacokin.model.poses import DOWN_QUAT_WXYZ, FreeAxis, quat_wxyz, unit_vector
from jacokin.model.robot import Robot

MOST_CELLS = 10**9  # one number for each is 8 GB
NOWHERE = -1  # the cell of a position outside the grid
_AT_ONCE = 4096  # poses whose nearest orientation is looked for in one product


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
            edges = np.ceil((self.upper - self.lower) / self.spacing - 1e-9)  # an edge may miss the box by rounding
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
        checks.instance("robot", robot, Robot, "a Robot")
        spacing = checks.positive("spacing", spacing, "m")
        placements = list(robot.pin_model.jointPlacements)[1:]
        frame = robot.pin_model.frames[robot.frame_id()].placement
        reach = sum(float(np.linalg.norm(placement.translation)) for placement in [*placements[1:], frame])
        steps = float(np.ceil(reach / spacing))
        edge = steps * spacing if math.isfinite(steps) else reach  # which then has too many cells
        return cls(placements[0].translation - edge, placements[0].translation + edge, spacing)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Rebuild from the numbers, so that arrays stay read-only."""
        return Grid, (self.lower, self.upper, self.spacing)

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


@dataclass(frozen=True, eq=False)
class Samples:
    """The poses of a map.

    Attributes:
        grid: the box in space that the map covers.
        orientations: of the tool at each position.
        symmetries: what of a pose does not matter.
    """

    grid: Grid
    orientations: Orientations
    symmetries: Symmetries

    @cached_property
    def shape(self) -> tuple[int, ...]:
        """Number of positions: along x, y and z, or along r and z."""
        if not self.symmetries.turns:
            return self.grid.shape
        farthest = np.abs([self.grid.lower[:2], self.grid.upper[:2]]).max(axis=0)
        return math.ceil(float(np.linalg.norm(farthest)) / self.grid.spacing), self.grid.shape[2]

    @property
    def positions(self) -> int:
        """Number of positions."""
        return math.prod(self.shape)

    def position(self, cells: NDArray[np.int_]) -> Array:
        """(k, 3) position of each cell [m], in the half plane y = 0 where joint 1 turns freely."""
        if not self.symmetries.turns:
            places = np.stack(np.unravel_index(cells, self.shape), axis=1)
            return np.asarray(self.grid.lower + (places + 0.5) * self.grid.spacing)
        r, z = np.unravel_index(cells, self.shape)
        spacing = self.grid.spacing
        return np.stack([(r + 0.5) * spacing, np.zeros(len(cells)), self.grid.lower[2] + (z + 0.5) * spacing], axis=1)

    def targets(self, cells: NDArray[np.int_]) -> Array:
        """(k, m, 4, 4) every orientation at each of these cells."""
        targets = np.zeros((len(cells), len(self.orientations), 4, 4))
        targets[..., 3, 3] = 1.0
        targets[..., :3, :3] = self.orientations.rotations
        targets[..., :3, 3] = self.position(cells)[:, None]
        return targets

    def cell_of(self, positions: Array) -> NDArray[np.int_]:
        """(n,) the cell that each position (n, 3) lies in; `NOWHERE` outside the grid."""
        spacing = self.grid.spacing
        with np.errstate(invalid="ignore"):
            places = np.floor((positions - self.grid.lower) / spacing)
            inside = ((places >= 0) & (places < self.grid.shape)).all(axis=1)
        if self.symmetries.turns:
            radius = np.floor(np.hypot(positions[:, 0], positions[:, 1]) / spacing)
            places = np.stack([radius, places[:, 2]], axis=1)
            inside &= radius < self.shape[0]
        inside = np.asarray(inside)
        indices = np.where(inside[:, None], places, 0.0).astype(np.int_)
        return np.where(inside, np.ravel_multi_index(tuple(indices.T), self.shape), NOWHERE)

    def orientation_of(self, rotations: Array, positions: Array) -> NDArray[np.int_]:
        """(n,) the nearest orientation for poses with these rotations (n, 3, 3) and positions (n, 3)."""
        if self.symmetries.turns:
            rotations = turn_about_base(rotations, -np.arctan2(positions[:, 1], positions[:, 0]))
        return self.nearest(rotations)

    def nearest(self, rotations: Array) -> NDArray[np.int_]:
        """(n,) the nearest orientation of each rotation (n, 3, 3), which is not turned before."""
        found = np.empty(len(rotations), dtype=np.int_)
        for first in range(0, len(rotations), _AT_ONCE):
            some = slice(first, first + _AT_ONCE)
            found[some] = self.cosines(rotations[some]).argmax(axis=1)
        return found

    def cosines(self, rotations: Array) -> Array:
        """(n, m) cosine of the angle from each rotation to each orientation, turns left out where they are free."""
        axis = self.symmetries.tool_axis
        if axis is not None:
            return np.asarray((rotations @ axis) @ (self.orientations.rotations @ axis).T)
        # trace(A^T B) = 1 + 2 cos(angle)
        flat = rotations.reshape(-1, 9)
        traces = flat @ self.orientations.rotations.reshape(-1, 9).T
        axes, ranges = self.orientations.axes, self.orientations.ranges
        if axes is not None and ranges is not None:
            # Turned by p about a, the trace is a^T L a + cos p (trace L - a^T L a) + sin p a.skew(L), with L = A^T B.
            turns = np.cross(axes[:, None], np.eye(3)).transpose(0, 2, 1)
            across = flat @ (self.orientations.rotations @ turns).reshape(-1, 9).T
            along = flat @ (self.orientations.rotations @ (axes[:, :, None] * axes[:, None])).reshape(-1, 9).T
            best, middle = np.arctan2(across, traces - along), ranges.mean(axis=1)
            p = np.clip(best + 2.0 * np.pi * np.round((middle - best) / (2.0 * np.pi)), *ranges.T)
            traces = along + np.cos(p) * (traces - along) + np.sin(p) * across
        return np.asarray((traces - 1.0) / 2.0)


def turn_about_base(rotations: Array, angles: Array) -> Array:
    """Turn rotations (n, 3, 3) by angles (n,) [rad] about the z axis of the base."""
    c, s = np.cos(angles), np.sin(angles)
    turn = np.zeros((len(angles), 3, 3))
    turn[:, 0, 0], turn[:, 0, 1], turn[:, 1, 0], turn[:, 1, 1], turn[:, 2, 2] = c, -s, s, c, 1.0
    return np.asarray(turn @ rotations)


def turn_about_z(angle: float) -> Array:
    """The rotation (3, 3) by an angle [rad] about the z axis."""
    return np.asarray(turn_about_base(np.eye(3)[None], np.array([angle]))[0])


MOST = 100_000
TOLERANCE = 1e-9  # [m] and [rad] that an axis may be off: a thousandth of the tolerance of a solution


class Orientations:
    """Orientations of the tool in the base frame; immutable.

    Attributes:
        name: how they were made.
        quats_wxyz: (m, 4) unit quaternions.
        rotations: (m, 3, 3) the same as matrices.
        axes: (m, 3) axis in the tool frame about which each may turn, a unit vector; None where they are fixed.
        ranges: (m, 2) least and largest angle about it [rad]; None where they are fixed.
    """

    __slots__ = ("axes", "name", "quats_wxyz", "ranges", "rotations")

    def __init__(
        self,
        quats_wxyz: ArrayLike,
        name: str = "given",
        *,
        axes: ArrayLike | None = None,
        ranges: ArrayLike | None = None,
    ) -> None:
        """Take quaternions (m, 4) whose norm is within 1 % of one.

        Args:
            quats_wxyz: quaternions.
            name: how they were made.
            axes: (m, 3) axes in the tool frame about which they may turn; a position is reached when one of the
                orientations that come from turning is. See also `free`.
            ranges: (m, 2) angles about the axes [rad]; None for full turns.

        Raises:
            InvalidInputError: malformed, none, more than 100,000, a wrong norm, or ranges without axes.
        """
        quats = checks.matrix("quats_wxyz", quats_wxyz, 4, "wxyz")
        if len(quats) > MOST:
            raise InvalidInputError(f"at most {MOST} orientations, got {len(quats)}")
        rotations, wrong = rotations_from_quats(quats)
        if len(wrong):
            raise InvalidInputError(f"quats_wxyz[{wrong[0]}] must have norm 1 (within 1 %), got {quats[wrong[0]]}")
        self.name = name
        self.quats_wxyz = checks.read_only(quats)
        self.rotations = checks.read_only(rotations)
        self.axes = self.ranges = None
        if axes is None:
            if ranges is not None:
                raise InvalidInputError("ranges are of axes; give axes too")
            return
        free = [
            FreeAxis(np.eye(4), axis=axis, range=limits)
            for axis, limits in zip(
                _rows("axes", axes, 3, len(quats)),
                _rows("ranges", (-math.pi, math.pi) if ranges is None else ranges, 2, len(quats)),
                strict=True,
            )
        ]
        self.axes = checks.read_only(np.array([each.axis for each in free]))
        self.ranges = checks.read_only(np.array([each.range for each in free]))

    def __len__(self) -> int:
        """How many."""
        return len(self.quats_wxyz)

    def __repr__(self) -> str:
        """How they were made, and how many there are."""
        return f"Orientations({len(self)}, {self.name!r})"

    def __setstate__(self, state: tuple[None, dict[str, object]]) -> None:
        """Unpickled arrays are writable until told otherwise."""
        for name, value in state[1].items():
            seal(value)
            setattr(self, name, value)

    @classmethod
    def even(cls, count: int) -> Orientations:
        """Rotations spread evenly over all of them, by a super-Fibonacci spiral."""
        count = checks.whole_number("count", count, 1, MOST)
        s = np.arange(count) + 0.5
        inner, outer = np.sqrt(s / count), np.sqrt(1.0 - s / count)
        # The constants of Alexa, section 3: sqrt(2), and psi that solves psi^4 = psi + 4.
        alpha, beta = 2.0 * np.pi * s / math.sqrt(2.0), 2.0 * np.pi * s / 1.533751168755204288118041413
        spiral = [inner * np.sin(alpha), inner * np.cos(alpha), outer * np.sin(beta), outer * np.cos(beta)]
        return cls(np.stack(spiral, axis=1), f"{count} rotations, super-Fibonacci")

    @classmethod
    def free(cls, targets: FreeAxis | Sequence[FreeAxis], name: str | None = None) -> Orientations:
        """Those of targets that may turn about an axis; their positions are not used.

        Raises:
            InvalidInputError: none, or one that is not a `FreeAxis`.
        """
        each = [targets] if isinstance(targets, FreeAxis) else checks.listed("targets", targets)
        if not each or not all(isinstance(target, FreeAxis) for target in each):
            raise checks.refusal("targets", "a FreeAxis, or a sequence of them", targets)
        return cls(
            np.array([quat_wxyz(target.matrix[:3, :3]) for target in each]),
            f"{len(each)} free about an axis" if name is None else name,
            axes=np.array([target.axis for target in each]),
            ranges=np.array([target.range for target in each]),
        )

    @classmethod
    def directions(cls, count: int, axis: ArrayLike = (0.0, 0.0, 1.0), *, free_roll: bool = False) -> Orientations:
        """Rotations that turn `axis` of the tool into directions spread evenly over the sphere.

        Args:
            count: how many.
            axis: (3,) in the tool frame.
            free_roll: whether the tool may turn about the axis; otherwise the roll of each is an arbitrary one.
        """
        checks.flag("free_roll", free_roll)
        count = checks.whole_number("count", count, 1, MOST)
        number = np.arange(count)
        z = 1.0 - (2.0 * number + 1.0) / count
        radius, angle = np.sqrt(1.0 - z * z), number * (math.pi * (3.0 - math.sqrt(5.0)))  # the golden angle
        return cls(
            shortest_turns(
                unit_vector("axis", axis), np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=1)
            ),
            f"{count} directions, spherical Fibonacci{', any roll' if free_roll else ''}",
            axes=np.tile(unit_vector("axis", axis), (len(number), 1)) if free_roll else None,
        )

    @classmethod
    def down(cls, yaws: int = 1) -> Orientations:
        """The tool pointing vertically down, turned about the vertical in equal steps."""
        yaws = checks.whole_number("yaws", yaws, 1, MOST)
        half = np.pi * np.arange(yaws) / yaws
        w, x, y, z = DOWN_QUAT_WXYZ
        c, s = np.cos(half), np.sin(half)  # Rz(2 half) times the tool pointing down
        quats = np.stack([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=1)
        return cls(quats, f"tool down, {yaws} yaws")

    def free_axis(self, index: int, pose: pin.SE3 | ArrayLike) -> FreeAxis:
        """A pose with one of these orientations as a target that may turn about its axis; index and axes are there."""
        assert self.axes is not None
        assert self.ranges is not None
        return FreeAxis(pose, axis=self.axes[index], range=self.ranges[index])

    def without_roll(self, axis: ArrayLike) -> Orientations:
        """One of those that turn `axis` of the tool into the same direction."""
        directions = self.rotations @ unit_vector("axis", axis)
        _, first = np.unique(np.round(directions, 9), axis=0, return_index=True)
        return Orientations(self.quats_wxyz[np.sort(first)], self.name)


@dataclass(frozen=True, slots=True, eq=False)
class Symmetries:
    """What does not matter.

    Attributes:
        turns: whether poses may be turned about the z axis of the base.
        tool_axis: (3,) axis of the tool about which poses may be turned, a unit vector in its frame; None if none.
    """

    turns: bool
    tool_axis: Array | None


NO_SYMMETRIES = Symmetries(turns=False, tool_axis=None)


def find_symmetries(solver: IKSolver) -> Symmetries:
    """The symmetries of an arm, frame and tool; obstacles, and the shapes of hand and base, do not have them."""
    robot = solver.robot
    chain = Chain(robot, robot.frame_id(solver.frame), solver.tool)
    (tool,), (jacobian,) = chain.placements(robot.home[None])
    position, rotation, velocity, angular = tool[:3, 3], tool[:3, :3], jacobian[:3].T, jacobian[3:].T
    # A joint whose axis passes through a point moves it by the cross product of the axis with the way to the tool.
    about_z = np.cross(angular[0], position)[:2]
    turns = bool(
        robot.unlimited[0]
        and np.abs(angular[0, :2]).max() < TOLERANCE
        and np.abs(velocity[0, :2] - about_z).max() < TOLERANCE
        and np.abs(velocity[0, 2]) < TOLERANCE
    )
    rolls = bool(robot.unlimited[-1] and not robot.sliding[-1] and np.abs(velocity[-1]).max() < TOLERANCE)
    return Symmetries(turns, np.asarray(rotation.T @ angular[-1]) if rolls else None)


def shortest_turns(axis: Array, directions: Array) -> Array:
    """Quaternions (m, 4) of the smallest rotations from a unit vector to others (m, 3)."""
    quats = np.concatenate([1.0 + directions @ axis[:, None], np.cross(axis, directions)], axis=1)
    opposite = quats[:, 0] < 1e-12
    if opposite.any():  # half a turn about anything perpendicular
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        quats[opposite] = [0.0, *(across / np.linalg.norm(across))]
    return np.asarray(quats / np.linalg.norm(quats, axis=1, keepdims=True))


def checked_orientations(
    value: Orientations | FreeAxis | Sequence[FreeAxis] | int, symmetries: Symmetries
) -> tuple[Orientations, Symmetries]:
    """A set of orientations, and the symmetries that a map with them has.

    Of a number, so many rotations, or directions of an axis about which the last joint rolls the tool freely. Tools
    that may turn about that very axis are nothing else; about another axis, turning and roll are two different things.

    Raises:
        InvalidInputError: neither a set nor a number.
    """
    axis = symmetries.tool_axis
    if isinstance(value, FreeAxis | list | tuple):
        value = Orientations.free(value)
    if isinstance(value, Orientations):
        if axis is None:
            return value, symmetries
        if value.axes is None or np.linalg.norm(np.cross(value.axes, axis), axis=1).max() < 1e-9:  # as of symmetries
            return value.without_roll(axis), symmetries
        return value, Symmetries(symmetries.turns, None)
    if not isinstance(value, int | np.integer) or isinstance(value, bool):
        raise checks.refusal("orientations", "an Orientations, one or several FreeAxis, or a number of them", value)
    count = checks.whole_number("orientations", value, lowest=1)
    return Orientations.even(count) if axis is None else Orientations.directions(count, axis), symmetries


def _rows(name: str, values: ArrayLike, width: int, count: int) -> Array:
    """One row for each of so many orientations; a single one is for all.

    Raises:
        InvalidInputError: another number of them, or malformed.
    """
    rows = checks.matrix(name, np.atleast_2d(checks.array(name, values, f"rows of {width} numbers")), width, "")
    if len(rows) not in (1, count):
        raise InvalidInputError(f"{name} must have one row for each of the {count} orientations, got {len(rows)}")
    return np.asarray(np.broadcast_to(rows, (count, width)))
