"""`Trajectory`: joint angles over time, which `track_path`, `plan_path`, `plan_motion` and `move_joints` return.

In a CSV file single numbers, limits and words stand in lines before the table, whose columns are the rest. A motion
that follows no path is written without the columns of paths, and files of earlier versions lack more: what a file does
not hold is as it is for a motion that follows no path.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.files import plain_numbers, read_arrays
from jacokin.ik.results import Frozen
from jacokin.ik.seeds import ON_LIMIT
from jacokin.ik.targets import Target
from jacokin.model import checks
from jacokin.model.robot import Robot, unit_of
from jacokin.motion.files import (
    NOT_OURS,
    Table,
    by_ending,
    format_exactly,
    read_table,
    save,
    write_arrays,
    write_table,
)
from jacokin.motion.grasps import Grasp
from jacokin.motion.rows import MotionState, Rows, between, cubic
from jacokin.showing import Shown, show

FORMATS = (".csv", ".npz", ".json", ".kinova.csv", ".kinova.json")
LIMITS = ("lower", "upper", "velocity_limit")
LEAD_IN = "LEAD_IN"  # status of rows that lead to where a path begins
NAMED = 8  # segments in a sentence
TO_SEND = (".json", ".kinova.csv", ".kinova.json")  # files that are sent to an arm
FOR_KINOVA = (".kinova.csv", ".kinova.json")
FIRST_TIME = 10.0  # [s] at most
KINOVA_STEP = 0.01  # [s] the control loop of the Jaco's base runs at 100 Hz (kinova-ros, README, velocity control)
SPEED_ROUNDING = 1e-9  # [rad/s] of positions subtracted and divided by a step
NANOSECONDS = 1_000_000_000  # [1/s]


#: Names of the fields that files hold beside `joint_names`, `t` and the limits: (n, dof) numbers, of which every file
#: has the first two; (n,) numbers, whole numbers and words; arrays of any length, texts, and single numbers.
JOINTS = ("q", "v", "a")
ROWS = ("position_error", "orientation_error", "clearance")
COUNTS = ("segment",)
WORDS = ("status", "limiting")
NUMBERS = ("parameter",)
TEXTS = ("qp_solver", "outcome", "message")
VALUES = ("start_distance",)
SLIDING = "sliding"  # of arms with a joint that slides; without it all turn, as in files of earlier versions
COUNTED = "rows"  # a note of CSV files, how many they have: a file that was cut off must not read as a whole motion
NEEDED = ("joint_names", "t", *LIMITS, "q", "v")
KNOWN = (*NEEDED, SLIDING, "a", *ROWS, *COUNTS, *WORDS, *NUMBERS, *TEXTS, *VALUES)
#: Those of paths alone.
OF_PATHS = ("position_error", "orientation_error", *COUNTS, *WORDS, *NUMBERS, "qp_solver", *VALUES)


def _misfit(found: Mapping[str, NDArray[Any]]) -> str:
    """What is wrong with the arrays of a file; "" if nothing is."""
    if missing := [name for name in NEEDED if name not in found]:
        return f"it lacks {', '.join(missing)}"
    if strange := [name for name in found if name not in KNOWN]:
        return f"it holds {', '.join(strange)}"
    rows, dof = found["t"].size, found["joint_names"].size
    for names, shape, kind in (
        (("t", *ROWS), (rows,), "f"),
        (COUNTS, (rows,), "i"),
        (WORDS, (rows,), "U"),
        (JOINTS, (rows, dof), "f"),
        (LIMITS, (dof,), "f"),
        (("joint_names",), (dof,), "U"),
        ((SLIDING,), (dof,), "b"),
        (NUMBERS, None, "f"),
        (TEXTS, (), "U"),
        (VALUES, (), "f"),
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
    for name in ("t", *JOINTS):
        if name in found and not np.isfinite(found[name]).all():
            return f"{name} is not finite everywhere"
    for name in LIMITS:
        if np.isnan(found[name]).any():
            return f"{name} is not a number everywhere"
    if (outcome := found.get("outcome")) is not None and outcome.item() not in MotionStatus.__members__:
        return f"outcome is none of {', '.join(MotionStatus.__members__)}"
    return "" if (np.diff(found["t"]) > 0.0).all() else "t does not rise"


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
    OFF_PATH = "the arm is off its path in places: `status`, `limiting` and `message` say where and why"
    CANNOT_STOP = (
        "the arm is too fast to come to rest within its limits and clear of everything: "
        "go on with the motion under way, and plan again when it is slower"
    )
    TOO_HEAVY = (
        "gravity alone asks for more torque than `torque_limit` somewhere on the way, however slow the motion: carry "
        "less, or give goals nearer to the base"
    )
    TOO_FAST = (
        "a joint moves faster from one row to the next than its velocity limit: this is not to be sent to an arm; "
        "plan it anew, with a smaller dt or speed"
    )
    MISSED = "the end of the motion misses its goal by more than the tolerances: give a goal away from singular poses"


_NONE, _NO_SEGMENTS = checks.read_only([]), checks.sealed(np.zeros(0, dtype=np.intp))
_NO_JOINTS = checks.sealed(np.zeros(0, dtype=np.bool_))


def _empty() -> Array:
    """No numbers."""
    return _NONE


def _unknown(count: int) -> Array:
    """Numbers (count,) that nobody knows."""
    return checks.sealed(np.full(count, np.nan))


#: What so many rows of a motion that follows no path have in fields that were not given.
USUAL: Mapping[str, Callable[[int], object]] = {
    "clearance": _unknown,
    "position_error": _unknown,
    "orientation_error": _unknown,
    "status": lambda count: ("OK",) * count,
    "limiting": lambda count: ("",) * count,
    "segment": lambda count: checks.sealed(np.full(count, -1, dtype=np.intp)),
}


class _Completing(Frozen):
    """A result whose fields that were not given are made, or measured, when they are first asked for."""

    __slots__ = ("_look",)
    _look: Callable[[], Array] | None

    if not TYPE_CHECKING:  # or else every name would be an attribute

        def __getattr__(self, name: str) -> object:
            """What is not there yet."""
            if name not in USUAL:
                raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
            is_measured = name == "clearance" and self._look is not None
            found = checks.read_only(self._look()) if is_measured else USUAL[name](len(self.t))
            object.__setattr__(self, name, found)
            return found


@dataclass(frozen=True, slots=True, eq=False)
class Trajectory(_Completing):
    """Joint angles over time; of joints that slide, [m] where [rad] is said. Arrays are read-only."""

    joint_names: tuple[str, ...]
    """Names of the joints."""
    t: Array
    """(n,) time [s], from 0."""
    q: Array
    """(n, dof) joint angles [rad]."""
    v: Array
    """(n, dof) joint velocities at that time [rad/s]; planned motions are at rest in the last row, and in the first
    one unless the arm moves already."""
    lower: Array
    """(dof,) lower limits [rad]."""
    upper: Array
    """(dof,) upper limits [rad]."""
    velocity_limit: Array
    """(dof,) velocity limits that were held [rad/s]."""
    a: Array = field(default_factory=_empty)
    """(n, dof) accelerations at that time [rad/s^2]. Without any, the change of velocity over the tick that ends here;
    row 0 is zero."""
    clearance: Array = field(default_factory=_empty)
    """(n,) smallest distance of shapes whose contact counts, or that are kept apart [m]; nan where unknown.
    `plan_motion` leaves measuring it to the first time that it is asked for."""
    outcome: str = "OK"
    """Name of a `MotionStatus`."""
    message: str = ""
    """What happened, in a sentence."""
    goal: Goal | None = None
    """What `plan_motion` leads to; not kept in files."""
    position_error: Array = field(default_factory=_empty)
    """(n,) distance to the path's pose at that time [m]; nan where no path is followed."""
    orientation_error: Array = field(default_factory=_empty)
    """(n,) angle to it [rad]."""
    status: tuple[str, ...] = ()
    """(n,) "OK", "LIMITED", "HELD" or "LOST", see `TrackerStatus`; "LEAD_IN" on the way to where a path begins."""
    limiting: tuple[str, ...] = ()
    """(n,) what held the arm back, joined by "; "."""
    segment: NDArray[np.intp] = field(default_factory=lambda: _NO_SEGMENTS)
    """(n,) which straight line of a path the row belongs to; -1 where it belongs to none."""
    branches: tuple[BranchReport, ...] = ()
    """Start configurations that were tried for a path, in order; not kept in files."""
    qp_solver: str = ""
    """QP solver that ran, with a fallback named."""
    parameter: Array = field(default_factory=_empty)
    """(waypoints,) what `plan_path` chose where a waypoint leaves one parameter free [rad]: the angle about the axis of
    a `FreeAxis`, or joint 3 of a seven-joint arm; nan at full poses of six joints and at waypoints that are not
    reached. Empty for others."""
    start_distance: float = 0.0
    """Largest angle of a joint between the seed (home without one) and row 0 of a path [rad]: the arm is to be brought
    there."""
    sliding: NDArray[np.bool_] = field(default_factory=lambda: _NO_JOINTS)
    """(dof,) which joints slide, `Robot.sliding`; all turn where it is not given."""

    def __post_init__(self) -> None:
        """Fill in what a motion that follows no path need not say, or leave it to when it is asked for."""
        object.__setattr__(self, "_look", None)
        if self.success and not {"OK", LEAD_IN}.issuperset(self.status):
            object.__setattr__(self, "outcome", MotionStatus.OFF_PATH.name)
        if not self.a.size:
            object.__setattr__(self, "a", changes(self.t, self.v))
        if not self.sliding.size or self.sliding.flags.writeable:
            sliding = self.sliding if self.sliding.size else np.zeros(len(self.joint_names))
            object.__setattr__(self, SLIDING, checks.sealed(np.array(sliding, dtype=np.bool_)))
        for name in USUAL:
            if not len(getattr(self, name)):
                object.__delattr__(self, name)
        for name in ("t", *JOINTS, *LIMITS):  # what is checked here stays as it is
            if getattr(self, name).flags.writeable:
                object.__setattr__(self, name, checks.read_only(getattr(self, name)))
        if self.success and (fault := self._too_fast()):
            object.__setattr__(self, "outcome", MotionStatus.TOO_FAST.name)
            object.__setattr__(self, "message", fault)

    def _too_fast(self) -> str:
        """Where a joint moves faster from one row to the next than its velocity limit; "" if none does."""
        if len(self.t) == 1:
            return ""
        steps = (self.t[1:] - self.t[:-1])[:, None]
        moved = np.abs(self.q[1:] - self.q[:-1])
        # Of rows of each joint, which NumPy goes through in a third of the time.
        if (np.ascontiguousarray(moved.T).max(axis=1) <= self.velocity_limit * steps.min()).all():
            return ""
        largest = np.maximum(np.abs(self.q[:-1]), np.abs(self.q[1:]))  # of two angles that are subtracted
        rounding = SPEED_ROUNDING * steps + 4.0 * float(np.finfo(np.float64).eps) * largest
        fast = ~(moved <= self.velocity_limit * (1.0 + SPEED_ROUNDING) * steps + rounding)
        if not fast.any():
            return ""
        row, joint = (int(index) for index in np.argwhere(fast)[0])
        unit = unit_of(self, joint)
        return (
            f"{self.joint_names[joint]} moves {moved[row, joint]:.6g} {unit} from row {row} to the next, in "
            f"{steps[row, 0]:.6g} s: faster than {self.velocity_limit[joint]:.6g} {unit}/s"
        )

    @classmethod
    def of(
        cls,
        robot: Robot,
        velocity: Array,
        rows: tuple[Array, Array, Array, Array],
        *,
        look: Callable[[Array], Array] | None = None,
        status: MotionStatus | None = None,
        message: str = "",
        goal: Goal | None = None,
    ) -> Self:
        """A motion of a robot within velocity limits (dof,) [rad/s], from times, angles, velocities, accelerations.

        All of them are checked already, and are not written to any more. With `look`, which gives the distances [m] of
        configurations (n, dof), its clearance is measured when it is first asked for.
        """
        t, q, v, a = map(checks.sealed, rows)
        made = cls(
            joint_names=robot.joint_names,
            t=t,
            q=q,
            v=v,
            lower=robot.lower,
            upper=robot.upper,
            velocity_limit=velocity,
            a=a,
            outcome="OK" if status is None else status.name,
            message=message,
            goal=goal,
            sliding=robot.sliding,
        )
        if look is not None:
            object.__setattr__(made, "_look", partial(look, q))
        return made

    @property
    def time(self) -> Array:
        """(n,) the times `t` [s]."""
        return self.t

    @property
    def duration(self) -> float:
        """Length of the trajectory [s]."""
        return float(self.t[-1])

    def state_at(self, time: float) -> MotionState:
        """The motion at a time [s], between rows by the cubic that meets their velocities; at its ends beyond them.

        Raises:
            InvalidInputError: not a number.
        """
        now = min(max(checks.number("time", time, "s"), float(self.t[0])), float(self.t[-1]))
        row = min(max(int(np.searchsorted(self.t, now, side="right")) - 1, 0), max(len(self.t) - 2, 0))
        if now == self.t[row] or len(self.t) == 1:
            return MotionState(self.q[row], self.v[row], self.a[row])
        step, x, (q, v, second, third) = cubic(self.t, self.q, self.v, now)
        place = q + x * (v + x * (second + x * third))
        speed, pull = v + x * (2.0 * second + 3.0 * x * third), 2.0 * second + 6.0 * x * third
        if now == self.t[-1]:
            place, speed = self.q[-1], step * self.v[-1]
        return MotionState(*map(checks.read_only, (place, speed / step, pull / step**2)))

    @property
    def success(self) -> bool:
        """True when it leads to its goal, and every tick of a path is on the path within the tolerances."""
        return self.outcome == MotionStatus.OK.name

    @property
    def follows_path(self) -> bool:
        """Whether it is along a path."""
        return bool((self.segment >= 0).any())

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

    def __len__(self) -> int:
        """Number of rows."""
        return len(self.t)

    def __repr__(self) -> str:
        """The trajectory on one line."""
        return f"<Trajectory: {str(self).partition(chr(10))[0]}>"

    def __str__(self) -> str:
        """The trajectory on two lines."""
        if not self.follows_path:
            return f"{len(self)} rows, {self.t[-1]:.3f} s: {MotionStatus[self.outcome].value}\n{self.message}"
        return (
            f"{len(self)} rows, {self.t[-1]:.3f} s, {'on the path throughout' if self.success else 'NOT on the path'}: "
            f"largest error {self.largest_errors[0]:.3g} m, {self.largest_errors[1]:.3g} rad; "
            f"off the path for {self.time_limited:.3f} s\n{self.message}"
        )

    def show(self, of: object, **options: Any) -> Shown:  # Any: checked there
        """Play it in the browser: `of` is its robot, or the solver. See `jacokin.viewer.show`."""
        return show(self, of, options)

    def save(
        self,
        path: str | Path,
        *,
        ros: int = 2,
        joint_prefix: str = "",
        first_time: float = 0.0,
        failed: bool = False,
    ) -> None:
        """Write a file; an existing one is replaced only when the new one is complete.

        ".csv" and ".npz" hold everything and can be loaded. ".json" holds the fields of a ROS JointTrajectory, with
        joints that slide in [m]. ".kinova.csv" holds angles [deg] and velocities [deg/s] at 100 Hz for Kinova's driver.
        ".kinova.json" holds a JointTrajectory of points 10 ms apart for the controller of kinova-ros, which plays the
        velocity of one point each 10 ms, whatever their times: points of another step end elsewhere. Both take every
        number of a joint for an angle: no joint may slide.

        Args:
            path: where the file goes.
            ros: 1 or 2, whose names of the parts of a duration .json files have: secs and nsecs, or sec and nanosec.
            joint_prefix: put before the names of joints in .json files; kinova-ros has "j2n6s300_".
            first_time: of the first point in .json files [s]; some controllers drop one at time 0.
            failed: True to write one that failed, too, to .csv or .npz, to look at.

        Raises:
            InvalidInputError: a trajectory that failed; another ending, the file cannot be written, or an option of ROS
                with another kind of file. Of a .json, that it does not end at rest, or leaves its limits where
                controllers interpolate between rows; of .kinova.csv and .kinova.json, that a joint slides, or a limit
                is broken after resampling.
        """
        checks.whole_number("ros", ros, 1, 2)
        checks.text("joint_prefix", joint_prefix)
        later = checks.non_negative("first_time", first_time, "s")
        if later > FIRST_TIME:
            raise checks.refusal("first_time", f"at most {FIRST_TIME:g}", first_time, "s")
        checks.flag("failed", failed)
        ending = by_ending(path, FORMATS)[1]
        if (ros != 2 or joint_prefix or later) and not ending.endswith(".json"):
            raise InvalidInputError(f"ros, joint_prefix and first_time are for .json files, got {str(path)!r}")
        if not self.success and (not failed or ending in TO_SEND):
            cure = "it can be written to .csv or .npz, to look at, with failed=True"
            raise InvalidInputError(f"a trajectory that failed is not saved: {self.outcome}, {self.message}; {cure}")
        if ending in FOR_KINOVA:
            refuse_sliding(str(path), self.joint_names, self.sliding)
        ros_fields: dict[str, Any] = {"ros": ros, "joint_prefix": joint_prefix, "first_time": later}
        save(
            path,
            {
                ".csv": self._write_csv,
                ".npz": lambda file: write_arrays(file, self._arrays()),
                ".json": partial(write_ros_json, trajectory=self, **ros_fields),
                ".kinova.csv": partial(write_kinova_csv, trajectory=self),
                ".kinova.json": partial(write_kinova_json, trajectory=self, **ros_fields),
            },
        )

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a .csv or .npz file that `save` wrote; numbers come back exactly.

        Raises:
            InvalidInputError: no such file, or it was not written by `save`; names the line where there is one.
        """
        file, ending = by_ending(path, (".csv", ".npz"))
        arrays = _read_csv(file) if ending == ".csv" else read_arrays(file, NOT_OURS)
        if "clearance" in arrays and not arrays["clearance"].size:  # of earlier versions, where none was measured
            del arrays["clearance"]
        if wrong := _misfit(arrays):
            raise InvalidInputError(f"{file}: {NOT_OURS}: {wrong}")
        found: dict[str, Any] = {}
        for name, array in arrays.items():
            if name in ("joint_names", *WORDS):
                found[name] = tuple(array.tolist())
            else:
                found[name] = array.item() if name in TEXTS + VALUES else checks.sealed(array)
        return cls(**found)

    @property
    def rows(self) -> Rows:
        """Times, angles, velocities and accelerations."""
        return Rows(self.t, self.q, self.v, self.a)

    def _arrays(self) -> dict[str, NDArray[Any]]:
        """The fields that files hold."""
        unsaid = (() if self.follows_path else OF_PATHS) + (() if self.sliding.any() else (SLIDING,))
        return {name: np.asarray(getattr(self, name)) for name in KNOWN if name not in unsaid}

    def _write_csv(self, file: Path) -> None:
        arrays = self._arrays()
        numbers = np.column_stack([arrays[name] for name in ("t", *JOINTS, *ROWS) if name in arrays])
        words = [map(str, arrays[name].tolist()) for name in (*COUNTS, *WORDS) if name in arrays]
        notes = {name: format_exactly(arrays[name]) for name in (*LIMITS, *NUMBERS) if name in arrays}
        notes |= {name: [str(int(slides)) for slides in arrays[name]] for name in (SLIDING,) if name in arrays}
        notes |= {name: [arrays[name].item()] for name in TEXTS if name in arrays}
        notes |= {name: [repr(arrays[name].item())] for name in VALUES if name in arrays}
        notes[COUNTED] = [str(len(self))]
        rows = [[*format_exactly(row), *rest] for row, *rest in zip(numbers, *words, strict=True)]
        write_table(file, Table(notes, _head(list(arrays), self.joint_names), rows))


#: What a trajectory was called along a path, and to a goal.
PathResult = JointMotion = Trajectory


def changes(t: Array, v: Array) -> Array:
    """(n, dof) change of velocities (n, dof) [rad/s] at the beginning of the tick that ends at each time [rad/s^2]."""
    acceleration = np.zeros_like(v)
    acceleration[1:] = np.diff(v, axis=0) / np.diff(t)[:, None]
    return checks.read_only(acceleration)


def _head(present: Sequence[str], joint_names: Sequence[str]) -> list[str]:
    """Names of the columns of a CSV file that holds some fields."""
    joints = [f"{name}_{joint}" for name in JOINTS if name in present for joint in joint_names]
    return ["t", *joints, *(name for name in (*ROWS, *COUNTS, *WORDS) if name in present)]


def _read_csv(file: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a CSV file."""
    table = read_table(file)
    dof = len(table.notes.get("lower", ()))
    names = [name[len("q_") :] for name in table.head[1 : 1 + dof]]
    joints = [name for name in JOINTS if names and f"{name}_{names[0]}" in table.head]
    others = [name for name in (*ROWS, *COUNTS, *WORDS) if name in table.head]
    if not dof or table.head != _head([*joints, *others], names):
        raise InvalidInputError(f"{file}: {NOT_OURS} (head line or limits missing)")
    written, there = "".join(table.notes.get(COUNTED, ())), len(table.rows)  # earlier versions did not count
    if written and written != str(there):
        raise InvalidInputError(f"{file}: {there} rows of the {written} that were written are there")
    found = _table_arrays(file, table, joints, others, dof) | _note_arrays(file, table)
    return {"joint_names": np.array(names), **found}


