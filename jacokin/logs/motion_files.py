"""`read_motion`: angles over time in any of the files that `Trajectory.save` writes, or a JointTrajectory of others."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.documents import read_json
from jacokin.errors import InvalidInputError
from jacokin.files import MESSAGE, plain_numbers
from jacokin.logs.messages import NANOSECOND, find_joints
from jacokin.model.robot import Robot
from jacokin.motion.files import by_ending, read_table
from jacokin.motion.trajectory import FORMATS, KINOVA_STEP, Trajectory, refuse_sliding

#: Of ROS 2, of ROS 1, or a number [s].
DURATIONS = ({"sec": float, "nanosec": float}, {"secs": float, "nsecs": float}, float)
MESSAGE_FORM = {"joint_names": [str], "points": [{"time_from_start": DURATIONS, "positions": [float]}]}
STEP_ROUNDING = 1e-6  # [s] of times that are written with two decimals


class MotionRows(NamedTuple):
    """Angles over time, as a file has them."""

    t: Array
    """(n,) [s]."""
    q: Array
    """(n, dof) in the order of the robot's joints [rad]."""
    fault: str = ""
    """Why it is not to be sent to an arm; "" where nothing speaks against it."""


def read_motion(path: str | Path, robot: Robot) -> MotionRows:
    """The rows of a file, for a robot.

    Joints may come in any order, with one prefix before all names, such as j2n6s300_; those of .kinova.csv have none.
    Joints that slide are in [m], which .kinova.csv does not hold.

    Raises:
        InvalidInputError: no such file, not a trajectory, or one of other joints; names the file.
    """
    file, ending = by_ending(path, FORMATS)
    if ending == ".kinova.csv":
        return _read_kinova(file, robot)
    rows: Sequence[Sequence[float]] | Array
    fault = ""
    if ending in (".csv", ".npz"):
        trajectory = Trajectory.load(file)
        names, t, rows = trajectory.joint_names, trajectory.t, trajectory.q
        fault = "" if trajectory.success else f"{trajectory.outcome}, {trajectory.message}"
    else:
        names, t, rows = _read_ros(file)
    try:
        order = find_joints(names, robot)
    except InvalidInputError as error:
        raise InvalidInputError(f"{file}: trajectory has {error}") from error
    if len(names) != robot.dof:
        raise InvalidInputError(f"{file}: trajectory has the joints {', '.join(names)}; {robot.name} has others")
    if any(len(row) != robot.dof for row in rows):
        raise InvalidInputError(f"{file}: every point must have {robot.dof} positions")
    return MotionRows(t, np.array(rows, dtype=np.float64).reshape(len(rows), robot.dof)[:, order], fault)


def _read_ros(file: Path) -> tuple[tuple[str, ...], Array, Sequence[Sequence[float]]]:
    """Names, times and angles of a JointTrajectory message of ROS 1 or ROS 2."""
    message = read_json(file, "not a JointTrajectory as JSON", MESSAGE_FORM, MESSAGE)
    points = message["points"]
    times = [_seconds(point["time_from_start"]) for point in points]
    return tuple(message["joint_names"]), np.array(times, dtype=np.float64), [point["positions"] for point in points]


def _seconds(duration: dict[str, float] | float) -> float:
    """A duration of one of the `DURATIONS` [s]."""
    if not isinstance(duration, dict):
        return duration
    names = ("sec", "nanosec") if "sec" in duration else ("secs", "nsecs")
    whole, rest = (float(duration[name]) for name in names)
    return whole + NANOSECOND * rest


def _read_kinova(file: Path, robot: Robot) -> MotionRows:
    """Angles in degrees at 100 Hz, as `Trajectory.save` writes them for Kinova's driver."""
    refuse_sliding(str(file), robot.joint_names, robot.sliding)
    table = read_table(file)
    wanted = ["time_s", *(f"joint{number}_deg" for number in range(1, robot.dof + 1))]
    if list(table.head[: len(wanted)]) != wanted or len(table.head) != 2 * robot.dof + 1:
        raise InvalidInputError(f"{file}: the head line must begin {','.join(wanted)} for {robot.name}")
    rows = []
    for line, row in zip(table.lines, table.rows, strict=True):
        try:
            rows.append(plain_numbers(row))
        except ValueError as error:
            raise InvalidInputError(f"{file}, line {line}: {error}") from error
    numbers = np.array(rows)
    if not np.abs(numbers[:, 0] - KINOVA_STEP * np.arange(len(numbers))).max() <= STEP_ROUNDING:
        raise InvalidInputError(f"{file}: its rows are not 10 ms apart")
    if not (numbers[-1, len(wanted) :] == 0.0).all():
        raise InvalidInputError(f"{file}: its last row is not at rest, as where a file was cut off")
    return MotionRows(numbers[:, 0], np.radians(numbers[:, 1 : len(wanted)]))
