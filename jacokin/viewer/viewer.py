"""`Viewer`: the running viewer of one robot, from what pages do to what they show."""

from __future__ import annotations

import logging
import threading
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik.solver import IKSolver
from jacokin.model import poses
from jacokin.motion.tracking.tracker import Tracker, TrackerStep
from jacokin.viewer import paste
from jacokin.viewer.contents import Contents
from jacokin.viewer.drawing import ArmPart
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.view import View

if TYPE_CHECKING:
    import viser

AIMED = {"target", "shown", "typed", "axis", "range", "prefer"}  # what changes the target
PERIOD = 0.02  # [s] from one picture to the next of what moves by itself
TICK = 0.01  # [s] of the tracker: 100 Hz, as the real arm takes joint angles
LONGEST_LAG = 0.1  # [s] of ticks that are caught up with; after a longer pause the tracker goes on from where it is

logger = logging.getLogger(__name__)


class Viewer:
    """A running viewer, made by `serve`. A context manager: leaving it closes the viewer."""

    def __init__(self, inspector: Inspector, start: View, contents: Contents, *, host: str, port: int) -> None:
        """Start the server and the thread that answers pages; users call `serve`."""
        from jacokin.viewer.browser import server
        from jacokin.viewer.browser.panel import Panel
        from jacokin.viewer.browser.stage import Stage

        self._inspector = inspector
        self._inbox = Inbox()
        self._view = start
        self._contents = contents
        self._setup = contents.setup
        self._following: Following | None = None
        self._goal = self._asked = start.target
        self._server, self._url = server.start(host, port, inspector.robot.name)
        self._stage = Stage(self._server, inspector, self._parts(contents.dressed), contents)
        self._panel = Panel(self._server, inspector, self._inbox.post, contents)
        self._player = self._panel.player
        self._stage.gizmo.on_update(self._gizmo_moved)
        self._show(start)
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._answer, name="jacokin viewer", daemon=True)
        self._thread.start()

    @property
    def url(self) -> str:
        """Address of the page, with the token that lets it in."""
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
        self._asked = poses.checked_pose(target)
        self._inbox.post("shown")

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until the viewer is closed, or so long [s]; returns whether it is."""
        return self._done.wait(timeout)

    def close(self) -> None:
        """Stop serving; pages stay open and say so. May be called again."""
        if self._done.is_set():
            return
        self._inbox.close()
        self._thread.join()
        self._server.stop()
        self._done.set()

    def __enter__(self) -> Self:
        """The viewer itself."""
        return self

    def __exit__(self, *raised: object) -> None:
        """Close."""
        self.close()

    async def _gizmo_moved(self, event: viser.TransformControlsEvent) -> None:
        self._inbox.post("target")

    def _answer(self) -> None:
        """Until closed: answer what pages do, move what moves by itself, and look for closest configurations."""
        before = time.monotonic()
        while True:
            moving = self._moving
            names = self._inbox.take(PERIOD if moving else 0.0 if self._view.pending else None)
            now = time.monotonic()
            elapsed, before = now - before, now
            if names is None:
                return
            try:
                if names:
                    self._act(names)
                elif not moving:
                    self._show(self._inspector.closest(self._view), move_gizmo=False)
                if moving and self._moving:  # what began just now had no time to move
                    self._move(elapsed)
            except JacokinError as error:
                self._ignore(error, move_gizmo=True)
            except Exception:
                logger.exception("the viewer could not answer %s", ", ".join(names))
                self._view = replace(self._view, pending=False)

    def _ignore(self, error: JacokinError, *, move_gizmo: bool) -> None:
        """Say that what a client sent was ignored, and why; a gizmo that got lost goes back."""
        logger.warning("ignored: %s", error)
        self._show(replace(self._view, note=f"Ignored: {error}", pending=False), move_gizmo=move_gizmo)

    def _act(self, names: dict[str, int]) -> None:
        """Answer the latest of each kind; an error in one does not keep the others from being answered."""
        self._view = replace(self._view, note="")
        for kinds, answer in (
            ({"python", "command"}, self._copy),
            ({"slice"}, self._slice),
            ({"ghosts", "ellipsoid", "visuals", "degrees"}, self._draw),
            ({"setup"}, self._change_setup),
            ({"track"}, self._track),
            ({"play", "time", "speed"}, self._play),
            ({"joints"}, self._pose_joints),
            ({"branch", "next", "previous"}, self._choose),
            (AIMED | {"angle"}, self._aim),
        ):
            if names.keys() & kinds:
                try:
                    answer(names)
                except JacokinError as error:
                    self._ignore(error, move_gizmo=kinds >= AIMED)

    def _copy(self, names: dict[str, int]) -> None:
        """Show the text to paste that was asked for."""
        make = paste.python_text if "python" in names else paste.command_text
        self._panel.say(make(self._inspector, self._view))

    def _slice(self, names: dict[str, int]) -> None:
        """Show another slice of the map, or none."""
        if self._panel.slicing is not None:
            self._panel.slicing.show()

    def _draw(self, names: dict[str, int]) -> None:
        """Draw more or less of the same view."""
        if "visuals" in names:
            self._stage.arm.dress(self._parts(self._panel.visuals))
        if "degrees" in names:
            self._panel.change_unit()
        self._show(self._view, move_gizmo=False)

    def _pose_joints(self, names: dict[str, int]) -> None:
        """Bring the joints to where their sliders are; the target follows."""
        self._stop()
        self._show(self._inspector.posture(self._panel.joints.wanted(self._view.q)))

    def _choose(self, names: dict[str, int]) -> None:
        """Go to another branch."""
        view = self._view
        if not len(view.branches):
            return
        self._stop()
        chosen = self._panel.branch if "branch" in names else view.selected
        step = names.get("next", 0) - names.get("previous", 0)
        wanted = 0 if chosen is None else (chosen + step) % len(view.branches)
        self._show(self._inspector.choose(view, wanted), move_gizmo=False)

    def _aim(self, names: dict[str, int]) -> None:
        """Take the gizmo for the target, free axis included; or move the free joint where the target is."""
        self._inspector.prefer = self._panel.prefer
        view = self._view
        if not names.keys() & AIMED and "angle" in names and view.free is not None and view.free.axis is None:
            self._stop()
            self._show(self._inspector.slid(view, self._panel.free.value))
            return
        if "shown" in names:
            self._stage.place_gizmo(self._asked)
        if "typed" in names:
            self._stage.place_gizmo(self._panel.target.wanted(view.gizmo))
        target, free = self._stage.target(), self._panel.free
        if self._following is not None and free.axis is None:
            self._goal = target
            return
        self._stop()
        if free.axis is None:
            view = self._inspector.at(target, self._seed())
        else:
            angle = free.value if "angle" in names else None
            view = self._inspector.turned(target, free.axis, self._seed(), angle, free.span)
        self._show(view, move_gizmo=False)

    def _change_setup(self, names: dict[str, int]) -> None:
        """Solve for another frame or tool, where the arm is; or look for contact otherwise, where the target is."""
        solving, before = self._panel.solving, self._setup
        try:
            wanted = solving.wanted(before)
            solver = wanted.solver(self._inspector.robot)
        except JacokinError:
            solving.show(before)
            raise
        self._stop()
        self._inspector.solver, self._setup = solver, wanted
        solving.show(wanted)
        self._stage.show_obstacles(wanted.obstacles)
        if wanted.frame != before.frame or wanted.tool is not before.tool:
            self._show(self._inspector.posture(self._view.q))
        self._aim({})

    def _track(self, names: dict[str, int]) -> None:
        """Begin or end following the gizmo."""
        wanted = self._panel.track
        self._stop()
        if not wanted:
            self._aim({})  # where the gizmo is, which may have moved on
            return
        try:
            self._following = Following(self._inspector.solver, self._seed())
        except JacokinError:
            self._panel.stop_tracking()
            raise
        self._goal = self._stage.target()

    def _play(self, names: dict[str, int]) -> None:
        """Play, pause, scrub, change the speed."""
        player = self._player
        if player is None:
            return
        if self._following is not None:
            self._stop()
        if "speed" in names:
            player.playback.set_speed(player.speed)
        if "time" in names:
            player.playback.scrub(player.time)
        if names.get("play", 0) % 2:
            player.playback.toggle()
        self._move(0.0)

    @property
    def _moving(self) -> bool:
        """Whether the arm moves by itself."""
        return self._following is not None or (self._player is not None and self._player.playback.playing)

    def _stop(self) -> None:
        """Let nothing move by itself any more."""
        if self._following is not None:
            self._following = None
            self._panel.stop_tracking()
        if self._player is not None and self._player.playback.playing:
            self._player.playback.toggle()
            self._player.show()

    def _move(self, elapsed: float) -> None:
        """Let a time [s] pass for what moves by itself."""
        if self._following is not None:
            step = self._following.advance(self._goal, elapsed)
            if step is not None:
                self._show(self._inspector.followed(self._goal, step), move_gizmo=False)
        elif self._player is not None:
            playback = self._player.playback
            q = playback.advance(elapsed)
            self._show(self._inspector.played(q, f"Trajectory at {playback.time:.2f} of {playback.duration:.2f} s"))
            self._player.show()

    def _parts(self, visuals: bool) -> tuple[ArmPart, ...]:
        """What the arm is drawn by: its visual meshes, if they are wanted and there are any."""
        meshes = self._contents.visuals
        return meshes if visuals and meshes is not None else self._contents.shapes

    def _seed(self) -> Array:
        """Where the arm is, within the limits."""
        robot = self._inspector.robot
        return np.asarray(np.clip(self._view.q, robot.lower, robot.upper))

    def _show(self, view: View, *, move_gizmo: bool = True) -> None:
        # A gizmo that somebody moved meanwhile stays where it is: that target is the next one.
        move_gizmo = move_gizmo and not self._inbox.waits("target")
        self._stage.show(view, ghosts=self._panel.ghosts, ellipsoid=self._panel.ellipsoid, move_gizmo=move_gizmo)
        self._panel.show(view)
        self._view = view


class Inbox:
    """Names of what pages did and how often, in order; any thread posts, one takes."""

    def __init__(self) -> None:
        """Start empty and open."""
        self._changed = threading.Condition()
        self._counts: dict[str, int] = {}
        self._closed = False

    def post(self, name: str) -> None:
        """Add a name; one that waits already is counted."""
        with self._changed:
            self._counts[name] = self._counts.get(name, 0) + 1
            self._changed.notify()

    def take(self, wait: float | None) -> dict[str, int] | None:
        """Every name that waits, with how often it was posted.

        Args:
            wait: at most so long for a name [s]; None for without end.

        Returns:
            Empty after waiting in vain; None once closed.
        """
        with self._changed:
            self._changed.wait_for(lambda: self._counts or self._closed, wait)
            if self._closed:
                return None
            taken, self._counts = self._counts, {}
            return taken

    def waits(self, name: str) -> bool:
        """Whether a name waits to be taken."""
        with self._changed:
            return name in self._counts

    def close(self) -> None:
        """Let `take` return None from now on."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


class Following:
    """A tracker that follows the gizmo at 100 Hz of the clock, within the velocity limits."""

    def __init__(self, solver: IKSolver, q: Array) -> None:
        """Start at rest at `q` (dof,) [rad].

        Raises:
            InvalidInputError: the robot's file has no velocity limits.
        """
        self._tracker = Tracker(solver.robot, solver.frame, dt=TICK, q=q, tool=solver.tool)
        self._owed = 0.0  # [s] on the clock that no tick has covered

    def advance(self, target: pin.SE3, elapsed: float) -> TrackerStep | None:
        """Let time pass on the clock [s], in whole ticks; the last one, or None when there was none."""
        self._owed += elapsed
        if self._owed > LONGEST_LAG:
            self._owed = TICK
        step = None
        while self._owed >= TICK:
            step = self._tracker.step(target)
            self._owed -= TICK
        return step
