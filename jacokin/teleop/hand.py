"""What a hand device says, in its own frame, what becomes of it, and the box that neither target nor tool leaves.

In its `Workspace` the target slows down before the walls. The tool does not go straight to a target that jumps, turns
or cannot be reached, so it is asked for a place near to it on the way, and a tick after which it could not stop inside
the box is not taken.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError
from jacokin.model import checks, poses
from jacokin.model.robot import Robot

GUARD = 0.2  # part of the inset: this far before the walls the tool already counts as outside
SLACK = 5e-5  # [m] that it may be beyond that: turning in one place needs some room
JUMP = 0.1  # [m] in a tick, after which somebody has put the arm elsewhere
AHEAD = (
    (0.02, 0.1),
    (2e-3, 0.01),
)  # [m], [rad] that the target is ahead of the tool at most; nearer it goes straighter
STOPS = 16  # places on the way to rest that are looked at


class Workspace:
    """A box in the base, and how far outside it the tool may still be."""

    def __init__(self, lower: Array, upper: Array) -> None:
        """Take the corners (3,) [m]."""
        self._lower, self._upper = lower, upper
        # [m] a tool that turns in its place moves by less; of a box that is flat, a tenth.
        inset = np.minimum(1e-3, 0.1 * (upper - lower))
        self._walls = lower + inset, upper - inset
        self._guarded = lower + GUARD * inset, upper - GUARD * inset
        self._allowed = self._guarded
        self._last: Array | None = None  # (3,) where the tool was a tick ago [m]

    def slowed(self, position: Array, way: Array) -> Array:
        """A way (3,) [m] from a position that slows towards walls and does not cross them; outside, only inwards."""
        lower, upper = self._walls
        room = np.maximum(np.where(way > 0.0, upper - position, position - lower), 0.0)
        slowed = np.abs(way) * np.minimum(room / 0.05, 1.0)  # [m] before a wall, from which the target slows
        return np.asarray(np.sign(way) * np.minimum(slowed, room))

    def tied(self, tool: pin.SE3) -> pin.SE3:
        """The pose of a tool that is tied to the hand, inside the box or as far outside as it started."""
        self.start_from(tool.translation)
        lower, upper = self._allowed
        inside = np.clip(tool.translation, np.minimum(self._lower, lower), np.maximum(self._upper, upper))
        return pin.SE3(tool.rotation, inside)

    def start_from(self, tool: Array) -> None:
        """Let the tool (3,) [m] be where it is now; as far outside as it is, it may be from now on, and no farther."""
        lower, upper = np.minimum(self._guarded[0], tool), np.maximum(self._guarded[1], tool)
        if self._last is not None and np.abs(tool - self._last).max() < JUMP:
            lower, upper = np.maximum(lower, self._allowed[0]), np.minimum(upper, self._allowed[1])
        self._allowed, self._last = (lower, upper), tool

    def keeps(
        self, robot: Robot, frame: int, tool: pin.SE3, q: Array, v: Array, acceleration: Array | None, dt: float
    ) -> bool:
        """Whether the tool stays inside, or no farther outside than it was, at `q` and while it brakes from there.

        Args:
            robot: the arm.
            frame: number of the frame that carries the tool.
            tool: T_frame_tool.
            q: (dof,) [rad].
            v: (dof,) [rad/s].
            acceleration: (dof,) by which joints brake [rad/s^2], infinite for those that stand at once; None for all.
            dt: control step [s].
        """
        rows = q[np.newaxis]
        if acceleration is not None and v.any():
            ticks = np.floor(np.abs(v) / (acceleration * dt))
            less = np.where(ticks > 0.0, acceleration * dt, 0.0)  # in every tick
            passed = np.minimum(np.round(np.linspace(0.0, ticks.max(), STOPS))[:, np.newaxis], ticks)
            rows = q + dt * np.sign(v) * (passed * np.abs(v) - 0.5 * less * passed * (passed + 1.0))
        return all(self.contains((robot.placement(row, frame) * tool).translation) for row in rows)

    def contains(self, place: Array) -> bool:
        """Whether the tool may be at a place (3,) [m]."""
        lower, upper = self._allowed
        return bool((place >= lower - SLACK).all() and (place <= upper + SLACK).all())


def checked_workspace(workspace: tuple[ArrayLike, ArrayLike] | None) -> Workspace | None:
    """A workspace from its lower and upper corner (3,) [m].

    Raises:
        InvalidInputError: not two corners, or the lower not below the upper.
    """
    if workspace is None:
        return None
    corners = checks.listed("workspace", workspace, "two corners, lower and upper")
    if len(corners) != 2:
        raise checks.refusal("workspace", "two corners, lower and upper", workspace)
    lower, upper = (checks.vector("workspace", corner, 3, "m") for corner in corners)
    if not (lower < upper).all():
        raise InvalidInputError(f"workspace: lower {lower.tolist()} must be below upper {upper.tolist()}")
    return Workspace(lower, upper)


LARGEST = 1e6  # [m], [m/s] or [rad/s] that a hand may say: squares of more could overflow
FORGETTING = 1.0  # [s] time constant by which a long gap between poses is forgotten
ROUNDING = 1e-6  # of times: gaps are sums of control steps
FASTEST = (3.0, 10.0)  # [m/s], [rad/s] that hands move and turn; frames that are farther from the last one are suspects
NOISE = (0.05, 0.2)  # [m], [rad] that a frame may be off however soon it comes


@dataclass(frozen=True, slots=True, eq=False)
class HandOptions(Sealed):
    """What a hand device is like; checked.

    Raises:
        InvalidInputError: a malformed number or rotation.
    """

    rotation_scale: float = 1.0
    """The tool turns this many times as far as the hand; 0 for no turning."""
    axes: ArrayLike | None = None
    """R_base_hand (3, 3), how the device's frame is turned against the base; None for not at all."""
    deadband: tuple[float, float] = (0.0, 0.0)
    """Of poses [m], [rad], of twists [m/s], [rad/s]: smaller motions of the hand move nothing."""
    watchdog: float = 0.1
    """Without input for this long, the arm brakes [s]."""

    def __post_init__(self) -> None:
        """Check every option once."""
        checks.non_negative("rotation_scale", self.rotation_scale)
        checks.positive("watchdog", self.watchdog, "s")
        _ = self.rotation, self.bands

    @property
    def rotation(self) -> Array:
        """The `axes` (3, 3)."""
        return np.eye(3) if self.axes is None else poses.checked_rotation("axes", self.axes)

    @property
    def bands(self) -> tuple[float, float]:
        """The `deadband`, linear and angular."""
        bands = checks.listed("deadband", self.deadband, "two numbers, linear and angular")
        if len(bands) != 2:
            raise checks.refusal("deadband", "two numbers, linear and angular", self.deadband)
        return checks.non_negative("deadband", bands[0]), checks.non_negative("deadband", bands[1])


