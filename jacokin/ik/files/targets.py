"""`TargetFile`: rows of numbers as targets; which columns mean what, and which rows cannot be solved.

A column that is not understood as a part of the target is carried through, in every format, unchanged, and stands
behind the answers. Left out are columns without a name, and those of a file of answers (q1, q2, ..., status,
position_error, orientation_error, method, message; of an NPZ also q, status_names, method_names), which are made anew.

A CSV file carries the text of each cell, an NPZ archive arrays (n,) of one type, a Parquet file columns of any type.
From one format to another numbers stay numbers and texts stay texts. Numbers in a CSV file read back to the same bits;
what is missing is an empty text there, and NaN among the numbers of an NPZ.
"""

from __future__ import annotations

import datetime
import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model.poses import QUATERNION_NORM_TOLERANCE, RIGID_TOLERANCE

if TYPE_CHECKING:
    import pyarrow as pa

KINDS = "biufcUSMm"  # of NumPy's types that are carried; the others hold Python objects, or several values in a row

#: Some rows of each carried column: texts of a CSV file, an array of an NPZ archive, or a column of a Parquet file.
Column: TypeAlias = "list[str] | NDArray[np.generic] | pa.Array"
Carried = Mapping[str, Column]


def as_objects(column: Column) -> list[Any]:
    """The values as JSON has them where it does, else as texts; None for what is missing. Any: of any type."""
    if isinstance(column, list):
        return column
    if not isinstance(column, np.ndarray):
        return _with_nanoseconds(column) if _is_finer(column.type) else [_plain(each) for each in column.to_pylist()]
    # Python has no nanoseconds.
    return [str(value) for value in column] if column.dtype.kind in "Mm" else [_plain(each) for each in column.tolist()]


def as_texts(column: Column) -> list[str]:
    """The values as texts, numbers with the digits that read back to the same bits."""
    return column if isinstance(column, list) else ["" if each is None else str(each) for each in as_objects(column)]


def as_array(column: Column) -> NDArray[np.generic]:
    """The values as an array (n,) of numbers, truth values or dates where they are such, else of texts."""
    array: object = column
    if not isinstance(column, np.ndarray | list):
        import pyarrow as pa

        # NumPy has no times of a day.
        array = None if pa.types.is_time(column.type) else column.to_numpy(zero_copy_only=False)
    if isinstance(array, np.ndarray) and array.dtype.kind in KINDS:
        return array
    return np.array(as_texts(column), dtype=np.str_)


def as_arrow(column: Column) -> pa.Array:
    """The values as a column of Arrow."""
    import pyarrow as pa

    if isinstance(column, np.ndarray) and column.dtype.kind in "biufMm":
        try:
            return pa.array(column)
        except pa.ArrowNotImplementedError:  # numbers of 16 bytes, times in hours
            return pa.array(as_texts(column), pa.string())
    return pa.array(as_texts(column), pa.string()) if isinstance(column, np.ndarray | list) else column


def _is_finer(kind: pa.DataType) -> bool:
    """Whether values of a type of Arrow are times in nanoseconds, which Python's have not."""
    import pyarrow as pa

    is_time = pa.types.is_timestamp(kind) or pa.types.is_duration(kind) or pa.types.is_time64(kind)
    return bool(is_time and kind.unit == "ns")


def _with_nanoseconds(column: pa.Array) -> list[str | None]:
    """The texts of a column of times in nanoseconds: as `_plain`, with nine decimals where six do not do."""
    import pyarrow as pa

    counts: list[int | None] = column.cast(pa.int64()).to_pylist()
    split = [(None, 0) if count is None else divmod(count, 1000) for count in counts]
    kind, micro = column.type, pa.duration("us")
    if pa.types.is_timestamp(kind):
        micro = pa.timestamp("us", kind.tz)
    elif pa.types.is_time64(kind):
        micro = pa.time64("us")
    texts: list[str | None] = []
    for value, (_, rest) in zip(pa.array([each for each, _ in split], micro).to_pylist(), split, strict=True):
        text = None if value is None else str(_plain(value))
        if text is not None and rest:
            seconds = _SECONDS.match(text)
            assert seconds is not None
            before, decimals, zone = seconds[1], seconds[2] or ".000000", text[seconds.end() :]
            text = f"{before}{decimals}{rest:03}{zone}"
        texts.append(text)
    return texts


def _plain(value: Any) -> Any:
    """Bytes as text, dates and times as ISO 8601, all else that JSON does not have as Python writes it."""
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="backslashreplace")
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)


POSITION = ("x", "y", "z")
QUATERNION = ("qw", "qx", "qy", "qz")
RPY = ("roll", "pitch", "yaw")
MATRIX = ("r11", "r12", "r13", "r21", "r22", "r23", "r31", "r32", "r33")

