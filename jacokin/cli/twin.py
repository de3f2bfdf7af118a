"""`jacokin twin`: Kinova's driver, simulated: a node of ROS 1 or 2 that moves a simulated arm."""

from __future__ import annotations

import contextlib
import math
import re
import sys
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import click

from jacokin import model
from jacokin.cli import display, options, process
from jacokin.cli.command import command, option, switch
from jacokin.cli.display import number, show_facts
from jacokin.cli.task import choose_renderer
from jacokin.cli.units import Units
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.tasks import TaskEnv
    from jacokin.twin import Faults, KinovaDriver, Record, SimulatedArm, TrajectoryController
    from jacokin.twin.nodes import Camera, Ticker
    from jacokin.twin.ros1 import Ros1Node
    from jacokin.twin.ros2 import Ros2Node


@dataclass(frozen=True, slots=True)
class TwinOptions:
    """The driver that is simulated, its arm, and how it is watched."""

    ros: str = option("--ros", type=click.Choice(["1", "2"]), required=True, help="The version of ROS.")
    robot: str = option("--robot", metavar="NAME", default=model.DEFAULT_ROBOT, help="A bundled Jaco or Mico.")
    name: str | None = option(
        "--name", metavar="NAME", help="Of the robot in ROS, as kinova_robotName; that of --robot if not given."
    )
    start: list[float] | None = option("--from", metavar="Q1 .. Q6", help="Joint angles at first; home if not given.")
    degrees: bool = switch("--degrees", needs=("--from",), help="--from is in degrees.")
    faults: str = option(
        "--faults",
        metavar="FAULTS",
        default="",
        help="What goes wrong, such as lag=0.02,loss=0.01,stall=0.3: [s], a share, [s].",
    )
    random_seed: int | None = options.random_seed()
    pace: float = options.pace(
        default=1.0,
        without=("--fast",),
        help="Simulated seconds in a second; with any but 1 the twin gives the time, on /clock.",
    )
    fast: bool = switch("--fast", help="As fast as it can, instead of at a pace.")
    task: str | None = option("--task", metavar="NAME", help="Stand in the scene of this task, such as lift_brick.")
    cameras: dict[str, tuple[int, int]] | None = options.cameras(
        needs=("--task",),
        help="With --task: publish pictures of front_close, wrist or whole, 10 a second. Repeatable.",
    )
    seconds: float | None = option(
        "--seconds", metavar="T", help="End after this simulated time [s]; by Ctrl-C if not given."
    )
    view: bool = switch("--view", help="Show the arm in the browser; prints the address.")
    port: int = options.port(needs=("--view",))
    json: bool = options.json()


@command(no_args_is_help=True)
def twin(given: TwinOptions) -> None:
    """A node that looks like Kinova's driver to its clients, and moves a simulated arm.

    ROS 1: the topics, actions and services of kinova-ros' NAME_driver, and NAME/follow_joint_trajectory, which plays
    one point each 10 ms in an open loop; a goal of it that is cancelled kills the twin, as it does the driver. ROS 2:
    /joint_states, /joint_trajectory_controller/follow_joint_trajectory, /forward_velocity_controller/commands and
    /finger_controller/commands. At its end it says what was heard, and where the arm stands. ROS is not installed with
    jacokin; without it the command says what to install.
    Exit code: 0, 1 where the driver died, 2 for wrong input.

    Examples:
      jacokin twin --ros 1
      jacokin twin --ros 1 --robot j2n6s200 --view
      jacokin twin --ros 1 --faults lag=0.02,loss=0.01,stall
      jacokin twin --ros 2 --task lift_brick --camera wrist=96x96
      jacokin twin --ros 2 --fast --seconds 60 --json
    """
    if given.cameras:
        choose_renderer()
    from jacokin.twin import Faults, SimulatedArm
    from jacokin.twin.nodes import Ticker

    found = Faults.parse(given.faults)
    if given.task is not None and (given.robot != model.DEFAULT_ROBOT or given.start is not None):
        raise InvalidInputError(f"--task has its robot, {model.DEFAULT_ROBOT}, and its start: leave them out")
    called = given.robot if given.name is None else given.name
    if given.name is not None and not re.fullmatch(r"[A-Za-z]\w*", called, re.ASCII):
        raise InvalidInputError(f"--name must be letters, digits and underscores, a letter first, got {called!r}")
    q = None
    if given.start is not None:
        joints = Units(given.degrees).for_joints(model.load_robot(given.robot))
        q = joints.configuration("--from", given.start)
    with contextlib.ExitStack() as stack:
        environment = None
        if given.task is not None:
            environment = _environment(given.task, given.random_seed or 0)
            stack.callback(environment.close)
        arm = SimulatedArm(given.robot, q=q, task=None if environment is None else environment.task)
        shown = _cameras(arm, given.cameras or {})
        watch = _watching(stack, arm, environment, given.port) if given.view else _nothing
        ticker = Ticker(math.inf if given.fast else given.pace)

        def goes_on() -> bool:
            process.heed_signals()
            return given.seconds is None or arm.state.time < given.seconds

        core, node = _node(given, called, arm, found, ticker, shown)
        stack.callback(node.close)
        try:  # a signal may come as soon as it says that it is ready
            click.echo(f"twin of {arm.robot.label} in ROS {given.ros}: ready; Ctrl-C ends it", err=True)
            node.run(watch, goes_on)
        except KeyboardInterrupt:
            click.echo("closed", err=True)
        finally:
            _show(core.record(), ticker.late, given.json)
        died = getattr(core, "died", "")
        if died:
            click.echo(f"jacokin: {died}", err=True)
            raise SystemExit(process.NOT_SOLVED)


