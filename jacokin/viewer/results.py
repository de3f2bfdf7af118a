"""`show`: open the viewer with a result."""

from __future__ import annotations

import os
import sys
import webbrowser
from functools import partial
from typing import TYPE_CHECKING

from jacokin.errors import InvalidInputError
from jacokin.ik.closed_form import Branches
from jacokin.ik.results import IKResult
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.robot import Robot
from jacokin.viewer.serving import serve
from jacokin.viewer.viewer import Viewer

if TYPE_CHECKING:
    from jacokin.model.scene import Scene
    from jacokin.motion.trajectory import Trajectory

SCREENS = ("DISPLAY", "WAYLAND_DISPLAY")


def show(
    shown: IKResult | Branches | Trajectory,
    of: Robot | IKSolver,
    *,
    scene: Scene | None = None,
    browse: bool = True,
    port: int = 0,
) -> Viewer:
    """Show a result in the browser; `result.show(of)`, `branches.show(of)` and `trajectory.show(of)` call this.

    Args:
        shown: an answer of `solve`, of which the arm stands where it is; branches of `solve_all`, each of which is
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
    elif isinstance(shown, Branches):
        if not len(shown):
            raise InvalidInputError("there are no branches to show: the pose is out of reach")
        at = checks.vector("branches", shown.q[0], robot.dof, "rad")
        frame, tool = (of.frame, of.tool) if isinstance(of, IKSolver) else (None, None)
        place = robot.forward_kinematics(at, frame)
        viewer = serving(target=place if tool is None else place * tool, seed=shown.nearest())
    else:
        viewer = serving(trajectory=shown)
    if browsing and (sys.platform != "linux" or any(os.environ.get(name) for name in SCREENS)):
        webbrowser.open(viewer.url)
    return viewer
