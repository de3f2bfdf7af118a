"""Trajectories: joint angles over time, what `track_path`, `plan_path` and `move_joints` return, and their files.

`PathResult` and `JointMotion` add their own columns to a `Trajectory`. A kind says in its `LAYOUT` which of its fields
are joint values, numbers, words and notes; in a CSV file notes stand in lines before the table, whose columns are the
others.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.results import Frozen
from jacokin.ik.targets import Target
from jacokin.model import checks
from jacokin.model.robot import Robot
from jacokin.motion.files import (
    NOT_OURS,
    Table,
    by_ending,
    format_exactly,
    read_arrays,
    read_table,
    save,
    write_arrays,
    write_table,
)
from jacokin.motion.grasps import Grasp

FORMATS = (".csv", ".npz", ".json", ".kinova.csv")
LIMITS = ("lower", "upper", "velocity_limit")
LEAD_IN = "LEAD_IN"  # status of rows that lead to where a path begins
NAMED = 8  # segments in a sentence
KINOVA_STEP = 0.01  # [s] the control loop of the Jaco's base runs at 100 Hz (kinova-ros, README, velocity control)
SPEED_ROUNDING = 1e-9  # [rad/s] of positions subtracted and divided by a step
DURATION = {1: ("secs", "nsecs"), 2: ("sec", "nanosec")}  # parts of a duration in each version of ROS
NANOSECONDS = 1_000_000_000  # [1/s]


class Layout(NamedTuple):
    """Names of the fields that files hold, beside `joint_names`, `t` and the limits."""

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

    def head(self, joint_names: Sequence[str]) -> list[str]:
        """Names of the columns of a CSV file."""
        joints = [f"{name}_{joint}" for name in self.joints for joint in joint_names]
        return ["t", *joints, *self.rows, *self.counts, *self.words]

    def misfit(self, found: Mapping[str, NDArray[Any]]) -> str:
        """What is wrong with the arrays of a file; "" if nothing is."""
        optional = (*self.numbers, *self.texts, *self.values)
        needed = ("joint_names", "t", *LIMITS, *self.joints, *self.rows, *self.counts, *self.words)
        if missing := [name for name in needed if name not in found]:
            return f"it lacks {', '.join(missing)}"
        if strange := [name for name in found if name not in needed + optional]:
            return f"it holds {', '.join(strange)}"
        rows, dof = found["t"].size, found["joint_names"].size
        for names, shape, kind in (
            (("t", *self.rows), (rows,), "f"),
            (self.counts, (rows,), "i"),
            (self.words, (rows,), "U"),
            (self.joints, (rows, dof), "f"),
            (LIMITS, (dof,), "f"),
            (("joint_names",), (dof,), "U"),
            (self.numbers, None, "f"),
            (self.texts, (), "U"),
            (self.values, (), "f"),
        ):
            for name in names:
                array = found.get(name)
                if array is None:
                    continue
                fits = array.ndim == 1 if shape is None else array.shape == shape
                if not fits or array.dtype.kind != kind:
                    return f"{name} has the wrong shape or type"
        if not rows:
            return "there are no rows"
        for name in ("t", *self.joints):
            if not np.isfinite(found[name]).all():
                return f"{name} is not finite everywhere"
        return "" if (np.diff(found["t"]) > 0.0).all() else "t does not rise"


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory(Frozen):
    """Joint angles over time. Arrays are read-only."""

    LAYOUT: ClassVar[Layout]

    joint_names: tuple[str, ...]
    """Names of the joints."""
    t: Array
    """(n,) time [s], from 0."""
    q: Array
    """(n, dof) joint angles [rad]."""
    v: Array
    """(n, dof) joint velocities [rad/s]; along a path those over the tick that ends here, row 0 is zero."""
    lower: Array
    """(dof,) lower limits [rad]."""
    upper: Array
    """(dof,) upper limits [rad]."""
    velocity_limit: Array
    """(dof,) velocity limits that were held [rad/s]."""

    @property
    def time(self) -> Array:
        """(n,) the times `t` [s]."""
        return self.t

    if TYPE_CHECKING:

        @property
        def a(self) -> Array:
            """(n, dof) accelerations [rad/s^2]: a field or a property of each kind."""

    @property
    def duration(self) -> float:
        """Length of the trajectory [s]."""
        return float(self.t[-1])

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.t)

    def save(self, path: str | Path, *, ros: int = 2, joint_prefix: str = "") -> None:
        """Write a file; an existing one is replaced only when the new one is complete.

        ".csv" and ".npz" hold everything and can be loaded. ".json" holds the fields of a ROS JointTrajectory.
        ".kinova.csv" holds angles [deg] and velocities [deg/s] at 100 Hz for Kinova's driver.

        Args:
            path: where the file goes.
            ros: 1 or 2, whose names of the parts of a duration .json files have: secs and nsecs, or sec and nanosec.
            joint_prefix: put before the names of joints in .json files; kinova-ros has "j2n6s300_".

        Raises:
            InvalidInputError: another ending, the file cannot be written, a limit is broken after resampling, or an
                option of ROS with another kind of file.
        """
        checks.whole_number("ros", ros, 1, 2)
        checks.text("joint_prefix", joint_prefix)
        if (ros != 2 or joint_prefix) and by_ending(path, FORMATS)[1] != ".json":
            raise InvalidInputError(f"ros and joint_prefix are for .json files, got {str(path)!r}")
        save(
            path,
            {
                ".csv": self._write_csv,
                ".npz": lambda file: write_arrays(file, self._arrays()),
                ".json": partial(write_ros_json, trajectory=self, ros=ros, joint_prefix=joint_prefix),
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
        layout, arrays = cls.LAYOUT, cls._read_csv(file) if ending == ".csv" else read_arrays(file)
        if wrong := layout.misfit(arrays):
            raise InvalidInputError(f"{file}: {NOT_OURS}: {wrong}")
        found: dict[str, Any] = {}
        for name, array in arrays.items():
            if name in ("joint_names", *layout.words):
                found[name] = tuple(array.tolist())
            else:
                found[name] = array.item() if name in layout.texts + layout.values else checks.sealed(array)
        return cls(**found)

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """The fields that files hold."""
        kept = {"joint_names", "t", *LIMITS, *(name for names in self.LAYOUT for name in names)}
        return {field.name: np.asarray(getattr(self, field.name)) for field in fields(self) if field.name in kept}

    def _write_csv(self, file: Path) -> None:
        layout, arrays = self.LAYOUT, self._arrays()
        numbers = np.column_stack([arrays[name] for name in ("t", *layout.joints, *layout.rows)])
        words = [map(str, arrays[name].tolist()) for name in (*layout.counts, *layout.words)]
        notes = {name: format_exactly(arrays[name]) for name in (*LIMITS, *layout.numbers)}
        notes |= {name: [arrays[name].item()] for name in layout.texts}
        notes |= {name: [repr(arrays[name].item())] for name in layout.values}
        rows = [[*format_exactly(row), *rest] for row, *rest in zip(numbers, *words, strict=True)]
        write_table(file, Table(notes, layout.head(self.joint_names), rows))

    @classmethod
    def _read_csv(cls, file: Path) -> dict[str, NDArray[Any]]:
        layout, table = cls.LAYOUT, read_table(file)
        dof = len(table.notes.get("lower", ()))
        names = [name[len(layout.joints[0]) + 1 :] for name in table.head[1 : 1 + dof]]
        if not dof or table.head != layout.head(names):
            raise InvalidInputError(f"{file}: {NOT_OURS} (head line or limits missing)")
        floats, counts = 1 + len(layout.joints) * dof + len(layout.rows), len(layout.counts)
        numbers, whole = [], []
        for line, row in zip(table.lines, table.rows, strict=True):
            try:
                numbers.append([float(cell) for cell in row[:floats]])
                whole.append([int(cell) for cell in row[floats : floats + counts]])
            except ValueError as error:
                raise InvalidInputError(f"{file}, line {line}: {error}") from error
        t, *blocks = np.split(np.array(numbers), 1 + dof * np.arange(len(layout.joints) + 1), axis=1)
        found: dict[str, NDArray[Any]] = {"joint_names": np.array(names), "t": t[:, 0]}
        found |= dict(zip(layout.joints, blocks, strict=False))
        found |= dict(zip(layout.rows, blocks[-1].T, strict=True))
        found |= dict(zip(layout.counts, np.array(whole, dtype=np.intp).T, strict=True))
        for place, name in enumerate(layout.words, start=floats + counts):
            found[name] = np.array([row[place] for row in table.rows])
        found |= {name: table.note_numbers(file, name) for name in LIMITS}
        found |= {name: table.note_numbers(file, name) for name in layout.numbers if name in table.notes}
        found |= {name: np.array("".join(table.notes[name])) for name in layout.texts if name in table.notes}
        found |= {name: table.note_numbers(file, name).squeeze() for name in layout.values if name in table.notes}
        return found


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
class PathResult(Trajectory):
    """Joint trajectory along a path, one row a tick. Arrays are read-only."""

    LAYOUT: ClassVar = Layout(
        joints=("q", "v"),
        rows=("position_error", "orientation_error", "clearance"),
        counts=("segment",),
        words=("status", "limiting"),
        numbers=("parameter",),
        texts=("qp_solver", "message"),
        values=("start_distance",),
    )

    position_error: Array
    """(n,) distance to the path's pose at that time [m]."""
    orientation_error: Array
    """(n,) angle to it [rad]."""
    status: tuple[str, ...]
    """(n,) "OK", "LIMITED", "HELD" or "LOST", see `TrackerStatus`; "LEAD_IN" on the way to where the path begins, where
    there are no errors (nan) and `segment` is -1."""
    limiting: tuple[str, ...]
    """(n,) what held the arm back, joined by "; "."""
    segment: NDArray[np.intp]
    """(n,) which straight line the row belongs to."""
    clearance: Array
    """(n,) smallest distance of shapes kept apart [m], see `TrackerStep`; nan when none are."""
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
        return not self.off_path.any()

    @property
    def off_path(self) -> NDArray[np.bool_]:
        """(n,) where a row is off the path."""
        return np.array([status not in ("OK", LEAD_IN) for status in self.status], dtype=np.bool_)

    @property
    def failed_segments(self) -> tuple[int, ...]:
        """Segments with a tick that is off the path."""
        return tuple(sorted(set(self.segment[self.off_path].tolist())))

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
        return float(self.off_path[1:].sum() * (self.t[1] - self.t[0]))

    @property
    def largest_errors(self) -> tuple[float, float]:
        """Of position [m] and orientation [rad] along the path; nan where the arm never comes to it."""
        known = ~np.isnan(self.position_error)
        if not known.any():
            return math.nan, math.nan
        return float(self.position_error[known].max()), float(self.orientation_error[known].max())

    def __str__(self) -> str:
        """The result on two lines."""
        return (
            f"{len(self)} rows, {self.t[-1]:.3f} s, {'on the path throughout' if self.success else 'NOT on the path'}: "
            f"largest error {self.largest_errors[0]:.3g} m, {self.largest_errors[1]:.3g} rad; "
            f"off the path for {self.time_limited:.3f} s\n{self.message}"
        )


