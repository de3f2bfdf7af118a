"""Trajectories as other programs may have them: what is played, and no more."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import cast

import numpy as np

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.motion.trajectory import Trajectory


def recorded(robot: Robot, t: Array | Sequence[float], q: Array, names: Sequence[str] | None = None) -> Trajectory:
    """Rows (n, dof) [rad] at times (n,) [s] of a robot's joints, or of joints of other names."""
    joint_names = robot.joint_names if names is None else tuple(names)
    return cast(Trajectory, SimpleNamespace(joint_names=joint_names, t=np.array(t), q=q))
