"""Hand devices: a space mouse, keys, a gamepad, and recorded streams, each read once a tick."""

from __future__ import annotations

import contextlib
import math
import sys
from collections.abc import Iterable
from typing import Any, Protocol, Self

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, JacokinError, needed
from jacokin.model import checks
from jacokin.model.gripper import opening_range
from jacokin.model.robot import Robot, checked_robot
from jacokin.teleop.streams import Stream

SILENT = 5.0  # [s] without a report, after which a space mouse is in trouble
MOUSE_AXES = ("x", "y", "z", "roll", "pitch", "yaw")
UDEV_RULE = 'KERNEL=="hidraw*", ATTRS{idVendor}=="256f|046d", TAG+="uaccess"'  # 3Dconnexion and, before, Logitech
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
CLOSING = 1.5  # [s] that a measured gripper takes from open to shut, as a Jaco's hand does
FINGER_KEYS = {"g": 1.0, "h": -1.0}  # close and open
CLUTCH_KEY = "space"
BEGIN, END, KEEP, DISCARD = "begin", "end", "keep", "discard"  # of an episode, what a hand may ask for
COMMAND_KEYS = {"b": BEGIN, "e": END, "y": KEEP, "x": DISCARD}
STICKS = ((1, 0, -1.0), (0, 1, -1.0), (3, 4, -1.0), (2, 5, -1.0))  # of a gamepad: its axis, that of the twist, sign
BUTTONS = ((7, 2, 1.0), (6, 2, -1.0), (5, 3, 1.0), (4, 3, -1.0))  # triggers up and down, shoulders turn about x
CLOSE_BUTTON, OPEN_BUTTON, CLUTCH_BUTTON = 0, 1, 9
COMMAND_BUTTONS = {8: BEGIN, 3: KEEP, 2: DISCARD}  # select, the highest, and the left one
STICK_REST = 0.12  # a stick this near to its middle rests there
MOST_AXES = 64  # of a gamepad, and buttons


class Device(Protocol):
    """Anything that says what a hand does.

    Beside `read` it may have `ended`, whether the session is to end; `opened`, False until there is somebody who leads;
    `fingers`, how fast the fingers are to close, from -1 to 1; `toggled()`, whether the clutch is to change, asked once
    a tick; `commands()`, what it asks for in `demonstrate`; `reset(time)`, to begin anew with an episode; and
    `trouble`, why it says nothing.
    """

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
        self.reset()

    def reset(self, time: float = 0.0) -> None:
        """Play from the beginning, from a time [s] on."""
        self._began = time
        self._next = 0

    def read(self, time: float) -> Array | None:
        """The newest pose that has arrived since the last call."""
        arrived = int(np.searchsorted(self._stream.time, time - self._began, side="right"))
        if arrived <= self._next:
            return None
        self._next = arrived
        return np.asarray(self._stream.hand[arrived - 1])

    @property
    def ended(self) -> bool:
        """Whether everything has been played."""
        return self._next >= len(self._stream)


class _KeyRequests:
    """What keys ask for beside motion: the clutch, and commands."""

    def __init__(self) -> None:
        self._toggles = 0
        self._commands: list[str] = []

    def toggle(self) -> None:
        """Open or close the clutch."""
        self._toggles += 1

    def toggled(self) -> bool:
        """Whether the clutch is to change, once for each time it was asked for."""
        if not self._toggles:
            return False
        self._toggles -= 1
        return True

    def command(self, name: str) -> None:
        """Ask for "begin", "end", "keep" or "discard", see `demonstrate`."""
        self._commands.append(checks.choice("name", name, (BEGIN, END, KEEP, DISCARD)))

    def commands(self) -> list[str]:
        """What was asked for since the last call."""
        return [self._commands.pop(0) for _ in range(len(self._commands))]  # another thread may ask meanwhile