def _table_arrays(
    file: Path, table: Table, joints: Sequence[str], others: Sequence[str], dof: int
) -> dict[str, NDArray[Any]]:
    """The fields that are columns of a CSV file: `joints` have one for each joint, `others` one."""
    rows, counts = [name for name in others if name in ROWS], [name for name in others if name in COUNTS]
    floats = 1 + len(joints) * dof + len(rows)
    numbers, whole = [], []
    for line, row in zip(table.lines, table.rows, strict=True):
        try:
            numbers.append(plain_numbers(row[:floats]))
            whole.append([int(cell) for cell in row[floats : floats + len(counts)]])
        except ValueError as error:
            raise InvalidInputError(f"{file}, line {line}: {error}") from error
    t, *blocks = np.split(np.array(numbers), 1 + dof * np.arange(len(joints) + 1), axis=1)
    found: dict[str, NDArray[Any]] = {"t": t[:, 0]}
    found |= dict(zip(joints, blocks, strict=False))
    found |= dict(zip(rows, blocks[-1].T, strict=True))
    found |= dict(zip(counts, np.array(whole, dtype=np.intp).T, strict=True))
    for place, name in enumerate((name for name in others if name in WORDS), start=floats + len(counts)):
        found[name] = np.array([row[place] for row in table.rows])
    return found


