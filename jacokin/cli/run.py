"""`jacokin run`: play a trajectory, or follow a hand, on an arm in ROS 1 or 2, or on a simulated one."""

from __future__ import annotations

import contextlib
import importlib.util
import math
import os
import queue
import shlex
import sys
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import files, model
from jacokin.cli import display, options
from jacokin.cli.command import command, option, switch
from jacokin.cli.display import show_facts
from jacokin.cli.groups import RobotOptions
from jacokin.cli.process import NOT_SOLVED
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.model import Robot
    from jacokin.runner import LiveMotion, PlannedMotion, ProcessLink, Runner, TwinLink

DEGREES = click.FloatRange(min=0.0, min_open=True)
LINES = 100  # of a hand that wait at most


@dataclass(frozen=True, slots=True)
class MotionOptions:
    """What is played, and what else is asked for."""

    file: Path | None = option(required=False, metavar="[FILE]", text="Trajectory, as `save` writes.")
    live: bool = switch("--live", help="Follow a hand instead: lines of JSON on standard input.")
    fingers: float | None = option(
        "--fingers", type=click.FloatRange(0.0, 1.0), metavar="S", help="Go there meanwhile, 0 open to 1 closed."
    )
    write_forwarder: Path | None = option(
        "--write-forwarder",
        without=("--live", "--twin", "--ros", "--forwarder"),
        metavar="FILE.py",
        help="Write the forwarder, and end.",
    )
    json: bool = options.json()


@dataclass(frozen=True, slots=True)
class ConnectionOptions:
    """The way to the arm."""

    ros: str | None = option("--ros", type=click.Choice(["1", "2"]), help="The version of ROS, on this machine.")
    forwarder: str | None = option(
        "--forwarder", metavar="COMMAND", help="Starts the forwarder elsewhere, by ssh or docker exec -i."
    )
    python: str | None = option(
        "--python", needs=("--ros",), metavar="PATH", help="Python of ROS, with --ros; that of the system if not given."
    )
    name: str | None = option(
        "--name",
        without=("--twin",),
        metavar="NAME",
        help="Of the robot in ROS, as kinova_robotName, and before its joints; that of --robot if not given. Joints of "
        "a file are named as there without it.",
    )
    states: str | None = option(
        "--states", needs=("--ros",), metavar="TOPIC", help="Of joint states, if it is not the driver's."
    )
    velocities: str | None = option(
        "--velocities", needs=("--ros",), metavar="TOPIC", help="Of velocities, if it is not the driver's."
    )
    twin: bool = switch("--twin", help="Move a simulated arm instead, without ROS, that stands where it begins.")
    faults: str = option(
        "--faults",
        needs=("--twin",),
        metavar="FAULTS",
        default="",
        help="With --twin: such as lag=0.02,loss=0.01,stall=0.3.",
    )
    random_seed: int | None = options.random_seed(needs=("--twin",))


@dataclass(frozen=True, slots=True)
class GuardOptions:
    """How the runner follows, and when it stops."""

    gain: float = option(
        "--gain", type=float, default=2.0, metavar="K", help="Of the correction [1/s]; 0 for an open loop."
    )
    latency: float | None = option(
        "--latency",
        metavar="T",
        help="From a velocity to its measurement [s]; measured as the arm begins to move if not given.",
    )
    start: float = option(
        "--start", without=("--live",), type=DEGREES, default=2.0, metavar="DEG", help="Allowed at the start [deg]."
    )
    lag: float = option("--lag", type=DEGREES, default=5.0, metavar="DEG", help="Allowed off the motion [deg].")
    silence: float = option(
        "--silence", type=float, default=0.5, metavar="T", help="Allowed without a measurement [s]."
    )
    contact: float | None = option(
        "--contact", metavar="NM", help="External torque that stops the arm, if it tells torques [N m]."
    )


