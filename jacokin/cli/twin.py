"""`jacokin twin`: Kinova's driver, simulated: a node of ROS 1 or 2 that moves a simulated arm."""

from __future__ import annotations

import contextlib
import math
import re
import sys
from collections.abc import Callable
from dataclasses import asdict
from typing import TYPE_CHECKING

import click

from jacokin import model
from jacokin.cli import display, options
from jacokin.cli.command import Command, NumberList
from jacokin.cli.display import number, show_facts
from jacokin.cli.process import NOT_SOLVED
from jacokin.cli.task import choose_renderer
from jacokin.cli.teleop import read_cameras
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.tasks import TaskEnv
    from jacokin.twin import Record, SimulatedArm
    from jacokin.twin.pictures import Camera


@click.command(cls=Command, no_args_is_help=True)
@click.option("--ros", type=click.Choice(["1", "2"]), required=True, help="The version of ROS.")
@click.option("--robot", metavar="NAME", default=model.DEFAULT_ROBOT, help="A bundled Jaco or Mico.")
@click.option("--name", metavar="NAME", help="Of the robot in ROS, as kinova_robotName; that of --robot if not given.")
@click.option("--from", "start", cls=NumberList, metavar="Q1 .. Q6", help="Joint angles at first; home if not given.")
@click.option("--degrees", is_flag=True, help="--from is in degrees.")
@click.option(
    "--faults",
    metavar="FAULTS",
    default="",
    help="What goes wrong, such as lag=0.02,loss=0.01,stall=0.3: [s], a share, [s].",
)
@options.random_seed
@click.option(
    "--pace",
    type=click.FloatRange(min=0.0, min_open=True),
    default=1.0,
    metavar="P",
    help="Simulated seconds in a second; with any but 1 the twin gives the time, on /clock.",
)
@click.option("--fast", is_flag=True, help="As fast as it can, instead of at a pace.")
@click.option("--task", metavar="NAME", help="Stand in the scene of this task, such as lift_brick.")
@click.option(
    "--camera",
    "cameras",
    multiple=True,
    callback=read_cameras,
    metavar="NAME[=HxW]",
    help="With --task: publish pictures of front_close, wrist or whole, 10 a second. Repeatable.",
)
@click.option("--seconds", type=float, metavar="T", help="End after this simulated time [s]; by Ctrl-C if not given.")
@click.option("--view", is_flag=True, help="Show the arm in the browser; prints the address.")
@click.option("--port", type=click.IntRange(min=0), default=8080, metavar="N", help="Of the page; 0 for any free one.")
@options.json
def twin(
    ros: str,
    robot: str,
    name: str | None,
    start: list[float] | None,
    degrees: bool,
    faults: str,
    random_seed: int | None,
    pace: float,
    fast: bool,
    task: str | None,
    cameras: dict[str, tuple[int, int]] | None,
    seconds: float | None,
    view: bool,
    port: int,
    json: bool,
) -> None:
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
    if cameras:
        choose_renderer()
    from jacokin.twin import Faults, KinovaDriver, SimulatedArm, TrajectoryController

    found = Faults.parse(faults)
    seed = random_seed or 0
    if cameras and task is None:
        raise InvalidInputError("--camera shows the scene of a task: give --task too")
    if task is not None and (robot != model.DEFAULT_ROBOT or start is not None):
        raise InvalidInputError(f"--task has its robot, {model.DEFAULT_ROBOT}, and its start: leave them out")
    speed = math.inf if fast else pace
    called = robot if name is None else name
    if not re.fullmatch(r"[A-Za-z]\w*", called, re.ASCII):
        raise InvalidInputError(f"--name must be letters, digits and underscores, a letter first, got {called!r}")
    q = None if start is None else [math.radians(angle) for angle in start] if degrees else start
    with contextlib.ExitStack() as stack:
        environment = None
        if task is not None:
            environment = _environment(task, seed)
            stack.callback(environment.close)
        arm = SimulatedArm(robot, q=q, task=None if environment is None else environment.task)
        shown = _cameras(arm, cameras or {})
        watch = _watching(stack, arm, environment, port) if view else _nothing
        core: KinovaDriver | TrajectoryController
        node: Ros1Node | Ros2Node
        if ros == "1":
            from jacokin.twin.ros1 import Ros1Node

            core = driver = KinovaDriver(arm, faults=found, seed=seed)
            node = Ros1Node(driver, called, pace=speed, cameras=shown)
        else:
            from jacokin.twin.ros2 import Ros2Node

            joints = [f"{called}_joint_{joint + 1}" for joint in range(arm.robot.dof)]
            core = controller = TrajectoryController(arm, joints, faults=found, seed=seed)
            node = Ros2Node(controller, called, pace=speed, cameras=shown)
        click.echo(f"twin of {arm.robot.label} in ROS {ros}: ready; Ctrl-C ends it", err=True)
        late = 0
        try:
            late = node.run(watch, lambda: seconds is None or arm.state.time < seconds)
        except KeyboardInterrupt:
            click.echo("closed", err=True)
        finally:
            node.close()
            _show(core.record(), late, json)
        died = getattr(core, "died", "")
        if died:
            click.echo(f"jacokin: {died}", err=True)
            raise SystemExit(NOT_SOLVED)


def _environment(task: str, seed: int) -> TaskEnv:
    """The scene of a task at the start of an episode."""
    from jacokin.tasks import TaskEnv

    if ":" in task:
        sys.path.insert(0, "")
    environment = TaskEnv(task, flatten=False)
    environment.reset(seed=seed)
    return environment


def _cameras(arm: SimulatedArm, sizes: dict[str, tuple[int, int]]) -> list[Camera]:
    from jacokin.twin.pictures import Camera

    return [Camera.of(arm.physics, camera, size) for camera, size in sizes.items()]


def _nothing() -> None:
    """Watch nothing."""


def _watching(
    stack: contextlib.ExitStack, arm: SimulatedArm, environment: TaskEnv | None, port: int
) -> Callable[[], None]:
    """Show the arm, and the props of a task, in the browser; returns what draws them."""
    from jacokin import viewer
    from jacokin.viewer.browser.props import Props

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