def _note_arrays(file: Path, table: Table) -> dict[str, NDArray[Any]]:
    """The fields that stand before the table of a CSV file."""
    notes = (*LIMITS, *NUMBERS, "clearance")  # which was a note in earlier versions
    found: dict[str, NDArray[Any]] = {
        name: table.note_numbers(file, name) for name in notes if name in table.notes or name in LIMITS
    }
    if SLIDING in table.notes:
        told = table.note_numbers(file, SLIDING)
        if not np.isin(told, (0.0, 1.0)).all():
            raise InvalidInputError(f"{file}: the line '# {SLIDING}' must hold 0 and 1")
        found[SLIDING] = told.astype(np.bool_)
    found |= {name: np.array("".join(table.notes[name])) for name in TEXTS if name in table.notes}
    found |= {name: table.note_numbers(file, name).squeeze() for name in VALUES if name in table.notes}
    return found


def list_segments(segments: Sequence[int]) -> str:
    """Numbers of segments for a sentence; of many, the first ones."""
    more = len(segments) - NAMED
    return ", ".join(map(str, segments[:NAMED])) + (f" and {more} more" if more > 0 else "")


def write_ros_json(file: Path, *, trajectory: Trajectory, ros: int, joint_prefix: str, first_time: float) -> None:
    """Write the fields of a ROS trajectory_msgs/JointTrajectory: SI units and radians, times to the nanosecond.

    Numbers keep all their digits: a rounded one may lie outside its limit.

    Raises:
        InvalidInputError: it does not end at rest, or leaves its limits where controllers interpolate between rows.
    """
    check_interpolated(trajectory)
    times = trajectory.t + first_time
    _write_message(file, [joint_prefix + name for name in trajectory.joint_names], times, trajectory.rows, ros)