def _node(
    given: TwinOptions, called: str, arm: SimulatedArm, faults: Faults, ticker: Ticker, cameras: list[Camera]
) -> tuple[KinovaDriver, Ros1Node] | tuple[TrajectoryController, Ros2Node]:
    """What moves the arm, and the node of ROS 1 or 2 that speaks for it.

    Raises:
        InvalidInputError: that ROS is not there.
    """
    from jacokin.twin import KinovaDriver, TrajectoryController

    seed = given.random_seed or 0
    if given.ros == "1":
        from jacokin.twin.ros1 import Ros1Node

        driver = KinovaDriver(arm, faults=faults, seed=seed)
        return driver, Ros1Node(driver, called, ticker=ticker, cameras=cameras)
    from jacokin.twin.ros2 import Ros2Node

    joints = [f"{called}_joint_{joint + 1}" for joint in range(arm.robot.dof)]
    controller = TrajectoryController(arm, joints, faults=faults, seed=seed)
    return controller, Ros2Node(controller, called, ticker=ticker, cameras=cameras)


def _environment(task: str, seed: int) -> TaskEnv:
    """The scene of a task at the start of an episode."""
    from jacokin.tasks import TaskEnv

    if ":" in task:
        sys.path.insert(0, "")
    environment = TaskEnv(task, flatten=False)
    environment.reset(seed=seed)
    return environment


def _cameras(arm: SimulatedArm, sizes: dict[str, tuple[int, int]]) -> list[Camera]:
    from jacokin.twin.nodes import Camera

    return [Camera.of(arm.physics, camera, size) for camera, size in sizes.items()]


def _nothing() -> None:
    """Watch nothing."""


def _watching(
    stack: contextlib.ExitStack, arm: SimulatedArm, environment: TaskEnv | None, port: int
) -> Callable[[], None]:
    """Show the arm, and the props of a task, in the browser; returns what draws them."""
    from jacokin import viewer
    from jacokin.viewer.browser.stage import Props

    shown = stack.enter_context(viewer.serve(arm.robot, seed=arm.state.q, port=port))
    props = None if environment is None else Props(shown.server, environment)
    click.echo(f"{shown.url} shows {arm.robot.label}", err=True)

    def draw() -> None:
        shown.stand(arm.state.q, finger_angle=float(arm.state.fingers.mean()), note=f"at {arm.state.time:.1f} s")
        if props is not None:
            props.show()

    return draw


def _show(record: Record, late: int, json: bool) -> None:
    """Say what the twin has heard and done."""
    if json:
        display.print_json({**asdict(record), "late": late})
        return
    lost = f", {record.lost} lost in faults, {record.stalls} stalls" if record.lost or record.stalls else ""
    show_facts(
        [
            ("simulated", f"{record.time:.2f} s, {late} ticks late"),
            ("heard", f"{record.goals} goals, {record.velocities} velocities{lost}"),
            ("angles", f"{display.numbers(map(math.degrees, record.angles))} deg"),
            ("from a limit", f"{number(math.degrees(record.margin))} deg at least"),
            ("fastest joint", f"{100.0 * record.speed:.0f} % of its limit"),
            ("last moved", f"{record.coasted:.2f} s after the last command"),
        ]
    )
