"""`serve`: open the viewer of a robot; `show`: of a result."""

from __future__ import annotations

import importlib.util
import logging
import os
import sys
import webbrowser
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.errors import InvalidInputError, MissingExtraError, ModelError
from jacokin.ik.results import IKResult
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.solutions.solution_set import SolutionSet
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import checked_target
from jacokin.model import checks
from jacokin.model.loading import load_robot
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot, fingerprint, velocity_limits
from jacokin.model.scene import Scene, checked_scene
from jacokin.reachability import ReachabilityMap, bundled, load
from jacokin.viewer.contents import Contents, MapSlices, Setup
from jacokin.viewer.drawing import ArmPart, load_parts, load_visuals
from jacokin.viewer.inspector import FULL_TURN, Inspector
from jacokin.viewer.playback import Playback
from jacokin.viewer.viewer import Viewer

if TYPE_CHECKING:
    from jacokin.logs import Recording
    from jacokin.model.scene import Scene
    from jacokin.motion.trajectory import Trajectory

DEFAULT_PORT = 8080
DEFAULT_HOST = "127.0.0.1"  # this machine and no other
AXES = ("x", "y", "z")

logger = logging.getLogger(__name__)


def serve(
    robot: Robot | str | None = None,
    *,
    frame: str | None = None,
    tool: pin.SE3 | ArrayLike | None = None,
    collision: str | None = None,
    scene: Scene | None = None,
    clearance: float = 0.0,
    prefer: str = "nearest",
    free_axis: str | None = None,
    free_range: Sequence[float] = FULL_TURN,
    visuals: bool = False,
    reachability: ReachabilityMap | str | Path | None = None,
    trajectory: Trajectory | Recording | str | Path | None = None,
    velocity_limit: ArrayLike | None = None,
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
        collision: contact of the branches: "prefer", "reject", "report", "ignore" or None, as for `IKSolver`.
        scene: obstacles around the arm; they are drawn, and count as self-contact does unless that is ignored.
        clearance: shapes this near to each other count as touching [m].
        prefer: which feasible branch the arm goes to: the one "nearest" to where it is, of the largest limit "margin",
            or of the largest "manipulability".
        free_axis: "x", "y" or "z": the tool may turn about this axis of its own.
        free_range: least and largest angle about it [rad].
        visuals: draw the visual meshes of the robot's file, if it has any, instead of the shapes that collide.
        reachability: a map to show slices of, or its folder; None for the one of a bundled robot, if there is one.
        trajectory: to play: a `Trajectory`, or a file that it saved: .csv, .npz, .json (ROS)
            or .kinova.csv; or what `Log.recording` gives, or the file of a log: .bag, .mcap or .db3. Where a log has
            it, the arm that was commanded is drawn beside the one that was measured.
        velocity_limit: (dof,) or one for all, of what "Track" and "Go" do [rad/s]; None for the robot's own. An arm
            whose file gives none is shown all the same, and only these two ask for it.
        target: T_base_tool to begin with, as `pin.SE3` or (4, 4); a position (3,) [m] keeps the orientation that the
            tool has at `seed`; None for where the tool is there.
        seed: (dof,) where the arm is at first [rad]; None for the robot's home.
        host: address to serve at. Any other than this machine's own lets every computer that reaches it and knows the
            token move the gizmo; nothing is encrypted.
        port: 0 for any free one.

    Returns:
        The running viewer: open its `url` in a browser, and `close()` it.

    Raises:
        MissingExtraError: viser is not installed, or rosbags for a log.
        InvalidInputError: target, seed, map or trajectory malformed or of another robot, the host unknown here, or the
            port in use.
        JacokinError: as `load_robot` and `IKSolver`.
    """
    if importlib.util.find_spec("viser") is None:
        raise MissingExtraError("viser", "viewer")
    if not isinstance(robot, Robot):
        robot = load_robot() if robot is None else load_robot(robot)
    obstacles = None if scene is None else checked_scene("scene", scene)
    visuals = checks.flag("visuals", visuals)
    looking = not (isinstance(collision, str) and collision == "ignore")
    solver = IKSolver(
        robot, frame, tool=tool, collision=collision, scene=obstacles if looking else None, clearance=clearance
    )
    inspector = Inspector(solver, prefer=prefer)
    axis = None if free_axis is None else AXES.index(checks.choice("free_axis", free_axis, AXES))
    span = FreeAxis(pin.SE3.Identity(), axis=(0, 0, 1), range=free_range).range
    shapes, shapes_note = load_parts(robot)
    meshes, meshes_note = _visuals(robot)
    notes = [note for note in (shapes_note, meshes_note) if note]
    for note in notes:
        logger.warning("%s", note)
    playback = None if trajectory is None else Playback(trajectory, robot)
    contents = Contents(
        setup=Setup(
            solver.frame,
            solver.tool,
            solver.verifier.options.collision,
            obstacles,
            obstacles=True,
            clearance=clearance,
        ),
        axis=axis,
        span=span,
        shapes=shapes,
        visuals=meshes,
        dressed=visuals,
        note="; ".join(notes),
        slices=_slices(robot, reachability),
        playback=playback,
        velocity_limit=None if velocity_limit is None else velocity_limits(robot, velocity_limit),
    )
    start, _ = seed_within_limits(robot, seed)
    if target is None and playback is not None and seed is None:
        start = playback.at(0.0)
    place = inspector.pose_of(start)
    if target is not None:
        asked = checked_target(target)
        place = pin.SE3(place.rotation if asked.position_only else asked.rotation, asked.position)
    if axis is not None:
        view = inspector.turned(place, axis, start, None, span)
    elif playback is not None and target is None and seed is None:
        view = inspector.replayed(playback)
    else:
        view = inspector.posture(start) if target is None else inspector.at(place, start)
    return Viewer(inspector, view, contents, host=host, port=port)


def _visuals(robot: Robot) -> tuple[tuple[ArmPart, ...] | None, str]:
    """The visual meshes of the robot's file, or None and why they cannot be drawn."""
    try:
        return load_visuals(robot), ""
    except ModelError as error:
        return None, f"The shapes that collide are drawn instead of the visual meshes: {error}"


def _slices(robot: Robot, reachability: ReachabilityMap | str | Path | None) -> MapSlices | None:
    """The slices of a map; of the bundled one where none is given and the robot is the bundled one.

    Raises:
        InvalidInputError: not a map, or one of another robot.
    """
    if isinstance(reachability, ReachabilityMap):
        recipe = reachability.recipe
        if fingerprint(robot, shapes=recipe["collision"] != "ignore") != recipe["robot"]["sha256"]:
            raise InvalidInputError(f"reachability is a map of another robot than this {robot.label}")
        return MapSlices(reachability)
    if reachability is not None:
        return MapSlices(load(reachability, robot=robot))
    if robot.source.bundled is None:
        return None
    try:
        return MapSlices(load(bundled(robot.source.bundled).folder, robot=robot))
    except InvalidInputError:  # an arm without a map, or with limits of its own
        return None


SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")


def show(
    shown: IKResult | SolutionSet | Trajectory,
    of: Robot | IKSolver,
    *,
    scene: Scene | None = None,
    browse: bool = True,
    port: int = 0,
) -> Viewer:
    """Show a result in the browser; `result.show(of)`, `solution_set.show(of)` and `trajectory.show(of)` call this.

    Args:
        shown: an answer of `solve`, of which the arm stands where it is; what `solve_all` gave, each point of which is
            drawn; a trajectory, to play.
        of: the robot that it is about, or the solver that found it, for its frame, tool, obstacles and contact.
        scene: obstacles, instead of the solver's.
        browse: open the page with the browser of this machine, where there is a screen. The address is `url` of what is
            returned, and what it prints as.
        port: 0 for any free one.

    Returns:
        The running viewer, at once: `wait()` for its end, or `close()` it. A program that ends takes it along.

    Raises:
        MissingExtraError: viser is not installed.
        InvalidInputError: a result of another robot, no branches, neither a robot nor a solver.
        JacokinError: as `serve`.
    """
    browsing = checks.flag("browse", browse)
    if isinstance(of, IKSolver):
        robot, options = of.robot, of.verifier.options
        scene = options.scene if scene is None else scene
        solving = partial(serve, robot, frame=of.frame, tool=of.tool, collision=options.collision, scene=scene)
        serving = partial(solving, clearance=options.clearance, port=port)
    elif isinstance(of, Robot):
        robot, serving = of, partial(serve, of, scene=scene, port=port)
    else:
        raise checks.refusal("of", "a Robot, or the IKSolver that found the result", of)
    if isinstance(shown, IKResult):
        viewer = serving(seed=shown.q)
    elif isinstance(shown, SolutionSet):
        if not len(shown):
            raise InvalidInputError("there is no configuration to show: the pose is out of reach")
        nearest = shown.nearest()
        at = checks.vector("set", shown.q[0] if nearest is None else nearest, robot.dof, "rad")
        frame, tool = (of.frame, of.tool) if isinstance(of, IKSolver) else (None, None)
        place = robot.forward_kinematics(at, frame)
        viewer = serving(target=place if tool is None else place * tool, seed=nearest)
    else:
        viewer = serving(trajectory=shown, velocity_limit=getattr(shown, "velocity_limit", None))
    if browsing and (sys.platform != "linux" or any(os.environ.get(name) for name in SCREENS)):
        webbrowser.open(viewer.url)
    return viewer