class Keyboard(_KeyRequests):
    """Keys of a terminal as twists: w s, a d, r f move along x, y, z; j l, i k, u o turn about them.

    "space" opens and closes the clutch; b, e, y and x ask to begin an episode, to end, to keep and to discard it.

    Attributes:
        fingers: how fast the fingers are to close as of the last `read`: 1 while g is pressed, -1 while h is, else 0.
    """

    def __init__(self, *, speed: float = 0.05, turn: float = 0.3) -> None:
        """Start without keys.

        Args:
            speed: [m/s] while a key is pressed.
            turn: [rad/s] likewise.
        """
        super().__init__()
        self._size = np.repeat([checks.positive("speed", speed, "m/s"), checks.positive("turn", turn, "rad/s")], 3)
        self._pressed: dict[str, float] = {}
        self.fingers = 0.0

    def press(self, key: str, time: float) -> None:
        """Hear a key at a time [s]; others than those above do nothing.

        Raises:
            InvalidInputError: key is not a text, or time not a number.
        """
        checks.text("key", key)
        if key in KEYS or key in FINGER_KEYS:
            self._pressed[key] = checks.number("time", time, "s")
        elif key == CLUTCH_KEY:
            self.toggle()
        elif key in COMMAND_KEYS:
            self.command(COMMAND_KEYS[key])

    def read(self, time: float) -> Array:
        """The twist of the keys that are pressed."""
        # [s] so long after it was heard: terminals repeat keys, and do not say when one ends.
        held = [key for key, when in self._pressed.items() if time - when < 0.15]
        self.fingers = sum(FINGER_KEYS.get(key, 0.0) for key in held)
        return np.asarray(_directions(held) * self._size)


class Controller(_KeyRequests):
    """Keys that are held and a gamepad, as somebody who sees them reports them, the viewer's page for example.

    Keys are those of `Keyboard`. Of a gamepad in the standard layout the left stick moves along x and y, the triggers
    up and down; the right stick turns about z and y, the shoulder buttons about x; the lowest and the right button
    close and open the fingers, start works the clutch; select begins an episode, the highest button keeps it, the left
    one discards it.

    Attributes:
        fingers: how fast the fingers are to close, from -1 to 1; as of the last report.
        ended: whether the session is to end.
        opened: whether anything has reported yet.
    """

    def __init__(self, *, speed: float = 0.1, turn: float = 0.6) -> None:
        """Start without a report.

        Args:
            speed: [m/s] while a key is held, or a stick pushed all the way.
            turn: [rad/s] likewise.
        """
        self._size = np.repeat([checks.positive("speed", speed, "m/s"), checks.positive("turn", turn, "rad/s")], 3)
        super().__init__()
        self._news: Array | None = None
        self._held: set[str] = set()  # of the clutch and of commands, as of the last report
        self.fingers, self.ended, self.opened = 0.0, False, False

    def report(self, keys: Iterable[str] = (), axes: ArrayLike = (), buttons: ArrayLike = ()) -> None:
        """Say what is held now, many times a second; may be called from another thread than `read`.

        Args:
            keys: that are held; others than those above do nothing.
            axes: of a gamepad, from -1 to 1; missing ones rest.
            buttons: of a gamepad, from 0 to 1; missing ones are not pressed.

        Raises:
            InvalidInputError: malformed keys or numbers; nothing has changed then.
        """
        pushed, pressed = _levels("axes", axes, -1.0), _levels("buttons", buttons, 0.0)
        try:
            held = set(keys)
        except TypeError:
            raise checks.refusal("keys", "names of keys", keys) from None
        pushed = np.sign(pushed) * np.maximum(np.abs(pushed) - STICK_REST, 0.0) / (1.0 - STICK_REST)
        twist = _directions(held)
        for numbers, table in ((pushed, STICKS), (pressed, BUTTONS)):
            for number, axis, sign in table:
                twist[axis] += sign * numbers[number]
        fingers = sum(FINGER_KEYS.get(key, 0.0) for key in held) + pressed[CLOSE_BUTTON] - pressed[OPEN_BUTTON]
        asked = {name for key, name in COMMAND_KEYS.items() if key in held}
        asked |= {name for button, name in COMMAND_BUTTONS.items() if pressed[button] > 0.5}
        if CLUTCH_KEY in held or pressed[CLUTCH_BUTTON] > 0.5:
            asked.add(CLUTCH_KEY)
        before, self._held, self.opened = self._held, asked, True
        for name in sorted(asked - before):
            if name == CLUTCH_KEY:
                self.toggle()
            else:
                self.command(name)
        self.fingers = min(max(float(fingers), -1.0), 1.0)
        self._news = np.clip(twist, -1.0, 1.0) * self._size

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
    given = checks.array(name, values, "numbers")
    if given.ndim != 1 or given.size > MOST_AXES or not np.isfinite(given).all():
        raise InvalidInputError(f"{name} must be at most {MOST_AXES} finite numbers, got {checks.shown(values)}")
    levels = np.zeros(MOST_AXES)
    levels[: given.size] = np.clip(given, least, 1.0)
    return levels


