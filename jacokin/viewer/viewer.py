"""`Viewer`: the running viewer of one robot, from what pages do to what they show."""

from __future__ import annotations

import logging
import math
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Self

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import JacokinError, ModelError
from jacokin.ik.solver import IKSolver
from jacokin.model import checks, poses
from jacokin.model.gripper import opening_range
from jacokin.model.scene import Scene
from jacokin.motion.free_motion.plan_motion import plan_motion
from jacokin.motion.tracking.steps import TrackerStep
from jacokin.motion.tracking.tracker import Tracker
from jacokin.motion.trajectory import MotionStatus, Trajectory
from jacokin.viewer import paste
from jacokin.viewer.contents import Contents, Playback
from jacokin.viewer.drawing import ArmPart, load_parts
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.texts import REACHED
from jacokin.viewer.view import View

if TYPE_CHECKING:
    import viser

    from jacokin.teleop import Controller, TeleopStep
    from jacokin.viewer.browser.panel import HandControls

AIMED = {"target", "shown", "typed", "axis", "range", "prefer"}  # what changes the target
PERIOD = 0.02  # [s] from one picture to the next of what moves by itself
TICK = 0.01  # [s] of the tracker: 100 Hz, as the real arm takes joint angles
OPENINGS = 12  # of the hand that are drawn, beside the first


logger = logging.getLogger(__name__)


