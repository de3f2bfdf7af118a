"""`smooth_rows`: joint angles and torques of a log, smoothed alike, and the angles differentiated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.logs.messages import JointRecord
from jacokin.model import checks

WINDOW = 0.2  # [s]
DEGREE = 3  # of the polynomials: the least that has an acceleration with a slope
FEWEST = 7  # rows in a window
HOLE = 5.0  # times the usual step: no polynomial reaches across


@dataclass(frozen=True, slots=True, eq=False)
class TorqueRows:
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
