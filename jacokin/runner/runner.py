"""`Runner`: from the time and what an arm measures to the velocities that it is to have. Read this file first.

Each tick sends the velocity of the motion, and a share of what the arm is off it. What is measured is late: it is
compared with where the motion was then, and what corrections have been sent since counts as done. While it is not known
how late, nothing is corrected that a late driver explains. An arm that falls behind is waited for; one that stays
behind, says nothing, or touches something, is stopped.

No clock and no arm are in here: whoever calls `step` says what time it is.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, fields
from enum import Enum
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.contact_observer import ContactObserver
from jacokin.model.robot import Robot, checked_robot, in_words
from jacokin.runner.measuring import MOST, LatencyMeasurement, Standing
from jacokin.runner.motions import Motion, Wanted, apart
from jacokin.twin.faults import TICK

RAMP = 0.2  # [s] in which a motion comes to wait for its arm, and goes on
WAITS = 0.8  # of `lag`: an arm that is so far behind is waited for
FULL = 0.4  # of `lag`: one that is nearer is not
NEAR = 0.25  # of `reached`: an arm that is nearer to the end is left alone
AVERAGED = 1.0  # [s] of what is measured after the end, which tells more than one that scatters
MISSING = 3.0  # measurements, after which the motion waits
BLOCKED = 1.0  # [s] of waiting, after which the arm is stopped
HORIZON = 0.1  # [s] in which no velocity leads past a limit


class RunnerStatus(Enum):
    """How it stands; the value is a sentence."""

    WAITING = "nothing has been measured yet"
    MOVING = "the arm moves"
    SETTLING = "the motion is over, and the arm comes to rest"
    ARRIVED = "the arm stands at the end of the motion"
    MISSED = "the arm did not come to the end of the motion"
    NOT_THERE = "the arm does not stand where the motion begins"
    BEHIND = "the arm fell behind the motion"
    SILENT = "nothing said where the arm is"
    LOST = "the driver no longer listens to velocities"
    CONTACT = "the arm touched something"
    INTERRUPTED = "it was told to stop"

    @property
    def has_ended(self) -> bool:
        """Whether nothing but zeros is sent from now on."""
        return self not in (RunnerStatus.WAITING, RunnerStatus.MOVING, RunnerStatus.SETTLING)


@dataclass(frozen=True, slots=True)
class RunnerOptions:
    """How it follows, and when it stops."""

    gain: float = 2.0
    """Velocity of a correction over what the arm is off [1/s]."""
    correction: float = 0.25
    """Largest velocity of a correction, over the velocity limit, up to 1."""
    latency: float | None = None
    """How late a velocity is seen in what is measured [s]; None to measure it as the arm begins to move."""
    lag: float = math.radians(5.0)
    """How far a joint may be off the motion [rad], [m] of one that slides."""
    silence: float = 0.5
    """How long nothing may be measured [s]; after half of it, or three measurements that miss, the motion waits."""
    reached: float = math.radians(0.2)
    """How near the end of the motion is there [rad], [m] of joints that slide."""
    patience: float = 5.0
    """How long the arm may take to come to rest after the end of the motion [s]."""
    contact: float | None = None
    """External torque at a joint that counts as contact [N m], where velocities and torques are told; None for any."""

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            InvalidInputError: one is out of range.
        """
        for field in fields(self):
            value = getattr(self, field.name)
            if value is None and field.name in ("latency", "contact"):
                continue
            if field.name in ("gain", "correction", "latency"):
                checks.non_negative(field.name, value)
            else:
                checks.positive(field.name, value)
        if self.correction > 1.0:
            raise checks.refusal("correction", "at most 1", self.correction)


@dataclass(frozen=True, slots=True, eq=False)
class Measured(Sealed):
    """What an arm said once. Numbers that are not all finite count as not told, as ROS drivers say nan for unknown."""

    q: Array
    """(dof,) angles [rad]."""
    v: Array | None = None
    """(dof,) velocities [rad/s]; None where they are not told."""
    torques: Array | None = None
    """(dof,) torques of the motors at the joints, with what holds the arm up [N m]; None where they are not told."""


@dataclass(frozen=True, slots=True, eq=False)
class RunnerStep(Sealed):
    """One tick."""

    v: Array
    """(dof,) velocities to send [rad/s], read-only; zeros unless it moves."""
    status: RunnerStatus
    """How it stands."""
    message: str
    """Why it stopped, or waits, with numbers; empty while all is well."""


class _Past(NamedTuple):
    time: float
    q: Array
    corrected: Array


