"""`Measurements`: what an instrument, or none, says about where the arm was at some joint angles.

Five kinds: positions of a point of the hand, full poses of it, its distances to fixed points, contact with one plane,
and contact with one point. Rows that are not finite are kept here and named by `calibrate`, which leaves them out.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array, seal
from jacokin.errors import InvalidInputError
from jacokin.files import ARRAYS, NOT_FINITE_TEXT, NUMBER_TEXT, open_parquet, read_arrays, read_rows
from jacokin.ik.files.targets import POSITION, QUATERNION, RPY, rotations_from_quats, rotations_from_rpys
from jacokin.logs import Log, StandstillRule
from jacokin.model import checks, poses

SIZES = {"positions": 3, "poses": 6, "distances": 1, "plane": 1, "point": 3}  # numbers that a row says
CONTACTS = ("plane", "point")
NOT_MEASUREMENTS = "is not a file of measurements"
LARGEST = 1e6  # [m], [rad] of what anybody measures
KINOVA = ("theta_x", "theta_y", "theta_z")  # R = Rx Ry Rz
JOINT = ("joint_", "q")  # before the number of a joint, from 1
FIXED_POINT = ("px", "py", "pz")
READ = (*POSITION, *QUATERNION, *RPY, *KINOVA, *FIXED_POINT, "distance", "sigma", "sigma_angle")  # beside the joints

Sigma = ArrayLike | tuple[ArrayLike, ArrayLike]


class Measurements:
    """Rows of one kind, of one point of the hand. Immutable.

    Attributes:
        kind: "positions", "poses", "distances", "plane" or "point".
        q: (n, dof) reported joint angles [rad]; read-only, as are the arrays below.
        values: what was measured: (n, 3) positions [m], (n, 4, 4) poses, (n,) distances [m]; (n, 0) for contacts.
        points: (n, 3) the fixed points of distances [m]; None for other kinds.
        sigma: (n, k) standard deviation of each number [m], of a pose's last three [rad].
        frame: the frame that carries the point; None for the robot's default frame.
        source: the file that the rows were read from; None for arrays.
        times: (n,) when the arm stood there [s]; None for rows that are not of a `Log`.
    """

    def __init__(
        self,
        q: ArrayLike,
        *,
        sigma: Sigma,
        positions: ArrayLike | None = None,
        poses: ArrayLike | None = None,
        distances: ArrayLike | None = None,
        points: ArrayLike | None = None,
        contact: str | None = None,
        frame: str | None = None,
        base: str | pin.SE3 | ArrayLike = "known",
        tool: str | pin.SE3 | ArrayLike = "known",
    ) -> None:
        """Keep rows of one kind.

        Args:
            q: (n, dof) joint angles as the arm reports them [rad].
            sigma: standard deviation of the instrument [m]: one, (n,), or one for each number; of poses a pair of
                those, [m] and [rad].
            positions: (n, 3) of the point [m].
            poses: (n, 4, 4), or a list of `pin.SE3`.
            distances: (n,) from `points` [m].
            points: (3,) or (n, 3) fixed points [m]; one for all must be finite.
            contact: "plane" or "point": the point of the hand touched one plane, or one fixed point, again and again,
                wherever that is.
            frame: the frame of the robot that carries the point; None for the robot's default frame.
            base: "known": the instrument measures in the arm's base; "unknown"; or T_sensor_base.
            tool: "known": the point is the frame's origin; "unknown"; or T_frame_target.

        Raises:
            InvalidInputError: not exactly one kind, or malformed; rows that are not finite pass.
        """
        given = {"positions": positions, "poses": poses, "distances": distances, "contact": contact}
        kinds = [name for name, value in given.items() if value is not None]
        if len(kinds) != 1:
            raise InvalidInputError(
                f"exactly one of {', '.join(given)} must be given, got {', '.join(kinds) or 'none of them'}"
            )
        self.kind = kinds[0] if contact is None else checks.choice("contact", contact, CONTACTS)
        self.q = checks.read_only(_usable(_rows("q", q, None, "rad")))
        n = len(self.q)
        self.values: Array = np.empty((n, 0))
        self.points: Array | None = None
        if positions is not None:
            self.values = _rows("positions", positions, 3, "m")
        elif poses is not None:
            self.values = _pose_rows(poses)
        elif distances is not None:
            self.values = checks.array("distances", distances, "a list of numbers", "m").reshape(-1)
            self.points = _fixed_points(points, n)
        if (points is None) == (self.kind == "distances"):
            raise InvalidInputError("points must be given with distances, and only with them")
        if len(self.values) != n:
            raise InvalidInputError(f"q has {n} rows and {kinds[0]} {len(self.values)}")
        self.values = checks.read_only(_usable(self.values))
        self.sigma = checks.read_only(_sigmas(sigma, n, self.kind))
        self.frame = checks.optional(checks.instance, "frame", frame, str, "the name of a frame")
        self._base = _placed("base", base)
        self._tool = _placed("tool", tool)
        self.source: Path | None = None
        self.times: Array | None = None
        self._lines: NDArray[np.intp] | None = None
        if self.kind in CONTACTS and self._base is None:
            raise InvalidInputError("base cannot be unknown for contact: no instrument measures it")

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.q)

    def __setstate__(self, state: dict[str, object]) -> None:
        """Unpickled arrays are writable until told otherwise."""
        self.__dict__.update(state)
        seal(tuple(state.values()))

    def __repr__(self) -> str:
        """Kind and number of rows."""
        return f"Measurements({len(self)} {self.kind}, frame={self.frame!r})"

    @property
    def base(self) -> pin.SE3 | None:
        """T_sensor_base, the arm's base in the instrument's frame, a copy; None where it is unknown."""
        return None if self._base is None else self._base.copy()

    @property
    def tool(self) -> pin.SE3 | None:
        """T_frame_target, the measured point or marker in the hand, a copy; None where it is unknown."""
        return None if self._tool is None else self._tool.copy()

    def select(self, rows: ArrayLike) -> Measurements:
        """Those of some rows: indices or a mask.

        Raises:
            InvalidInputError: no such rows.
        """
        try:
            index = np.arange(len(self))[np.asarray(rows)].reshape(-1)
        except (IndexError, ValueError, OverflowError) as error:
            raise InvalidInputError(f"rows: {error}") from error
        chosen = object.__new__(Measurements)
        chosen.__dict__.update(self.__dict__)
        for name in ("q", "values", "sigma", "points", "times"):
            array = getattr(self, name)
            if array is not None:
                setattr(chosen, name, checks.read_only(array[index]))
        if self._lines is not None:
            chosen._lines = checks.sealed(self._lines[index])
        return chosen

    def name_row(self, row: int) -> str:
        """Which row it is, in words: the line of a text file, from 1; the time in a log; else its index, from 0."""
        if self.times is not None:
            return f"row {row} (from 0), at {self.times[row]:.1f} s"
        if self._lines is not None:
            return f"line {self._lines[row]}"
        return f"row {row} (from 0)" if self.source is not None else f"row {row}"

    @property
    def finite(self) -> NDArray[np.bool_]:
        """(n,) whether a row is made of finite numbers up to 1e6."""
        numbers = [self.q, self.values.reshape(len(self), -1), *([] if self.points is None else [self.points])]
        return np.asarray(np.isfinite(np.hstack(numbers)).all(axis=1))

    @classmethod
    def load(
        cls,
        path: str | Path,
        *,
        sigma: Sigma | None = None,
        frame: str | None = None,
        base: str | pin.SE3 | ArrayLike = "known",
        tool: str | pin.SE3 | ArrayLike = "known",
        contact: str | None = None,
        degrees: bool = False,
        kinova: bool = False,
    ) -> Measurements:
        """Read a .csv, .npz or .parquet file.

        Its columns: joint_1, joint_2, ... or q1, q2, ...; x, y, z; for poses also qw, qx, qy, qz, or roll, pitch, yaw,
        or theta_x, theta_y, theta_z (Kinova's, R = Rx Ry Rz); for distances `distance`, px, py, pz. `sigma` [m] and
        `sigma_angle` [rad] may be columns, too. Other columns are left alone. An empty cell is a missing number, which
        no sigma may be; a row with more cells than columns is refused, and so are words in these columns.

        Args:
            path: the file.
            sigma: as in `Measurements`; None for the columns.
            frame: as in `Measurements`, as are `base`, `tool` and `contact`.
            base: see there.
            tool: see there.
            contact: see there; x, y, z are then not used.
            degrees: joint angles and roll, pitch, yaw are in degrees.
            kinova: as Kinova's software: all angles in degrees, lengths in millimetres, those of sigma, too.

        Raises:
            InvalidInputError: cannot be read, or lacks columns; names them.
            MissingExtraError: a Parquet file without pyarrow.
        """
        path = checks.path("path", path)
        columns, lines = _read(path)
        angle = math.pi / 180.0 if checks.flag("degrees", degrees) or checks.flag("kinova", kinova) else 1.0
        length = 1e-3 if kinova else 1.0
        joints = [name for name in columns if _is_joint(name)]
        joints.sort(key=lambda name: int("".join(filter(str.isdecimal, name))))
        if not joints:
            raise InvalidInputError(f"{path}: has no joint angles: columns joint_1, joint_2, ... or q1, q2, ...")
        if not any(joints == [f"{name}{number + 1}" for number in range(len(joints))] for name in JOINT):
            raise InvalidInputError(
                f"{path}: joint angles must be columns joint_1, joint_2, ... or q1, q2, ... without a gap; of numbers "
                f"there are {', '.join(joints)}"
            )
        q = angle * np.column_stack([columns[name] for name in joints])
        arguments: tuple[str, ...] = ("sigma", "frame", "base", "tool", "unknown")
        if sigma is None:
            arguments = arguments[1:]
            if "sigma" not in columns:
                raise InvalidInputError(f"{path}: has no column sigma: give sigma= [m], the error of the instrument")
            sigma = length * columns["sigma"]
            if "sigma_angle" in columns:
                sigma = (sigma, (angle if kinova else 1.0) * columns["sigma_angle"])
        try:
            found = cls(
                q,
                sigma=sigma,
                frame=frame,
                base=base,
                tool=tool,
                **_measured(path, columns, len(q), angle, length, contact),
            )
        except InvalidInputError as error:
            if str(error).startswith((*arguments, f"{path}: ")):  # not what the file says, or named
                raise
            raise InvalidInputError(f"{path}: {error}") from error
        found.source, found._lines = path, lines
        return found

    @classmethod
    def from_log(
        cls,
        log: Log,
        *,
        sigma: Sigma,
        rule: StandstillRule | None = None,
        joints: str | None = None,
        poses: str | None = None,
        frame: str | None = None,
        base: str | pin.SE3 | ArrayLike = "known",
        tool: str | pin.SE3 | ArrayLike = "known",
    ) -> Measurements:
        """Rows where the arm of a log stands still and its hand is measured: see `Log.standstills`.

        Args:
            log: a recording of ROS.
            sigma: a tuple of two errors, [m] and [rad], takes poses; anything else [m] takes positions only, of an
                instrument that measures poses, too.
            rule: what counts as standing still; None for its defaults.
            joints: topic of the joints, as in `Log.joints`.
            poses: topic of the instrument, as in `Log.poses`.
            frame: as in `Measurements`, as are `base` and `tool`.
            base: see there; the instrument's frame is that of its messages.
            tool: see there.

        Raises:
            InvalidInputError: as `Log.standstills`; points and a pair of errors; malformed.
        """
        checks.instance("log", log, Log, "a Log")
        found = log.standstills(rule, joints=joints, poses=poses)
        wants_poses = isinstance(sigma, tuple)
        if wants_poses and found.rotations is None:
            raise InvalidInputError("sigma must be one error [m]: the instrument of the log measures points, not poses")
        values: dict[str, Any] = {"poses": found.poses} if wants_poses else {"positions": found.positions}
        made = cls(found.q, sigma=sigma, frame=frame, base=base, tool=tool, **values)
        made.source, made.times = log.path, found.start
        return made


def checked_measurements(name: str, value: Measurements | Sequence[Measurements]) -> tuple[Measurements, ...]:
    """One set of measurements, or several, as a tuple.

    Raises:
        InvalidInputError: anything else, none, or one without rows.
    """
    several = (value,) if isinstance(value, Measurements) else checks.listed(name, value, "Measurements, or a list")
    for each in several:
        checks.instance(name, each, Measurements, "Measurements, or a list of them")
    if not several or not all(map(len, several)):
        raise InvalidInputError(f"{name} is empty, or has a set without rows")
    return several


def _rows(name: str, value: ArrayLike, columns: int | None, unit: str) -> Array:
    rows = checks.array(name, value, f"rows of {columns or 'joint'} numbers", unit)
    if rows.ndim != 2 or (columns is not None and rows.shape[1] != columns):
        shape = f"(n, {columns or 'dof'})"
        raise InvalidInputError(f"{name} must have shape {shape} [{unit}], got shape {rows.shape}")
    if not len(rows):
        raise InvalidInputError(f"{name} is empty")
    return rows


def _usable(values: Array) -> Array:
    """The values, NaN where they are larger than anybody measures: squares of them may be infinite."""
    return np.where(np.abs(values) <= LARGEST, values, np.nan)


def _pose_rows(value: ArrayLike) -> Array:
    """Poses (n, 4, 4); those that are not finite pass, others must be rigid.

    Raises:
        InvalidInputError: another shape, or not rigid; names the row.
    """
    if isinstance(value, list | tuple) and all(isinstance(each, pin.SE3) for each in value):
        return np.array([each.homogeneous for each in value]).reshape(-1, 4, 4)
    rows = checks.array("poses", value, "poses (n, 4, 4)", "m")
    if rows.ndim != 3 or rows.shape[1:] != (4, 4):
        raise InvalidInputError(f"poses must have shape (n, 4, 4) [m], got shape {rows.shape}")
    found = np.array(rows)
    for row in np.flatnonzero(np.isfinite(rows).all(axis=(1, 2))):
        found[row] = poses.checked_matrix(f"poses[{row}]", rows[row])
    return found


def _fixed_points(points: ArrayLike | None, n: int) -> Array | None:
    if points is None:
        return None
    given = _usable(checks.array("points", points, "a point (3,), or a row for each distance", "m"))
    if given.shape not in ((3,), (n, 3)):
        raise InvalidInputError(f"points must be of shape (3,) or ({n}, 3) [m], got shape {given.shape}")
    if given.ndim == 1 and not np.isfinite(given).all():
        raise InvalidInputError(f"points must be finite, and at most {LARGEST:g} m from the base, got {points}")
    return checks.read_only(np.broadcast_to(given, (n, 3)))


def _sigmas(sigma: Sigma, n: int, kind: str) -> Array:
    """Standard deviations (n, k) of a kind.

    Raises:
        InvalidInputError: not positive, or of another shape.
    """
    if kind == "poses":
        if not isinstance(sigma, tuple | list) or len(sigma) != 2:
            raise checks.refusal("sigma", "a pair of poses' errors, [m] and [rad]", sigma)
        return np.hstack([_sigma("sigma[0]", sigma[0], n, 3, "m"), _sigma("sigma[1]", sigma[1], n, 3, "rad")])
    return _sigma("sigma", sigma, n, SIZES[kind], "m")


def _sigma(name: str, value: object, n: int, size: int, unit: str) -> Array:
    given = checks.array(name, value, "a number, or one for each row", unit)  # type: ignore[arg-type]  # refused there
    if given.shape == (n,):
        given = given[:, np.newaxis]
    try:
        full = np.broadcast_to(given, (n, size))
    except ValueError:
        pair = ", as a pair of errors, which is for poses" if given.shape == (2,) else ""
        raise InvalidInputError(
            f"{name} must have shape (), ({n},) or ({n}, {size}), got {given.shape}{pair}"
        ) from None
    if not (np.isfinite(full) & (full > 0.0)).all():
        raise InvalidInputError(f"{name} must be positive and finite [{unit}]")
    smallest = 1e-12  # of what any instrument tells apart; squares of less overflow
    if full.min() < smallest or full.max() > LARGEST:
        worst = full.min() if full.min() < smallest else full.max()
        raise InvalidInputError(f"{name} must be between {smallest:g} and {LARGEST:g} [{unit}], got {worst:.3g}")
    return full


def _placed(name: str, value: str | pin.SE3 | ArrayLike) -> pin.SE3 | None:
    if isinstance(value, str):
        known = checks.choice(name, value, ("known", "unknown")) == "known"
        return pin.SE3.Identity() if known else None
    return poses.checked_pose(value, name)


def _measured(
    path: Path, columns: Mapping[str, Array], n: int, angle: float, length: float, contact: str | None
) -> dict[str, Any]:
    """What a file's columns say beside the joint angles, as arguments of `Measurements`."""
    if contact is not None:
        return {"contact": contact}
    if "distance" in columns:
        points = length * _columns(path, columns, FIXED_POINT)
        return {"distances": length * columns["distance"], "points": points}
    positions = length * _columns(path, columns, POSITION)
    rotations = _rotations(path, columns, angle)
    if rotations is None:
        return {"positions": positions}
    T = np.tile(np.eye(4), (n, 1, 1))
    T[:, :3, :3], T[:, :3, 3] = rotations, positions
    return {"poses": T}


def _read(path: Path) -> tuple[Mapping[str, Array], NDArray[np.intp] | None]:
    """The columns of a file that hold numbers, and the line of each row, from 1; None where there are no lines.

    Raises:
        InvalidInputError: cannot be read, rows of different lengths, or columns that are read and are not numbers.
    """
    if path.suffix == ".npz":
        return _same_length(path, read_arrays(path, NOT_MEASUREMENTS)), None
    return (_read_parquet(path), None) if path.suffix == ".parquet" else _read_csv(path)


def _read_parquet(path: Path) -> Mapping[str, Array]:
    """The columns of a Parquet file that hold numbers.

    Raises:
        InvalidInputError: cannot be read, is too large, or holds something else in a column that is read.
    """
    with open_parquet(path, NOT_MEASUREMENTS) as file:
        if file.metadata.num_rows * file.metadata.num_columns > ARRAYS // 8:
            raise InvalidInputError(f"{path}: {NOT_MEASUREMENTS}: its columns have more than {ARRAYS} bytes")
        table, columns = file.read(), {}
        for name in table.column_names:
            column = table.column(name)
            if str(column.type).startswith(("double", "float", "halffloat", "int", "uint")):
                columns[name] = np.asarray(column.to_numpy(), dtype=np.float64)
            elif _is_read(name):
                raise InvalidInputError(f"{path}: column {name} must be numbers, got {column.type}")
        return columns


def _read_csv(path: Path) -> tuple[Mapping[str, Array], NDArray[np.intp]]:
    """The columns of a CSV file that hold numbers, and the line of each row, from 1.

    Raises:
        InvalidInputError: cannot be read, rows of different lengths, no rows, a column is there twice, or one that is
            read has a cell that is not a number.
    """
    cells = read_rows(path)
    names = [name.strip() for _, row in cells[:1] for name in row]
    lines, rows = [], []
    for line, row in cells[1:]:
        if any(cell.strip() for cell in row[len(names) :]):
            raise InvalidInputError(f"{path}: line {line} has {len(row)} cells, and there are {len(names)} columns")
        lines.append(line)
        rows.append([cell.strip() for cell in row] + [""] * (len(names) - len(row)))
    twice = [name for number, name in enumerate(names) if name in names[:number]]
    if twice:
        raise InvalidInputError(f"{path}: column {twice[0]!r} is there twice")
    if not rows:
        raise InvalidInputError(f"{path}: has no rows of measurements")
    columns: dict[str, Array] = {}
    for number, name in enumerate(names):
        try:
            columns[name] = np.array(
                [_number(path, line, name, row[number]) for line, row in zip(lines, rows, strict=True)]
            )
        except InvalidInputError:
            if _is_read(name):
                raise
    return columns, checks.sealed(np.array(lines))


def _number(path: Path, line: int, column: str, text: str) -> float:
    if not text:
        return math.nan
    if not (NUMBER_TEXT.fullmatch(text) or NOT_FINITE_TEXT.fullmatch(text)):
        raise InvalidInputError(f"{path}: line {line}, column {column}: {text!r} is not a number")
    return float(text)


def _same_length(path: Path, arrays: Mapping[str, NDArray[Any]]) -> Mapping[str, Array]:
    """Columns of an archive that are read, all of one length.

    Raises:
        InvalidInputError: they have other shapes, or are not numbers.
    """
    read = {name: array for name, array in arrays.items() if _is_read(name)}
    for name, array in read.items():
        if array.dtype.kind not in "iuf":
            raise InvalidInputError(f"{path}: column {name} must be numbers, got {array.dtype}")
    columns = {name: array.astype(np.float64) for name, array in read.items()}
    if len({column.shape for column in columns.values()}) > 1 or any(each.ndim != 1 for each in columns.values()):
        told = ", ".join(f"{name} {column.shape}" for name, column in columns.items())
        raise InvalidInputError(f"{path}: its columns must have one dimension and one length, got shapes {told}")
    return columns


def _is_read(name: str) -> bool:
    return name in READ or _is_joint(name)


def _is_joint(name: str) -> bool:
    return any(name.startswith(prefix) and name[len(prefix) :].isdecimal() for prefix in JOINT)


def _columns(path: Path, columns: Mapping[str, Array], names: Sequence[str]) -> Array:
    missing = [name for name in names if name not in columns]
    if missing:
        raise InvalidInputError(
            f"{path}: column {', '.join(missing)} is missing; found: {', '.join(columns) or 'nothing'}"
        )
    return np.column_stack([columns[name] for name in names])


def _rotations(path: Path, columns: Mapping[str, Array], angle: float) -> Array | None:
    """Rotations (n, 3, 3) of a file's columns, NaN where a row has none; None without such columns."""
    if any(name in columns for name in QUATERNION):
        quats = _columns(path, columns, QUATERNION)
        rotations, wrong = rotations_from_quats(np.where(np.isfinite(quats), quats, 0.0))
        rotations[wrong] = np.nan
        return rotations
    if any(name in columns for name in RPY):
        return rotations_from_rpys(angle * _columns(path, columns, RPY))
    if any(name in columns for name in KINOVA):
        # Rx Ry Rz is the inverse of Rz Ry Rx of the negative angles.
        return np.swapaxes(rotations_from_rpys(-angle * _columns(path, columns, KINOVA)), 1, 2)
    return None