class Viewer:
    """A running viewer, made by `serve`. A context manager: leaving it closes the viewer."""

    def __init__(self, inspector: Inspector, start: View, contents: Contents, *, host: str, port: int) -> None:
        """Start the server and the thread that answers pages; users call `serve`."""
        from jacokin.viewer.browser import panel, server
        from jacokin.viewer.browser.controls import posting
        from jacokin.viewer.browser.stage import Stage

        self._inspector = inspector
        self._inbox = Inbox()
        self._view = start
        self._drawing = threading.Lock()
        self._contents = contents
        self._setup = contents.setup
        self._following: GizmoFollower | None = None
        self._going: Going | None = None
        self._led: tuple[Callable[[], View], float | None] | None = None
        self._led_drawn = 0.0
        self._hand: HandControls | None = None
        self._hands: dict[int, tuple[ArmPart, ...]] = {}
        self._opening: int | None = None
        self._fingers: tuple[float, float] | None = None  # between which they are drawn; not known yet
        self._motion: Trajectory | None = None
        self._start = start.q  # of the next motion
        self._goal = self._asked = start.target
        self._server, self._url = server.start(host, port, inspector.robot.label)
        self._server.add_script(panel.HAND_SCRIPT, panel.read_hand_script())
        self._stage = Stage(self._server, inspector, self._parts(contents.dressed), contents)
        self._panel = panel.Panel(self._server, inspector, self._inbox.post, contents)
        self._player = self._panel.player
        self._stage.gizmo.on_update(posting(self._inbox.post, "target"))
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
        """What the page shows; waits for what is being drawn."""
        with self._drawing:
            return self._view

    @property
    def motion(self) -> Trajectory | None:
        """What "Go" planned last: a motion, or why there is none; None before."""
        return self._motion

    @property
    def scene(self) -> Scene | None:
        """The obstacles: those that were given, and those that pages have added; None for none."""
        return self._setup.scene

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

    def add_controller(self) -> Controller:
        """Let pages lead an arm by keys and a gamepad: a device for `jacokin.teleop.lead`.

        The page gets a folder "Hand". What leads is the page in front, and none while no page is. A second call gives
        a controller of its own, and the one before hears nothing more.
        """
        from jacokin.teleop import Controller
        from jacokin.viewer.browser.panel import HandControls

        controller = Controller()
        if self._hand is not None:
            self._hand.remove()
        self._hand = HandControls(self._server, controller)
        return controller

    def follow(self, step: TeleopStep, *, finger_angle: float | None = None) -> None:
        """Show the arm where a tick of teleoperation brought it; every tick may be given, some are drawn.

        Args:
            step: of a `Teleop` with this robot and frame.
            finger_angle: of the fingers, drawn at a dozen openings of a gripper that is
                known or can be measured [rad], or [m] where they slide; None for as they are.

        Raises:
            InvalidInputError: not a step.
        """
        from jacokin.teleop import TeleopStep

        checks.instance("step", step, TeleopStep, "a TeleopStep")
        self._lead(lambda: self._followed(step), finger_angle, at_once=not step.v.any())

    def stand(self, q: ArrayLike, *, finger_angle: float | None = None, note: str = "") -> None:
        """Show the arm where something else moves it; every tick may be given, some are drawn.

        Args:
            q: (dof,) where the joints are [rad].
            finger_angle: of the fingers, as for `follow`.
            note: what the arm is doing, in words.

        Raises:
            InvalidInputError: not such a configuration.
        """
        at = self._inspector.robot.configuration(q, "q")
        self._lead(lambda: self._inspector.played(at, note), finger_angle)

    def _lead(self, view: Callable[[], View], finger_angle: float | None, *, at_once: bool = False) -> None:
        """Take where the arm is now, and draw it if the last time was long ago, or at once."""
        angle = None if finger_angle is None else checks.number("finger_angle", finger_angle, "rad")
        self._led = view, angle
        now = time.monotonic()
        if now - self._led_drawn >= PERIOD or at_once:
            self._led_drawn = now
            self._inbox.post("led")

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

    def __repr__(self) -> str:
        """The address of the page."""
        return f"Viewer({self._url})"

    def __enter__(self) -> Self:
        """The viewer itself."""
        return self

    def __exit__(self, *raised: object) -> None:
        """Close."""
        self.close()

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
            ({"ghosts", "ellipsoid", "datasheet", "commanded", "visuals", "degrees"}, self._draw),
            ({"add", "clicked", "pick", "shape", "moved", "remove"}, self._build),  # the obstacles
            ({"setup"}, self._change_setup),
            ({"track"}, self._track),
            ({"play", "time", "speed"}, self._play),
            ({"joints"}, self._pose_joints),
            ({"branch", "next", "previous"}, self._choose),
            (AIMED | {"angle"}, self._aim),
            ({"start"}, self._start_here),
            ({"go"}, self._go),
            ({"led"}, self._draw_led),
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
            self._stage.arm.dress(self._parts(self._panel.wants("visuals")))
        if "degrees" in names:
            self._panel.change_unit()
        self._stage.datasheet, self._stage.commanded = self._panel.wants("datasheet"), self._panel.wants("commanded")
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
            self._stage.draw_path()
        self._aim({})

    def _build(self, names: dict[str, int]) -> None:
        """Add, move or remove an obstacle, and look where the target is now."""
        scene = self._panel.building.change(names)
        wanted = replace(self._setup, scene=scene)
        solver = wanted.solver(self._inspector.robot)
        self._stop()
        self._inspector.solver, self._setup = solver, wanted
        self._panel.solving.show(wanted)
        self._stage.draw_obstacles(scene)
        self._stage.show_obstacles(wanted.obstacles)
        self._aim({})

    def _track(self, names: dict[str, int]) -> None:
        """Begin or end following the gizmo."""
        wanted = self._panel.wants("track")
        if wanted and self._following is not None:  # ended and begun again before this was answered
            return
        self._stop()
        if not wanted:
            self._aim({})  # where the gizmo is, which may have moved on
            return
        try:
            self._following = GizmoFollower(self._inspector.solver, self._seed(), self._contents.velocity_limit)
        except JacokinError:
            self._panel.stop_tracking()
            raise
        self._goal = self._stage.target()

    def _play(self, names: dict[str, int]) -> None:
        """Play, pause, scrub, change the speed."""
        player = self._player
        if player is None:
            return
        if self._following is not None or self._going is not None:
            self._stop()
        if "speed" in names:
            player.playback.set_speed(player.speed)
        if "time" in names:
            player.playback.scrub(player.time)
        if names.get("play", 0) % 2:
            player.playback.toggle()
        self._move(0.0)

    def _start_here(self, names: dict[str, int]) -> None:
        """Let the next motion begin where the arm is shown."""
        self._stop()
        self._start = self._view.q
        self._show(self._view, move_gizmo=False)

    def _go(self, names: dict[str, int]) -> None:
        """Begin a motion from the start to what is shown; or stop the one underway, and stand there."""
        if names["go"] % 2 == 0:
            return
        if self._going is not None:
            note = f"Stopped at {self._going.said}; choose a branch or move the target to go on"
            self._stop()
            self._show(replace(self._view, note=note), move_gizmo=False)
            return
        self._stop()
        inspector = self._inspector
        goal = replace(inspector.closest(self._view) if self._view.pending else self._view, commanded=None)
        self._panel.show_going(True)
        self._show(replace(goal, note="Looking for a way"), move_gizmo=False)
        try:
            planner = self._setup.planner(inspector.solver)
            speeds = self._contents.velocity_limit
            self._motion = motion = plan_motion(planner, self._start, goal.q, time_limit=1.0, velocity_limit=speeds)
            stopped = self._inbox.drop("go")  # the same button, meanwhile
            if motion.success and not stopped:
                self._going = Going(motion, goal, inspector)
        finally:
            self._view = goal
            self._panel.show_going(self._going is not None)
        if stopped:
            self._show(replace(goal, note="Stopped before a way was found"), move_gizmo=False)
        elif not motion.success:
            note = f"No motion: {motion.message}. {MotionStatus[motion.outcome].value}"
            self._show(replace(goal, note=note), move_gizmo=False)

    def _followed(self, step: TeleopStep) -> View:
        """The view of a tick of a hand that leads."""
        if self._hand is not None:
            self._hand.show(step)
        target = self._inspector.pose_of(step.q) if step.target is None else step.target
        return replace(self._inspector.followed(target, step.tracking), note=str(step))

    def _draw_led(self, names: dict[str, int]) -> None:
        """Show the arm where it was last said to be."""
        if self._led is None:
            return
        view, angle = self._led
        self._stop()
        if angle is not None:
            self._open_hand(angle)
        self._arrive(view())

    def _open_hand(self, angle: float) -> None:
        """Draw the fingers at about an angle [rad], or [m] where they slide; a gripper that is not known stays."""
        if self._panel.wants("visuals"):
            return
        robot = self._inspector.robot
        if self._fingers is None:
            try:
                self._fingers = opening_range(robot)
            except ModelError:
                self._fingers = (0.0, 0.0)
        low, high = sorted(self._fingers)
        if low == high:
            return
        opening = round((angle - low) / (high - low) * OPENINGS)
        if opening == self._opening:
            return
        if opening not in self._hands:
            drawn = min(max(low + opening / OPENINGS * (high - low), low), high)
            self._hands[opening], _ = load_parts(robot, drawn)
        self._opening = opening
        self._stage.arm.dress(self._hands[opening])

    @property
    def _moving(self) -> bool:
        """Whether the arm moves by itself."""
        playing = self._player is not None and self._player.playback.playing
        return self._following is not None or self._going is not None or playing

    def _stop(self) -> None:
        """Let nothing move by itself any more."""
        if self._following is not None:
            self._following = None
            self._panel.stop_tracking()
        if self._going is not None:
            self._going = None
            self._panel.show_going(False)
        if self._player is not None and self._player.playback.playing:
            self._player.playback.toggle()
            self._player.show()

    def _move(self, elapsed: float) -> None:
        """Let a time [s] pass for what moves by itself."""
        if self._following is not None:
            step = self._following.advance(self._goal, elapsed)
            if step is not None:
                self._arrive(self._inspector.followed(self._goal, step), move_gizmo=False)
        elif self._going is not None:
            view, over = self._going.advance()
            if over:
                self._stop()
            self._arrive(view, move_gizmo=False)
        elif self._player is not None:
            playback = self._player.playback
            playback.advance(elapsed)
            self._arrive(self._inspector.replayed(playback))
            self._player.show()

    def _arrive(self, view: View, *, move_gizmo: bool = True) -> None:
        """Show a view to which the arm moved by itself: motions begin there."""
        self._start = view.q
        self._show(view, move_gizmo=move_gizmo)

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
        ghosts, ellipsoid = self._panel.wants("ghosts"), self._panel.wants("ellipsoid")
        # As one message: browsers draw it at once, and the thread that sends is woken once.
        with self._drawing, self._server.atomic():
            self._stage.show(view, ghosts=ghosts, ellipsoid=ellipsoid, move_gizmo=move_gizmo)
            self._stage.mark_start(self._start, visible=ghosts and not np.array_equal(self._start, view.q))
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

    def drop(self, name: str) -> bool:
        """Forget a name; returns whether it waited."""
        with self._changed:
            return self._counts.pop(name, 0) > 0

    def close(self) -> None:
        """Let `take` return None from now on."""
        with self._changed:
            self._closed = True
            self._changed.notify_all()