class Runner:
    """Leads an arm along a motion, a tick of 10 ms after the other.

    Attributes:
        robot: the arm.
        motion: that it follows.
        status: how it stands.
        message: why it stopped; empty while it goes on.
        worst: the largest angle that a joint was seen off the motion [rad].
    """

    def __init__(self, robot: Robot, motion: Motion, options: RunnerOptions | None = None) -> None:
        """Wait for the first measurement.

        Args:
            robot: the arm, whose velocity and joint limits are kept.
            motion: to follow.
            options: None for the usual ones.

        Raises:
            InvalidInputError: not a robot, a motion or options.
        """
        self.robot, self.motion = checked_robot("robot", robot), motion
        for name in ("begin", "step"):
            checks.function(f"motion.{name}", getattr(motion, name, None))
        usual = RunnerOptions() if options is None else options
        self.options = checks.instance("options", usual, RunnerOptions, "RunnerOptions, or None")
        self.status, self.message, self.worst = RunnerStatus.WAITING, "", 0.0
        still = np.zeros(robot.dof)
        self._observer = None if self.options.contact is None else ContactObserver(robot, self.options.contact)
        self._measurement, self._latency = LatencyMeasurement(robot), self.options.latency
        longest = MOST if self._latency is None else self._latency
        self._past: deque[_Past] = deque(maxlen=2 + math.ceil(longest / TICK))
        self._wanted, self._corrected, self._error = Wanted(still, still), still, still
        self._needs: deque[tuple[float, Array, Array]] = deque()
        self._needed = still, still  # (dof,) least and largest that corrections have to come to [rad]
        self._rate, self._waits, self._over = 0.0, 0.0, 0.0
        self._now, self._heard, self._period = -math.inf, -math.inf, math.inf
        self._felt = math.inf  # when contact was last looked for; inf before it begins
        self._standing = Standing(robot)
        self._q: Array | None = None
        self._has_begun = False

    @property
    def away(self) -> float:
        """How far the joint that is farthest was off the motion when the arm last spoke [rad]; inf before it began.

        Where the arm stands, the mean of what it has said counts.
        """
        if self._q is None or not self._has_begun:
            return math.inf
        place = self._standing.place
        return float(np.abs(apart(self.robot, self._q if place is None else place, self._wanted.q)).max())

    @property
    def measured_latency(self) -> float | None:
        """How late the arm was seen to begin to move [s]; None while that is not known."""
        return self._measurement.found

    @property
    def latency(self) -> float:
        """How late it takes what is measured to be [s]."""
        if self._latency is not None:
            return self._latency
        return 0.05 if self.measured_latency is None else self.measured_latency  # [s] until it is known

    @property
    def _is_latency_known(self) -> bool:
        return self._latency is not None or self.measured_latency is not None

    @property
    def misses_contact(self) -> bool:
        """Whether contact counts, but the arm has told no velocities and torques for longer than `silence`."""
        return self._observer is not None and self._now - self._felt > self.options.silence

    @property
    def stands(self) -> bool:
        """Whether what was measured last is one place: in the last 0.3 s, or up to 3.4 s where it scatters."""
        return self._standing.place is not None

    def stop(self, message: str = "") -> None:
        """Send nothing but zeros from now on; nothing where it has ended before."""
        self._end(RunnerStatus.INTERRUPTED, message)

    def lose(self) -> None:
        """Send nothing but zeros from now on, as nobody listens; nothing where it has ended before."""
        self._end(RunnerStatus.LOST, "the driver ended, or was restarted, in the middle; a new one is sent nothing")

    def step(self, time: float, measured: Measured | None = None) -> RunnerStep:
        """One tick.

        Args:
            time: now, by any clock that does not run backwards [s].
            measured: what the arm has said since the last tick; None for nothing.

        Returns:
            The velocities to send for the tick that begins now.

        Raises:
            InvalidInputError: a time that runs backwards, or something malformed is measured; nothing has changed then.
        """
        now = checks.number("time", time, "s")
        if now < self._now:
            raise InvalidInputError(f"time ran backwards by {self._now - now:.3g} s")
        if measured is not None:
            checks.instance("measured", measured, Measured, "Measured")
            q, v, torques = (self._told(name, getattr(measured, name)) for name in ("q", "v", "torques"))
            if q is not None:
                self._hear(now, q, v, torques)
        self._now = now
        self._past.append(_Past(now, self._wanted.q, self._corrected))
        self._measurement.lead(now, self._wanted.q + self._corrected)
        age = now - self._heard
        if not self.status.has_ended and self.status is not RunnerStatus.WAITING:
            if age > self.options.silence:
                self._end(RunnerStatus.SILENT, f"nothing has said where the arm is for {age:.2f} s")
            else:
                self._judge(now, age)
        v = np.zeros(self.robot.dof)
        if self.status in (RunnerStatus.MOVING, RunnerStatus.SETTLING):
            v = self._lead()
        return RunnerStep(checks.read_only(v), self.status, self.message)

    def _told(self, name: str, values: Array | None) -> Array | None:
        """Numbers (dof,) that were measured; None where they are not told, or not finite.

        Raises:
            InvalidInputError: malformed.
        """
        if values is None and name != "q":
            return None
        found = checks.array(name, values, f"{self.robot.dof} numbers")  # type: ignore[arg-type]  # checked there
        if found.shape != (self.robot.dof,):
            raise InvalidInputError(f"{name} must have shape ({self.robot.dof},), got shape {found.shape}")
        return found if np.isfinite(found).all() else None

    def _hear(self, now: float, q: Array, v: Array | None, torques: Array | None) -> None:
        since, self._heard, self._q = now - self._heard, now, q
        self._standing.hear(now, q)
        if self.status is RunnerStatus.WAITING:
            self._begin(q)
        elif not self.status.has_ended:
            self._period = since
            self._measurement.hear(now, q)
            seen = now - self.latency
            then = next((past for past in self._past if past.time >= seen - 0.5 * TICK), self._past[-1])
            self._error = apart(self.robot, q, then.q)
            possible = [then] if self._is_latency_known else list(self._past)
            led = np.array([past.q for past in possible])
            needed = apart(self.robot, q, led) + np.array([past.corrected for past in possible])
            self._need(now, min(seen, possible[0].time), needed)
            self.worst = max(self.worst, float(np.abs(self._error).max()))
            self._feel(q, v, torques, since)

    def _need(self, now: float, seen: float, needed: Array) -> None:
        """Take what corrections (n, dof) may have to come to, as it was seen: the mean, once the motion is over."""
        if self.status is not RunnerStatus.SETTLING or seen < self._over:
            self._needs.clear()
        self._needs.append((now, needed.min(axis=0), needed.max(axis=0)))
        while self._needs[0][0] < now - AVERAGED:
            self._needs.popleft()
        _, least, largest = zip(*self._needs, strict=True)
        self._needed = np.mean(least, axis=0), np.mean(largest, axis=0)

    def _begin(self, q: Array) -> None:
        try:
            self.motion.begin(q)
        except InvalidInputError as error:
            self._end(RunnerStatus.NOT_THERE, str(error))
            return
        self._wanted = self.motion.step(0.0)
        self._past.clear()
        self._has_begun, self._felt = True, self._heard
        self._error, self.status = apart(self.robot, q, self._wanted.q), RunnerStatus.MOVING
        self._needed = self._error, self._error

    def _feel(self, q: Array, v: Array | None, torques: Array | None, since: float) -> None:
        """Look for contact."""
        if self._observer is None or v is None or torques is None or since <= 0.0:
            return
        self._felt = self._heard
        step = self._observer.step(q, v, torques, since)
        if step.joints:
            joint = self.robot.joint_names.index(step.joints[0])
            torque = float(step.external_torque[joint])
            self._end(RunnerStatus.CONTACT, f"{step.joints[0]} feels {torque:.3g} N m that the motion does not explain")

    def _judge(self, now: float, age: float) -> None:
        """End, wait or go on, by what is known now."""
        options, far = self.options, np.abs(self._error)
        joint = int(np.argmax(far))
        off = f"{self.robot.joint_names[joint]} is {in_words(self.robot, joint, far[joint], '.1f')} off the motion"
        if far[joint] > options.lag:
            self._end(RunnerStatus.BEHIND, f"{off} ({in_words(self.robot, joint, options.lag)} allowed)")
            return
        if self.status is RunnerStatus.SETTLING:
            if self.stands and self.away < options.reached:
                self._end(RunnerStatus.ARRIVED, "")
            elif now - self._over > options.patience:
                self._end(RunnerStatus.MISSED, f"{off} {options.patience:g} s after its end")
            return
        careful = not self._is_latency_known or self._measurement.loses
        # Half, while it is not known how late the arm is seen, and where much of what is sent is lost.
        allowed = 0.5 * options.lag if careful else options.lag
        share = (WAITS * allowed - far[joint]) / ((WAITS - FULL) * allowed)
        late = age > min(0.5 * options.silence, self.latency + MISSING * self._period)
        goal = 0.0 if late else min(1.0, max(0.0, share))
        self._rate += float(np.clip(goal - self._rate, -TICK / RAMP, TICK / RAMP))
        self._waits = self._waits + TICK if self._rate < 0.05 else 0.0
        if self._waits > BLOCKED + (0.0 if self._is_latency_known else MOST):
            self._end(RunnerStatus.BEHIND, f"{off}, and stays there")
        elif self.motion.is_over:
            self.status, self._over = RunnerStatus.SETTLING, now

    def _lead(self) -> Array:
        """The velocities of this tick (dof,) [rad/s]."""
        options, limit = self.options, self.robot.velocity_limit
        error = np.clip(self._corrected, *self._needed) - self._corrected
        if self.status is RunnerStatus.SETTLING:
            error = np.where(np.abs(error) < NEAR * options.reached, 0.0, error)
        forward = np.zeros(self.robot.dof)
        q = self._wanted.q - error
        if self.status is RunnerStatus.MOVING:
            self._wanted = self.motion.step(self._rate * TICK)
            forward = self._rate * self._wanted.v
        most = options.correction * limit
        v = np.clip(forward + np.clip(options.gain * error, -most, most), -limit, limit)
        low, high = (self.robot.lower - q) / HORIZON, (self.robot.upper - q) / HORIZON
        v = np.clip(v, np.minimum(low, 0.0), np.maximum(high, 0.0))
        self._corrected = self._corrected + (v - forward) * TICK
        return v

    def _end(self, status: RunnerStatus, message: str) -> None:
        if not self.status.has_ended:
            self.status, self.message = status, message
