"""`jacokin teleop`: a recorded hand, a space mouse, keys or a gamepad lead the arm, in the viewer or in a task.

In a task, episodes of what the hand does become a data set.
"""

from __future__ import annotations

import contextlib
import math
import os
import re
import select
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import files, model, motion
from jacokin.cli import display, options
from jacokin.cli.command import command, option, switch
from jacokin.cli.display import number, show_facts
from jacokin.cli.groups import RADIANS, RobotOptions, SceneOptions
from jacokin.cli.options import keep_degrees
from jacokin.cli.process import NOT_SOLVED
from jacokin.cli.task import DATA_SETS, choose_renderer
from jacokin.errors import InvalidInputError, ModelError
from jacokin.showing import has_display

if TYPE_CHECKING:
    from jacokin.arrays import Array
    from jacokin.tasks import TaskEnv
    from jacokin.teleop import Device, Fingers, Keyboard, Player, Session, TaskArm, Teleop, TeleopStep
    from jacokin.viewer import Viewer
    from jacokin.viewer.browser.stage import Props

DEVICES = ("player", "spacemouse", "keyboard", "page")
RATE = 60.0  # [1/s] of a hand that is made
ARRIVED = 1e-3  # [m] nearer to its target, the tool has arrived
ACCELERATION = 4.0  # [rad/s^2]
TASK_SPEED = 0.1, 0.6  # [m/s], [rad/s] of keys
STREAM = ".npz"
CLUTCH, LEAVE = " ", ("q", "\x1b", "\x04")
HINT = """w s, a d, r f move along x, y, z; j l, i k, u o turn about them; g h close and open the fingers;
space opens and closes the clutch, q ends"""


@dataclass(frozen=True, slots=True)
class LeadingOptions:
    """What leads the arm, for how long, and what is written of it."""

    device: str = option("--device", type=click.Choice(DEVICES), default="player", help="What leads the arm.")
    stream: str | None = option(
        "--stream", metavar="FILE.npz|KIND", help="For the player: a recording or a made hand, smooth if not given."
    )
    rate: float | None = option(
        "--rate", metavar="R", help="Of a hand that is made: poses in a second [1/s]; 60 if not given."
    )
    random_seed: int | None = options.random_seed()
    seconds: float | None = option(
        "--seconds", metavar="T", help="End after this time [s]; with the device if not given."
    )
    fast: bool = switch("--fast", help="As fast as it can, instead of in real time; for the player.")
    output: Path | None = option(
        "--output",
        help="Write the commanded motion here, .csv, .npz, .json (ROS), .kinova.csv or .kinova.json (kinova-ros).",
    )
    json: bool = options.json()

    @property
    def recording(self) -> Path | None:
        """The file of a stream."""
        return None if self.stream is None or Path(self.stream).suffix != STREAM else Path(self.stream)

    @property
    def is_made(self) -> bool:
        """Whether the hand is made, and not recorded or somebody's."""
        return self.device == "player" and self.recording is None

    @property
    def seed(self) -> int:
        """Of the random numbers."""
        return self.random_seed or 0

    @property
    def duration(self) -> float:
        """For how long it leads at most [s]."""
        return math.inf if self.seconds is None else self.seconds

    def check(self) -> None:
        """Refuse options that do not go together.

        Raises:
            InvalidInputError: names them.
        """
        from jacokin.motion.trajectory import FORMATS

        if self.device != "player" and (self.stream is not None or self.fast):
            raise InvalidInputError("--stream and --fast are for --device player")
        if self.rate is not None and not self.is_made:
            raise InvalidInputError("--rate is for a hand that is made: --device player without a recording")
        if self.output is not None and self.output.suffix in DATA_SETS:
            advice = f"a data set of a task is --record {self.output} --task NAME"
            raise InvalidInputError(f"--output writes one motion; {advice}")
        if self.output is not None and self.output.suffix not in FORMATS:
            raise InvalidInputError(f"--output must end in {' or '.join(FORMATS)}, got {str(self.output)!r}")