def write_kinova_json(file: Path, *, trajectory: Trajectory, ros: int, joint_prefix: str, first_time: float) -> None:
    """Write a JointTrajectory for kinova-ros, whose controller plays one point's velocity each 10 ms, in an open loop.

    The velocity of a point is the one for the 10 ms that begin with it, as in `write_kinova_csv`.

    Raises:
        InvalidInputError: a resampled row breaks a position or velocity limit.
    """
    q, v = resample(trajectory, KINOVA_STEP)
    check_limits(trajectory, q, v)
    t = np.arange(len(q), dtype=np.float64) * KINOVA_STEP
    rows = Rows(t, q, v, changes(t, v))
    _write_message(file, [joint_prefix + name for name in trajectory.joint_names], t + first_time, rows, ros)


def _write_message(file: Path, names: list[str], times: Array, rows: Rows, ros: int) -> None:
    """Write the fields of a JointTrajectory; `times` (n,) are from its start [s]."""
    points, parts = [], ("secs", "nsecs") if ros == 1 else ("sec", "nanosec")
    for time, q, v, a in zip(times.tolist(), rows.q.tolist(), rows.v.tolist(), rows.a.tolist(), strict=True):
        duration = divmod(round(time * NANOSECONDS), NANOSECONDS)
        points.append(
            {
                "positions": q,
                "velocities": v,
                "accelerations": a,
                "time_from_start": dict(zip(parts, duration, strict=True)),
            }
        )
    with file.open("w", encoding="utf-8") as stream:
        json.dump({"joint_names": names, "points": points}, stream, allow_nan=False)
        stream.write("\n")


