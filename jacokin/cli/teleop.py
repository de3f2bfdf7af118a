"""`jacokin teleop`: a recorded hand, a space mouse, keys or a gamepad lead the arm, in the viewer or in a task."""

from __future__ import annotations

import contextlib
import math
import os
import re
import select
import signal
import sys
import threading
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import files, model, motion
from jacokin.cli import display, options
from jacokin.cli.command import Command
from jacokin.cli.display import number, show_facts
from jacokin.cli.options import keep_apart
from jacokin.cli.process import NOT_SOLVED
from jacokin.errors import InvalidInputError
from jacokin.model.descriptions import bundled

if TYPE_CHECKING:
    from jacokin.arrays import Array
    from jacokin.tasks import TaskEnv
    from jacokin.teleop import Controller, Device, Keyboard, Session, Stream, Teleop, TeleopStep
    from jacokin.viewer import Viewer

DEVICES = ("player", "spacemouse", "keyboard", "page")
ARRIVED = 1e-3  # [m] nearer to its target, the tool has arrived
DT = 0.01  # [s]
ACCELERATION = 4.0  # [rad/s^2]
MOTOR_PART = 0.8  # of the acceleration that simulated motors are strong enough for
FINGERS = 3
STREAM = ".npz"
CLUTCH, LEAVE = " ", ("q", "\x1b", "\x04")
SPECIAL_KEY = r"\x1b[\[o][0-9;]*[a-z~]"  # arrows and others are sequences that begin with the character of Esc
MOST_TYPED = 256  # characters that are read at once
HINT = """w s, a d, r f move along x, y, z; j l, i k, u o turn about them; g h close and open the fingers;
space opens and closes the clutch, q ends"""