@command(no_args_is_help=True)
def run(given: MotionOptions, way: ConnectionOptions, bounds: GuardOptions, source: RobotOptions) -> None:
    """Play a trajectory on an arm: velocities 100 times a second, corrected by the angles that it measures.

    The arm must stand where the file begins, up to whole turns of joints without limits. It is stopped when it falls
    behind the motion, says no longer where it is, feels contact (--contact), and on Ctrl-C, SIGTERM and SIGHUP. At the
    end it says how far the arm stands from the last row. With --live it follows lines such as {"clutch": true},
    {"hand": [x, y, z, qw, qx, qy, qz]}, a twist of six numbers, or {"end": true}. Have a hand on the stop button.
    Exit code: 0, 1 where the arm was stopped or did not arrive, 2 for wrong input.

    Examples:
      jacokin run lift.csv --twin
      jacokin run lift.csv --twin --faults lag=0.02,loss=0.01,stall
      jacokin run lift.csv --ros 1 --name j2n6s300
      jacokin run lift.csv --ros 2 --fingers 1
      jacokin run --write-forwarder forwarder.py
      jacokin run lift.csv --forwarder "ssh arm python3 forwarder.py --ros 1"
    """
    from jacokin.runner import PlannedMotion, Runner, RunnerOptions
    from jacokin.runner import run as play

    if given.write_forwarder is not None:
        if given.file is not None:
            raise InvalidInputError("--write-forwarder writes the forwarder, and ends: give it without a file")
        _write_forwarder(given.write_forwarder)
        return
    if (given.file is None) is not given.live:
        raise InvalidInputError("give a file, or --live")
    robot = source.load()
    chosen = RunnerOptions(
        gain=bounds.gain,
        latency=bounds.latency,
        lag=math.radians(bounds.lag),
        silence=bounds.silence,
        contact=bounds.contact,
    )
    with contextlib.ExitStack() as stack:
        motion: PlannedMotion | LiveMotion
        watch: Callable[[], None] | None = None
        if given.file is not None:
            motion = PlannedMotion.load(given.file, robot, start=math.radians(bounds.start))
            link = _link(robot, way, motion)
        else:
            motion = live_motion = _live(robot)
            watch = _reading(live_motion)
            link = _link(robot, way, None)
        stack.callback(link.close)
        runner = Runner(robot, motion, chosen)
        try:
            play(runner, link, fingers=given.fingers, watch=_watching_contact(runner, watch))
        except InvalidInputError:
            if math.isfinite(runner.away):  # it had begun
                _show(runner, given.json)
            raise
        except BaseException:
            _show(runner, given.json)
            raise
        _show(runner, given.json)
    if runner.status.name != "ARRIVED":
        raise SystemExit(NOT_SOLVED)


def _write_forwarder(path: Path) -> None:
    text = (Path(__file__).parents[1] / "runner" / "forwarder.py").read_text(encoding="utf-8")
    if path.exists():
        raise InvalidInputError(f"--write-forwarder: {path} is there already")
    with files.replacing(path) as unfinished:
        unfinished.write_text(text, encoding="utf-8")
    click.echo(f"{path} is to be started beside the driver, by --forwarder", err=True)


def _link(robot: Robot, way: ConnectionOptions, motion: PlannedMotion | None) -> TwinLink | ProcessLink:
    """The way to the arm.

    Raises:
        InvalidInputError: none, or several.
    """
    from jacokin.runner import ProcessLink

    if (way.ros is not None) + (way.forwarder is not None) + way.twin != 1:
        raise InvalidInputError("give one of --ros, --forwarder and --twin")
    bundled = robot.source.bundled or model.DEFAULT_ROBOT
    if way.twin:
        return _twin(robot, bundled, way, motion)
    name = way.name or bundled
    # Kinova's drivers put the name before the joints; another arm has its joints' names from its own description.
    prefix = "" if robot.source.bundled is None and way.name is None else f"{name}_"
    joints = [prefix + joint for joint in robot.joint_names]
    if way.forwarder is not None:
        try:
            command = shlex.split(way.forwarder)
        except ValueError as error:
            raise InvalidInputError(f"--forwarder is no command: {error}") from error
        if not command:
            raise InvalidInputError("--forwarder is empty")
        return ProcessLink(command, joints)
    if way.ros == "1" and robot.sliding.any():
        raise InvalidInputError(
            "--ros 1 sends degrees to Kinova's driver, and "
            f"{robot.joint_names[robot.sliding.tolist().index(True)]} of {robot.label} slides: use --ros 2"
        )
    package = "rospy" if way.ros == "1" else "rclpy"
    has_ros = importlib.util.find_spec(package) is not None
    # Of the systems that ROS is packaged for.
    python = way.python or (sys.executable if has_ros else "/usr/bin/python3")
    command = [python, os.fspath(Path(__file__).parents[1] / "runner" / "forwarder.py"), "--ros", str(way.ros)]
    command += ["--robot", name]
    for word, topic in (("--states", way.states), ("--velocities", way.velocities)):
        command += [word, topic] if topic is not None else []
    return ProcessLink(command, joints)