def refuse_sliding(file: str, joint_names: Sequence[str], sliding: NDArray[np.bool_]) -> None:
    """Refuse one of Kinova's files for joints of which some slide.

    Raises:
        InvalidInputError: names them.
    """
    slides = [name for name, is_sliding in zip(joint_names, sliding.tolist(), strict=True) if is_sliding]
    if slides:
        verb = "slides" if len(slides) == 1 else "slide"
        raise InvalidInputError(f"{file}: Kinova's files hold angles, and {', '.join(slides)} {verb}")


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
    outside = beyond_limits(trajectory, q) > 0.0
    fast = np.abs(v) > trajectory.velocity_limit + SPEED_ROUNDING
    for broken, values, per in ((outside, q, ""), (fast, v, "/s")):
        if broken.any():
            row, joint = (int(index) for index in np.argwhere(broken)[0])
            unit = unit_of(trajectory, joint) + per
            raise InvalidInputError(
                f"{trajectory.joint_names[joint]} breaks its limit after resampling: "
                f"{values[row, joint]:.17g} {unit} in row {row}"
            )


def beyond_limits(trajectory: Trajectory, q: Array) -> Array:
    """How far rows (n, dof) [rad] are past the limits of their trajectory.

    Where it starts outside, how much farther than it already was on its way inside.
    """
    past = np.maximum(np.maximum(trajectory.lower - q, q - trajectory.upper), 0.0)
    return np.asarray(past - np.minimum.accumulate(past, axis=0))