@click.command(cls=Command)
@click.option("--device", type=click.Choice(DEVICES), default="player", help="What leads the arm.")
@click.option(
    "--stream",
    metavar="FILE.npz|KIND",
    help="For the player: a recording or a made hand, smooth if not given.",
)
@click.option("--rate", default=60.0, metavar="R", help="Of a hand that is made: poses in a second [1/s].")
@options.random_seed
@click.option("--scale", default=1.0, metavar="S", help="The tool moves this many times as far as the hand.")
@click.option(
    "--filter",
    "constant",
    type=float,
    metavar="T",
    help="Time constant of a low-pass on the hand [s], 0 for none; without it, gaps between its poses are smoothed.",
)
@click.option(
    "--recover", type=float, metavar="T", help="Held off its target this long [s], the tool takes another branch."
)
@click.option("--seconds", type=float, metavar="T", help="End after this time [s]; with the device if not given.")
@click.option("--fast", is_flag=True, help="As fast as it can, instead of in real time; for the player.")
@options.scene
@options.clearance
@click.option("--dt", type=float, metavar="T", help="Control step [s]; 0.01, or that of the task.")
@click.option(
    "--acceleration-limit",
    type=float,
    metavar="A",
    help="Of the joints [rad/s^2]; 4, or what the motors of the task are strong enough for.",
)
@click.option("--task", metavar="NAME", help="Lead the arm of this task's simulation, such as reach_site.")
@click.option("--view", is_flag=True, help="Show the arm in the browser; prints the address. --device page does, too.")
@click.option("--port", type=click.IntRange(min=0), default=8080, metavar="N", help="Of the page; 0 for any free one.")
@click.option(
    "--output",
    type=options.FILE,
    metavar="FILE",
    help="Write the commanded motion here, .csv, .npz, .json (ROS) or .kinova.csv.",
)
@options.frame
@options.json
@options.robot()
def teleop(
    device: str,
    stream: str | None,
    rate: float,
    random_seed: int | None,
    scale: float,
    constant: float | None,
    recover: float | None,
    seconds: float | None,
    fast: bool,
    scene: Path | None,
    clearance: float,
    dt: float | None,
    acceleration_limit: float | None,
    task: str | None,
    view: bool,
    port: int,
    output: Path | None,
    frame: str | None,
    json: bool,
    source: options.RobotOptions,
) -> None:
    """Let a hand lead the arm: a recording, a space mouse, keys or a gamepad.

    No arm is driven but that of --task and the one that --view shows. Keys of the terminal or of the page: w s, a d,
    r f move along x, y, z; j l, i k, u o turn about them; g and h close and open the fingers; the space bar opens and
    closes the clutch; q ends, in the page its button does, and Ctrl-C everywhere: the arm brakes first. The page reads
    a gamepad, too. In a task the seed of the episode is that of --random-seed, and without --scene the arm keeps off
    the table.
    Exit code: 0 the tool ends on its target, 1 more than 1 mm off, 2 wrong input.

    Examples:
      jacokin teleop --stream jerky --fast --output motion.csv
      jacokin teleop --stream hand.npz --scene scene.yaml --clearance 0.01
      jacokin teleop --device keyboard --task reach_site
      jacokin teleop --device spacemouse --scale 0.5 --view
      jacokin teleop --device page --task lift_brick
    """
    from jacokin.motion.trajectory import FORMATS

    if device != "player" and (stream is not None or fast):
        raise InvalidInputError("--stream and --fast are for --device player")
    if output is not None and output.suffix not in FORMATS:
        raise InvalidInputError(f"--output must end in {' or '.join(FORMATS)}, got {str(output)!r}")
    recording = None if stream is None or Path(stream).suffix != STREAM else Path(stream)
    inputs = {"--robot": source.robot, "--scene": scene, "--stream": recording}
    keep_apart({"--output": output}, inputs, source.package_dirs)
    if task is not None and (dt is not None or source != options.RobotOptions(robot=model.DEFAULT_ROBOT)):
        raise InvalidInputError(f"--task has its robot, {model.DEFAULT_ROBOT}, and its control step: leave them out")
    from jacokin.teleop import Fingers, Player, SpaceMouse, Teleop, lead
    from jacokin.teleop.teleop import AUTO

    with contextlib.ExitStack() as stack:
        writable = None if output is None else stack.enter_context(files.replacing(output))
        simulation = None if task is None else stack.enter_context(_simulation(task, random_seed or 0))
        robot = source.load() if simulation is None else simulation.robot
        around = simulation.table if simulation is not None and scene is None else options.load_scene(scene)
        possible = ACCELERATION if simulation is None else simulation.acceleration.clip(max=ACCELERATION)
        tracker = motion.Tracker(
            robot,
            frame,
            q=None if simulation is None else simulation.q,
            dt=simulation.dt if simulation is not None else DT if dt is None else dt,
            scene=around,
            clearance=clearance,
            acceleration_limit=possible if acceleration_limit is None else acceleration_limit,
        )
        led = Teleop(tracker, clutch=True, scale=scale, filter=AUTO if constant is None else constant, recover=recover)
        shown = None
        if view or device == "page":
            shown = stack.enter_context(_page(tracker, around, clearance, port))
        leading: Device
        if device == "player":
            leading = Player(_stream(robot, stream, rate, random_seed or 0))
        elif device == "spacemouse":
            leading = stack.enter_context(SpaceMouse())
        elif device == "keyboard":
            leading = stack.enter_context(_keys(led))
        else:
            assert shown is not None
            leading = _PageKeys(led, shown.add_controller())
        limits = bundled.robot_table()["finger"]
        at = limits["lower"] if robot.finger_angle is None else robot.finger_angle
        fingers = Fingers(at, lower=limits["lower"], upper=limits["upper"])

        def act(step: TeleopStep) -> bool:
            angle = fingers.move(getattr(leading, "fingers", 0.0), tracker.dt)
            if shown is not None:
                shown.follow(step, finger_angle=angle)
            return simulation is None or simulation.act(step, angle)

        if shown is not None:
            click.echo(f"{shown.url} shows {robot.label}; Ctrl-C ends it", err=True)
        stop = stack.enter_context(_interrupted())
        session = lead(
            led, leading, seconds=math.inf if seconds is None else seconds, paced=not fast, act=act, stop=stop
        )
        if writable is not None:
            session.motion.save(writable)
    error = float(session.position_error[-1]) if len(session.position_error) else 0.0
    if json:
        display.print_json(_document(session, simulation))
    else:
        _show(session, simulation, output)
    if error > ARRIVED or not session.within_limits:
        raise SystemExit(NOT_SOLVED)