@dataclass(frozen=True, slots=True)
class FollowingOptions:
    """How the arm follows."""

    scale: float = option(
        "--scale", default=1.0, metavar="S", help="The tool moves this many times as far as the hand."
    )
    constant: float | None = option(
        "--filter",
        metavar="T",
        help="Time constant of a low-pass on the hand [s], 0 for none; "
        "without it, gaps between its poses are smoothed.",
    )
    recover: float | None = option(
        "--recover", metavar="T", help="Held off its target this long [s], the tool takes another branch."
    )
    dt: float | None = option("--dt", metavar="T", help="Control step [s]; 0.01, or that of the task.")
    acceleration_limit: float | None = option(
        "--acceleration-limit",
        metavar="A",
        help="Of the joints [rad/s^2]; 4, or what the motors of the task are strong enough for.",
    )
    velocity_limit: list[float] | None = options.velocity_limit()
    frame: str | None = options.frame()

    def follow(self, robot: model.Robot, arm: TaskArm | None, scene: model.Scene | None, clearance: float) -> Teleop:
        """What leads an arm, that of a task where there is one.

        Without a scene and a clearance, an arm without shapes is led without looking for contact, which is said.

        Raises:
            InvalidInputError: as `Tracker` and `Teleop`.
            ShapeError: the description's shapes cannot be loaded.
        """
        from jacokin.teleop import Teleop
        from jacokin.teleop.teleop import AUTO

        possible = ACCELERATION if arm is None else arm.acceleration
        looks = scene is not None or clearance > 0.0 or model.SelfContact(robot).has_shapes
        if not looks:
            click.echo("jacokin: note: the description has no collision shapes: contact is not looked for", err=True)
        tracker = motion.Tracker(
            robot,
            self.frame,
            q=None if arm is None else arm.q,
            dt=arm.dt if arm is not None else 0.01 if self.dt is None else self.dt,  # [s]
            scene=scene,
            clearance=clearance if looks else None,
            velocity_limit=RADIANS.for_joints(robot).limits("--velocity-limit", self.velocity_limit, "rad/s"),
            acceleration_limit=possible if self.acceleration_limit is None else self.acceleration_limit,
        )
        smoothing = AUTO if self.constant is None else self.constant
        return Teleop(tracker, clutch=True, scale=self.scale, filter=smoothing, recover=self.recover)


@dataclass(frozen=True, slots=True)
class SimulationOptions:
    """The task whose arm is led, and the data set of its episodes."""

    task: str | None = option(
        "--task", metavar="NAME", help="Lead the arm of this task's simulation, such as reach_site."
    )
    record: Path | None = option(
        "--record",
        needs=("--task",),
        without=("--seconds", "--output"),
        help="With --task: a data set of the episodes that are kept, .hdf5, .minari or .lerobot.",
    )
    episodes: int | None = option(
        "--episodes",
        needs=("--record",),
        type=click.IntRange(min=1),
        metavar="N",
        help="With --record: how many to keep; a session that ends with fewer goes on when it is started again.",
    )
    cameras: dict[str, tuple[int, int]] | None = options.cameras(
        needs=("--record",),
        help="With --record: a camera that observes, front_close or wrist, and the size of its pictures. Repeatable.",
    )
    pace: float | None = options.pace(
        needs=("--record",),
        without=("--fast",),
        help="With --record: simulated seconds in a second; 0.5 is slow motion.",
    )
    render: bool = switch(
        "--render",
        needs=("--task",),
        help="With --task: show the simulation in a window, which needs a display.",
    )

    def check(self, hand: LeadingOptions, *, has_robot: bool) -> None:
        """Refuse options that do not go together, before anything is made.

        Args:
            hand: what leads the arm.
            has_robot: whether a robot or a control step is given.

        Raises:
            InvalidInputError: names them.
        """
        if self.record is not None and self.record.suffix not in DATA_SETS:
            raise InvalidInputError(f"--record must end in {', '.join(DATA_SETS)}, got {str(self.record)!r}")
        if hand.random_seed is not None and self.task is None and not hand.is_made:
            raise InvalidInputError("--random-seed is for a hand that is made, or for --task")
        if self.task is not None and has_robot:
            raise InvalidInputError(
                f"--task has its robot, {model.DEFAULT_ROBOT}, and its control step: leave them out"
            )
        if self.render and not has_display():
            raise InvalidInputError(
                "--render needs a display; without one, --view shows the arm and the props in a browser"
            )

    @contextlib.contextmanager
    def start(self, seed: int) -> Iterator[_Simulation | None]:
        """The task at the start of an episode; None without one."""
        if self.task is None:
            yield None
            return
        if self.cameras:
            choose_renderer()
        from jacokin import tasks
        from jacokin.teleop.demonstrations import CONTROL

        if ":" in self.task:
            sys.path.insert(0, "")
        made = tasks.TaskEnv(
            self.task,
            control=CONTROL,
            flatten=False,
            observations="vision" if self.cameras else "features",
            cameras=self.cameras,
            render_mode="human" if self.render else None,
        )
        with contextlib.closing(made) as environment:
            yield _Simulation(environment, seed)


