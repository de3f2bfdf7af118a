"""What a runner follows: `PlannedMotion`, which a file holds, and `LiveMotion`, which a hand makes as it goes."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.files import parsing
from jacokin.logs.motion_files import read_motion
from jacokin.model import checks
from jacokin.model.angles import wrap_to_pi
from jacokin.model.robot import Robot, checked_robot, in_words
from jacokin.motion.trajectory import SPEED_ROUNDING, Trajectory

if TYPE_CHECKING:
    from jacokin.teleop.teleop import Teleop  # its QP is not loaded for a file

ROUNDING = 1e-9  # [rad] of degrees in files; [s] of times that are added up
STILL = 1e-4  # [rad/s] a slower arm stands still


class Wanted(NamedTuple):
    """Where the arm is to be after a tick."""

    q: Array
    """(dof,) [rad]."""
    v: Array
    """(dof,) that leads there, constant over the tick [rad/s]."""


class Motion(Protocol):
    """What a runner follows, a tick after the other."""

    def begin(self, q: Array) -> None:
        """Begin where the arm stands (dof,) [rad].

        Raises:
            InvalidInputError: it does not begin there.
        """

    def step(self, dt: float) -> Wanted:
        """Go on by a time [s], 0 to stay."""

    @property
    def is_over(self) -> bool:
        """Whether it has come to its end."""


class PlannedMotion:
    """Rows of angles over time, straight lines between them.

    Attributes:
        robot: whose limits it keeps.
        time: (n,) from 0 [s].
        q: (n, dof) [rad].
    """

    def __init__(self, robot: Robot, time: ArrayLike, q: ArrayLike, *, start: float = math.radians(2.0)) -> None:
        """Take rows that keep the limits of a robot.

        Args:
            robot: the arm.
            time: (n,) strictly rising [s].
            q: (n, dof) [rad].
            start: how far a joint may be from the first row when it begins [rad], [m] of one that slides.

        Raises:
            InvalidInputError: malformed, or a row breaks a limit; names it.
        """
        self.robot = checked_robot("robot", robot)
        self._start = checks.positive("start", start, "rad")
        at = checks.array("time", time, "numbers", "s")
        rows = checks.array("q", q, "rows of numbers", "rad")
        if at.ndim != 1 or not len(at) or rows.shape != (len(at), robot.dof):
            raise InvalidInputError(
                f"a motion of {robot.label} has rows of {robot.dof} joints, got {at.shape} times, {rows.shape} angles"
            )
        if not (np.isfinite(at).all() and np.isfinite(rows).all() and (np.diff(at) > 0.0).all()):
            raise InvalidInputError("times must strictly rise, and all numbers be finite")
        _check_limits(robot, at, rows)
        self.time, self.q = checks.read_only(at - at[0]), checks.read_only(rows)
        self._now = 0.0

    @classmethod
    def of(cls, trajectory: Trajectory, robot: Robot, *, start: float = math.radians(2.0)) -> PlannedMotion:
        """A trajectory.

        Raises:
            InvalidInputError: it failed, or as for `PlannedMotion`.
        """
        checks.instance("trajectory", trajectory, Trajectory, "a Trajectory")
        if not trajectory.success:
            raise InvalidInputError(f"a trajectory that failed is not sent: {trajectory.outcome}, {trajectory.message}")
        return cls(robot, trajectory.t, trajectory.q, start=start)

    @classmethod
    def load(cls, path: str | Path, robot: Robot, *, start: float = math.radians(2.0)) -> PlannedMotion:
        """Read any of the files that `Trajectory.save` writes.

        Raises:
            InvalidInputError: it cannot be read, is of other joints, or as for `PlannedMotion`.
        """
        t, q, fault = read_motion(path, checked_robot("robot", robot))
        with parsing(Path(path), "is not a motion"):
            if fault:
                raise InvalidInputError(f"a trajectory that failed is not sent: {fault}")
            return cls(robot, t, q, start=start)

    @property
    def duration(self) -> float:
        """Length [s]."""
        return float(self.time[-1])

    @property
    def now(self) -> float:
        """How far it has come [s]."""
        return self._now

    @property
    def is_over(self) -> bool:
        """Whether it has come to its end."""
        return self._now >= self.duration

    def begin(self, q: Array) -> None:
        """Begin where the arm stands (dof,) [rad]; joints without limits may stand whole turns away."""
        away = apart(self.robot, q, self.q[0])
        far = np.abs(away)
        if far.max() > self._start:
            joint = int(np.argmax(far))
            off, allowed = in_words(self.robot, joint, far[joint], ".1f"), in_words(self.robot, joint, self._start)
            raise InvalidInputError(
                f"{self.robot.joint_names[joint]} is {off} from where the motion begins ({allowed} allowed): "
                "move it there first"
            )
        self._now = 0.0

    def step(self, dt: float) -> Wanted:
        """Go on by a time [s], 0 to stay."""
        before = self._at(self._now)
        self._now = min(self._now + dt, self.duration)
        q = self._at(self._now)
        return Wanted(q, (q - before) / dt if dt > 0.0 else np.zeros_like(q))

    def _at(self, time: float) -> Array:
        row = min(max(int(np.searchsorted(self.time, time, side="right")) - 1, 0), max(len(self.time) - 2, 0))
        if len(self.time) == 1:
            return np.asarray(self.q[0])
        part = (time - self.time[row]) / (self.time[row + 1] - self.time[row])
        return np.asarray(self.q[row] + part * (self.q[row + 1] - self.q[row]))


class LiveMotion:
    """A hand that leads the tool: `Teleop`, whose clutch and watchdog hold here too.

    Attributes:
        teleop: what follows the hand.
        said: what it said last, in a line; empty before the first tick.
    """

    def __init__(self, teleop: Teleop) -> None:
        """Follow a hand.

        Raises:
            InvalidInputError: not a `Teleop`.
        """
        from jacokin.teleop.teleop import Teleop  # its QP is not loaded for a file

        self.teleop, self.said = checks.instance("teleop", teleop, Teleop, "a Teleop"), ""
        self._hand: ArrayLike | None = None
        self._ended, self._ahead = False, 0.0  # [s] of the last tick that are still to come
        self._q = self._from = self._to = teleop.tracker.q

    def take(self, message: str) -> None:
        """Take a line of JSON: {"hand": [...]}, {"clutch": true} or {"end": true}, or several of these fields.

        "hand" has the 7 numbers of a pose, position [m] and quaternion wxyz, or the 6 of a twist [m/s, rad/s].

        Raises:
            InvalidInputError: not such a line; nothing has changed.
        """
        checks.instance("a line", message, str, "a text")
        try:
            fields = json.loads(message)
        except (ValueError, RecursionError) as error:
            raise InvalidInputError(f"a line must be JSON: {error}") from error
        if not isinstance(fields, dict) or not fields or not set(fields) <= {"hand", "clutch", "end"}:
            raise InvalidInputError(
                f'a line must be like {{"hand": [...]}}, with hand, clutch or end, got {message[:80]!r}'
            )
        for name in ("clutch", "end"):
            if name in fields:
                checks.flag(name, fields[name])
        if fields.get("end"):
            self._ended = True
            self.teleop.clutch(False)
        elif "clutch" in fields:
            self.teleop.clutch(fields["clutch"])
        if "hand" in fields:
            self._hand = fields["hand"]

    @property
    def is_over(self) -> bool:
        """Whether it has come to its end."""
        return self._ended and bool(np.abs(self.teleop.tracker.v).max() < STILL)

    def begin(self, q: Array) -> None:
        """Begin where the arm stands (dof,) [rad]."""
        self.teleop.tracker.reset(q)
        self._q = self._from = self._to = self.teleop.tracker.q
        self._ahead = 0.0

    def step(self, dt: float) -> Wanted:
        """Go on by a time [s], 0 to stay: along the ticks of the tracker, whose velocity is constant in each."""
        tick, before = self.teleop.tracker.dt, self._q
        self._ahead -= dt
        while self._ahead < -ROUNDING:
            self._ahead += tick
            hand, self._hand = self._hand, None
            step = self.teleop.step(hand)
            self._from, self._to = self._to, step.q
            self.said = f"{step.status.name}: {step.message}" if step.message else step.status.name
        self._q = self._to - max(self._ahead, 0.0) / tick * (self._to - self._from)
        return Wanted(self._q, (self._q - before) / dt if dt > 0.0 else np.zeros_like(before))


def apart(robot: Robot, q: Array, other: Array) -> Array:
    """From angles to others (dof,) [rad], up to whole turns on joints without limits."""
    away = np.asarray(other - q)
    return np.where(robot.unlimited & ~robot.sliding, wrap_to_pi(away), away)


def _check_limits(robot: Robot, time: Array, q: Array) -> None:
    past = np.maximum(robot.lower - q, q - robot.upper)
    if past.max() > ROUNDING:
        row, joint = (int(index) for index in np.unravel_index(int(np.argmax(past)), past.shape))
        raise InvalidInputError(
            f"{robot.joint_names[joint]} is {in_words(robot, joint, past[row, joint])} past its limit in row {row}"
        )
    if len(q) == 1:
        return
    steps = np.diff(time)[:, None]
    fast = np.abs(np.diff(q, axis=0)) / steps - robot.velocity_limit
    if (fast * steps > SPEED_ROUNDING * steps + ROUNDING).any():
        row, joint = (int(index) for index in np.unravel_index(int(np.argmax(fast)), fast.shape))
        raise InvalidInputError(
            f"{robot.joint_names[joint]} is {in_words(robot, joint, fast[row, joint])}/s faster than its limit from "
            f"row {row} to the next"
        )
