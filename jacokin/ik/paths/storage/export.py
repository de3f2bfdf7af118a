"""Trajectories for other programs: the fields of a ROS JointTrajectory, and joint velocities for Kinova's driver.

Nothing here talks to an arm.
"""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Protocol

import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.paths.storage.tables import Table, exact, write_table

KINOVA_STEP = 0.01  # [s] the control loop of the Jaco's base runs at 100 Hz (kinova-ros, README, velocity control)
SPEED_ROUNDING = 1e-9  # [rad/s] of positions subtracted and divided by a step
NANOSECONDS = 1_000_000_000  # [1/s]


class Trajectory(Protocol):
    """What is exported: `PathResult` and `JointMotion`."""

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints."""

    @property
    def t(self) -> Array:
        """(n,) time [s], from 0."""

    @property
    def q(self) -> Array:
        """(n, dof) [rad]."""

    @property
    def v(self) -> Array:
        """(n, dof) [rad/s]."""

    @property
    def a(self) -> Array:
        """(n, dof) [rad/s^2]."""

    @property
    def lower(self) -> Array:
        """(dof,) lower limits [rad]."""

    @property
    def upper(self) -> Array:
        """(dof,) upper limits [rad]."""

    @property
    def velocity_limit(self) -> Array:
        """(dof,) [rad/s]."""


def write_ros_json(file: Path, trajectory: Trajectory) -> None:
    """Write the fields of a ROS 2 trajectory_msgs/JointTrajectory: SI units and radians, times to the nanosecond.

    Numbers keep all their digits: a rounded one may lie outside its limit.
    """
    points = []
    for time, q, v, a in zip(
        trajectory.t.tolist(), trajectory.q.tolist(), trajectory.v.tolist(), trajectory.a.tolist(), strict=True
    ):
        seconds, nanoseconds = divmod(round(time * NANOSECONDS), NANOSECONDS)
        points.append(
            {
                "positions": q,
                "velocities": v,
                "accelerations": a,
                "time_from_start": {"sec": seconds, "nanosec": nanoseconds},
            }
        )
    message = {"joint_names": list(trajectory.joint_names), "points": points}
    with file.open("w", encoding="utf-8") as stream:
        json.dump(message, stream, allow_nan=False)
        stream.write("\n")


def write_kinova_csv(file: Path, trajectory: Trajectory) -> None:
    """Write angles [deg] and velocities [deg/s] at exactly 100 Hz, as Kinova's driver for the Jaco takes them.

    Zero and sign of every joint are those of Kinova's URDF, which the driver shares (kinova-ros, publishJointAngles);
    angles of unlimited joints are not wrapped. The velocity of a row is the one to send for the 10 ms that begin with
    it: sent in turn, they lead from the first angles through all others. The last row is the end, with velocity zero.

    Raises:
        InvalidInputError: a resampled row breaks a position or velocity limit.
    """
    q, v = resampled(trajectory, KINOVA_STEP)
    check_limits(trajectory, q, v)
    degrees = _degrees_within(q, trajectory.lower, trajectory.upper)
    velocity = np.degrees(v)
    count = q.shape[1]
    head = [
        "time_s",
        *(f"joint{k}_deg" for k in range(1, count + 1)),
        *(f"joint{k}_deg_s" for k in range(1, count + 1)),
    ]
    numbers = np.column_stack([degrees, velocity])
    rows = [[f"{tick / 100:.2f}", *exact(row)] for tick, row in enumerate(numbers)]
    write_table(file, Table({}, head, rows))


def resampled(trajectory: Trajectory, step: float) -> tuple[Array, Array]:
    """Angles (m, dof) [rad] every `step` [s], and the velocity (m, dof) [rad/s] that leads to the next row.

    Straight lines between the rows, so no joint passes its limits or gets faster than between two rows. The last row
    is the end of the trajectory, up to a step later than there.
    """
    duration = float(trajectory.t[-1])
    count = math.ceil(duration / step - 1e-9)  # division rounds
    times = np.minimum(np.arange(count + 1) * step, duration)
    q = np.column_stack([np.interp(times, trajectory.t, column) for column in trajectory.q.T])
    q = np.clip(q, trajectory.q.min(axis=0), trajectory.q.max(axis=0))  # interpolation rounds
    v = np.zeros_like(q)
    v[:-1] = np.diff(q, axis=0) / step
    return q, v


def check_limits(trajectory: Trajectory, q: Array, v: Array) -> None:
    """Refuse rows that break the limits of their trajectory.

    Raises:
        InvalidInputError: names the joint, the row and the value.
    """
    outside = (q < trajectory.lower) | (q > trajectory.upper)
    fast = np.abs(v) > trajectory.velocity_limit + SPEED_ROUNDING
    for broken, values, unit in ((outside, q, "rad"), (fast, v, "rad/s")):
        if broken.any():
            row, joint = (int(index) for index in np.argwhere(broken)[0])
            raise InvalidInputError(
                f"{trajectory.joint_names[joint]} breaks its limit after resampling: "
                f"{values[row, joint]:.17g} {unit} in row {row}"
            )


def _degrees_within(q: Array, lower: Array, upper: Array) -> Array:
    """Angles in degrees that read back to radians within the limits; rounding could put them one ulp outside."""
    degrees = np.degrees(q)
    for _ in range(4):
        back = np.radians(degrees)
        degrees = np.where(back < lower, np.nextafter(degrees, np.inf), degrees)
        degrees = np.where(back > upper, np.nextafter(degrees, -np.inf), degrees)
    return degrees