def check_interpolated(trajectory: Trajectory) -> None:
    """Refuse what would leave its limits where controllers go from row to row by cubics or quintics.

    Raises:
        InvalidInputError: names the joint, the rows and the value; or it does not end at rest.
    """
    q, v, names = trajectory.q, trajectory.v, trajectory.joint_names
    if np.abs(v[-1]).max() > 1e-7:  # ROS 2's joint_trajectory_controller refuses more than 1.2e-7
        joint = int(np.argmax(np.abs(v[-1])))
        raise InvalidInputError(
            f"the last row is not at rest ({names[joint]} at {v[-1, joint]:.3g} {unit_of(trajectory, joint)}/s): "
            "controllers of ROS 2 refuse it"
        )
    if len(q) == 1:
        return
    rows, steps = trajectory.rows, np.diff(trajectory.t)
    for order in ("cubics", "quintics"):
        at, speed = between(rows, quintic=order == "quintics")
        past = beyond_limits(trajectory, np.vstack([q[:1], at.reshape(-1, q.shape[1])]))[1:].reshape(at.shape)
        fast = np.abs(speed) - trajectory.velocity_limit * (1.0 + 1e-6)  # interpolation swings
        for excess, allowed, per in ((fast, SPEED_ROUNDING, "/s"), (past, ON_LIMIT, "")):
            if excess.max() > allowed:
                row, _, joint = (int(index) for index in np.unravel_index(int(np.argmax(excess)), excess.shape))
                unit = unit_of(trajectory, joint) + per
                raise InvalidInputError(
                    f"{names[joint]} would pass its limit by {excess.max():.3g} {unit} between rows {row} and "
                    f"{row + 1} where a controller interpolates by {order}: plan it with a smaller dt, "
                    f"{0.5 * steps[row]:.3g} s or less"
                )


def _to_degrees(q: Array, lower: Array, upper: Array) -> Array:
    """Angles in degrees that read back to radians within the limits; rounding could put them one ulp outside."""
    degrees = np.degrees(q)
    for _ in range(4):
        back = np.radians(degrees)
        degrees = np.where(back < lower, np.nextafter(degrees, np.inf), degrees)
        degrees = np.where(back > upper, np.nextafter(degrees, -np.inf), degrees)
    return degrees
