"""`run`: a runner and the `Link` to an arm, at 100 Hz: `TwinLink` to a simulated arm, `ProcessLink` to a forwarder."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import time
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.files import reason
from jacokin.model import checks
from jacokin.runner.runner import Measured, Runner, RunnerStatus
from jacokin.twin import KinovaDriver, TrajectoryController
from jacokin.twin.arm import ArmController
from jacokin.twin.faults import TICK

LONGEST = 1 << 16  # bytes of a line
LEAVING = 2.0  # [s] that a forwarder may take to leave
PATIENCE = 10.0  # [s] until an arm says where it is, and listens
ENDING = 1.5  # [s] for which zeros are sent and the arm is measured, at most
ZEROS = 5  # at least


class Link(Protocol):
    """The way to an arm, and the clock beside it."""

    def now(self) -> float:
        """Seconds by the clock of the arm, or the wall."""

    def wait(self, until: float) -> None:
        """Let the time come [s]."""

    def hear(self) -> Measured | None:
        """The newest that came since the last call; None for nothing.

        Raises:
            InvalidInputError: the way is cut, or nobody is at its other end; says why.
        """

    @property
    def listens(self) -> bool:
        """Whether velocities that are sent now arrive."""

    def send(self, v: Array) -> None:
        """Send velocities (dof,) for a tick [rad/s]."""

    def move_fingers(self, share: float) -> None:
        """Let the fingers go, 0 open to 1 closed."""

    def close(self) -> None:
        """Leave; whoever is at the other end stops the arm."""


class TwinLink:
    """A simulated arm, whose time passes as it is waited for.

    Attributes:
        driver: that it ticks.
    """

    listens = True

    def __init__(self, driver: KinovaDriver | TrajectoryController, *, period: float = 0.1, pace: bool = False) -> None:
        """Lead to a driver.

        Args:
            driver: Kinova's, or a controller of ros2_control.
            period: in which it tells its state [s].
            pace: True to take as long as a real arm.

        Raises:
            InvalidInputError: one is something else.
        """
        checks.instance("driver", driver, ArmController, "a KinovaDriver or a TrajectoryController")
        self.driver = driver
        self._every = max(1, round(min(checks.positive("period", period, "s"), 1e6) / TICK))  # [s]: as good as never
        self._pace = checks.flag("pace", pace)
        self._ticks, self._told = 0, self._tell()

    def now(self) -> float:
        """Seconds by the clock of the arm, or the wall."""
        return self._ticks * TICK

    def wait(self, until: float) -> None:
        """Let the time come [s]."""
        while self.now() < until - 0.5 * TICK:
            self.driver.tick()
            self._ticks += 1
            if self._ticks % self._every == 0:
                self._told = self._tell() or self._told
            if self._pace:
                time.sleep(TICK)

    def _tell(self) -> Measured | None:
        state = self.driver.tell()
        return None if state is None else Measured(state.q, state.v, state.torques)

    def hear(self) -> Measured | None:
        """The newest that the driver told since the last call; None for nothing."""
        told, self._told = self._told, None
        return told

    def send(self, v: Array) -> None:
        """Send velocities (dof,) for a tick [rad/s]."""
        if isinstance(self.driver, KinovaDriver):
            self.driver.joint_velocity(v)
        else:
            self.driver.velocity(v)

    def move_fingers(self, share: float) -> None:
        """Let the fingers go, 0 open to 1 closed."""
        driver, (lower, upper) = self.driver, self.driver.arm.finger_range
        angles = np.full(len(driver.arm.state.fingers), lower + share * (upper - lower))
        driver.move_fingers(driver.finger_turns(angles) if isinstance(driver, KinovaDriver) else angles)

    def close(self) -> None:
        """Leave; whoever is at the other end stops the arm."""


class ProcessLink:
    """A forwarder, a process that reads lines of JSON and writes some: see `jacokin.runner.forwarder`.

    It may be anywhere: the command may be `ssh` or `docker exec -i`.
    """

    def __init__(self, command: Sequence[str], joints: Sequence[str]) -> None:
        """Start it.

        Args:
            command: the program and its words.
            joints: names of the joints, from the base to the tool, with any prefix where they are measured.

        Raises:
            InvalidInputError: it does not start, or is not a list of words.
        """
        words = [checks.text("a word of command", word) for word in checks.listed("command", command)]
        names = [checks.text("a name of joints", name) for name in checks.listed("joints", joints)]
        if not words:
            raise checks.refusal("command", "a program and its words", command)
        pipe = subprocess.PIPE
        try:  # a session of its own: Ctrl-C is for the runner, which stops the arm first
            self._process = subprocess.Popen(words, stdin=pipe, stdout=pipe, start_new_session=True)
        except (OSError, ValueError) as error:
            raise InvalidInputError(f"{words[0]!r} does not start: {reason(error)}") from error
        assert self._process.stdout is not None
        assert self._process.stdin is not None
        self._out, self._in = self._process.stdout.fileno(), self._process.stdin.fileno()
        os.set_blocking(self._out, False)
        os.set_blocking(self._in, False)
        self._held, self._unsent, self._lacking = b"", b"", ""
        self._topics: dict[str, str] = {}
        self.listens = self._is_closed = False
        with contextlib.suppress(InvalidInputError):  # one that has left already: what it said is heard first
            self._say({"joints": names})

    def now(self) -> float:
        """Seconds by the clock of the arm, or the wall."""
        return time.monotonic()

    def wait(self, until: float) -> None:
        """Let the time come [s]."""
        ahead = until - time.monotonic()
        if ahead > 0.0:
            time.sleep(ahead)

    def hear(self) -> Measured | None:
        """The newest that the driver told since the last call; None for nothing."""
        newest: Measured | None = None
        for line in self._lines():
            try:
                fields: dict[str, Any] = json.loads(line)
                if "error" in fields:
                    raise InvalidInputError(str(fields["error"]))
                self.listens = bool(fields.get("listens", self.listens))
                self._topics.update({name: str(fields[name]) for name in ("velocities", "states") if name in fields})
                if fields.get("missing"):
                    missing, heard = (", ".join(map(str, fields.get(name, ()))) for name in ("missing", "heard"))
                    self._lacking = f"joint states have {heard}, and no {missing}"
                if "q" in fields:
                    q, v, torques = (_array(fields.get(name)) for name in ("q", "v", "torques"))
                    newest = newest if q is None else Measured(q, v, torques)
            except (ValueError, TypeError, AttributeError) as error:
                if isinstance(error, InvalidInputError):
                    raise
                raise InvalidInputError(f"the forwarder says what is no line of it: {line[:80]!r}") from error
        return newest

    @property
    def lacking(self) -> str:
        """What is missing until an arm moves: of which topic, or which joints; "" where the forwarder does not tell."""
        if self.listens and self._lacking:
            return self._lacking
        topic = self._topics.get("states" if self.listens else "velocities")
        return "" if topic is None else f"nobody is at {topic}"

    def _lines(self) -> list[bytes]:
        """The whole lines that have come."""
        self._check_open()
        while select.select([self._out], [], [], 0.0)[0]:
            part = os.read(self._out, LONGEST)
            if not part:
                if b"\n" not in self._held:
                    raise InvalidInputError("the forwarder has left: the arm stops because velocities stop")
                break
            self._held += part
            if len(self._held) > 4 * LONGEST:
                raise InvalidInputError("the forwarder says more than anybody can hear")
        *lines, self._held = self._held.split(b"\n")
        return lines

    def send(self, v: Array) -> None:
        """Send velocities (dof,) for a tick [rad/s]; they are lost where the pipe is full, as of one that hangs."""
        self._say({"v": v.tolist()})

    def move_fingers(self, share: float) -> None:
        """Let the fingers go, 0 open to 1 closed."""
        self._say({"fingers": share})

    def _check_open(self) -> None:
        """Refuse to use what was closed: its numbers may be those of other files by now."""
        if self._is_closed:
            raise InvalidInputError("the link to the arm is closed")

    def _say(self, fields: dict[str, Any]) -> None:
        self._check_open()
        if not self._unsent:
            self._unsent = json.dumps(fields).encode() + b"\n"
        try:
            self._unsent = self._unsent[os.write(self._in, self._unsent) :]
        except BlockingIOError:
            pass
        except OSError as error:
            raise InvalidInputError("the forwarder has left: the arm stops because velocities stop") from error

    def close(self) -> None:
        """Leave; whoever is at the other end stops the arm."""
        self._is_closed = True
        for stream in (self._process.stdin, self._process.stdout):
            if stream is not None:
                with contextlib.suppress(OSError):
                    stream.close()
        try:
            self._process.wait(LEAVING)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _array(values: object) -> Array | None:
    return None if values is None else np.array(values, dtype=np.float64)


def run(runner: Runner, link: Link, *, fingers: float | None = None, watch: Callable[[], None] | None = None) -> None:
    """Lead an arm along the motion of a runner; `runner.status` then says how it ended.

    Args:
        runner: that has not begun.
        link: to its arm. It is not closed.
        fingers: where they go meanwhile, 0 open to 1 closed; None to leave them alone.
        watch: called every tick.

    Raises:
        InvalidInputError: the arm does not say where it is, or does not listen, within 10 s, or the link is cut; or
            fingers are not from 0 to 1.
        KeyboardInterrupt: as it came; the arm was told to stop.
    """
    checks.instance("runner", runner, Runner, "a Runner")
    checks.optional(checks.function, "watch", watch)
    if fingers is not None and checks.non_negative("fingers", fingers) > 1.0:
        raise checks.refusal("fingers", "at most 1", fingers)
    begun = due = link.now()
    try:
        while not runner.status.has_ended:
            due = max(due + TICK, link.now())  # what is late is not made up for: the driver would keep it in its queue
            link.wait(due)
            measured = link.hear()
            is_first = runner.status is RunnerStatus.WAITING
            if is_first and not (link.listens and measured is not None):
                if link.now() - begun > PATIENCE:
                    what = "says where it is" if link.listens else "listens to velocities"
                    lacking = getattr(link, "lacking", "")  # only of a forwarder
                    raise InvalidInputError(f"no arm {what} (waited {PATIENCE:g} s){lacking and ': ' + lacking}")
                continue
            if not link.listens:
                runner.lose()  # for good: a driver that comes back finds nobody who moves its arm
            step = runner.step(link.now(), measured)
            if is_first and fingers is not None and not step.status.has_ended:
                link.move_fingers(fingers)
            link.send(step.v)
            if watch is not None:
                watch()
    except BaseException:
        with contextlib.suppress(InvalidInputError):  # where the link is cut: why it ended is said, as it came
            _come_to_rest(runner, link)
        raise
    _come_to_rest(runner, link)


def _come_to_rest(runner: Runner, link: Link) -> None:
    """End the motion, and send zeros until the arm stands."""
    runner.stop()
    due = begun = link.now()
    sent, still = 0, np.zeros(runner.robot.dof)
    while sent < ZEROS or (link.now() - begun < ENDING and not runner.stands):
        link.send(still)
        sent += 1
        due = max(due + TICK, link.now())
        link.wait(due)
        measured = link.hear()
        with contextlib.suppress(InvalidInputError):  # zeros are sent, whatever the arm says
            runner.step(link.now(), measured)