@dataclass(frozen=True, slots=True)
class PageOptions:
    """The page that shows the arm."""

    view: bool = switch("--view", help="Show the arm in the browser; prints the address. --device page does, too.")
    port: int = options.port(needs=("--view", "--device"))


@command()
def teleop(
    hand: LeadingOptions,
    following: FollowingOptions,
    around: SceneOptions,
    simulated: SimulationOptions,
    page: PageOptions,
    source: RobotOptions,
) -> None:
    """Let a hand lead the arm: a recording, a space mouse, keys or a gamepad.

    No arm is driven but that of --task and the one that --view shows. Keys of the terminal or of the page: w s, a d,
    r f move along x, y, z; j l, i k, u o turn about them; g and h close and open the fingers; the space bar opens and
    closes the clutch; q ends, in the page its button does, and Ctrl-C everywhere: the arm brakes first. The page reads
    a gamepad, too. In a task the seed of the episode is that of --random-seed, and without --scene the arm keeps off
    the table. With --record, b begins an episode, e ends it, y keeps it and x throws it away; a player begins, ends
    and keeps by itself. What has ended is on disk at once; Ctrl-C and q end the session, and write the data set.
    Exit code: 0 the tool ends on its target, or all episodes that were asked for are kept; 1 it is more than 1 mm off,
    or fewer are kept; 2 wrong input.

    Examples:
      jacokin teleop --stream jerky --fast --output motion.csv
      jacokin teleop --stream hand.npz --scene scene.yaml --clearance 0.01
      jacokin teleop --device keyboard --task reach_site
      jacokin teleop --device spacemouse --scale 0.5 --view
      jacokin teleop --device page --task lift_brick
      jacokin teleop --device keyboard --view --task lift_brick --record demos.lerobot --camera wrist --episodes 50
    """
    hand.check()
    simulated.check(hand, has_robot=following.dt is not None or source != RobotOptions())
    inputs = {"--scene": around.scene, "--stream": hand.recording}
    source.keep_apart({"--output": hand.output, "--record": simulated.record}, inputs)
    from jacokin.teleop import lead

    with contextlib.ExitStack() as stack:
        writable = None if hand.output is None else stack.enter_context(files.replacing(hand.output))
        simulation = stack.enter_context(simulated.start(hand.seed))
        arm = None if simulation is None else simulation.arm
        robot = source.load() if arm is None else arm.robot
        keep_degrees(hand.output, robot)
        scene = arm.table if arm is not None and around.scene is None else around.load()
        led = following.follow(robot, arm, scene, around.clearance)
        watched = _Watched()
        if page.view or hand.device == "page":
            watched = stack.enter_context(_page(led.tracker, scene, around.clearance, page.port, simulation))
        device = _open_device(hand, simulated, robot, watched.shown, stack)
        if watched.shown is not None:
            click.echo(f"{watched.shown.url} shows {robot.label}; Ctrl-C ends it", err=True)
        stop = stack.enter_context(_interrupted())
        if simulated.record is not None:
            assert simulation is not None
            _demonstrate(
                simulation.environment,
                device,
                simulated.record,
                (hand, simulated),
                lambda arm: following.follow(arm.robot, arm, scene, around.clearance),
                watched,
                stop,
            )
            return
        fingers = _fingers(robot, said=hasattr(device, "fingers")) if watched.shown is not None else None
        fingers = fingers if arm is None else arm.fingers

        def act(step: TeleopStep) -> bool:
            angle = None if fingers is None else fingers.move(getattr(device, "fingers", 0.0), led.tracker.dt)
            watched.follow(step, angle)
            goes_on = simulation is None or angle is None or simulation.act(step, angle)
            watched.show_props()
            return goes_on

        session = lead(led, device, seconds=hand.duration, paced=not hand.fast, act=act, stop=stop)
        if writable is not None:
            session.motion.save(writable)
    error = float(session.position_error[-1]) if len(session.position_error) else 0.0
    if hand.json:
        display.print_json(_document(session, simulation))
    else:
        _show(session, simulation, hand.output)
    if error > ARRIVED or not session.within_limits:
        raise SystemExit(NOT_SOLVED)