def read_hand(hand: pin.SE3 | ArrayLike) -> pin.SE3 | Array:
    """A pose of the hand in its device's frame, or its twist (6,) [m/s, rad/s].

    Args:
        hand: a pose as `pin.SE3`, (4, 4), or (7,) position [m] and quaternion wxyz; or a twist (6,).

    Raises:
        InvalidInputError: neither, not finite, larger than any hand's, or a quaternion whose norm is not 1.
    """
    if isinstance(hand, pin.SE3):
        _near(hand.translation)
        return poses.checked_pose(hand, "hand")
    array = checks.array("hand", hand, "a pose (7,) or (4, 4), or a twist (6,)")
    if array.shape == (6,):
        return _near(checks.vector("hand", array, 6, "m/s, rad/s"))
    if array.shape == (7,):
        numbers = _near(checks.vector("hand", array, 7, "m"))
        return pin.SE3(poses.rotation_from_quat_wxyz(numbers[3:]), numbers[:3])
    if array.shape == (4, 4):
        return poses.checked_pose(_near(array), "hand")
    raise checks.refusal("hand", "a pose (7,) or (4, 4), or a twist (6,)", hand)


def _near(numbers: Array) -> Array:
    """Numbers of a hand; InvalidInputError where some are larger than any hand's."""
    if np.abs(numbers).max() > LARGEST:  # NaN goes on to the check that names it
        raise InvalidInputError(f"hand has a number above {LARGEST:g} [m, m/s, rad/s], got {numbers.tolist()}")
    return numbers


