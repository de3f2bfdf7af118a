"""A followed path as arrays, and as files: CSV to read anywhere, NPZ to read back exactly and quickly."""

from __future__ import annotations

import csv
import zipfile
import zlib
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from jacokin import files
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks

FORMATS = (".csv", ".npz")


@dataclass(frozen=True, slots=True, eq=False)
class BranchReport:
    """What became of the path from one start configuration."""

    q_start: Array
    """(dof,) the branch [rad]."""
    failed_segments: tuple[int, ...]
    """Segments on which the error exceeded the tolerances at some tick; empty when the path is feasible."""
    position_error: float
    """Largest position error along the path [m]."""
    orientation_error: float
    """Largest orientation error along the path [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class PathResult:
    """Joint trajectory along a path, one row a tick. Arrays are read-only."""

    joint_names: tuple[str, ...]
    """Names of the joints."""
    t: Array
    """(n,) time [s]; row 0 is the start."""
    q: Array
    """(n, dof) joint angles [rad]."""
    v: Array
    """(n, dof) joint velocities over the tick that ends here [rad/s]; row 0 is zero."""
    position_error: Array
    """(n,) distance to the path's pose at that time [m]."""
    orientation_error: Array
    """(n,) angle to it [rad]."""
    status: tuple[str, ...]
    """(n,) "OK", "LIMITED", "HELD" or "LOST", see `TrackerStatus`."""
    limiting: tuple[str, ...]
    """(n,) what held the arm back, joined by "; "."""
    segment: NDArray[np.intp]
    """(n,) which straight line the row belongs to."""
    clearance: Array
    """(n,) smallest distance of shapes kept apart [m], see `TrackerStep`; nan when none are."""
    lower: Array
    """(dof,) lower limits [rad]."""
    upper: Array
    """(dof,) upper limits [rad]."""
    velocity_limit: Array
    """(dof,) velocity limits that were held [rad/s]."""
    branches: tuple[BranchReport, ...] = ()
    """Start configurations that were tried, in order; not kept in files."""
    qp_solver: str = ""
    """QP solver that ran, with a fallback named."""
    message: str = ""
    """What happened, in a sentence."""

    @property
    def success(self) -> bool:
        """True when every tick is on the path within the tolerances."""
        return all(status == "OK" for status in self.status)

    @property
    def failed_segments(self) -> tuple[int, ...]:
        """Segments with a tick that is off the path."""
        return tuple(sorted({int(s) for s, status in zip(self.segment, self.status, strict=True) if status != "OK"}))

    @property
    def limit_margin(self) -> Array:
        """(n, dof) distance to the nearer joint limit [rad]; inf on free joints."""
        return np.asarray(np.minimum(self.q - self.lower, self.upper - self.q))

    @property
    def time_limited(self) -> float:
        """Time spent off the path [s]."""
        if len(self.t) < 2:
            return 0.0
        return float(sum(status != "OK" for status in self.status) * (self.t[1] - self.t[0]))

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.t)

    def __str__(self) -> str:
        """The result on two lines."""
        return (
            f"{len(self)} rows, {self.t[-1]:.3f} s, {'on the path throughout' if self.success else 'NOT on the path'}: "
            f"largest error {self.position_error.max():.3g} m, {self.orientation_error.max():.3g} rad; "
            f"off the path for {self.time_limited:.3f} s\n{self.message}"
        )

    def save(self, path: str | Path) -> None:
        """Write a .csv or .npz file; an existing file is replaced only when the new one is complete.

        Raises:
            InvalidInputError: another ending, or the file cannot be written.
        """
        file = _checked_file(path)
        try:
            with files.replacing(file) as temporary:
                if file.suffix == ".csv":
                    self._write_csv(temporary)
                else:
                    self._write_npz(temporary)
        except OSError as error:
            raise InvalidInputError(f"cannot write {file}: {error.strerror or error}") from error

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read what `save` wrote; numbers come back exactly.

        Raises:
            InvalidInputError: no such file, or it is not one of ours; names the line where there is one.
        """
        file = _checked_file(path)
        try:
            found = cls._read_csv(file) if file.suffix == ".csv" else cls._read_npz(file)
        except OSError as error:
            raise InvalidInputError(f"cannot read {file}: {error.strerror or error}") from error
        wrong = found._misshapen()
        if wrong:
            raise InvalidInputError(f"{file}: not a path written by jacokin: {wrong} has the wrong shape or type")
        return found

    def _misshapen(self) -> str:
        """Name of the first field that does not fit the others; "" if all do."""
        rows, dof = len(self.status), len(self.joint_names)
        shapes = {
            **dict.fromkeys(("t", "position_error", "orientation_error", "clearance", "segment"), (rows,)),
            **dict.fromkeys(("q", "v"), (rows, dof)),
            **dict.fromkeys(("lower", "upper", "velocity_limit"), (dof,)),
        }
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array.shape != shape or array.dtype.kind not in "fi":
                return name
        return "" if len(self.limiting) == rows else "limiting"

    def _write_csv(self, file: Path) -> None:
        joints = self.joint_names
        head = ["t", *(f"q_{j}" for j in joints), *(f"v_{j}" for j in joints), *TAIL]
        with file.open("w", newline="") as stream:
            writer = csv.writer(stream)
            for name, values in (("lower", self.lower), ("upper", self.upper), ("velocity_limit", self.velocity_limit)):
                writer.writerow([f"# {name}", *(repr(float(value)) for value in values)])
            writer.writerow(["# qp_solver", self.qp_solver])
            writer.writerow(["# message", self.message])
            writer.writerow(head)
            numbers = np.column_stack(
                [self.t, self.q, self.v, self.position_error, self.orientation_error, self.clearance]
            ).tolist()
            for row, segment, status, limiting in zip(
                numbers, self.segment.tolist(), self.status, self.limiting, strict=True
            ):
                writer.writerow([*map(repr, row), segment, status, limiting])

    @classmethod
    def _read_csv(cls, file: Path) -> Self:
        with file.open(newline="") as stream:
            try:
                rows = list(csv.reader(stream))
            except (csv.Error, UnicodeDecodeError) as error:
                raise InvalidInputError(f"{file}: not a CSV file: {error}") from error
        notes = {row[0][2:]: row[1:] for row in rows if row and row[0].startswith("# ")}
        table = [(line, row) for line, row in enumerate(rows, start=1) if row and not row[0].startswith("# ")]
        dof = len(notes.get("lower", ()))
        if len(table) < 2 or not dof or len(table[0][1]) != 1 + 2 * dof + len(TAIL) or table[0][1][0] != "t":
            raise InvalidInputError(f"{file}: not a path written by jacokin (head line or limits missing)")
        numbers, rest = [], []
        for line, row in table[1:]:
            try:
                numbers.append([float(cell) for cell in row[: 1 + 2 * dof + 3]])
                segment, status, limiting = row[1 + 2 * dof + 3 :]
                rest.append((int(segment), status, limiting))
            except ValueError as error:
                raise InvalidInputError(f"{file}, line {line}: {error}") from error
        limits = {}
        for name in ("lower", "upper", "velocity_limit"):
            try:
                limits[name] = checks.read_only([float(cell) for cell in notes[name]])
            except (KeyError, ValueError) as error:
                raise InvalidInputError(f"{file}: the line '# {name}' is missing or malformed") from error
        data = checks.read_only(numbers)
        segments = np.array([row[0] for row in rest], dtype=np.intp)
        segments.setflags(write=False)
        return cls(
            joint_names=tuple(name[2:] for name in table[0][1][1 : 1 + dof]),
            t=data[:, 0],
            q=data[:, 1 : 1 + dof],
            v=data[:, 1 + dof : 1 + 2 * dof],
            position_error=data[:, 1 + 2 * dof],
            orientation_error=data[:, 2 + 2 * dof],
            clearance=data[:, 3 + 2 * dof],
            segment=segments,
            status=tuple(row[1] for row in rest),
            limiting=tuple(row[2] for row in rest),
            qp_solver="".join(notes.get("qp_solver", ())),
            message="".join(notes.get("message", ())),
            lower=limits["lower"],
            upper=limits["upper"],
            velocity_limit=limits["velocity_limit"],
        )

    def _write_npz(self, file: Path) -> None:
        names = [field.name for field in fields(self) if field.name != "branches"]
        kept: dict[str, Any] = {name: np.asarray(getattr(self, name)) for name in names}
        with file.open("wb") as stream:
            np.savez_compressed(stream, **kept)

    @classmethod
    def _read_npz(cls, file: Path) -> Self:
        try:
            with file.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
                found = {name: archive[name] for name in archive.files}
            for array in found.values():
                array.setflags(write=False)
            for name in ("joint_names", "status", "limiting"):
                found[name] = tuple(str(value) for value in found[name])
            for name in ("qp_solver", "message"):
                found[name] = str(found[name])
            return cls(**found)
        except (KeyError, TypeError, ValueError, EOFError, OSError, zipfile.BadZipFile, zlib.error) as error:
            if isinstance(error, FileNotFoundError | PermissionError | IsADirectoryError):
                raise
            raise InvalidInputError(f"{file}: not a path written by jacokin: {error}") from error


TAIL = ("position_error", "orientation_error", "clearance", "segment", "status", "limiting")


def _checked_file(path: str | Path) -> Path:
    if not isinstance(path, str | Path):
        raise InvalidInputError(f"path must be a file name, got {path!r}")
    file = Path(path)
    if file.suffix not in FORMATS:
        raise InvalidInputError(f"a path file must end in .csv or .npz, got {str(path)!r}")
    return file
