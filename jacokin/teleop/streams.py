"""Recorded streams of a hand: made by code for tests and trials, saved and read."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.files import read_arrays, replacing
from jacokin.ik.results import Frozen
from jacokin.model import checks, poses
from jacokin.model.robot import Robot, checked_robot

REST = 1.0  # [s] at the start and, at least, at the end
SLOW = 0.06  # [m/s] on average
FASTEST = 10_000.0  # [1/s] of a hand: each pose takes some time and memory
TURNING = 0.5  # [rad/s] likewise


@dataclass(frozen=True, slots=True, eq=False)
class Stream(Frozen):
    """Poses of a hand over time. Arrays are read-only."""

    time: Array
    """(n,) when each pose arrives, not before the one before it [s]; missing and doubled ones are part of a stream."""
    hand: Array
    """(n, 7) position [m] and quaternion wxyz; as a device may send them, NaN and zeros too."""

    def __post_init__(self) -> None:
        """Check that it can be played.

        Raises:
            InvalidInputError: not numbers of these shapes, or times that are not finite or run backwards.
        """
        time, hand = checks.array("time", self.time, "numbers (n,)"), checks.array("hand", self.hand, "numbers (n, 7)")
        if time.ndim != 1 or hand.shape != (len(time), 7):
            raise InvalidInputError(f"time must be (n,) and hand (n, 7), got shapes {time.shape} and {hand.shape}")
        if not np.isfinite(time).all() or (np.diff(time) < 0.0).any():
            raise InvalidInputError("time must be finite, and must not run backwards")
        object.__setattr__(self, "time", checks.read_only(time))
        object.__setattr__(self, "hand", checks.read_only(hand))

    def __len__(self) -> int:
        """How many poses."""
        return len(self.time)

    def save(self, path: str | Path) -> None:
        """Write a .npz file.

        Raises:
            InvalidInputError: another ending, or it cannot be written.
        """
        file = checks.path("path", path, "a file name")
        if file.suffix != ".npz":
            raise InvalidInputError(f"the file of a stream must end in .npz, got {str(file)!r}")
        with replacing(file) as temporary, temporary.open("wb") as out:
            np.savez(out, time=self.time, hand=self.hand)

    @classmethod
    def load(cls, path: str | Path) -> Stream:
        """Read a file that `save` wrote.

        Raises:
            InvalidInputError: it cannot be read, or holds something else.
        """
        file = checks.path("path", path, "a file name")
        held = read_arrays(file, "does not hold a stream", ("time", "hand"))
        try:
            return cls(*(checks.array(name, held[name], "numbers") for name in ("time", "hand")))
        except InvalidInputError as error:
            raise InvalidInputError(f"{file}: does not hold a stream: {error}") from error


def make_stream(robot: Robot, kind: str, rng: np.random.Generator, *, rate: float = 60.0) -> Stream:
    """A hand that starts as if it held the tool at `robot.home`, does something, and comes back.

    Args:
        robot: whose home it starts from.
        kind: "smooth" hands; "jerky" ones that jump; "dropouts": late, doubled and missing poses, NaN and zero
            quaternions; "shoulder": through the axis of the first joint; "wrist_flips": turns by up to half a turn;
            "out_of_reach": beyond the reach and back.
        rng: randomness.
        rate: poses in a second, at most 10000 [1/s]; those of hand devices are 10 to 200.

    Raises:
        UnknownNameError: an unknown kind.
        InvalidInputError: a malformed argument.
    """
    checked_robot("robot", robot)
    make = KINDS[checks.choice("kind", kind, KINDS)]
    checks.generator("rng", rng)
    if checks.positive("rate", rate, "1/s") > FASTEST:
        raise checks.refusal("rate", f"at most {FASTEST:g}", rate, "1/s")
    start = robot.forward_kinematics(robot.home)
    corners = make(start, rng)
    times, ways, turns = _timed(corners)
    time = np.arange(0.0, times[-1] + 2.0 * REST, 1.0 / rate)
    way = np.column_stack([_smooth(time, times, column) for column in ways.T])
    turn = np.column_stack([_smooth(time, times, column) for column in turns.T])
    if kind == "jerky":
        for _ in range(6):
            moved = (time > rng.uniform(REST, times[-1] - REST)) & (time < times[-1] - REST)
            way[moved] += rng.uniform(-0.08, 0.08, 3)
            turn[moved] += rng.uniform(-0.3, 0.3, 3)
    rotations = [pin.exp3(row) @ start.rotation for row in turn]
    hand = np.array([[*start.translation + row, *poses.quat_wxyz(R)] for row, R in zip(way, rotations, strict=True)])
    if kind == "dropouts":
        time, hand = _spoil(time, hand, times[-1], rng)
    return Stream(time, hand)


def _timed(corners: list[tuple[Array, Array]]) -> tuple[Array, Array, Array]:
    """Times, ways [m] and turns [rad] of corners, in between which the hand is slow."""
    ways, turns = (np.array([corner[part] for corner in corners]) for part in (0, 1))
    far = np.linalg.norm(np.diff(ways, axis=0), axis=1) / SLOW
    turned = np.linalg.norm(np.diff(turns, axis=0), axis=1) / TURNING
    return REST + np.append(0.0, np.cumsum(np.maximum(np.maximum(far, turned), 0.5))), ways, turns


def _smooth(time: Array, times: Array, values: Array) -> Array:
    """From value to value, at rest at each, with the least jerk in between."""
    row = np.clip(np.searchsorted(times, time, side="right") - 1, 0, len(times) - 2)
    part = np.clip((time - times[row]) / (times[row + 1] - times[row]), 0.0, 1.0)
    return np.asarray(values[row] + (values[row + 1] - values[row]) * part**3 * (10.0 - 15.0 * part + 6.0 * part**2))


def _spoil(time: Array, hand: Array, end: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """Late, doubled, missing and malformed poses before the end."""
    kept = np.ones(len(time), dtype=bool)
    for _ in range(3):
        gap = rng.uniform(REST, end)
        kept &= (time < gap) | (time > gap + rng.uniform(0.05, 0.8)) | (time > end)
    kept &= (rng.random(len(time)) > 0.05) | (time > end)
    rows = np.sort(np.concatenate([np.flatnonzero(kept), rng.choice(np.flatnonzero(kept), len(time) // 30)]))
    late = np.where(time[rows] < end, rng.exponential(0.005, len(rows)), 0.0)
    arrival = np.maximum.accumulate(time[rows] + late)
    hand = hand[rows].copy()
    before = np.flatnonzero(arrival < end)
    hand[rng.choice(before, 5), rng.integers(0, 7, 5)] = np.nan
    hand[rng.choice(before, 3), 3:] = 0.0
    return arrival, hand


CornerPoses = list[tuple[Array, Array]]
STILL = (np.zeros(3), np.zeros(3))


def _wander(start: pin.SE3, rng: np.random.Generator) -> CornerPoses:
    return [STILL, *((rng.uniform(-0.08, 0.08, 3), rng.uniform(-0.3, 0.3, 3)) for _ in range(4)), STILL]


def _over_shoulder(start: pin.SE3, rng: np.random.Generator) -> CornerPoses:
    over = np.append(rng.uniform(-0.02, 0.02, 2), start.translation[2] + rng.uniform(0.0, 0.25)) - start.translation
    return [STILL, (over, np.zeros(3)), (1.4 * over, np.zeros(3)), (over, np.zeros(3)), STILL]


def _flip(start: pin.SE3, rng: np.random.Generator) -> CornerPoses:
    axis = rng.normal(size=3)
    axis *= rng.uniform(0.5, 1.0) * np.pi / np.linalg.norm(axis)
    return [STILL, (rng.uniform(-0.05, 0.05, 3), axis), STILL, (rng.uniform(-0.05, 0.05, 3), -axis), STILL]


def _reach_out(start: pin.SE3, rng: np.random.Generator) -> CornerPoses:
    way = start.translation + rng.normal(size=3) * 0.2
    return [STILL, (rng.uniform(0.5, 0.8) * way / np.linalg.norm(way), rng.uniform(-0.2, 0.2, 3)), STILL]


KINDS: dict[str, Callable[[pin.SE3, np.random.Generator], CornerPoses]] = {
    "smooth": _wander,
    "jerky": _wander,
    "dropouts": _wander,
    "shoulder": _over_shoulder,
    "wrist_flips": _flip,
    "out_of_reach": _reach_out,
}
