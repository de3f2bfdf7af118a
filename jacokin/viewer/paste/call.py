"""Which call gives the configuration on the screen: of those that may, the first that does when it is tried."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik.results import Branches, Status
from jacokin.model import poses
from jacokin.model.pose_targets import FreeAxis, pose
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.view import View

SAME = 1e-6  # [rad] an answer this near to the arm on the screen is the same


@dataclass(frozen=True, slots=True, eq=False)
class Call:
    """A call that gives the configuration on the screen."""

    seed: Array
    """(dof,) [rad]."""
    prefer: str
    """Which configuration."""
    free: bool
    """Whether the target may turn about its free axis."""
    branch: int | None = None
    """The number of the branch among all of them; None for the answer of `solve`."""


def call_of(inspector: Inspector, view: View) -> Call:
    """The call whose answer is on the screen, found by trying."""
    turns = view.free is not None and view.free.axis is not None
    reached = view.status is Status.OK or view.selected is not None
    seeds = [view.q, view.seed] if reached else [view.seed]
    for free in (True, False) if turns else (False,):
        for prefer in dict.fromkeys((inspector.prefer, "nearest")):
            for seed in seeds:
                if inspector.robot.within_limits(seed) and _gives(inspector, view, Call(seed, prefer, free)):
                    return Call(seed, prefer, free)
    if len(view.branches):
        found = inspector.solver.solve_all(view.target, view.seed)
        if isinstance(found, Branches) and len(found):
            apart = np.abs(found.q - view.q).max(axis=1)
            if apart.min() < SAME:
                return Call(view.seed, "nearest", free=False, branch=int(np.argmin(apart)))
    return Call(view.seed, "nearest", free=False)


def _gives(inspector: Inspector, view: View, call: Call) -> bool:
    """Whether a call gives the configuration on the screen."""
    target: pin.SE3 | FreeAxis = _as_read(view.target)
    if call.free and view.free is not None:
        target = FreeAxis(
            _as_read(view.gizmo), axis=axis_vector(view.free.axis), range=(view.free.lower, view.free.upper)
        )
    try:
        result = inspector.solver.solve(target, call.seed, prefer=call.prefer)
    except JacokinError:
        return False
    return bool(np.abs(result.q - view.q).max() < SAME)


def _as_read(place: pin.SE3) -> pin.SE3:
    """A pose as it comes out of the text: a quaternion rounds, which decides between equal branches."""
    return pose(place.translation, quat_wxyz=poses.quaternion(place.rotation))


def axis_vector(axis: int | None) -> list[float]:
    """(3,) the axis x, y or z of the tool by its number."""
    return [1.0 if index == axis else 0.0 for index in range(3)]