def _open_device(
    hand: LeadingOptions,
    simulated: SimulationOptions,
    robot: model.Robot,
    shown: Viewer | None,
    stack: contextlib.ExitStack,
) -> Device:
    """What leads the arm, until the stack is closed.

    Raises:
        InvalidInputError: it is not there.
    """
    from jacokin.teleop import Keyboard, SpaceMouse

    if hand.device == "player":
        return _player(robot, hand.stream, hand.rate, hand.seed)
    if hand.device == "page":
        assert shown is not None
        return shown.add_controller()
    # In a task, whose episodes end after a while, as quick as the page's keys.
    keyboard = Keyboard() if simulated.task is None else Keyboard(speed=TASK_SPEED[0], turn=TASK_SPEED[1])
    if hand.device == "keyboard":
        return stack.enter_context(_keys("--device keyboard", keyboard))
    mouse = stack.enter_context(SpaceMouse())
    is_typed = simulated.record is not None or (sys.platform != "win32" and sys.stdin.isatty())
    return stack.enter_context(_keys("--record", keyboard, mouse)) if is_typed else mouse


def _demonstrate(
    environment: TaskEnv,
    device: Device,
    path: Path,
    given: tuple[LeadingOptions, SimulationOptions],
    make: Callable[[TaskArm], Teleop],
    watched: _Watched,
    stop: threading.Event,
) -> None:
    """Record episodes, and say what became of them."""
    from jacokin.teleop import demonstrate

    hand, simulated = given
    standing: list[TaskArm] = []  # the arm that stands in the page

    def watch(arm: TaskArm, step: TeleopStep | None) -> None:
        if watched.shown is not None and step is None and arm not in standing:
            standing[:] = [arm]
            still = make(arm)
            still.clutch(False)
            step = still.step()
        if step is not None:
            watched.follow(step, arm.fingers.angle)
        watched.show_props()

    found = demonstrate(
        environment,
        device,
        path,
        episodes=simulated.episodes,
        seed=hand.seed,
        pace=math.inf if hand.fast else simulated.pace or 1.0,
        make=make,
        watch=watch,
        tell=lambda text: click.echo(text, err=True),
        stop=stop,
    )
    kept = f"{found.kept} kept, {found.solved} of them solved, {found.discarded} thrown away"
    if hand.json:
        document = {name: getattr(found, name) for name in ("kept", "solved", "steps", "discarded", "late")}
        display.print_json({"path": str(found.path), **document, "is_written": found.is_written})
    else:
        lines = [("episodes", kept), ("steps", f"{found.steps}, {found.late} late in this session")]
        if found.is_written:
            lines.append(("written to", str(found.path)))
        elif found.kept:
            lines.append(("not complete", f"they are kept in {found.path}.episodes: the same command goes on"))
        show_facts(lines)
    if not found.is_written:
        raise SystemExit(NOT_SOLVED)


def _player(robot: model.Robot, given: str | None, rate: float | None, seed: int) -> Player:
    """A recording, or a hand that is made."""
    import numpy as np

    from jacokin.teleop import Player, Stream, make_stream
    from jacokin.teleop.streams import KINDS

    if given is not None and Path(given).suffix == STREAM:
        return Player(Stream.load(given))
    if given is not None and given not in KINDS and Path(given).suffix:
        raise InvalidInputError(f"--stream must be a recording, {STREAM}, or one of {', '.join(KINDS)}, got {given!r}")
    kind = "smooth" if given is None else given
    return Player(make_stream(robot, kind, np.random.default_rng(seed), rate=RATE if rate is None else rate))


def _fingers(robot: model.Robot, *, said: bool) -> Fingers | None:
    """The fingers of an arm that is in no simulation; None where none can be moved, and why, if that is to be said."""
    from jacokin.teleop import Fingers

    try:
        return Fingers.of(robot)
    except ModelError as error:
        if said:
            click.echo(f"fingers stay as they are: {error}", err=True)
        return None


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


