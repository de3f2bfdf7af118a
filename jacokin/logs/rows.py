"""Rows for calibration: `find_standstills`, while an instrument looks at the arm; `smooth_rows`, with torques."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array, Sealed
from jacokin.errors import InvalidInputError
from jacokin.logs.messages import JointRecord, PoseRecord
from jacokin.model import checks

GAP = 0.5  # [s] without messages: what the arm did meanwhile is not known
WINDOW = 0.2  # [s]
DEGREE = 3  # of the polynomials: the least that has an acceleration with a slope
FEWEST = 7  # rows in a window
HOLE = 5.0  # times the usual step: no polynomial reaches across


@dataclass(frozen=True, slots=True)
class StandstillRule:
    """When an arm stands still: for so long, no joint is quicker than this, and none goes farther than that.

    Speeds are differences of the reported angles over 0.2 s, since not all drivers report velocities.

    Raises:
        InvalidInputError: not positive, or `settle` negative.
    """

    speed: float = 0.01
    """No joint is quicker [rad/s]."""
    duration: float = 1.0
    """For at least so long [s], besides `settle` at both ends."""
    settle: float = 0.3
    """After it has stopped, and before it goes on, nothing is used: it swings, and instruments are late [s]."""
    spread: float = 0.005
    """No joint's angles are farther apart meanwhile [rad]: slow drift is motion, too."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        for name, unit in (("speed", "rad/s"), ("duration", "s"), ("spread", "rad")):
            object.__setattr__(self, name, checks.positive(name, getattr(self, name), unit))
        object.__setattr__(self, "settle", checks.non_negative("settle", self.settle, "s"))


@dataclass(frozen=True, slots=True, eq=False)
class Standstills(Sealed):
    """Where an arm stood still, in order of time. Arrays are read-only."""

    start: Array
    """(n,) from when on messages are used [s], from the beginning of the recording; on the clock of headers, if any."""
    stop: Array
    """(n,) until when [s]."""
    q: Array
    """(n, dof) mean joint angles [rad]."""
    q_spread: Array
    """(n,) standard deviation of the joint that varies most [rad]."""
    positions: Array
    """(n, 3) median of what the instrument measured meanwhile [m]."""
    rotations: Array | None
    """(n, 3, 3) that is nearest to the medians; None for points."""
    noise: Array
    """(n,) standard deviation of the coordinate that varies most [m]."""
    counts: NDArray[np.int_]
    """(n,) measurements of the instrument in each."""
    drifting: int
    """How many more there were in which a joint went farther than `spread`."""
    unseen: int
    """How many more there were in which the instrument measured nothing."""

    def __len__(self) -> int:
        """How many there are."""
        return len(self.q)

    @property
    def poses(self) -> Array:
        """(n, 4, 4) what the instrument measured.

        Raises:
            InvalidInputError: it measured points.
        """
        if self.rotations is None:
            raise InvalidInputError("poses: the instrument measured points, whose positions are known only")
        T = np.tile(np.eye(4), (len(self), 1, 1))
        T[:, :3, :3], T[:, :3, 3] = self.rotations, self.positions
        return checks.read_only(T)


def find_standstills(
    rule: StandstillRule, joints: JointRecord, times: Array, poses: PoseRecord, pose_times: Array
) -> Standstills:
    """Where the arm stands still.

    Args:
        rule: when it does.
        joints: what was reported.
        times: (n,) of that [s].
        poses: what was measured.
        pose_times: (m,) of that, on the same clock [s].

    Raises:
        InvalidInputError: nowhere, or only while nothing was measured.
    """
    rows, drifting, unseen = [], 0, 0
    spans = _still(rule, joints.q, times)
    for first, last in spans:
        here = slice(first, last + 1)
        q = joints.q[here]
        if np.ptp(q, axis=0).max() > rule.spread:
            drifting += 1
            continue
        seen = (pose_times >= times[first]) & (pose_times <= times[last])
        if not seen.any():
            unseen += 1
            continue
        positions = poses.positions[seen]
        rotation = np.eye(3) if poses.rotations is None else _middle(poses.rotations[seen])
        noise = positions.std(axis=0).max()
        rows.append((times[first], times[last], q, np.median(positions, axis=0), rotation, noise, int(seen.sum())))
    if not rows:
        raise InvalidInputError(_nowhere(rule, joints, times, pose_times, len(spans), drifting))
    start, stop, angles, positions, rotations, noise, counts = zip(*rows, strict=True)
    return Standstills(
        start=checks.read_only(start),
        stop=checks.read_only(stop),
        q=checks.read_only([each.mean(axis=0) for each in angles]),
        q_spread=checks.read_only([each.std(axis=0).max() for each in angles]),
        positions=checks.read_only(positions),
        rotations=None if poses.rotations is None else checks.read_only(rotations),
        noise=checks.read_only(noise),
        counts=checks.sealed(np.array(counts)),
        drifting=drifting,
        unseen=unseen,
    )