#: What a motion may lead to: a configuration, what `IKSolver.solve` takes, or a grasp.
Aim: TypeAlias = Target | Grasp


@dataclass(frozen=True, slots=True, eq=False)
class Goal(Frozen):
    """A configuration that reaches one of the goals. Arrays are read-only."""

    q: Array
    """(dof,) joint angles [rad]."""
    number: int
    """Which of the goals that were given it reaches."""
    target: Aim | None = None
    """That goal; None for a configuration."""
    parameter: float | None = None
    """Angle about the free axis, or of joint 3 on seven joints [rad]; None where nothing is free."""


class MotionStatus(Enum):
    """Outcome of a motion to a goal; the value is a sentence that says what to try."""

    OK = "the motion leads to its goal"
    START_IN_CONTACT = (
        "the arm touches something where it starts: move it out by hand or by joints, "
        "or allow that contact, Scene(..., allow=[...])"
    )
    UNREACHABLE = "no configuration within the limits reaches a goal: move or turn it, or give more goals"
    GOAL_IN_CONTACT = (
        "every configuration that reaches a goal touches something: move it, give more goals, leave an axis free, "
        "or allow that contact, Scene(..., allow=[...])"
    )
    NO_WAY = "no way was found, though there may be one: allow more time, or give more goals"
    MISSED = "the end of the motion misses its goal by more than the tolerances: give a goal away from singular poses"


