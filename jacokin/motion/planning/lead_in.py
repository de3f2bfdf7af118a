"""`lead_in`: the motion that brings the arm from where it is to where a planned path begins, before that path."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik.solver import IKSolver
from jacokin.ik.verification import Verifier
from jacokin.model import checks
from jacokin.model.poses import FreeAxis, rotation_angle
from jacokin.motion.free_motion.plan_motion import plan_motion
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.trajectory import LEAD_IN, Trajectory, changes

THERE = 1e-3  # [m] and [rad] an arm this near to the first pose is at it


def is_away(verifier: Verifier, q: Array, target: pin.SE3 | FreeAxis) -> bool:
    """Whether the tool at `q` (dof,) is elsewhere than at a target, whatever the angle about its free axis."""
    tool = verifier.tool_pose(q)
    pose = target.at(0.0) if isinstance(target, FreeAxis) else target
    if np.linalg.norm(tool.translation - pose.translation) > THERE:
        return True
    if not isinstance(target, FreeAxis):
        return rotation_angle(tool.rotation.T @ pose.rotation) > THERE
    return float(np.linalg.norm(tool.rotation @ target.axis - pose.rotation @ target.axis)) > THERE


def lead_in(solver: IKSolver, start: Array, path: Trajectory, dt: float, acceleration: Array | None) -> Trajectory:
    """A path with the motion to its first row before it, in rows of `dt` [s] whose status is "LEAD_IN".

    Args:
        solver: knows the arm and its scene.
        start: (dof,) where the arm is [rad].
        path: a path that begins elsewhere.
        dt: control step [s].
        acceleration: (dof,) limits [rad/s^2]; None for those of `plan_motion`.
    """
    motion = plan_motion(
        solver,
        start,
        path.q[0],
        dt=dt,
        velocity_limit=path.velocity_limit,
        acceleration_limit=ACCELERATION if acceleration is None else acceleration,
    )
    if not motion.success:
        status = ("HELD",) * len(path)
        q = checks.read_only(np.tile(start, (len(path), 1)))
        away = checks.read_only(np.full(len(path), np.nan))
        message = f"there is no way from the start to where the path would begin: {motion.message}"
        still = checks.read_only(np.zeros_like(q))
        return replace(
            path,
            q=q,
            v=still,
            a=still,
            status=status,
            limiting=(message,) * len(path),
            position_error=away,
            orientation_error=away,
            clearance=away,
            message=message,
        )
    # All but its last row are whole steps; the last one is reached within the step after them.
    count = len(motion) - 1
    q = np.vstack([motion.q[:-1], path.q])
    v = np.zeros_like(q)
    v[1:] = np.diff(q, axis=0) / dt
    unknown = np.full(count, np.nan)
    clear = motion.clearance[:-1] if not np.isnan(path.clearance).all() else unknown
    t = checks.read_only(np.arange(len(q)) * dt)
    return replace(
        path,
        t=t,
        q=checks.read_only(q),
        v=checks.read_only(v),
        a=changes(t, v),
        status=(LEAD_IN,) * count + path.status,
        limiting=("",) * count + path.limiting,
        segment=checks.sealed(np.concatenate([np.full(count, -1, dtype=np.intp), path.segment])),
        position_error=checks.read_only(np.concatenate([unknown, path.position_error])),
        orientation_error=checks.read_only(np.concatenate([unknown, path.orientation_error])),
        clearance=checks.read_only(np.concatenate([clear, path.clearance])),
        start_distance=0.0,
        message=f"{path.message.partition(';')[0]}, after a motion of {motion.duration:.4g} s to where it begins",
    )