def _still(rule: StandstillRule, q: Array, times: Array) -> list[tuple[int, int]]:
    """First and last row of each time in which the arm is slow, without what it needs to settle."""
    if len(times) < 2:
        return []
    # Over 0.2 s, two messages of kinova-ros at 10 Hz, noise of encoders averages out.
    before, after = (np.clip(times + half, times[0], times[-1]) for half in (-0.1, 0.1))
    moved = np.column_stack([np.interp(after, times, each) - np.interp(before, times, each) for each in q.T])
    slow = np.abs(moved).max(axis=1) <= rule.speed * (after - before)
    # A run ends before a row that is not slow, and where messages are missing.
    breaks = np.flatnonzero(~slow[1:] | ~slow[:-1] | (np.diff(times) > GAP))
    found = []
    for first, last in zip([0, *(breaks + 1)], [*breaks, len(times) - 1], strict=True):
        inner = np.flatnonzero(
            (times[first : last + 1] >= times[first] + rule.settle)
            & (times[first : last + 1] <= times[last] - rule.settle)
        )
        if slow[first] and len(inner) > 1:
            one, other = first + int(inner[0]), first + int(inner[-1])
            if times[last] - times[first] - 2.0 * rule.settle >= rule.duration:
                found.append((one, other))
    return found


def _middle(rotations: Array) -> Array:
    """The rotation that is nearest to the medians of the entries of some (n, 3, 3)."""
    left, _, right = np.linalg.svd(np.median(rotations, axis=0))
    return np.asarray((left * [1.0, 1.0, np.linalg.det(left @ right)]) @ right)


def _nowhere(
    rule: StandstillRule, joints: JointRecord, times: Array, pose_times: Array, found: int, drifting: int
) -> str:
    if not found:
        return (
            f"{joints.topic}: the arm never stands still for {rule.duration:g} s with no joint above {rule.speed:g} "
            f"rad/s, and {rule.settle:g} s before and after; messages are up to "
            f"{np.diff(times).max(initial=0.0):.2f} s apart"
        )
    if drifting == found:
        return f"{joints.topic}: whenever the arm stands still, a joint goes farther than {rule.spread:g} rad meanwhile"
    apart = (
        f"joints from {times[0]:.1f} to {times[-1]:.1f} s, the hand from {pose_times[0]:.1f} to {pose_times[-1]:.1f} s"
    )
    return f"{joints.topic}: nothing is measured of the hand while the arm stands still ({apart})"


@dataclass(frozen=True, slots=True, eq=False)
class TorqueRows(Sealed):
    """What `identify_arm` and `identify_payload` take. Arrays are read-only."""

    t: Array
    """(n,) [s] from the beginning of the recording; on the clock of headers, if any."""
    q: Array
    """(n, dof) joint angles [rad]."""
    v: Array
    """(n, dof) velocities [rad/s], derivatives of `q`."""
    a: Array
    """(n, dof) accelerations [rad/s^2], derivatives of `v`."""
    torque: Array
    """(n, dof) torques, as the driver reports them [N m]."""
    step: float
    """Time between rows; those where messages are missing are not there [s]."""


def smooth_rows(joints: JointRecord, window: float) -> TorqueRows:
    """Fit a cubic polynomial to a window around each row (Savitzky and Golay, Analytical Chemistry 36(8), 1964).

    Angles and torques pass the same filter. Rows whose window is not whole, at the ends and beside holes, are left out.

    Args:
        joints: with torques.
        window: [s].

    Raises:
        InvalidInputError: no torques, or too few messages in a window.
    """
    from scipy.signal import savgol_filter

    if joints.torque is None:
        raise InvalidInputError(f"{joints.topic}: its messages have no effort for every joint")
    times = joints.t if joints.stamp is None else joints.stamp
    steps = np.diff(times)
    if not len(steps):
        raise InvalidInputError(f"{joints.topic}: has one message only")
    step = float(np.median(steps))
    size = 2 * round(window / step / 2.0) + 1
    if size < FEWEST:
        raise InvalidInputError(
            f"{joints.topic}: {size} messages in a window of {window:g} s, and {FEWEST} are needed: they come every "
            f"{step:.3g} s; give a longer window"
        )
    parts = np.split(np.arange(len(times)), np.flatnonzero(steps > HOLE * step) + 1)
    half, rows = size // 2, []
    for part in parts:
        at = np.arange(times[part[0]], times[part[-1]], step)
        if len(at) < size:
            continue
        q, torque = (
            np.column_stack([np.interp(at, times[part], column[part]) for column in each.T])
            for each in (joints.q, joints.torque)
        )
        whole = slice(half, len(at) - half)
        derivatives = [savgol_filter(q, size, DEGREE, deriv=order, delta=step, axis=0)[whole] for order in range(3)]
        rows.append((at[whole], *derivatives, savgol_filter(torque, size, DEGREE, axis=0)[whole]))
    if not rows:
        raise InvalidInputError(f"{joints.topic}: nowhere are there {window:g} s of messages without a hole")
    t, q, v, a, torque = (checks.read_only(np.concatenate(each)) for each in zip(*rows, strict=True))
    return TorqueRows(t, q, v, a, torque, step)
