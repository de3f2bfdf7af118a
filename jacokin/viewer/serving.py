"""`serve`: open the viewer of a robot; `show`: of a result."""

from __future__ import annotations

import importlib.util
import logging
import webbrowser
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from jacokin.ik.targets import TargetPose, checked_target
from jacokin.model import checks
from jacokin.model.loading import load_robot
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot, fingerprint, velocity_limits
from jacokin.model.scene import Scene, checked_scene
from jacokin.reachability import ReachabilityMap, bundled, load
from jacokin.showing import has_display
from jacokin.viewer.contents import Contents, MapSlices, Playback, Setup
from jacokin.viewer.drawing import ArmPart, load_parts, load_visuals
from jacokin.viewer.inspector import FULL_TURN, Inspector
from jacokin.viewer.view import View
from jacokin.viewer.viewer import Viewer

if TYPE_CHECKING:
    from jacokin.logs import Recording
    from jacokin.motion.trajectory import Trajectory

AXES = ("x", "y", "z")

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class ViewerOptions:
    """What a viewer solves for, and how it shows it; `serve` checks them."""

    frame: str | None = None
    """Frame to bring to the target; None for the robot's default frame."""
    tool: pin.SE3 | ArrayLike | None = None
    """T_frame_tool, a constant pose after the frame."""
    collision: str | None = None
    """Contact of the branches: "prefer", "reject", "report", "ignore" or None, as for `IKSolver`."""
    clearance: float = 0.0
    """Shapes this near to each other count as touching [m]."""
    prefer: str = "nearest"
    """Which feasible branch the arm goes to: the one "nearest" to where it is, of the largest limit "margin", or of the
    largest "manipulability"."""
    free_axis: str | None = None
    """"x", "y" or "z": the tool may turn about this axis of its own."""
    free_range: Sequence[float] = FULL_TURN
    """Least and largest angle about it [rad]."""
    visuals: bool = False
    """Draw the visual meshes of the robot's file, if it has any, instead of the shapes that collide."""
    velocity_limit: ArrayLike | None = None
    """(dof,) or one for all, of what "Track" and "Go" do [rad/s]; None for the robot's own. An arm whose file gives
    none is shown all the same, and only these two ask for it."""
    host: str = "127.0.0.1"  # this machine and no other
    """Address to serve at. Any other than this machine's own lets every computer that reaches it and knows the token
    move the gizmo; nothing is encrypted."""