def _twin(robot: Robot, bundled: str, way: ConnectionOptions, motion: PlannedMotion | None) -> TwinLink:
    """A simulated arm that stands where a motion begins, in real time for a hand.

    Raises:
        InvalidInputError: the robot is another one.
    """
    from jacokin.runner import TwinLink
    from jacokin.twin import Faults, KinovaDriver, SimulatedArm

    count = model.load_robot(bundled).dof
    if robot.dof != count:
        raise InvalidInputError(
            f"--twin moves a simulated {bundled} of {count} joints, and {robot.name} has {robot.dof}"
        )
    if robot.source.bundled is None:
        click.echo(f"jacokin: note: --twin moves a simulated {bundled}, whatever {robot.name} is", err=True)
    arm = SimulatedArm(bundled, q=None if motion is None else motion.q[0])
    driver = KinovaDriver(arm, faults=Faults.parse(way.faults), seed=way.random_seed or 0)
    return TwinLink(driver, pace=motion is None)


def _live(robot: Robot) -> LiveMotion:
    from jacokin.motion import Tracker
    from jacokin.runner import LiveMotion
    from jacokin.teleop import Teleop
    from jacokin.twin.faults import TICK

    tracker = Tracker(robot, dt=TICK, q=robot.home, acceleration_limit=2.0)  # [rad/s^2]
    return LiveMotion(Teleop(tracker))


def _reading(motion: LiveMotion) -> Callable[[], None]:
    """Read standard input in a thread; returns what gives its lines to a motion, and says what became of them."""
    lines: queue.Queue[str | None] = queue.Queue(LINES)
    said = [""]

    def read() -> None:
        with contextlib.suppress(OSError):  # a terminal that is gone, and with it the hand
            for line in sys.stdin:
                if line.strip():
                    lines.put(line)
        lines.put(None)

    def watch() -> None:
        with contextlib.suppress(queue.Empty):
            while True:
                line = lines.get_nowait()
                try:
                    motion.take('{"end": true}' if line is None else line)
                except InvalidInputError as error:
                    click.echo(f"jacokin: {error}", err=True)
        word = motion.said.partition(":")[0]
        if word != said[0]:
            said[0] = word
            click.echo(f"jacokin: {motion.said}", err=True)

    threading.Thread(target=read, name="hand", daemon=True).start()
    return watch


def _watching_contact(runner: Runner, watch: Callable[[], None] | None) -> Callable[[], None]:
    """What is called every tick, and says once where contact is asked for and cannot be felt."""
    said = [False]

    def watch_both() -> None:
        if watch is not None:
            watch()
        if runner.misses_contact and not said[0] and not runner.status.has_ended:
            said[0] = True
            silence = runner.options.silence
            click.echo(
                f"jacokin: --contact watches nothing: the arm has told no velocities and torques for {silence:g} s",
                err=True,
            )

    return watch_both


def _show(runner: Runner, json: bool) -> None:
    """Say how it ended."""
    # A joint that slides has no degrees, and either may be the one that is farthest.
    slides = bool(runner.robot.sliding.any())
    away, worst = (value if slides else math.degrees(value) for value in (runner.away, runner.worst))
    if json:
        name = "" if slides else "_deg"
        fields = {
            "status": runner.status.name,
            "message": runner.message,
            f"away{name}": away if math.isfinite(away) else None,
            f"worst{name}": worst,
            "stands": runner.stands,
            "latency": runner.latency,
            "measured_latency": runner.measured_latency,
        }
        display.print_json(fields)
        return
    facts = [("status", f"{runner.status.name}: {runner.status.value}")]
    facts += [("because", runner.message)] if runner.message else []
    if math.isfinite(away):
        where = "the end of the motion" if runner.status.name in ("ARRIVED", "MISSED") else "where the motion was"
        far, farthest = (f"{each:.4f} rad or m" if slides else f"{each:.2f} deg" for each in (away, worst))
        facts += [("the arm", f"{far} from {where}{'' if runner.stands else ', and may still move'}")]
        facts += [("farthest", f"{farthest} off the motion on the way")]
    facts += [("latency", _latency(runner))] if runner.measured_latency is not None else []
    show_facts(facts)


def _latency(runner: Runner) -> str:
    """How late the arm was, and what to do where something else was given."""
    measured, taken = runner.measured_latency, runner.latency
    assert measured is not None
    if abs(measured - taken) <= 0.03:  # [s] by which a latency that is given may be off
        return f"{measured:.2f} s"
    return f"{measured:.2f} s measured, but {taken:.2f} s given: leave out --latency, or give {measured:.2f}"
