"""`lead`: a device through teleoperation, tick by tick, and the `Session` that says what happened."""

from __future__ import annotations

import math
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeVar

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik.results import Frozen
from jacokin.model import checks
from jacokin.motion.tracking.steps import TrackerStatus
from jacokin.motion.tracking.tracker import STILL
from jacokin.motion.trajectory import SPEED_ROUNDING, Trajectory, changes
from jacokin.teleop.devices import Device
from jacokin.teleop.teleop import Teleop, TeleopStatus, TeleopStep

SETTLED = 1e-6  # relative, of a target that moves no more
HOLD = 5.0  # [s] for which the last pose of a recording holds at most

T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False)
class Session(Frozen):
    """What came of leading the arm. Arrays are read-only."""

    motion: Trajectory
    """The joint angles that were commanded, from where the arm was at first."""
    statuses: Mapping[str, int]
    """Ticks by the name of their `TeleopStatus`."""
    faults: Mapping[str, int]
    """Ticks by what was wrong with the input, or with the device that failed to say something."""
    tracking: Mapping[str, int]
    """Ticks in which the tool followed, by the name of their `TrackerStatus`."""
    limiting: Mapping[str, int]
    """Ticks in which each limit, pair of shapes or singular pose held the tool back, most often first."""
    position_error: Array
    """(k,) distance between tool and target in each tick that followed, by forward kinematics [m]."""
    late: int
    """Ticks that began later than a tick after their time; 0 without pacing."""
    within_limits: bool
    """Whether every commanded configuration is within the joint limits, and no joint faster than its limit."""

    def __str__(self) -> str:
        """The session on one line."""
        counts = ", ".join(f"{name} {count}" for name, count in self.statuses.items()) or "no ticks"
        off = f"; at most {self.position_error.max():.2g} m off its target" if len(self.position_error) else ""
        faults = "".join(f"; {fault} ({count} ticks)" for fault, count in self.faults.items())
        limits = "kept" if self.within_limits else "broken"
        return f"{self.motion.duration:.2f} s: {counts}{off}; limits {limits}{faults}"


def lead(
    teleop: Teleop,
    device: Device,
    *,
    seconds: float = math.inf,
    paced: bool = True,
    act: Callable[[TeleopStep], bool] | None = None,
    stop: threading.Event | None = None,
) -> Session:
    """Let a device lead the arm; then open the clutch, brake, and end when the arm stands.

    A device that raises an exception counts as one that says nothing: the watchdog brakes, `Session.faults` has the
    reason, and the arm goes on when the device does.

    Args:
        teleop: what is led, with its clutch closed if the arm is to follow.
        device: what is read once a tick; keys and a gamepad work the clutch, too. One with an attribute `ended`, such
            as `Player`, ends the session: its last pose holds until the tool is there, for at most 5 s.
        seconds: for how long at most [s], from when somebody has opened a page that leads; infinite for as long as the
            device goes on.
        paced: whether ticks come in real time, or as fast as they can.
        act: gets every tick, to move a simulation; returns whether to go on. None for always.
        stop: once set, by another thread or a signal, the arm brakes and the session ends.

    Raises:
        InvalidInputError: a malformed argument.
    """
    checks.instance("teleop", teleop, Teleop, "a Teleop")
    if not callable(getattr(device, "read", None)):
        raise checks.refusal("device", "something with read(time), such as a Player", device)
    if seconds != math.inf:
        checks.positive("seconds", seconds, "s")
    checks.optional(checks.function, "act", act, "callable with a step, or None")
    check_stop(stop)
    dt, late = teleop.tracker.dt, 0
    stop = stop or threading.Event()
    leading = _Leading(teleop, device, act)
    if paced:
        wait_for_somebody(device, stop)
    began = time.monotonic()
    goes_on, is_led = True, True
    while goes_on and (is_led or float(np.abs(teleop.tracker.v).max()) > STILL):
        now = len(leading.steps) * dt
        late += paced and wait_until(began + now) > dt
        goes_on = leading.tick(now, is_led=is_led)
        if is_led and (now + 1.5 * dt > seconds or leading.held > HOLD or stop.is_set()):
            is_led = False
            teleop.clutch(False)
    return _summed_up(teleop, np.array(leading.rows), leading.steps, leading.faults, late)