class Fingers:
    """An opening of the hand that keys or buttons change, at a speed and within limits.

    Attributes:
        angle: of the fingers [rad], or [m] where they slide.
    """

    def __init__(
        self, angle: float, *, lower: float, upper: float, speed: float = 0.8, open_at_upper: bool = False
    ) -> None:
        """Start at an angle.

        Args:
            angle: [rad].
            lower: least angle [rad].
            upper: largest angle [rad].
            speed: [rad/s] of fingers that close with all force.
            open_at_upper: whether the hand is open at the upper limit; else it is at the lower one.

        Raises:
            InvalidInputError: malformed numbers, or the lower limit above the upper.
        """
        self._lower, self._upper = checks.number("lower", lower, "rad"), checks.number("upper", upper, "rad")
        if not self._lower <= self._upper:
            raise InvalidInputError(f"lower {lower} must not be above upper {upper}")
        closing = checks.positive("speed", speed, "rad/s")
        self._speed = -closing if checks.flag("open_at_upper", open_at_upper) else closing
        self.angle = min(max(checks.number("angle", angle, "rad"), self._lower), self._upper)

    @classmethod
    def of(cls, robot: Robot) -> Fingers:
        """The gripper of an arm, as open as the arm was loaded, else open; it closes in a second and a half.

        Raises:
            ModelError: the arm has no gripper, or one that cannot be measured; see `jacokin.model.Gripper`.
        """
        opened, shut = opening_range(checked_robot("robot", robot))
        at = opened if robot.finger_angle is None else robot.finger_angle
        lower, upper = sorted((opened, shut))
        return cls(at, lower=lower, upper=upper, speed=(upper - lower) / CLOSING, open_at_upper=opened > shut)

    def move(self, closing: float, dt: float) -> float:
        """The angle [rad] after closing for `dt` [s], at a part of the speed from -1 to 1.

        Raises:
            InvalidInputError: not numbers; nothing has changed then.
        """
        closing, dt = checks.number("closing", closing), checks.number("dt", dt, "s")
        self.angle = min(max(self.angle + closing * self._speed * dt, self._lower), self._upper)
        return self.angle


class SpaceMouse:
    """A space mouse (extra `spacemouse`, package pyspacemouse) as twists: x to the right, y away from you, z up.

    A mouse may have several interfaces, most of them silent, and several mice may be plugged in: the one that is moved
    first leads, until it is unplugged.

    Attributes:
        fingers: how fast the fingers are to close as of the last `read`: 1 while the first button is pressed, -1 while
            the second is, else 0.
        trouble: why it says nothing, as a sentence; "" while it does, or has not been waited for long.
    """

    def __init__(self, *, speed: float = 0.1, turn: float = 0.6) -> None:
        """Open every one that is plugged in.

        Args:
            speed: [m/s] when the cap is pushed all the way.
            turn: [rad/s] when it is turned all the way.

        Raises:
            MissingExtraError: pyspacemouse is not installed.
            JacokinError: none is plugged in, or none can be opened, for lack of permission for example.
        """
        self._size = np.repeat([checks.positive("speed", speed, "m/s"), checks.positive("turn", turn, "rad/s")], 3)
        with needed("pyspacemouse", "spacemouse"):
            import pyspacemouse  # noqa: F401 - looked for here, opened below
        self._open = _open_space_mice()
        self._leading: _Interface | None = None
        self._retry = 0.0  # [s] when an unplugged one is looked for again
        self._since: float | None = None  # [s] when it was first asked
        self.fingers, self.trouble = 0.0, ""

    def read(self, time: float) -> Array | None:
        """The twist of the newest report, which holds until the next; None before a mouse is moved, and unplugged.

        An unplugged one is looked for again once a second.
        """
        self._since = time if self._since is None else self._since
        if not self._open and time >= self._retry:
            self._retry = time + 1.0  # [s]
            with contextlib.suppress(JacokinError):  # still unplugged
                self._open = _open_space_mice()
                self._since = time
        for interface in list(self._open):
            if not interface.listen():
                self._let_go(interface)
            elif self._leading is None and interface.moves:
                self._leading = interface
        if self._leading is not None:
            for other in [each for each in self._open if each is not self._leading]:
                self._let_go(other)
            self.trouble, self.fingers = "", self._leading.fingers
            return twist_of_space_mouse(self._leading.state, self._size)
        self.fingers = 0.0
        if not self._open:
            self.trouble = "the space mouse is unplugged"
        elif time - self._since > SILENT:
            names = ", ".join(dict.fromkeys(each.name for each in self._open))
            self.trouble = f"nothing has come from {names} yet: push its cap, or plug it in anew"
        return None

    def _let_go(self, interface: _Interface) -> None:
        """Close an interface, which may be gone."""
        self._open.remove(interface)
        interface.close()
        if interface is self._leading:
            self._leading = None
            self._retry = 0.0

    def __enter__(self) -> Self:
        """Itself."""
        return self

    def __exit__(self, *raised: object) -> None:
        """Close what is open."""
        for interface in list(self._open):
            self._let_go(interface)


