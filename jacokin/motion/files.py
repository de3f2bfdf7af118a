"""Trajectories as CSV and NPZ files that come back exactly: one way for every kind of trajectory.

A kind says which of its fields are joint values, numbers, words and notes. In a CSV file notes stand in lines before
the table, whose columns are the others.
"""

from __future__ import annotations

import csv
import json
import math
import zipfile
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Protocol, Self

import numpy as np
from numpy.typing import NDArray

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.results import Frozen
from jacokin.model import checks

NOT_OURS = "not a trajectory written by jacokin"
LARGEST = 4_000_000_000  # [byte] of an NPZ file's arrays: a day at 100 Hz takes 1.2e9


@dataclass(frozen=True, slots=True)
class Table:
    """A CSV file: lines "# name,value,..." before a head line and rows.

    Attributes:
        notes: values by name.
        head: names of the columns.
        rows: cells; a table that was read has rows as long as its head.
        lines: the line of the file in which each row stands; empty in tables to be written.
    """

    notes: Mapping[str, Sequence[str]]
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    lines: Sequence[int] = ()

    def numbers(self, row: int, start: int, stop: int) -> list[float]:
        """Some cells of a row as numbers; ValueError when one is not."""
        return [float(cell) for cell in self.rows[row][start:stop]]

    def note_numbers(self, file: Path, name: str) -> list[float]:
        """The numbers of a note.

        Raises:
            InvalidInputError: missing or malformed.
        """
        try:
            return [float(cell) for cell in self.notes[name]]
        except (KeyError, ValueError) as error:
            raise InvalidInputError(f"{file}: the line '# {name}' is missing or malformed") from error


def save(path: str | Path, writers: Mapping[str, Callable[[Path], None]]) -> None:
    """Write a file by the ending of its name; what is there is replaced only by a complete file.

    Raises:
        InvalidInputError: another ending, or the file cannot be written.
    """
    file, ending = by_ending(path, writers)
    try:
        with files.replacing(file) as temporary:
            writers[ending](temporary)
    except OSError as error:
        raise InvalidInputError(f"cannot write {file}: {error.strerror or error}") from error


def by_ending(path: str | Path, endings: Iterable[str]) -> tuple[Path, str]:
    """The file and its ending, the longest one that fits.

    Raises:
        InvalidInputError: not a file name, or another ending.
    """
    if not isinstance(path, str | Path):
        raise InvalidInputError(f"path must be a file name, got {checks.shown(path)}")
    for ending in sorted(endings, key=len, reverse=True):
        if str(path).endswith(ending):
            return Path(path), ending
    raise InvalidInputError(f"the file name must end in {' or '.join(endings)}, got {str(path)!r}")


def exact(values: NDArray[np.float64]) -> list[str]:
    """Numbers as text that reads back to the same bits."""
    return [repr(value) for value in values.tolist()]


def write_table(file: Path, table: Table) -> None:
    """Write a CSV file."""
    with file.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        for name, values in table.notes.items():
            writer.writerow([f"# {name}", *values])
        writer.writerow(table.head)
        writer.writerows(table.rows)


def read_table(file: Path) -> Table:
    """Read a CSV file.

    Raises:
        InvalidInputError: unreadable, without rows, or a row that is longer or shorter than the head.
    """
    try:
        with file.open(newline="", encoding="utf-8") as stream:
            rows = list(csv.reader(stream))
    except OSError as error:
        raise InvalidInputError(f"cannot read {file}: {error.strerror or error}") from error
    except (csv.Error, UnicodeDecodeError) as error:
        raise InvalidInputError(f"{file}: not a CSV file: {error}") from error
    notes = {row[0][2:]: row[1:] for row in rows if row and row[0].startswith("# ")}
    numbered = [(line, row) for line, row in enumerate(rows, start=1) if row and not row[0].startswith("# ")]
    if len(numbered) < 2:
        raise InvalidInputError(f"{file}: {NOT_OURS} (no rows)")
    head = numbered[0][1]
    for line, row in numbered[1:]:
        if len(row) != len(head):
            raise InvalidInputError(f"{file}, line {line}: {len(row)} columns, the head line has {len(head)}")
    return Table(notes, head, [row for _, row in numbered[1:]], [line for line, _ in numbered[1:]])


def write_arrays(file: Path, arrays: Mapping[str, NDArray[np.generic]]) -> None:
    """Write an NPZ file."""
    with file.open("wb") as stream:
        np.savez_compressed(stream, **dict(arrays))  # type: ignore[arg-type]  # its stub takes allow_pickle for an array