def _stream(robot: model.Robot, given: str | None, rate: float, seed: int) -> Stream:
    """A recording, or a hand that is made."""
    import numpy as np

    from jacokin.teleop import Stream, make_stream

    if given is not None and Path(given).suffix == STREAM:
        return Stream.load(given)
    return make_stream(robot, given or "smooth", np.random.default_rng(seed), rate=rate)


@contextlib.contextmanager
def _interrupted() -> Iterator[threading.Event]:
    """What the first Ctrl-C sets, so that the arm brakes; the second one ends the program."""
    stop = threading.Event()
    before = signal.getsignal(signal.SIGINT)
    if before == signal.SIG_IGN or threading.current_thread() is not threading.main_thread():
        yield stop
        return

    def brake(number: int, frame: object) -> None:
        stop.set()
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, brake)
    try:
        yield stop
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _page(tracker: motion.Tracker, scene: model.Scene | None, clearance: float, port: int) -> Iterator[Viewer]:
    """The viewer, with the arm where the tracker is."""
    from jacokin import viewer

    with viewer.serve(
        tracker.robot, frame=tracker.frame, scene=scene, clearance=clearance, seed=tracker.q, port=port
    ) as shown:
        yield shown


class _PageKeys:
    """Keys and gamepad of the page."""

    def __init__(self, led: Teleop, controller: Controller) -> None:
        self._led, self._controller = led, controller

    @property
    def ended(self) -> bool:
        """Whether the page has ended the session."""
        return self._controller.ended

    @property
    def fingers(self) -> float:
        """How fast the fingers are to close, from -1 to 1."""
        return self._controller.fingers

    def read(self, time: float) -> Array | None:
        """The twist that was reported since the last call."""
        if self._controller.toggled():
            self._led.clutch(not self._led.engaged)
        return self._controller.read(time)


class _Keys:
    """The keys of a terminal, and whether one has ended the session."""

    def __init__(self, led: Teleop, keyboard: Keyboard) -> None:
        self._led, self._keyboard = led, keyboard
        self.ended = False

    @property
    def fingers(self) -> float:
        """How fast the fingers are to close, from -1 to 1."""
        return self._keyboard.fingers

    def read(self, time: float) -> Array:
        """The twist of the keys that are pressed."""
        while not self.ended and select.select([sys.stdin], [], [], 0.0)[0]:
            typed = os.read(sys.stdin.fileno(), MOST_TYPED).decode("ascii", errors="replace").lower()
            self.ended = not typed
            for key in re.sub(SPECIAL_KEY, "", typed):
                if key == CLUTCH:
                    self._led.clutch(not self._led.engaged)
                self._keyboard.press(key, time)
                self.ended |= key in LEAVE
        return self._keyboard.read(time)


@contextlib.contextmanager
def _keys(led: Teleop) -> Iterator[_Keys]:
    """Keys as they are typed, without Enter; the terminal is as before afterwards.

    Raises:
        InvalidInputError: standard input is not a terminal of Unix.
    """
    from jacokin.teleop import Keyboard

    if sys.platform == "win32" or not sys.stdin.isatty():
        raise InvalidInputError("--device keyboard needs a terminal of Linux or macOS as standard input")
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        click.echo(HINT, err=True)
        yield _Keys(led, Keyboard())
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


