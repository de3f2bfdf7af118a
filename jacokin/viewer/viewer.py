"""`serve`: the viewer of one robot in the browser, from what pages do to what they show."""

from __future__ import annotations

import importlib.util
import logging
import threading
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import JacokinError, MissingExtraError
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import TargetPose
from jacokin.ik.targets import checked as checked_target
from jacokin.model import poses
from jacokin.model.loading import load_robot
from jacokin.model.pose_targets import pose
from jacokin.model.robot import Robot
from jacokin.viewer import shapes, texts
from jacokin.viewer.inbox import Inbox
from jacokin.viewer.view import Inspector, View

if TYPE_CHECKING:
    import viser

DEFAULT_PORT = 8080
DEFAULT_HOST = "127.0.0.1"  # this machine and no other

logger = logging.getLogger(__name__)


class Viewer:
    """A running viewer, made by `serve`. A context manager: leaving it closes the viewer."""

    def __init__(self, inspector: Inspector, target: pin.SE3 | None, start: Array, host: str, port: int) -> None:
        """Start the server and the thread that answers pages; users call `serve`."""
        from jacokin.viewer import server
        from jacokin.viewer.panel import Panel
        from jacokin.viewer.stage import Stage

        self._inspector = inspector
        self._inbox = Inbox()
        self._view = inspector.posture(start) if target is None else inspector.at(target, start)
        parts = shapes.parts_of(inspector.robot)
        self._server, self._url = server.start(host, port, inspector.robot.name)
        self._stage = Stage(self._server, inspector, parts)
        self._panel = Panel(self._server, inspector, self._inbox.post)
        self._stage.gizmo.on_update(self._gizmo_moved)
        self._show(self._view)
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._answer, name="jacokin viewer", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page."""
        return self._url

    @property
    def view(self) -> View:
        """What the page shows."""
        return self._view

    @property
    def server(self) -> viser.ViserServer:
        """Viser's server, to add to the scene or to take pictures of it."""
        return self._server

    def show(self, target: pin.SE3 | ArrayLike) -> None:
        """Move the gizmo to a target, T_base_tool as `pin.SE3` or (4, 4).

        Raises:
            InvalidInputError: the target is malformed.
        """
        self._stage.place_gizmo(poses.checked_pose(target))
        self._inbox.post("shown")

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the viewer is closed, or so long [s]; returns whether it is."""
        return self._done.wait(timeout)

    def close(self) -> None:
        """Stop serving; pages stay open and say so. May be called again."""
        if self._done.is_set():
            return
        from jacokin.viewer import server

        self._inbox.close()
        self._thread.join()
        server.stop(self._server)
        self._done.set()

    def __enter__(self) -> Self:
        """The viewer itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        """Close."""
        self.close()

    async def _gizmo_moved(self, event: viser.TransformControlsEvent) -> None:
        self._inbox.post("target")

    def _answer(self) -> None:
        """Answer what pages do, until the viewer is closed; the closest configuration when there is time for it."""
        while True:
            names = self._inbox.take(0.0 if self._view.pending else None)
            if names is None:
                return
            try:
                self._act(names)
            except JacokinError as error:  # a client sent what is not a number: show again what was there
                logger.warning("ignored: %s", error)
                self._show(self._view)
            except Exception:
                logger.exception("the viewer could not answer %s", ", ".join(names))

    def _act(self, names: dict[str, int]) -> None:
        view = self._view
        if not names:
            self._show(self._inspector.closest(view), move_gizmo=False)
            return
        for name in ("python", "command"):
            if name in names:
                make = texts.python_text if name == "python" else texts.command_text
                self._panel.say(make(self._inspector, view))
        if "ghosts" in names:
            self._stage.show_ghosts(self._panel.ghosts)
            self._show(view)
        if "joints" in names:
            self._show(self._inspector.posture(self._panel.joints(view.q)))
        elif "target" in names or "shown" in names:
            position, quat = self._stage.target()
            self._show(self._inspector.at(pose(position, quat), self._seed()), move_gizmo="shown" in names)
        elif names.keys() & {"branch", "next", "previous"} and len(view.branches):
            chosen = self._panel.branch if "branch" in names else view.selected
            step = names.get("next", 0) - names.get("previous", 0)
            wanted = 0 if chosen is None else (chosen + step) % len(view.branches)
            self._show(self._inspector.choose(view, wanted), move_gizmo=False)

    def _seed(self) -> Array:
        """Where the arm is, within the limits."""
        robot = self._inspector.robot
        return np.asarray(np.clip(self._view.q, robot.lower, robot.upper))

    def _show(self, view: View, *, move_gizmo: bool = True) -> None:
        self._stage.show(view, move_gizmo=move_gizmo)
        self._panel.show(view)
        self._view = view


def serve(
    robot: Robot | str | None = None,
    *,
    frame: str | None = None,
    tool: pin.SE3 | ArrayLike | None = None,
    collision: str = "ignore",
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
        collision: self-contact of the branches: "ignore", "report" or "reject", as for `IKSolver`.
        target: T_base_tool to begin with, as `pin.SE3` or (4, 4); a position (3,) [m] keeps the orientation that the
            tool has at `seed`; None for where the tool is there.
        seed: (dof,) where the arm is at first [rad]; None for the robot's home.
        host: address to serve at. Any other than this machine's own lets every computer that reaches it move the gizmo.
        port: 0 for any free one.

    Returns:
        The running viewer: open its `url` in a browser, and `close()` it.

    Raises:
        MissingExtraError: viser is not installed.
        InvalidInputError: target or seed malformed, the host unknown here, or the port in use.
        JacokinError: as `load_robot` and `IKSolver`.
    """
    if importlib.util.find_spec("viser") is None:
        raise MissingExtraError("viser", "viewer")
    if not isinstance(robot, Robot):
        robot = load_robot() if robot is None else load_robot(robot)
    solver = IKSolver(robot, frame, tool=tool, collision=collision)
    inspector = Inspector(solver)
    start, _ = seed_within_limits(robot, seed)
    wanted = None if target is None else _pose(inspector, checked_target(target), start)
    return Viewer(inspector, wanted, start, host, port)


def _pose(inspector: Inspector, target: TargetPose, start: Array) -> pin.SE3:
    """A target whose orientation, if free, is that of the tool at `start`."""
    rotation = inspector.pose_of(start).rotation if target.position_only else target.rotation
    return pin.SE3(rotation, target.position)
