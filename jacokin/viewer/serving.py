"""`serve`: open the viewer of a robot."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import MissingExtraError
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import TargetPose
from jacokin.ik.targets import checked as checked_target
from jacokin.model.loading import load_robot
from jacokin.model.robot import Robot
from jacokin.model.scenes.scene import Scene, checked_scene
from jacokin.viewer import motion
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.motion import Playback, Trajectory
from jacokin.viewer.viewer import Options, Viewer

DEFAULT_PORT = 8080
DEFAULT_HOST = "127.0.0.1"  # this machine and no other


def serve(
    robot: Robot | str | None = None,
    *,
    frame: str | None = None,
    tool: pin.SE3 | ArrayLike | None = None,
    collision: str = "ignore",
    scene: Scene | None = None,
    clearance: float = 0.0,
    prefer: str = "nearest",
    trajectory: Trajectory | str | Path | None = None,
    target: pin.SE3 | ArrayLike | None = None,
    seed: ArrayLike | None = None,
    host: str = DEFAULT_HOST,
    port: int = DEFAULT_PORT,
) -> Viewer:
    """Show a robot in the browser: a gizmo for the target, and every branch that reaches it.

    Args:
        robot: a robot, or what `load_robot` takes; None for the j2n6s300.
        frame: frame to bring to the target; None for the robot's default frame.
        tool: T_frame_tool, a constant pose after the frame.
        collision: contact of the branches: "ignore", "report" or "reject", as for `IKSolver`.
        scene: obstacles around the arm; they are drawn, and count as self-contact does unless that is ignored.
        clearance: shapes this near to each other count as touching [m].
        prefer: which feasible branch the arm goes to: the one "nearest" to where it is, of the largest limit "margin",
            or of the largest "manipulability".
        trajectory: to play: a `PathResult`, a `JointMotion`, or a file that one of them saved.
        target: T_base_tool to begin with, as `pin.SE3` or (4, 4); a position (3,) [m] keeps the orientation that the
            tool has at `seed`; None for where the tool is there.
        seed: (dof,) where the arm is at first [rad]; None for the robot's home.
        host: address to serve at. Any other than this machine's own lets every computer that reaches it move the gizmo.
        port: 0 for any free one.

    Returns:
        The running viewer: open its `url` in a browser, and `close()` it.

    Raises:
        MissingExtraError: viser is not installed.
        InvalidInputError: target, seed or trajectory malformed, the host unknown here, or the port in use.
        JacokinError: as `load_robot` and `IKSolver`.
    """
    if importlib.util.find_spec("viser") is None:
        raise MissingExtraError("viser", "viewer")
    if not isinstance(robot, Robot):
        robot = load_robot() if robot is None else load_robot(robot)
    obstacles = None if scene is None else checked_scene("scene", scene)
    looking = collision != "ignore"
    solver = IKSolver(
        robot, frame, tool=tool, collision=collision, scene=obstacles if looking else None, clearance=clearance
    )
    inspector = Inspector(solver, prefer=prefer)
    playback = None
    if trajectory is not None:
        playback = Playback(motion.load(trajectory) if isinstance(trajectory, str | Path) else trajectory, robot)
    start, _ = seed_within_limits(robot, seed)
    if target is not None:
        view = inspector.at(_pose(inspector, checked_target(target), start), start)
    else:
        view = inspector.posture(start if playback is None or seed is not None else playback.at(0.0))
    return Viewer(inspector, view, Options(host, port, obstacles, playback))


def _pose(inspector: Inspector, target: TargetPose, start: Array) -> pin.SE3:
    """A target whose orientation, if free, is that of the tool at `start`."""
    rotation = inspector.pose_of(start).rotation if target.position_only else target.rotation
    return pin.SE3(rotation, target.position)
