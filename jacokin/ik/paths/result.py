"""A followed path as arrays, and as files."""

from __future__ import annotations

from dataclasses import dataclass, field, fields
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.paths import export, files
from jacokin.ik.results import Frozen
from jacokin.model import checks

FORMATS = (".csv", ".npz", ".json", ".kinova.csv")
TAIL = ("position_error", "orientation_error", "clearance", "segment", "status", "limiting")
NOTES = ("lower", "upper", "velocity_limit")
AT_SEED = 1e-3  # [rad] a start this near to the seed is not worth a word


@dataclass(frozen=True, slots=True, eq=False)
class BranchReport(Frozen):
    """How well the path was followed from one start configuration."""

    q_start: Array
    """(dof,) the branch [rad]."""
    failed_segments: tuple[int, ...]
    """Segments on which the error exceeded the tolerances at some tick; empty when the path is feasible."""
    position_error: float
    """Largest position error along the path [m]."""
    orientation_error: float
    """Largest orientation error along the path [rad]."""


@dataclass(frozen=True, slots=True, eq=False)
class PathResult(Frozen):
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
    parameter: Array = field(default_factory=lambda: checks.read_only([]))
    """(waypoints,) what `plan_path` chose where a waypoint leaves one parameter free [rad]: the angle about the axis of
    a `FreeAxis`, or joint 3 of a seven-joint arm; nan at full poses of six joints and at waypoints that are not
    reached. Empty for tracked paths."""
    start_distance: float = 0.0
    """Largest angle of a joint between the seed (home without one) and row 0 [rad]: the arm is to be brought there."""

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
        """(n, dof) distance to the nearer joint limit [rad]; inf on unlimited joints."""
        return np.asarray(np.minimum(self.q - self.lower, self.upper - self.q))

    @property
    def a(self) -> Array:
        """(n, dof) change of velocity at the beginning of the tick that ends here [rad/s^2]; row 0 is zero."""
        acceleration = np.zeros_like(self.v)
        acceleration[1:] = np.diff(self.v, axis=0) / np.diff(self.t)[:, None]
        return acceleration

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
        """Write a file; an existing one is replaced only when the new one is complete.

        ".csv" and ".npz" hold everything and can be loaded. ".json" holds the fields of a ROS JointTrajectory.
        ".kinova.csv" holds angles [deg] and velocities [deg/s] at 100 Hz for Kinova's driver.

        Raises:
            InvalidInputError: another ending, the file cannot be written, or a limit is broken after resampling.
        """
        files.save(
            path,
            {
                ".csv": self._write_csv,
                ".npz": self._write_npz,
                ".json": partial(export.write_ros_json, trajectory=self),
                ".kinova.csv": partial(export.write_kinova_csv, trajectory=self),
            },
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a .csv or .npz file that `save` wrote; numbers come back exactly.

        Raises:
            InvalidInputError: no such file, or it was not written by `save`; names the line where there is one.
        """
        file, ending = files.by_ending(path, (".csv", ".npz"))
        found = cls._read_csv(file) if ending == ".csv" else cls._read_npz(file)
        wrong = found._misshapen()
        if wrong:
            raise InvalidInputError(f"{file}: {files.NOT_OURS}: {wrong} has the wrong shape or type")
        return found

    def _misshapen(self) -> str:
        """Name of the first field that does not fit the others; "" if all do."""
        rows, dof = len(self.status), len(self.joint_names)
        shapes = {
            **dict.fromkeys(("t", "position_error", "orientation_error", "clearance", "segment"), (rows,)),
            **dict.fromkeys(("q", "v"), (rows, dof)),
            **dict.fromkeys(NOTES, (dof,)),
        }
        for name, shape in shapes.items():
            array = getattr(self, name)
            if array.shape != shape or array.dtype.kind not in "fi":
                return name
        return "" if len(self.limiting) == rows else "limiting"

    def _write_csv(self, file: Path) -> None:
        joints = self.joint_names
        numbers = np.column_stack([self.t, self.q, self.v, self.position_error, self.orientation_error, self.clearance])
        notes = {name: files.exact(getattr(self, name)) for name in NOTES}
        notes |= {
            "qp_solver": [self.qp_solver],
            "message": [self.message],
            "start_distance": [repr(self.start_distance)],
        }
        rows = zip(numbers, self.segment.tolist(), self.status, self.limiting, strict=True)
        table = files.Table(
            notes,
            ["t", *(f"q_{j}" for j in joints), *(f"v_{j}" for j in joints), *TAIL],
            [[*files.exact(row), str(segment), status, limiting] for row, segment, status, limiting in rows],
        )
        files.write_table(file, table)

    @classmethod
    def _read_csv(cls, file: Path) -> Self:
        table = files.read_table(file)
        dof = len(table.notes.get("lower", ()))
        width = 1 + 2 * dof + 3  # columns of numbers
        if not dof or len(table.head) != width + 3 or table.head[0] != "t" or tuple(table.head[width - 3 :]) != TAIL:
            raise InvalidInputError(f"{file}: {files.NOT_OURS} (head line or limits missing)")
        numbers, segments = [], []
        for row, line in enumerate(table.lines):
            try:
                numbers.append(table.numbers(row, 0, width))
                segments.append(int(table.rows[row][width]))
            except ValueError as error:
                raise InvalidInputError(f"{file}, line {line}: {error}") from error
        data = checks.read_only(numbers)
        segment = np.array(segments, dtype=np.intp)
        segment.setflags(write=False)
        return cls(
            joint_names=tuple(name[2:] for name in table.head[1 : 1 + dof]),
            t=data[:, 0],
            q=data[:, 1 : 1 + dof],
            v=data[:, 1 + dof : 1 + 2 * dof],
            position_error=data[:, 1 + 2 * dof],
            orientation_error=data[:, 2 + 2 * dof],
            clearance=data[:, 3 + 2 * dof],
            segment=segment,
            status=tuple(row[width + 1] for row in table.rows),
            limiting=tuple(row[width + 2] for row in table.rows),
            qp_solver="".join(table.notes.get("qp_solver", ())),
            message="".join(table.notes.get("message", ())),
            start_distance=table.note_numbers(file, "start_distance")[0] if "start_distance" in table.notes else 0.0,
            lower=checks.read_only(table.note_numbers(file, "lower")),
            upper=checks.read_only(table.note_numbers(file, "upper")),
            velocity_limit=checks.read_only(table.note_numbers(file, "velocity_limit")),
        )

    def _write_npz(self, file: Path) -> None:
        names = [field.name for field in fields(self) if field.name != "branches"]
        files.write_arrays(file, {name: np.asarray(getattr(self, name)) for name in names})

    @classmethod
    def _read_npz(cls, file: Path) -> Self:
        found: dict[str, Any] = dict(files.read_arrays(file))
        try:
            for array in found.values():
                array.setflags(write=False)
            for name in ("joint_names", "status", "limiting"):
                found[name] = tuple(str(value) for value in found[name])
            for name in ("qp_solver", "message"):
                found[name] = str(found[name])
            found["start_distance"] = float(found.get("start_distance", 0.0))
            return cls(**found)
        except (KeyError, TypeError, ValueError) as error:
            raise InvalidInputError(f"{file}: {files.NOT_OURS}: {error}") from error