class _Interface:
    """One interface of a space mouse.

    Attributes:
        name: of the mouse.
        state: of the package, as of the newest report.
    """

    def __init__(self, name: str, device: Any) -> None:  # Any: of a package that is not always there
        self.name, self._device = name, device
        self.state: Any = None
        self._heard = -math.inf  # [s] of the last report, by the package's clock

    def listen(self) -> bool:
        """Read all reports that wait: a call of the package reads one, the mouse may send more in a tick.

        Returns:
            Whether it is still there.
        """
        try:
            for _ in range(64):  # hidapi keeps no more
                self.state = self._device.read()
                before, self._heard = self._heard, self.state.t
                if self._heard == before:
                    break
        except Exception:  # unplugged, whichever of the packages below says so
            return False
        return bool(self._device.connected)  # otherwise it repeats its last state

    @property
    def moves(self) -> bool:
        """Whether the newest report is of a cap or a button that is not at rest; of a battery, for example, it is."""
        return any(getattr(self.state, axis, 0.0) for axis in MOUSE_AXES) or any(self._buttons)

    @property
    def fingers(self) -> float:
        """1 while the first button is pressed, -1 while the second is, else 0."""
        pressed = [*self._buttons, 0, 0]
        return float(bool(pressed[0])) - float(bool(pressed[1]))

    @property
    def _buttons(self) -> list[int]:
        return list(getattr(self.state, "buttons", ()))

    def close(self) -> None:
        """Close it, if it is there."""
        with contextlib.suppress(Exception):
            self._device.close()


def _open_space_mice() -> list[_Interface]:
    """Every interface of every space mouse that can be opened.

    Raises:
        JacokinError: there is none; says why.
    """
    import pyspacemouse

    # It prints what it found, and standard output is the program's. Its older conventions turn about other axes than
    # they move along.
    convention = pyspacemouse.AxisConvention.HID_Z_UP
    found, reason = list[_Interface](), Exception("none is plugged in")
    with contextlib.redirect_stdout(sys.stderr):
        try:
            names = pyspacemouse.get_connected_devices() if hasattr(pyspacemouse, "get_connected_devices") else []
            if not names:  # it may know better, and says what is wrong
                return [_Interface("the space mouse", pyspacemouse.open(axis_convention=convention))]
        except Exception as error:  # the package's own, hidapi's, the system's
            raise JacokinError(_why_not_opened(error)) from error
        for number, name in enumerate(names):
            index = names[:number].count(name)  # a mouse has as many names here as interfaces
            try:
                device = pyspacemouse.open(device=name, device_index=index, axis_convention=convention)
            except Exception as error:  # as above
                reason = error
            else:
                found.append(_Interface(name, device))
    if not found:
        raise JacokinError(_why_not_opened(reason, list(dict.fromkeys(names)))) from reason
    return found


def _why_not_opened(error: Exception, names: list[str] | None = None) -> str:
    """A sentence about mice that cannot be opened; with names where there are some."""
    if names is None and not isinstance(error, PermissionError):
        return f"no space mouse can be opened: {error}"
    what = ", ".join(names or ["the space mouse"])
    return (
        f"{what} is plugged in and cannot be opened ({error}): this user lacks the permission, which a udev rule gives "
        f"({UDEV_RULE} in /etc/udev/rules.d/70-spacemouse.rules, then `udevadm control --reload` and plug it in anew), "
        "or another program holds it"
    )


def twist_of_space_mouse(state: Any, size: Array) -> Array:
    """Twist (6,) of pyspacemouse's state: numbers from -1 to 1, x to the right, y away from the hand, z up.

    Raises:
        InvalidInputError: the state lacks an axis.
    """
    try:
        axes = [getattr(state, axis) for axis in MOUSE_AXES]
        return np.asarray(size * np.array(axes, dtype=np.float64))
    except (AttributeError, TypeError, ValueError) as error:
        raise InvalidInputError(f"not what a space mouse says: {error}") from error