ANSWERS = ("status", "position_error", "orientation_error", "method", "message")  # what is written beside q1, q2, ...
_JOINT = re.compile(r"q[1-9][0-9]*", re.ASCII)
_SECONDS = re.compile(r"(.*?\d+:\d\d:\d\d)(\.\d{6})?")
# Letters and digits of names that other programs give to the numbers of an orientation: Qw, rot.y, rz_deg, Roll, R11.
_TURNED = re.compile(r"(((q|quat|quaternion|o|orientation|r|rot|rotation)[wxyz]|roll|pitch|yaw)(rad|deg)?|r[1-3]{2})")


@dataclass(frozen=True, slots=True, eq=False)
class TargetFile:
    """Targets as a file gives them."""

    columns: tuple[str, ...]
    """x, y, z [m], followed by qw, qx, qy, qz, by roll, pitch, yaw [rad], by the rotation matrix r11, r12, ..., r33, or
    by nothing where orientations are free."""
    values: Array
    """(n, len(columns)) as written."""
    targets: Array
    """(n, 4, 4) poses, or (n, 3) positions where orientations are free."""
    lines: NDArray[np.int_]
    """(n,) line of each row in a text file, the first line is 1; in other files the row, the first is 1."""
    problems: Mapping[int, str] = field(default_factory=dict)
    """Rows that are not targets, and why; their targets stand for nothing."""
    carried: Carried = field(default_factory=dict)
    """The other columns, by name: texts of a CSV file, an array of an NPZ archive, or a column of a Parquet file."""

    def __len__(self) -> int:
        """Number of targets."""
        return len(self.values)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Pickle what the file says; the targets are made anew."""
        return target_rows, (self.columns, self.values, self.lines, self.carried)


def target_rows(
    columns: tuple[str, ...], values: Array, lines: NDArray[np.int_], carried: Carried = MappingProxyType({})
) -> TargetFile:
    """Targets of rows (n, len(columns)) of numbers, which need not be finite."""
    problems = {
        int(row): f"{columns[int(np.argmin(np.isfinite(values[row])))]} is not finite"
        for row in np.flatnonzero(~np.isfinite(values).all(axis=1))
    }
    usable = values
    if problems:
        usable = values.copy()
        usable[list(problems)] = _placeholder(columns)
    orientation = columns[3:]
    if not orientation:
        return TargetFile(columns, values, usable, lines, problems, carried)
    matrices = np.zeros((len(values), 4, 4))
    matrices[:, 3, 3] = 1.0
    matrices[:, :3, 3] = usable[:, :3]
    wrong: NDArray[np.int_] = np.empty(0, dtype=np.int_)
    if orientation == RPY:
        rotations = rotations_from_rpys(usable[:, 3:])
    elif orientation == QUATERNION:
        rotations, wrong = rotations_from_quats(usable[:, 3:])
        for row in wrong:
            norm = math.hypot(*values[row, 3:])
            problems[int(row)] = f"quat_wxyz must have norm 1 (within 1 %), got norm {norm:.6g}"
    else:
        rotations = usable[:, 3:].reshape(-1, 3, 3).copy()
        wrong = _not_rigid(rotations)
        problems |= {int(row): f"{MATRIX[0]} ... {MATRIX[-1]} is not a rotation matrix" for row in wrong}
    rotations[wrong] = np.eye(3)
    matrices[:, :3, :3] = rotations
    return TargetFile(columns, values, matrices, lines, problems, carried)


def _placeholder(columns: tuple[str, ...]) -> Array:
    """A row that is a target, in place of one that is not."""
    if columns[3:] == QUATERNION:
        return np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0])
    if columns[3:] == MATRIX:
        return np.concatenate([np.zeros(3), np.eye(3).ravel()])
    return np.zeros(len(columns))


@dataclass(frozen=True, slots=True)
class TargetColumns:
    """The columns of a file that make a target, and those that are carried through.

    Attributes:
        names: x, y, z, followed by qw, qx, qy, qz, by roll, pitch, yaw, by r11, r12, ..., r33, or by nothing where
            orientations are free.
        places: index of each of them in a row of the file.
        carried: names of the columns that are carried through, and the index of each.
        count: how many columns the file has.
    """

    names: tuple[str, ...]
    places: tuple[int, ...]
    carried: Mapping[str, int]
    count: int


def choose_columns(path: Path, header: Sequence[str], place: str = ", line 1") -> TargetColumns:
    """The columns to read; `place` is where in the file they are named.

    Raises:
        InvalidInputError: a column is missing or repeated, orientations are given twice, or under other names.
    """
    names = tuple(name.strip() for name in header)
    place = f"{path}{place}"
    repeated = [name for name, count in Counter(names).items() if name and count > 1]
    if repeated:
        raise InvalidInputError(f"{place}: column {', '.join(repeated)} is repeated")
    orientation = _orientation(names, place)
    wanted = POSITION + orientation
    missing = [name for name in wanted if name not in names]
    if missing:
        found = ", ".join(names) or "nothing"
        marks = [word for mark, word in ((";", "semicolons"), ("\t", "tabs")) if len(names) == 1 and mark in names[0]]
        advice = f"; commas separate columns, not {marks[0]}, and decimals need a point" if marks else ""
        raise InvalidInputError(
            f"{place}: column {', '.join(missing)} is missing; needed: {', '.join(wanted)}; found: {found}{advice}"
        )
    carried = {name: at for at, name in enumerate(names) if name and name not in wanted and not is_answer(name)}
    turned = [name for name in carried if _TURNED.fullmatch(re.sub(r"[\W_]", "", name).lower())]
    if not orientation and len(turned) >= 3:  # of an orientation
        raise InvalidInputError(
            f"{place}: column {', '.join(turned)} looks like an orientation, which would be lost: orientations are "
            f"{', '.join(QUATERNION)}, or {', '.join(RPY)} [rad], or {', '.join(MATRIX)}; rename what is not one"
        )
    return TargetColumns(wanted, tuple(names.index(name) for name in wanted), carried, len(names))


def _orientation(names: Sequence[str], place: str) -> tuple[str, ...]:
    """Names of the columns of the orientation, all of them where one is there; none where orientations are free.

    Raises:
        InvalidInputError: orientations are given twice; `place` is where.
    """
    groups = {"quaternions": QUATERNION, "roll, pitch, yaw": RPY, "matrices": MATRIX}
    found = {name: group for name, group in groups.items() if any(column in names for column in group)}
    if len(found) > 1:
        raise InvalidInputError(f"{place}: orientations are given twice, as {' and as '.join(found)}")
    return next(iter(found.values()), ())


def left_behind(header: Sequence[str]) -> list[str]:
    """Columns of a file that are not carried through, and why; none of a file of answers, which is solved again."""
    names = [name.strip() for name in header]
    if set(ANSWERS) <= set(names):
        return []
    own = [f"{name} (answers have one)" for name in names if is_answer(name)]
    return own + [f"number {at} (it has no name)" for at, name in enumerate(names, 1) if not name]


def is_answer(name: str) -> bool:
    """Whether a column is one of those that files of answers have beside the target."""
    return name in ANSWERS or _JOINT.fullmatch(name) is not None


def rotations_from_quats(quats_wxyz: Array) -> tuple[Array, NDArray[np.int_]]:
    """Rotations (n, 3, 3) of quaternions (n, 4), and the rows whose norm is not within 1 % of one (the identity)."""
    with np.errstate(over="ignore"):
        norms = np.linalg.norm(quats_wxyz, axis=1)
    wrong = np.flatnonzero(~(np.abs(norms - 1.0) <= QUATERNION_NORM_TOLERANCE))
    quats = quats_wxyz.copy()
    quats[wrong] = 1.0, 0.0, 0.0, 0.0
    return Rotation.from_quat(quats, scalar_first=True).as_matrix(), wrong


def rotations_from_rpys(rpys: Array) -> Array:
    """Rotations (n, 3, 3) of R = Rz(yaw) Ry(pitch) Rx(roll), angles (n, 3) [rad]."""
    return np.asarray(Rotation.from_euler("xyz", rpys).as_matrix())


def _not_rigid(rotations: Array) -> NDArray[np.int_]:
    """Rows of (n, 3, 3) that are not rotations within the tolerance of single targets."""
    with np.errstate(over="ignore", invalid="ignore"):
        misfit = np.abs(np.swapaxes(rotations, 1, 2) @ rotations - np.eye(3)).max(axis=(1, 2))
        good = (misfit <= RIGID_TOLERANCE) & (np.linalg.det(rotations) > 0.0)
    return np.flatnonzero(~good)


class FilePart(NamedTuple):
    """Some consecutive rows of a file; can be sent to other machines that see it."""

    first: int
    """The first row, counted from 0; of a CSV file its line, where the header is line 1."""
    rows: int
    """How many rows."""
    offset: int | None = 0
    """Bytes before it in a CSV file; None where the rows can only be reached through all that come before."""

    @property
    def can_be_read(self) -> bool:
        """Whether it can be read alone."""
        return self.offset is not None


def equal_parts(total: int, size: int, *, alone: bool = True) -> list[FilePart]:
    """Parts of `size` rows, the last one of what is left."""
    offset = 0 if alone else None
    return [FilePart(first, min(size, total - first), offset) for first in range(0, total, size)]