class GizmoFollower:
    """A tracker that follows the gizmo at 100 Hz of the clock, within the velocity limits."""

    def __init__(self, solver: IKSolver, q: Array, velocity_limit: Array | None) -> None:
        """Start at rest at `q` (dof,) [rad].

        Args:
            solver: for its robot, frame and tool.
            q: where the arm is.
            velocity_limit: (dof,) [rad/s]; None for the robot's own.

        Raises:
            InvalidInputError: neither there nor in the robot's file is a velocity limit.
        """
        robot = solver.robot
        self._tracker = Tracker(robot, solver.frame, dt=TICK, q=q, tool=solver.tool, velocity_limit=velocity_limit)
        self._owed = 0.0  # [s] on the clock that no tick has covered

    def advance(self, target: pin.SE3, elapsed: float) -> TrackerStep | None:
        """Let time pass on the clock [s], in whole ticks; the last one, or None when there was none."""
        self._owed += elapsed
        if self._owed > 0.1:  # [s], a long pause: the tracker goes on from where it is
            self._owed = TICK
        step = None
        while self._owed >= TICK:
            step = self._tracker.step(target)
            self._owed -= TICK
        return step


class Going:
    """A planned motion that is played once, at its own speed on the clock, and ends at what was shown."""

    def __init__(self, motion: Trajectory, goal: View, inspector: Inspector) -> None:
        """Begin now.

        Args:
            motion: ends at the arm of `goal`, whole turns of joints without limits aside.
            goal: the view to come to.
            inspector: of the robot.
        """
        self._motion, self._goal, self._inspector = motion, goal, inspector
        self._playback = Playback(motion, inspector.robot)
        self._began = time.monotonic()

    @property
    def said(self) -> str:
        """How far it is, in words."""
        return self._playback.said

    def advance(self) -> tuple[View, bool]:
        """The view of now, and whether the motion is over."""
        playback, goal = self._playback, self._goal
        playback.scrub(time.monotonic() - self._began)
        if playback.time < playback.duration:
            return self._inspector.underway(goal, playback.at(playback.time), f"Moving, {self.said}"), False
        far = max(goal.errors) > REACHED
        rest = f"; {1e3 * goal.errors[0]:.1f} mm and {math.degrees(goal.errors[1]):.1f} deg from the target"
        q = checks.read_only(self._motion.q[-1])
        return replace(goal, q=q, note=f"Arrived: {self._motion.message}{rest if far else ''}"), True