def read_arrays(file: Path) -> dict[str, NDArray[np.generic]]:
    """Read an NPZ file, its headers first: a small file may claim to hold more than the memory.

    Raises:
        InvalidInputError: unreadable, or not an archive of plain arrays.
    """
    try:
        with zipfile.ZipFile(file) as archive:
            _check_headers(archive)
        with np.load(file, allow_pickle=False) as arrays:
            return {name: arrays[name] for name in arrays.files}
    except (ValueError, EOFError, KeyError, NotImplementedError, RuntimeError, zipfile.BadZipFile, zlib.error) as error:
        raise InvalidInputError(f"{file}: {NOT_OURS}: {error}") from error
    except OSError as error:
        raise InvalidInputError(f"cannot read {file}: {error.strerror or error}") from error


def _check_headers(archive: zipfile.ZipFile) -> None:
    """ValueError when a member is not an array, or the arrays claim more than the archive holds or than is sensible."""
    total = 0
    for member in archive.infolist():
        with archive.open(member) as stream:
            version = np.lib.format.read_magic(stream)
            read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
            shape, _, dtype = read(stream)
        size = math.prod(shape) * dtype.itemsize
        total += size
        if dtype.hasobject or size > member.file_size or total > LARGEST:
            raise ValueError(f"{member.filename} claims {size} bytes")


KINOVA_STEP = 0.01  # [s] the control loop of the Jaco's base runs at 100 Hz (kinova-ros, README, velocity control)
SPEED_ROUNDING = 1e-9  # [rad/s] of positions subtracted and divided by a step
NANOSECONDS = 1_000_000_000  # [1/s]