class _Leading:
    """Ticks of a device that leads, and what came of them.

    Attributes:
        rows: joint angles, from where the arm was at first.
        steps: what each tick did.
        faults: what was wrong with the input, and how often.
        held: [s] for which the last pose of a device that has ended has been held; infinite once the tool is there.
    """

    def __init__(self, teleop: Teleop, device: Device, act: Callable[[TeleopStep], bool] | None) -> None:
        self._teleop, self._device, self._act = teleop, device, act
        self.rows, self.steps = [teleop.tracker.q], list[TeleopStep]()
        self.faults = Counter[str]()
        self.held = 0.0
        self._last: Array | None = None

    def tick(self, now: float, *, is_led: bool) -> bool:
        """Lead for a tick at a time [s]; returns whether to go on."""
        heard, fault = (self._last, "") if self.held > 0.0 else read_device(self._device, now)
        failed = work_clutch(self._teleop, self._device)
        heard, fault = (None, failed) if failed else (heard, fault)
        self._last = self._last if heard is None else heard
        asked = self.steps[-1].target if self.steps else None
        step = self._teleop.step(heard if is_led else None)
        self._count(fault or (step.message if step.status is TeleopStatus.BAD_INPUT else ""))
        self.rows.append(step.q)
        self.steps.append(step)
        goes_on = self._act is None or self._act(step)
        ended, failed = has_ended(self._device)
        self._count(failed)
        if ended:
            is_pose = self._last is not None and len(self._last) == 7
            # A last pose far from the one before waits for another that confirms it.
            waits = step.target is not None and (self.held == 0.0 or is_closing_in(step, asked))
            self.held = self.held + self._teleop.tracker.dt if is_pose and waits else math.inf
        return goes_on

    def _count(self, fault: str) -> None:
        if fault:
            self.faults[fault.partition(", got")[0]] += 1  # without the numbers, which differ


def check_stop(stop: object) -> None:
    """Check what is asked whether to end.

    Raises:
        InvalidInputError: nothing that can be asked.
    """
    if stop is not None and not callable(getattr(stop, "is_set", None)):
        raise checks.refusal("stop", "something with is_set(), such as a threading.Event, or None", stop)


def wait_for_somebody(device: Device, stop: threading.Event) -> None:
    """Wait until there is somebody who leads, nobody is to, or `stop` is set."""
    while not (getattr(device, "opened", True) or getattr(device, "ended", False) or stop.is_set()):
        time.sleep(0.05)  # [s]


def wait_until(due: float) -> float:
    """Wait for a time of `time.monotonic`; returns by how much it had passed before [s], negative if it had not."""
    late = time.monotonic() - due
    time.sleep(max(0.0, -late))
    return late


def is_closing_in(step: TeleopStep, asked: pin.SE3 | None) -> bool:
    """Whether a tool is still on its way to the target of a tick; `asked` is that of the tick before."""
    return (
        step.tracking.status is TrackerStatus.LIMITED
        or float(np.abs(step.v).max()) > STILL
        or not (asked is None or step.target is None or step.target.isApprox(asked, SETTLED))  # it is smoothed
    )


def told(question: Callable[[], T], silent: T) -> tuple[T, str]:
    """What a device answers, and why it failed, "" if it did not; `silent` where it failed."""
    try:
        return question(), ""
    except Exception as error:  # of whatever driver: an arm in motion must brake, not stop being led
        return silent, f"{type(error).__name__}: {error}"


def read_device(device: Device, now: float) -> tuple[Array | None, str]:
    """What a device says, and why it failed or says nothing; empty if it did not."""
    heard, fault = told(lambda: device.read(now), None)
    if heard is None and not fault:
        trouble, failed = told(lambda: str(getattr(device, "trouble", "")), "")
        return None, trouble or failed
    return heard, fault


def has_ended(device: Device) -> tuple[bool, str]:
    """Whether a device ends the session, and why it failed, "" if it did not."""
    return told(lambda: bool(getattr(device, "ended", False)), silent=False)


def asks_for_clutch(device: Device) -> tuple[bool, str]:
    """Whether a device asks for the clutch to change, and why it failed, "" if it did not."""

    def asks() -> bool:
        toggled = getattr(device, "toggled", None)
        return toggled is not None and bool(toggled())

    return told(asks, silent=False)


def work_clutch(teleop: Teleop, device: Device) -> str:
    """Open or close the clutch where a device asks for it; returns why the device failed, "" if it did not."""
    asked, failed = asks_for_clutch(device)
    if asked:
        teleop.clutch(not teleop.engaged)
    return failed


def _summed_up(teleop: Teleop, q: Array, steps: list[TeleopStep], faults: Counter[str], late: int) -> Session:
    """Measure what was commanded."""
    tracker, robot = teleop.tracker, teleop.tracker.robot
    followed = [(step, step.target) for step in steps if step.target is not None]
    errors = []
    for step, target in followed:
        tool = robot.forward_kinematics(step.q, tracker.frame) * tracker.tool
        errors.append(float(np.linalg.norm(tool.translation - target.translation)))
    t = checks.read_only(np.arange(len(q)) * tracker.dt)
    v = np.zeros_like(q)
    v[1:] = np.diff(q, axis=0) / tracker.dt
    limiting = Counter(name for step, _ in followed for name in step.tracking.limiting)
    is_slow_enough = bool((np.abs(v) <= tracker.velocity_limit + SPEED_ROUNDING).all())
    return Session(
        motion=Trajectory.of(robot, tracker.velocity_limit, (t, q, v, changes(t, v))),
        statuses=MappingProxyType(dict(Counter(step.status.name for step in steps))),
        faults=MappingProxyType(dict(faults.most_common())),
        tracking=MappingProxyType(dict(Counter(step.tracking.status.name for step, _ in followed))),
        limiting=MappingProxyType(dict(limiting.most_common())),
        position_error=checks.read_only(errors),
        late=late,
        within_limits=is_slow_enough and all(robot.within_limits(row) for row in q),
    )