def serve(
    robot: Robot | str | None = None,
    options: ViewerOptions | None = None,
    *,
    scene: Scene | None = None,
    reachability: ReachabilityMap | str | Path | None = None,
    trajectory: Trajectory | Recording | str | Path | None = None,
    target: pin.SE3 | ArrayLike | None = None,
    seed: ArrayLike | None = None,
    port: int = 8080,
) -> Viewer:
    """Show a robot in the browser: a gizmo for the target, and every branch that reaches it.

    Args:
        robot: a robot, or what `load_robot` takes; None for the j2n6s300.
        options: of the solver and of the page; None for the usual ones.
        scene: obstacles around the arm; they are drawn, and count as self-contact does unless that is ignored.
        reachability: a map to show slices of, or its folder; None for the one of a bundled robot, if there is one.
        trajectory: to play: a `Trajectory`, or a file that it saved: .csv, .npz, .json (ROS)
            or .kinova.csv; or what `Log.recording` gives, or the file of a log: .bag, .mcap or .db3. Where a log has
            it, the arm that was commanded is drawn beside the one that was measured.
        target: T_base_tool to begin with, as `pin.SE3` or (4, 4); a position (3,) [m] keeps the orientation that the
            tool has at `seed`; None for where the tool is there.
        seed: (dof,) where the arm is at first [rad]; None for the robot's home.
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
    chosen = ViewerOptions() if options is None else checks.instance("options", options, ViewerOptions, "ViewerOptions")
    if not isinstance(robot, Robot):
        robot = load_robot() if robot is None else load_robot(robot)
    obstacles = None if scene is None else checked_scene("scene", scene)
    looking = not (isinstance(chosen.collision, str) and chosen.collision == "ignore")
    solver = IKSolver(
        robot,
        chosen.frame,
        tool=chosen.tool,
        collision=chosen.collision,
        scene=obstacles if looking else None,
        clearance=chosen.clearance,
    )
    inspector = Inspector(solver, prefer=chosen.prefer)
    playback = None if trajectory is None else Playback(trajectory, robot)
    contents = _contents(solver, chosen, obstacles, _slices(robot, reachability), playback)
    view = _first_view(inspector, contents, None if target is None else checked_target(target), seed)
    return Viewer(inspector, view, contents, host=chosen.host, port=port)


def _contents(
    solver: IKSolver,
    options: ViewerOptions,
    scene: Scene | None,
    slices: MapSlices | None,
    playback: Playback | None,
) -> Contents:
    """What there is to show.

    Raises:
        InvalidInputError: an option is wrong.
    """
    robot, axis, limit = solver.robot, options.free_axis, options.velocity_limit
    shapes, shapes_note = load_parts(robot)
    meshes, meshes_note = _visuals(robot)
    notes = [note for note in (shapes_note, meshes_note) if note]
    for note in notes:
        logger.warning("%s", note)
    return Contents(
        setup=Setup(
            solver.frame,
            solver.tool,
            solver.verifier.options.collision,
            scene,
            obstacles=True,
            clearance=options.clearance,
        ),
        axis=None if axis is None else AXES.index(checks.choice("free_axis", axis, AXES)),
        span=FreeAxis(pin.SE3.Identity(), axis=(0, 0, 1), range=options.free_range).range,
        shapes=shapes,
        visuals=meshes,
        dressed=checks.flag("visuals", options.visuals),
        note="; ".join(notes),
        slices=slices,
        playback=playback,
        velocity_limit=None if limit is None else velocity_limits(robot, limit),
    )


def _first_view(inspector: Inspector, contents: Contents, target: TargetPose | None, seed: ArrayLike | None) -> View:
    """What is shown at first.

    Raises:
        InvalidInputError: a seed that is malformed.
    """
    start, _ = seed_within_limits(inspector.robot, seed)
    playback = contents.playback
    if target is None and playback is not None and seed is None:
        start = playback.at(0.0)
    place = inspector.pose_of(start)
    if target is not None:
        place = pin.SE3(place.rotation if target.position_only else target.rotation, target.position)
    if contents.axis is not None:
        return inspector.turned(place, contents.axis, start, None, contents.span)
    if playback is not None and target is None and seed is None:
        return inspector.replayed(playback)
    return inspector.posture(start) if target is None else inspector.at(place, start)


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
        robot, solving = of.robot, of.verifier.options
        scene = solving.scene if scene is None else scene
        options = ViewerOptions(of.frame, of.tool, solving.collision, solving.clearance)
    elif isinstance(of, Robot):
        robot, options = of, ViewerOptions()
    else:
        raise checks.refusal("of", "a Robot, or the IKSolver that found the result", of)
    serving = partial(serve, robot, scene=scene, port=port)
    if isinstance(shown, IKResult):
        viewer = serving(options, seed=shown.q)
    elif isinstance(shown, SolutionSet):
        if not len(shown):
            raise InvalidInputError("there is no configuration to show: the pose is out of reach")
        nearest = shown.nearest()
        at = checks.vector("set", shown.q[0] if nearest is None else nearest, robot.dof, "rad")
        frame, tool = (of.frame, of.tool) if isinstance(of, IKSolver) else (None, None)
        place = robot.forward_kinematics(at, frame)
        viewer = serving(options, target=place if tool is None else place * tool, seed=nearest)
    else:
        limit = getattr(shown, "velocity_limit", None)
        viewer = serving(replace(options, velocity_limit=limit), trajectory=shown)
    if browsing and has_display():
        webbrowser.open(viewer.url)
    return viewer