class Play:
    """A dead band for poses: the output stays until the hand is farther away, and then is dragged behind it.

    So a trembling hand moves nothing, and there is no jump where the band ends.
    """

    def __init__(self, linear: float, angular: float, pose: pin.SE3) -> None:
        """Begin at a pose, with a band of [m] and [rad]."""
        self._linear, self._angular, self.pose = linear, angular, pose

    def move(self, pose: pin.SE3) -> pin.SE3:
        """The output for a pose of the hand."""
        away = pose.translation - self.pose.translation
        turn = pin.log3(pose.rotation @ self.pose.rotation.T)
        rotation = pin.exp3(_shortened(turn, self._angular)) @ self.pose.rotation if self._angular else pose.rotation
        self.pose = pin.SE3(rotation, self.pose.translation + _shortened(away, self._linear))
        return self.pose


def dead(twist: Array, linear: float, angular: float) -> Array:
    """A twist (6,) less a band of [m/s] and [rad/s], zero inside it."""
    return np.concatenate([_shortened(twist[:3], linear), _shortened(twist[3:], angular)])


def _shortened(vector: Array, less: float) -> Array:
    """A vector (3,) shorter by `less`, zero where it is no longer than that."""
    length = math.sqrt(vector.dot(vector))
    return vector * max(0.0, 1.0 - less / length) if length > 0.0 else vector


class Mapping:
    """From motions of the hand to motions of the target, from the place where the clutch closed.

    Attributes:
        target: T_base_tool that the hand asks for.
    """

    def __init__(self, tool: pin.SE3, axes: Array, scale: float, rotation_scale: float) -> None:
        """Begin at the tool's pose; `axes` (3, 3) turns vectors of the hand's frame into the base."""
        self.target = tool
        self._axes, self._scale, self._rotation_scale = axes, scale, rotation_scale

    def shift(self, way: Array, turn: Array, workspace: Workspace | None) -> None:
        """Move the target by what the hand moved (3,) [m] and turned (3,) [rad], in the hand's frame."""
        way = self._scale * (self._axes @ way)
        if workspace is not None:
            way = workspace.slowed(self.target.translation, way)
        rotation = pin.exp3(self._rotation_scale * (self._axes @ turn)) @ self.target.rotation
        self.target = pin.SE3(rotation, self.target.translation + way)

    def in_base(self, twist: Array) -> Array:
        """A twist (6,) of the hand as one of the tool in base axes [m/s, rad/s]."""
        way, turn = self._axes.dot(twist[:3]), self._axes.dot(twist[3:])
        return np.concatenate([self._scale * way, self._rotation_scale * turn])


def near(tool: pin.SE3, target: pin.SE3, linear: float, angular: float) -> pin.SE3:
    """The pose on the way from the tool to a target that is at most [m] and [rad] from the tool."""
    away = target.translation - tool.translation
    turn = pin.log3(target.rotation @ tool.rotation.T)
    turn, away = turn - _shortened(turn, angular), away - _shortened(away, linear)
    return pin.SE3(pin.exp3(turn) @ tool.rotation, tool.translation + away)


class Witness:
    """Leaves out single frames that no hand can have made, such as those of a camera that mistook it for a moment.

    A pose that is farther from the last one than hands are fast waits for the next: if that is near to it, the hand has
    jumped; if not, the frame was wrong.
    """

    def __init__(self) -> None:
        """Begin without a pose."""
        self._last: tuple[pin.SE3, float] | None = None
        self._suspect: tuple[pin.SE3, float] | None = None

    def believes(self, pose: pin.SE3, time: float) -> bool:
        """Whether a pose of the hand is to be followed that came at a time [s]."""
        suspect, self._suspect = self._suspect, None
        believed = [known for known in (self._last, suspect) if known is not None]
        if believed and not any(_is_possible(*known, pose, time) for known in believed) and suspect is None:
            self._suspect = pose, time
            return False
        self._last = pose, time
        return True