@dataclass(frozen=True, slots=True, eq=False)
class JointMotion(Trajectory):
    """A motion between two configurations, sampled. Arrays are read-only."""

    LAYOUT: ClassVar = Layout(joints=("q", "v", "a"), numbers=("clearance",), texts=("outcome", "message"))

    a: Array
    """(n, dof) accelerations [rad/s^2]."""
    clearance: Array = field(default_factory=lambda: checks.read_only([]))
    """(n,) smallest distance of shapes whose contact counts [m]; nan without shapes, empty where none was measured."""
    outcome: str = "OK"
    """Name of a `MotionStatus`."""
    message: str = ""
    """What happened, in a sentence."""
    goal: Goal | None = None
    """What `plan_motion` leads to; not kept in files."""

    @classmethod
    def of(
        cls,
        robot: Robot,
        velocity: Array,
        rows: tuple[Array, Array, Array, Array],
        *,
        clearance: ArrayLike = (),
        status: MotionStatus = MotionStatus.OK,
        message: str = "",
        goal: Goal | None = None,
    ) -> Self:
        """A motion of a robot within velocity limits (dof,) [rad/s], from times, angles, velocities, accelerations."""
        t, q, v, a = map(checks.read_only, rows)
        return cls(
            joint_names=robot.joint_names,
            t=t,
            q=q,
            v=v,
            lower=robot.lower,
            upper=robot.upper,
            velocity_limit=checks.read_only(velocity),
            a=a,
            clearance=checks.read_only(np.array(clearance, dtype=np.float64)),
            outcome=status.name,
            message=message,
            goal=goal,
        )

    @property
    def success(self) -> bool:
        """True when the motion leads to its goal."""
        return self.outcome == MotionStatus.OK.name

    def __str__(self) -> str:
        """The motion on two lines."""
        return f"{len(self)} rows, {self.t[-1]:.3f} s: {MotionStatus[self.outcome].value}\n{self.message}"