class Trajectory(Protocol):
    """What is exported: `PathResult` and `JointMotion`."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""

    @property
    def t(self) -> Array:
        """(n,) time [s], from 0."""

    @property
    def q(self) -> Array:
        """(n, dof) [rad]."""

    @property
    def v(self) -> Array:
        """(n, dof) [rad/s]."""

    @property
    def a(self) -> Array:
        """(n, dof) [rad/s^2]."""

    @property
    def lower(self) -> Array:
        """(dof,) lower limits [rad]."""

    @property
    def upper(self) -> Array:
        """(dof,) upper limits [rad]."""

    @property
    def velocity_limit(self) -> Array:
        """(dof,) [rad/s]."""


def write_ros_json(file: Path, trajectory: Trajectory) -> None:
    """Write the fields of a ROS 2 trajectory_msgs/JointTrajectory: SI units and radians, times to the nanosecond.

    Numbers keep all their digits: a rounded one may lie outside its limit.
    """
    points = []
    for time, q, v, a in zip(
        trajectory.t.tolist(), trajectory.q.tolist(), trajectory.v.tolist(), trajectory.a.tolist(), strict=True
    ):
        seconds, nanoseconds = divmod(round(time * NANOSECONDS), NANOSECONDS)
        points.append(
            {
                "positions": q,
                "velocities": v,
                "accelerations": a,
                "time_from_start": {"sec": seconds, "nanosec": nanoseconds},
            }
        )
    message = {"joint_names": list(trajectory.joint_names), "points": points}
    with file.open("w", encoding="utf-8") as stream:
        json.dump(message, stream, allow_nan=False)
        stream.write("\n")


def write_kinova_csv(file: Path, trajectory: Trajectory) -> None:
    """Write angles [deg] and velocities [deg/s] at exactly 100 Hz, as Kinova's driver for the Jaco takes them.

    Zero and sign of every joint are those of Kinova's URDF, which the driver shares (kinova-ros, publishJointAngles);
    angles of unlimited joints are not wrapped. The velocity of a row is the one to send for the 10 ms that begin with
    it: sent in turn, they lead from the first angles through all others. The last row is the end, with velocity zero.

    Raises:
        InvalidInputError: a resampled row breaks a position or velocity limit.
    """
    q, v = resampled(trajectory, KINOVA_STEP)
    check_limits(trajectory, q, v)
    degrees = _degrees_within(q, trajectory.lower, trajectory.upper)
    velocity = np.degrees(v)
    count = q.shape[1]
    head = [
        "time_s",
        *(f"joint{k}_deg" for k in range(1, count + 1)),
        *(f"joint{k}_deg_s" for k in range(1, count + 1)),
    ]
    numbers = np.column_stack([degrees, velocity])
    rows = [[f"{tick / 100:.2f}", *exact(row)] for tick, row in enumerate(numbers)]
    write_table(file, Table({}, head, rows))


def resampled(trajectory: Trajectory, step: float) -> tuple[Array, Array]:
    """Angles (m, dof) [rad] every `step` [s], and the velocity (m, dof) [rad/s] that leads to the next row.

    Straight lines between the rows, so no joint passes its limits or gets faster than between two rows. The last row
    is the end of the trajectory, up to a step later than there.
    """
    duration = float(trajectory.t[-1])
    count = math.ceil(duration / step - 1e-9)  # division rounds
    times = np.minimum(np.arange(count + 1) * step, duration)
    q = np.column_stack([np.interp(times, trajectory.t, column) for column in trajectory.q.T])
    q = np.clip(q, trajectory.q.min(axis=0), trajectory.q.max(axis=0))  # interpolation rounds
    v = np.zeros_like(q)
    v[:-1] = np.diff(q, axis=0) / step
    return q, v


def check_limits(trajectory: Trajectory, q: Array, v: Array) -> None:
    """Refuse rows that break the limits of their trajectory.

    Raises:
        InvalidInputError: names the joint, the row and the value.
    """
    outside = (q < trajectory.lower) | (q > trajectory.upper)
    fast = np.abs(v) > trajectory.velocity_limit + SPEED_ROUNDING
    for broken, values, unit in ((outside, q, "rad"), (fast, v, "rad/s")):
        if broken.any():
            row, joint = (int(index) for index in np.argwhere(broken)[0])
            raise InvalidInputError(
                f"{trajectory.joint_names[joint]} breaks its limit after resampling: "
                f"{values[row, joint]:.17g} {unit} in row {row}"
            )


def _degrees_within(q: Array, lower: Array, upper: Array) -> Array:
    """Angles in degrees that read back to radians within the limits; rounding could put them one ulp outside."""
    degrees = np.degrees(q)
    for _ in range(4):
        back = np.radians(degrees)
        degrees = np.where(back < lower, np.nextafter(degrees, np.inf), degrees)
        degrees = np.where(back > upper, np.nextafter(degrees, -np.inf), degrees)
    return degrees


FORMATS = (".csv", ".npz", ".json", ".kinova.csv")
LIMITS = ("lower", "upper", "velocity_limit")


class Layout(NamedTuple):
    """Names of the fields of a trajectory, beside `joint_names`, `t` and the limits."""

    joints: tuple[str, ...]
    """(n, dof) numbers."""
    rows: tuple[str, ...] = ()
    """(n,) numbers."""
    counts: tuple[str, ...] = ()
    """(n,) whole numbers."""
    words: tuple[str, ...] = ()
    """(n,) words."""
    numbers: tuple[str, ...] = ()
    """Arrays of any length; a file may be without them."""
    texts: tuple[str, ...] = ()
    """Single words or sentences; a file may be without them."""
    values: tuple[str, ...] = ()
    """Single numbers; a file may be without them."""

    @property
    def columns(self) -> tuple[str, ...]:
        """The columns of a CSV file after the joints."""
        return self.rows + self.counts + self.words


if TYPE_CHECKING:

    class _Trajectory(Frozen, Trajectory):
        """Every kind has these, as fields or properties."""

else:
    _Trajectory = Frozen


class Stored(_Trajectory):
    """A trajectory that can be saved and loaded."""

    __slots__ = ()

    LAYOUT: ClassVar[Layout]

    def save(self, path: str | Path) -> None:
        """Write a file; an existing one is replaced only when the new one is complete.

        ".csv" and ".npz" hold everything and can be loaded. ".json" holds the fields of a ROS JointTrajectory.
        ".kinova.csv" holds angles [deg] and velocities [deg/s] at 100 Hz for Kinova's driver.

        Raises:
            InvalidInputError: another ending, the file cannot be written, or a limit is broken after resampling.
        """
        save(
            path,
            {
                ".csv": self._write_csv,
                ".npz": self._write_npz,
                ".json": partial(write_ros_json, trajectory=self),
                ".kinova.csv": partial(write_kinova_csv, trajectory=self),
            },
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a .csv or .npz file that `save` wrote; numbers come back exactly.

        Raises:
            InvalidInputError: no such file, or it was not written by `save`; names the line where there is one.
        """
        file, ending = by_ending(path, (".csv", ".npz"))
        found = cls._read_csv(file) if ending == ".csv" else cls._read_npz(file)
        wrong = _misshapen(found, cls.LAYOUT)
        if wrong:
            raise InvalidInputError(f"{file}: {NOT_OURS}: {wrong}")
        for value in found.values():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
        return cls(**found)

    def _write_csv(self, file: Path) -> None:
        layout = self.LAYOUT
        numbers = np.column_stack([self.t, *(getattr(self, name) for name in (*layout.joints, *layout.rows))])
        words = [[str(word) for word in getattr(self, name)] for name in (*layout.counts, *layout.words)]
        notes = {name: exact(getattr(self, name)) for name in (*LIMITS, *layout.numbers)}
        notes |= {name: [getattr(self, name)] for name in layout.texts}
        notes |= {name: [repr(getattr(self, name))] for name in layout.values}
        table = Table(
            notes,
            ["t", *(f"{name}_{joint}" for name in layout.joints for joint in self.joint_names), *layout.columns],
            [[*exact(row), *rest] for row, *rest in zip(numbers, *words, strict=True)],
        )
        write_table(file, table)

    @classmethod
    def _read_csv(cls, file: Path) -> dict[str, Any]:
        layout, table = cls.LAYOUT, read_table(file)
        dof = len(table.notes.get("lower", ()))
        names = tuple(name[len(layout.joints[0]) + 1 :] for name in table.head[1 : 1 + dof])
        head = ["t", *(f"{name}_{joint}" for name in layout.joints for joint in names), *layout.columns]
        if not dof or table.head != head:
            raise InvalidInputError(f"{file}: {NOT_OURS} (head line or limits missing)")
        width = 1 + len(layout.joints) * dof + len(layout.rows)
        numbers, counts = [], []
        for row, line in enumerate(table.lines):
            try:
                numbers.append(table.numbers(row, 0, width))
                counts.append([int(cell) for cell in table.rows[row][width : width + len(layout.counts)]])
            except ValueError as error:
                raise InvalidInputError(f"{file}, line {line}: {error}") from error
        data = np.array(numbers)
        blocks = np.split(data[:, 1:], dof * np.arange(1, len(layout.joints) + 1), axis=1)
        found: dict[str, Any] = {
            "joint_names": names,
            "t": data[:, 0],
            **dict(zip(layout.joints, blocks, strict=False)),
        }
        found |= dict(zip(layout.rows, blocks[-1].T, strict=True))
        found |= dict(zip(layout.counts, np.array(counts, dtype=np.intp).T, strict=True))
        for place, name in enumerate(layout.words, start=width + len(layout.counts)):
            found[name] = tuple(row[place] for row in table.rows)
        found |= {name: np.array(table.note_numbers(file, name)) for name in LIMITS}
        noted = [name for name in (*layout.numbers, *layout.texts, *layout.values) if name in table.notes]
        for name in noted:
            if name in layout.texts:
                found[name] = "".join(table.notes[name])
            else:
                values = np.array(table.note_numbers(file, name))
                found[name] = values if name in layout.numbers else float(values[0]) if values.size else 0.0
        return found

    def _write_npz(self, file: Path) -> None:
        layout = self.LAYOUT
        kept = {"joint_names", "t", *LIMITS, *(name for names in layout for name in names)}
        write_arrays(
            file,
            {field.name: np.asarray(getattr(self, field.name)) for field in fields(self) if field.name in kept},  # type: ignore[arg-type]  # every subclass is a dataclass
        )

    @classmethod
    def _read_npz(cls, file: Path) -> dict[str, Any]:
        layout = cls.LAYOUT
        arrays = read_arrays(file)
        found: dict[str, Any] = {}
        try:
            for name in ("t", *LIMITS, *layout.joints, *layout.rows, *layout.counts):
                found[name] = arrays.pop(name)
            for name in ("joint_names", *layout.words):
                found[name] = tuple(str(value) for value in arrays.pop(name))
            for name in [name for name in arrays if name in layout.numbers]:
                found[name] = arrays.pop(name)
            for name in [name for name in arrays if name in layout.texts]:
                found[name] = str(arrays.pop(name))
            for name in [name for name in arrays if name in layout.values]:
                found[name] = float(arrays.pop(name))
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInputError(f"{file}: {NOT_OURS}: {error}") from error
        if arrays:
            raise InvalidInputError(f"{file}: {NOT_OURS}: it holds {', '.join(arrays)}")
        return found


def _misshapen(found: dict[str, Any], layout: Layout) -> str:
    """What is wrong with the fields of a file; "" if nothing is."""
    rows, dof = len(found["t"]) if np.ndim(found["t"]) == 1 else 0, len(found["joint_names"])
    shapes: dict[str, tuple[int, ...]] = {
        **dict.fromkeys(("t", *layout.rows, *layout.counts), (rows,)),
        **dict.fromkeys(layout.joints, (rows, dof)),
        **dict.fromkeys(LIMITS, (dof,)),
    }
    for name, shape in shapes.items():
        kinds = "i" if name in layout.counts else "f"
        if found[name].shape != shape or found[name].dtype.kind not in kinds:
            return f"{name} has the wrong shape or type"
    for name in layout.numbers:
        if name in found and (found[name].ndim != 1 or found[name].dtype.kind != "f"):
            return f"{name} has the wrong shape or type"
    for name in layout.words:
        if len(found[name]) != rows:
            return f"{name} has the wrong shape or type"
    if not rows:
        return "there are no rows"
    for name in ("t", *layout.joints):
        if not np.isfinite(found[name]).all():
            return f"{name} is not finite everywhere"
    return "" if (np.diff(found["t"]) > 0.0).all() else "t does not rise"