def _is_possible(before: pin.SE3, since: float, after: pin.SE3, now: float) -> bool:
    """Whether a hand can have gone from one pose to another."""
    gap = max(now - since, 0.0)
    turn = pin.log3(after.rotation @ before.rotation.T)
    away = np.linalg.norm(after.translation - before.translation), np.linalg.norm(turn)
    return all(far <= max(noise, gap * fast) for far, noise, fast in zip(away, NOISE, FASTEST, strict=True))


class LowPass:
    """The target through a first-order low-pass.

    Attributes:
        latency: by which a target that moves steadily lags [s]: the time constant.
        part: of what is missing that a tick makes up for.
    """

    def __init__(self, pose: pin.SE3, constant: float, dt: float) -> None:
        """Begin at a pose, with a time constant [s], 0 for none, and the control step [s]."""
        self._pose, self.latency = pose, constant
        self.part = 1.0 if constant == 0.0 else -math.expm1(-dt / constant)

    @property
    def lag_of_twists(self) -> float:
        """By which a twist lags [s]."""
        return self.latency

    def start_from(self, pose: pin.SE3) -> None:
        """Go on from a pose, which something else has led to."""
        self._pose = pose

    def move(self, target: pin.SE3, is_new: bool) -> pin.SE3:
        """A tick nearer to the target."""
        self._pose = _between(self._pose, target, self.part)
        return self._pose


class SmoothedTarget:
    """The target without the steps of a hand that speaks more seldom than the arm ticks.

    Each new pose is approached straight, at the speed that leads there in two gaps between poses, the longest ones of
    about the last second. The next pose comes half way, so a hand that moves steadily is followed steadily. Where none
    comes, the second half of the way takes ever longer: the arm comes to rest without going too far.

    Attributes:
        part: of what is missing of a twist that a tick makes up for: twists are no steps.
        lag_of_twists: by which one lags [s].
    """

    part, lag_of_twists = 1.0, 0.0

    def __init__(self, pose: pin.SE3, dt: float, longest: float) -> None:
        """Begin at a pose, with the control step [s]; a hand had paused in gaps that are longer than `longest` [s]."""
        self._pose, self._dt, self._longest = pose, dt, longest
        self._gap = self._left = dt
        self._since = -dt  # [s] since the last new pose; the tick in which it begins is the next one

    @property
    def latency(self) -> float:
        """By how much a hand that moves steadily is ahead [s]: two gaps, none where it speaks in every tick."""
        return 2.0 * self._gap - self._dt if self._gap > (1.0 + ROUNDING) * self._dt else 0.0

    def start_from(self, pose: pin.SE3) -> None:
        """Go on from a pose, which something else has led to."""
        self._pose = pose
        self._gap = self._left = self._dt
        self._since = 0.0

    def move(self, target: pin.SE3, is_new: bool) -> pin.SE3:
        """A tick nearer to the target, which `is_new` if the hand has moved since the last tick."""
        self._since += self._dt
        if is_new:
            if self._since <= self._longest + ROUNDING:
                self._gap = max(self._since, self._gap * math.exp(-self._since / FORGETTING))
            self._since = 0.0
            self._left = self._dt + self.latency
        self._pose = _between(self._pose, target, min(self._dt / self._left, 1.0))
        self._left = max(self._left - self._dt, 0.5 * (self._dt + self.latency))
        return self._pose


def _between(start: pin.SE3, end: pin.SE3, part: float) -> pin.SE3:
    """A pose on the straight way from one to another."""
    if part >= 1.0:
        return end
    turn = pin.exp3(part * pin.log3(end.rotation @ start.rotation.T))
    return pin.SE3(turn @ start.rotation, start.translation + part * (end.translation - start.translation))
