"""Hand devices: a space mouse, keys, a gamepad, and recorded streams, each read once a tick."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Iterable
from types import TracebackType
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, JacokinError, needed
from jacokin.model import checks
from jacokin.teleop.streams import Stream

KEY_HOLD = 0.15  # [s] a key counts as pressed after it was heard: terminals repeat keys, and do not say when it ends
MOST_REPORTS = 64  # that are read at once: hidapi keeps no more
REOPEN = 1.0  # [s] until an unplugged device is looked for again
KEYS = {  # key -> axis of the twist and its sign
    "w": (0, 1.0),
    "s": (0, -1.0),
    "a": (1, 1.0),
    "d": (1, -1.0),
    "r": (2, 1.0),
    "f": (2, -1.0),
    "j": (3, 1.0),
    "l": (3, -1.0),
    "i": (4, 1.0),
    "k": (4, -1.0),
    "u": (5, 1.0),
    "o": (5, -1.0),
}
FINGER_KEYS = {"g": 1.0, "h": -1.0}  # close and open
CLUTCH_KEY = "space"
STICKS = ((1, 0, -1.0), (0, 1, -1.0), (3, 4, -1.0), (2, 5, -1.0))  # of a gamepad: its axis, that of the twist, sign
BUTTONS = ((7, 2, 1.0), (6, 2, -1.0), (5, 3, 1.0), (4, 3, -1.0))  # triggers up and down, shoulders turn about x
CLOSE_BUTTON, OPEN_BUTTON, CLUTCH_BUTTON = 0, 1, 9
STICK_REST = 0.12  # a stick this near to its middle rests there
MOST_AXES = 64  # of a gamepad, and buttons


class Device(Protocol):
    """Anything that says what a hand does."""

    def read(self, time: float) -> Array | None:
        """A pose (7,) or twist (6,) for `Teleop.step`, None for nothing new; `time` [s] since the start."""


class Player:
    """Plays a stream as a device."""

    def __init__(self, stream: Stream) -> None:
        """Play from the beginning.

        Raises:
            InvalidInputError: not a stream.
        """
        self._stream = checks.instance("stream", stream, Stream, "a Stream")
        self._next = 0

    def read(self, time: float) -> Array | None:
        """The newest pose that has arrived since the last call."""
        arrived = int(np.searchsorted(self._stream.time, time, side="right"))
        if arrived <= self._next:
            return None
        self._next = arrived
        return np.asarray(self._stream.hand[arrived - 1])

    @property
    def ended(self) -> bool:
        """Whether everything has been played."""
        return self._next >= len(self._stream)


class Keyboard:
    """Keys of a terminal as twists: w s, a d, r f move along x, y, z; j l, i k, u o turn about them.

    Attributes:
        fingers: how fast the fingers are to close as of the last `read`: 1 while g is pressed, -1 while h is, else 0.
    """

    def __init__(self, *, speed: float = 0.05, turn: float = 0.3) -> None:
        """Start without keys.

        Args:
            speed: [m/s] while a key is pressed.
            turn: [rad/s] likewise.
        """
        self._size = np.repeat([checks.positive("speed", speed, "m/s"), checks.positive("turn", turn, "rad/s")], 3)
        self._pressed: dict[str, float] = {}
        self.fingers = 0.0

    def press(self, key: str, time: float) -> None:
        """Hear a key at a time [s]; others than those above do nothing."""
        if key in KEYS or key in FINGER_KEYS:
            self._pressed[key] = time

    def read(self, time: float) -> Array:
        """The twist of the keys that are pressed."""
        held = [key for key, when in self._pressed.items() if time - when < KEY_HOLD]
        self.fingers = sum(FINGER_KEYS.get(key, 0.0) for key in held)
        return np.asarray(_directions(held) * self._size)


class Controller:
    """Keys that are held and a gamepad, as somebody who sees them reports them, the viewer's page for example.

    Keys are those of `Keyboard`; "space" opens and closes the clutch. Of a gamepad in the standard layout the left
    stick moves along x and y, the triggers up and down; the right stick turns about z and y, the shoulder buttons about
    x; the lowest and the right button close and open the fingers, start works the clutch.

    Attributes:
        fingers: how fast the fingers are to close, from -1 to 1; as of the last report.
        ended: whether the session is to end.
    """

    def __init__(self, *, speed: float = 0.1, turn: float = 0.6) -> None:
        """Start without a report.

        Args:
            speed: [m/s] while a key is held, or a stick pushed all the way.
            turn: [rad/s] likewise.
        """
        self._size = np.repeat([checks.positive("speed", speed, "m/s"), checks.positive("turn", turn, "rad/s")], 3)
        self._news: Array | None = None
        self._clutch_held = False
        self._toggles = 0
        self.fingers, self.ended = 0.0, False

    def report(self, keys: Iterable[str] = (), axes: ArrayLike = (), buttons: ArrayLike = ()) -> None:
        """Say what is held now, many times a second; may be called from another thread than `read`.

        Args:
            keys: that are held; others than those above do nothing.
            axes: of a gamepad, from -1 to 1; missing ones rest.
            buttons: of a gamepad, from 0 to 1; missing ones are not pressed.

        Raises:
            InvalidInputError: malformed numbers; nothing has changed then.
        """
        pushed, pressed = _levels("axes", axes, -1.0), _levels("buttons", buttons, 0.0)
        held = set(keys)
        pushed = np.sign(pushed) * np.maximum(np.abs(pushed) - STICK_REST, 0.0) / (1.0 - STICK_REST)
        twist = _directions(held)
        for numbers, table in ((pushed, STICKS), (pressed, BUTTONS)):
            for number, axis, sign in table:
                twist[axis] += sign * numbers[number]
        fingers = sum(FINGER_KEYS.get(key, 0.0) for key in held) + pressed[CLOSE_BUTTON] - pressed[OPEN_BUTTON]
        clutch_held = CLUTCH_KEY in held or pressed[CLUTCH_BUTTON] > 0.5
        self._toggles += clutch_held and not self._clutch_held
        self._clutch_held = clutch_held
        self.fingers = min(max(float(fingers), -1.0), 1.0)
        self._news = np.clip(twist, -1.0, 1.0) * self._size

    def toggle(self) -> None:
        """Open or close the clutch."""
        self._toggles += 1

    def toggled(self) -> bool:
        """Whether the clutch is to change, once for each time it was asked for."""
        if not self._toggles:
            return False
        self._toggles -= 1
        return True

    def read(self, time: float) -> Array | None:
        """The twist (6,) of the last report; None where none came since the last call."""
        twist, self._news = self._news, None
        return twist


def _directions(keys: Iterable[str]) -> Array:
    """(6,) the axes that keys move or turn along, in units of the speeds."""
    twist = np.zeros(6)
    for key in keys:
        if key in KEYS:
            axis, sign = KEYS[key]
            twist[axis] += sign
    return twist


def _levels(name: str, values: ArrayLike, least: float) -> Array:
    """(MOST_AXES,) numbers from `least` to 1, zero where none are given."""
    given = checks.array(name, values, "numbers") if np.size(values) else np.zeros(0)
    if given.ndim != 1 or given.size > MOST_AXES or not np.isfinite(given).all():
        raise InvalidInputError(f"{name} must be at most {MOST_AXES} finite numbers, got {checks.shown(values)}")
    levels = np.zeros(MOST_AXES)
    levels[: given.size] = np.clip(given, least, 1.0)
    return levels


class Fingers:
    """An opening of the hand that keys or buttons change, at a speed and within limits.

    Attributes:
        angle: of the fingers [rad], open at the lower limit.
    """

    def __init__(self, angle: float, *, lower: float, upper: float, speed: float = 0.8) -> None:
        """Start at an angle.

        Args:
            angle: [rad].
            lower: least angle, where the hand is open [rad].
            upper: largest angle [rad].
            speed: [rad/s] of fingers that close with all force.

        Raises:
            InvalidInputError: malformed numbers, or the lower limit above the upper.
        """
        self._lower, self._upper = checks.number("lower", lower, "rad"), checks.number("upper", upper, "rad")
        if not self._lower <= self._upper:
            raise InvalidInputError(f"lower {lower} must not be above upper {upper}")
        self._speed = checks.positive("speed", speed, "rad/s")
        self.angle = min(max(checks.number("angle", angle, "rad"), self._lower), self._upper)

    def move(self, closing: float, dt: float) -> float:
        """The angle [rad] after closing for `dt` [s], at a part of the speed from -1 to 1."""
        self.angle = min(max(self.angle + closing * self._speed * dt, self._lower), self._upper)
        return self.angle


class SpaceMouse:
    """A space mouse (extra `spacemouse`, package pyspacemouse) as twists: x to the right, y away from you, z up."""

    def __init__(self, *, speed: float = 0.1, turn: float = 0.6) -> None:
        """Open the first one that is plugged in.

        Args:
            speed: [m/s] when the cap is pushed all the way.
            turn: [rad/s] when it is turned all the way.

        Raises:
            MissingExtraError: pyspacemouse is not installed.
            JacokinError: none is plugged in, or it cannot be opened.
        """
        self._size = np.repeat([checks.positive("speed", speed, "m/s"), checks.positive("turn", turn, "rad/s")], 3)
        with needed("pyspacemouse", "spacemouse"):
            import pyspacemouse  # noqa: F401 - looked for here, opened below
        try:
            self._device = _open_space_mouse()
        except Exception as error:  # the package's own, hidapi's, the system's
            raise JacokinError(f"no space mouse can be opened: {error}") from error
        self._heard = -math.inf  # [s] of the last report, by the package's clock
        self._retry = 0.0  # [s] when an unplugged one is looked for again

    def read(self, time: float) -> Array | None:
        """The twist of the newest report, which holds until the next; None where the mouse is unplugged.

        An unplugged one is looked for again once a second.
        """
        if self._device is None:
            if time < self._retry:
                return None
            self._retry = time + REOPEN
            try:
                self._device = _open_space_mouse()
            except Exception:  # still unplugged
                return None
        try:
            state = self._newest()
        except Exception:  # unplugged, whichever of the packages below says so
            state = None
        if state is None or not self._device.connected:  # which repeats its last state
            self._let_go()
            return None
        return twist_of_space_mouse(state, self._size)

    def _newest(self) -> Any:
        """The state after all reports that wait: a call of the package reads one, the mouse may send more in a tick."""
        for _ in range(MOST_REPORTS):
            state = self._device.read()
            before, self._heard = self._heard, state.t
            if self._heard == before:
                break
        return state

    def _let_go(self) -> None:
        """Close the device, which may be gone."""
        device, self._device = self._device, None
        if device is not None:
            with contextlib.suppress(Exception):
                device.close()

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Close the device."""
        self._let_go()


def _open_space_mouse() -> Any:  # Any: of a package that is not always there
    """The first one that is plugged in; raises what the package, hidapi and the system raise."""
    import pyspacemouse

    # It prints what it found, and standard output is the program's. Its older conventions turn about other axes than
    # they move along.
    with contextlib.redirect_stdout(sys.stderr):
        return pyspacemouse.open(axis_convention=pyspacemouse.AxisConvention.HID_Z_UP)


def twist_of_space_mouse(state: Any, size: Array) -> Array:
    """Twist (6,) of pyspacemouse's state: numbers from -1 to 1, x to the right, y away from the hand, z up.

    Raises:
        InvalidInputError: the state lacks an axis.
    """
    try:
        axes = [state.x, state.y, state.z, state.roll, state.pitch, state.yaw]
        return np.asarray(size * np.array(axes, dtype=np.float64))
    except (AttributeError, TypeError, ValueError) as error:
        raise InvalidInputError(f"not what a space mouse says: {error}") from error