class _Simulation:
    """A task whose arm follows commands.

    Attributes:
        robot: its arm, with the fingers about as they are.
        q: (6,) where its arm is at first [rad].
        dt: its control step [s].
        table: what the arm stands on.
        total: sum of the rewards.
        is_solved: whether the task is solved now.
        lag: largest angle of a joint between the simulated arm and the command [rad].
        acceleration: (6,) that its motors are strong enough for, with a reserve [rad/s^2].
    """

    def __init__(self, environment: TaskEnv, seed: int) -> None:
        from gymnasium.spaces import Box

        from jacokin.mujoco_bridge import robots

        self._environment = environment
        environment.reset(seed=seed)
        space = environment.action_space
        assert isinstance(space, Box)  # as the environment made it
        angles = environment.data.qpos[: len(space.low)].clip(space.low, space.high)
        self.q = angles[:-FINGERS]
        self.robot = model.load_robot(finger_angle=float(angles[-FINGERS:].mean()))
        self.dt = environment.dt
        self.table = model.Scene([model.Floor(-robots.ARM_OFFSET[2])])
        self.total, self.is_solved, self.lag = 0.0, False, 0.0
        self.acceleration = self._possible_acceleration()

    def _possible_acceleration(self) -> Array:
        """Torque of the motors less friction and the gravity that they hold here, over the inertia with armature."""
        import numpy as np

        simulated, robot = self._environment.model, self.robot
        arm = slice(robot.dof)
        spare = simulated.actuator_forcerange[arm, 1] - simulated.dof_frictionloss[arm] - np.abs(robot.gravity(self.q))
        inertia = robot.mass_matrix(self.q).diagonal() + simulated.dof_armature[arm]
        return np.asarray(MOTOR_PART * spare / inertia)

    def act(self, step: TeleopStep, finger_angle: float) -> bool:
        """Move the simulated arm to where the command is, and the fingers; whether the episode goes on."""
        from jacokin.model.angles import nearest_copy

        free = self.robot.unlimited
        q = nearest_copy(step.q, 0.0 * step.q, free)  # the actions allow a turn to each side
        _, reward, _, is_over, info = self._environment.step([*q, *[finger_angle] * FINGERS])
        self.total += reward
        self.is_solved = bool(info["is_success"])
        at = self._environment.data.qpos[: self.robot.dof]
        self.lag = max(self.lag, float(abs(nearest_copy(at, step.q, free) - step.q).max()))
        return not is_over


@contextlib.contextmanager
def _simulation(name: str, seed: int) -> Iterator[_Simulation]:
    from jacokin import tasks

    if ":" in name:
        sys.path.insert(0, "")
    with contextlib.closing(tasks.TaskEnv(name, control="joint_position", flatten=False)) as environment:
        yield _Simulation(environment, seed)


def _document(session: Session, simulation: _Simulation | None) -> dict[str, object]:
    errors = session.position_error
    document: dict[str, object] = {
        "ticks": len(session.motion) - 1,
        "duration": session.motion.duration,
        "statuses": dict(session.statuses),
        "faults": dict(session.faults),
        "tracking": dict(session.tracking),
        "limiting": dict(session.limiting),
        "worst_position_error": float(errors.max()) if len(errors) else None,
        "last_position_error": float(errors[-1]) if len(errors) else None,
        "within_limits": session.within_limits,
        "late": session.late,
        "q_end": session.motion.q[-1].tolist(),
    }
    if simulation is not None:
        document["return"] = simulation.total
        document["solved"] = simulation.is_solved
        document["lag"] = simulation.lag
    return document


def _show(session: Session, simulation: _Simulation | None, output: Path | None) -> None:
    errors = session.position_error
    lines = [
        ("ticks", f"{len(session.motion) - 1} in {session.motion.duration:.2f} s, {session.late} late"),
        ("hand", _counts(session.statuses)),
        ("tool", _counts(session.tracking) or "followed nothing"),
        ("held back by", _counts(session.limiting) or "nothing"),
    ]
    if session.faults:
        lines.insert(2, ("input", "; ".join(f"{said} ({count} ticks)" for said, count in session.faults.items())))
    if len(errors):
        lines.append(("tool off target", f"{number(errors.max())} m at worst, {number(errors[-1])} m at the end"))
    lines.append(("limits", "kept in every tick" if session.within_limits else "broken: please report it"))
    if simulation is not None:
        solved = "solved" if simulation.is_solved else "not solved"
        lines.append(("task", f"return {simulation.total:.1f}, {solved}"))
        lines.append(("simulated arm", f"at most {number(simulation.lag)} rad off the command"))
    if output is not None:
        lines.append(("written to", str(output)))
    show_facts(lines)


def _counts(counts: Mapping[str, int]) -> str:
    return ", ".join(f"{name} {count}" for name, count in counts.items())