class _Watched:
    """The page that shows the arm and the props of a task; without a page, nothing is shown.

    Attributes:
        shown: the viewer, if there is one.
    """

    def __init__(self, shown: Viewer | None = None, simulation: _Simulation | None = None) -> None:
        self.shown = shown
        self._props: Props | None = None
        if shown is not None and simulation is not None:
            from jacokin.viewer.browser.stage import Props

            self._props = Props(shown.server, simulation.environment)

    def follow(self, step: TeleopStep, angle: float | None) -> None:
        """Show the arm, and its fingers at an angle [rad]."""
        if self.shown is not None:
            self.shown.follow(step, finger_angle=angle)

    def show_props(self) -> None:
        """Show the props where they are."""
        if self._props is not None:
            self._props.show()


@contextlib.contextmanager
def _page(
    tracker: motion.Tracker,
    scene: model.Scene | None,
    clearance: float,
    port: int,
    simulation: _Simulation | None,
) -> Iterator[_Watched]:
    """The viewer, with the arm where the tracker is, and the props of a task."""
    from jacokin import viewer

    chosen = viewer.ViewerOptions(frame=tracker.frame, clearance=clearance)
    with viewer.serve(tracker.robot, chosen, scene=scene, seed=tracker.q, port=port) as shown:
        yield _Watched(shown, simulation)


class _Keys:
    """The keys of a terminal, alone or beside another device, and whether one has ended the session."""

    def __init__(self, keyboard: Keyboard, beside: Device | None) -> None:
        self._keyboard, self._beside = keyboard, beside
        self.ended = False
        self.toggled, self.commands = keyboard.toggled, keyboard.commands

    @property
    def fingers(self) -> float:
        """How fast the fingers are to close, from -1 to 1."""
        return self._keyboard.fingers or float(getattr(self._beside, "fingers", 0.0))

    @property
    def trouble(self) -> str:
        """Why the other device says nothing."""
        return str(getattr(self._beside, "trouble", ""))

    def read(self, time: float) -> Array | None:
        """The twist of the keys that are pressed; without one, what the other device says."""
        while not self.ended and select.select([sys.stdin], [], [], 0.0)[0]:
            typed = os.read(sys.stdin.fileno(), 256).decode("ascii", errors="replace").lower()
            self.ended = not typed
            # Arrows and others are sequences that begin with the character of Esc.
            for key in re.sub(r"\x1b[\[o][0-9;]*[a-z~]", "", typed):
                self._keyboard.press("space" if key == CLUTCH else key, time)
                self.ended |= key in LEAVE
        twist = self._keyboard.read(time)
        return twist if self._beside is None or twist.any() else self._beside.read(time)


@contextlib.contextmanager
def _keys(option: str, keyboard: Keyboard, beside: Device | None = None) -> Iterator[_Keys]:
    """Keys as they are typed, without Enter, beside another device or alone; the terminal is as before afterwards.

    Raises:
        InvalidInputError: standard input is not a terminal of Unix.
    """
    if sys.platform == "win32" or not sys.stdin.isatty():
        raise InvalidInputError(f"{option} needs a terminal of Linux or macOS as standard input")
    import termios
    import tty

    before = termios.tcgetattr(sys.stdin)
    try:
        tty.setcbreak(sys.stdin)
        click.echo(HINT, err=True)
        yield _Keys(keyboard, beside)
    finally:
        termios.tcsetattr(sys.stdin, termios.TCSADRAIN, before)


class _Simulation:
    """A task whose arm follows commands.

    Attributes:
        environment: the task.
        arm: its arm, where it is at first.
        total: sum of the rewards.
        is_solved: whether the task is solved now.
        lag: largest angle of a joint between the simulated arm and the command [rad].
    """

    def __init__(self, environment: TaskEnv, seed: int) -> None:
        from jacokin.teleop import TaskArm

        self.environment = environment
        environment.reset(seed=seed)
        self.arm = TaskArm(environment)
        self.total, self.is_solved, self.lag = 0.0, False, 0.0

    def act(self, step: TeleopStep, finger_angle: float) -> bool:
        """Move the simulated arm to where the command is, and the fingers; whether the episode goes on."""
        from jacokin.model.angles import nearest_copy

        robot = self.arm.robot
        _, reward, _, is_over, info = self.environment.step(self.arm.action(step.q, finger_angle))
        self.total += reward
        self.is_solved = bool(info["is_success"])
        at = self.environment.data.qpos[: robot.dof]
        self.lag = max(self.lag, float(abs(nearest_copy(at, step.q, robot.unlimited) - step.q).max()))
        return not is_over


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