def load_trajectory(file: str | Path) -> PathResult | JointMotion:
    """A trajectory of either kind from a file.

    Raises:
        InvalidInputError: neither kind of trajectory.
    """
    try:
        return PathResult.load(file)
    except InvalidInputError as error:
        try:
            return JointMotion.load(file)
        except InvalidInputError:
            raise error from None


def list_segments(segments: Sequence[int]) -> str:
    """Numbers of segments for a sentence; of many, the first ones."""
    more = len(segments) - NAMED
    return ", ".join(map(str, segments[:NAMED])) + (f" and {more} more" if more > 0 else "")


def write_ros_json(file: Path, trajectory: Trajectory, *, ros: int, joint_prefix: str) -> None:
    """Write the fields of a ROS trajectory_msgs/JointTrajectory: SI units and radians, times to the nanosecond.

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
                "time_from_start": dict(zip(DURATION[ros], (seconds, nanoseconds), strict=True)),
            }
        )
    message = {"joint_names": [joint_prefix + name for name in trajectory.joint_names], "points": points}
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
    q, v = resample(trajectory, KINOVA_STEP)
    check_limits(trajectory, q, v)
    degrees = _to_degrees(q, trajectory.lower, trajectory.upper)
    velocity = np.degrees(v)
    count = q.shape[1]
    head = [
        "time_s",
        *(f"joint{k}_deg" for k in range(1, count + 1)),
        *(f"joint{k}_deg_s" for k in range(1, count + 1)),
    ]
    numbers = np.column_stack([degrees, velocity])
    rows = [[f"{tick / 100:.2f}", *format_exactly(row)] for tick, row in enumerate(numbers)]
    write_table(file, Table({}, head, rows))


def resample(trajectory: Trajectory, step: float) -> tuple[Array, Array]:
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


def _to_degrees(q: Array, lower: Array, upper: Array) -> Array:
    """Angles in degrees that read back to radians within the limits; rounding could put them one ulp outside."""
    degrees = np.degrees(q)
    for _ in range(4):
        back = np.radians(degrees)
        degrees = np.where(back < lower, np.nextafter(degrees, np.inf), degrees)
        degrees = np.where(back > upper, np.nextafter(degrees, -np.inf), degrees)
    return degrees
