"""Options that several commands have in common, and what they are read as."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import model
from jacokin.cli.command import FILE, NumberList, option, parse_numbers, switch
from jacokin.cli.units import Units
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import pinocchio as pin

AXES = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}
NAME_OR_FILE = "A bundled robot, or the path of a .urdf or .xml (MJCF)."

PICTURE = 84, 84  # rows and columns of what a camera observes [pixels]

Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]
Vector6 = tuple[float, float, float, float, float, float]


def parse_joints(flag: str, form: str, example: str, texts: Sequence[str], count: int = 1) -> dict[str, list[float]]:
    """Names of joints, and so many numbers for each, from texts such as JOINT=VALUE.

    Raises:
        InvalidInputError: one is not of this form, or a joint is given twice.
    """
    found: dict[str, list[float]] = {}
    for text in texts:
        joint, sign, values = text.rpartition("=")
        if not sign:
            raise InvalidInputError(f"{flag} must be {form}, for example {example}, got {text!r}")
        if joint in found:
            raise InvalidInputError(f"{flag} is given twice for {joint!r}")
        found[joint] = parse_numbers(f"{flag} {joint}", values, count)
    return found


def read_limits(
    context: click.Context, parameter: click.Parameter, texts: Sequence[str]
) -> dict[str, tuple[float, float]] | None:
    """Read lower and upper limits of joints from --limit; errors as of `parse_joints`."""
    found = parse_joints("--limit", "JOINT=LOW,HIGH", "joint_2=0.9,5.4", texts, 2)
    return {joint: (low, high) for joint, [low, high] in found.items()} or None


def read_locked(context: click.Context, parameter: click.Parameter, texts: Sequence[str]) -> dict[str, float] | None:
    """Read positions of joints from --lock; errors as of `parse_joints`."""
    found = parse_joints("--lock", "JOINT=VALUE", "gripper=0.5", texts)
    return {joint: value for joint, [value] in found.items()} or None


def read_placement(
    context: click.Context, parameter: click.Parameter, text: str | None
) -> pin.SE3 | list[float] | None:
    """Read a position (3,) from three numbers, or a pose from seven.

    Raises:
        InvalidInputError: another count of numbers, or not a quaternion.
    """
    if text is None:
        return None
    values = parse_numbers(parameter.opts[0], text)
    if len(values) not in (3, 7):
        raise InvalidInputError(f"{parameter.opts[0]} must be 3 numbers, or 7 with a quaternion, got {len(values)}")
    return values if len(values) == 3 else _parse_pose(parameter.opts[0], values)


def read_tool(context: click.Context, parameter: click.Parameter, text: str | None) -> pin.SE3 | None:
    """Read T_frame_tool from --tool."""
    place = read_placement(context, parameter, text)
    return _parse_pose(parameter.opts[0], place) if isinstance(place, list) else place


def _parse_pose(flag: str, values: list[float]) -> pin.SE3:
    """The pose of a position and perhaps a quaternion in a row."""
    try:
        return model.pose(values[:3], values[3:] or None)
    except InvalidInputError as error:
        raise InvalidInputError(f"{flag}: {error}") from error


def read_axis(context: click.Context, parameter: click.Parameter, text: str | None) -> list[float] | None:
    """Read an axis (3,): x, y, z, or three numbers.

    Raises:
        InvalidInputError: anything else.
    """
    if text is None:
        return None
    word = text.strip().lower()
    try:
        return AXES[word] if word in AXES else parse_numbers(parameter.opts[0], text, 3)
    except InvalidInputError as error:
        raise InvalidInputError(
            f"{parameter.opts[0]} must be x, y, z or three numbers such as 1,0,0.5, got {text!r}"
        ) from error


def read_cameras(
    context: click.Context, parameter: click.Parameter, texts: tuple[str, ...]
) -> dict[str, tuple[int, int]] | None:
    """Read cameras and the sizes of their pictures from --camera.

    Raises:
        InvalidInputError: it is neither NAME nor NAME=HEIGHTxWIDTH, or given twice.
    """
    found = dict[str, tuple[int, int]]()
    for text in texts:
        name, sign, size = text.partition("=")
        match = re.fullmatch(r"([0-9]{1,4})x([0-9]{1,4})", size)
        if not name or (sign and match is None):
            raise InvalidInputError(f"--camera must be NAME or NAME=HEIGHTxWIDTH, such as wrist=96x96, got {text!r}")
        if name in found:
            raise InvalidInputError(f"--camera is given twice for {name!r}")
        found[name] = PICTURE if match is None else (int(match[1]), int(match[2]))
    return found or None


# Options of several commands, each a field of a class of options; a call gives it other settings.
base = partial(option, "--base", metavar="FRAME", help="Base frame of the arm; the file's root if not given.")
tip = partial(option, "--tip", metavar="FRAME", help="Frame at the end of the arm, for a file with several.")
package_dirs = partial(
    option,
    "--package-dir",
    type=FILE,
    multiple=True,
    metavar="FOLDER",
    help="Folder that holds the packages of package:// meshes, beside ROS_PACKAGE_PATH. Repeatable.",
)
limits = partial(
    option,
    "--limit",
    multiple=True,
    callback=read_limits,
    default=None,
    metavar="JOINT=LOW,HIGH",
    help="Limits of a joint in place of those of the file [rad], also with --degrees. Repeatable.",
)
locked = partial(
    option,
    "--lock",
    multiple=True,
    callback=read_locked,
    default=None,
    metavar="JOINT=VALUE",
    help="Where a joint off the arm is locked [rad], or [m], also with --degrees. Repeatable.",
)
srdf = partial(
    option, "--srdf", metavar="FILE.srdf", help="Pairs of links whose contact does not count, if not beside the URDF."
)
calibration = partial(option, "--calibration", metavar="FILE.toml", help="How this arm differs from its description.")
frame = partial(option, "--frame", metavar="NAME", help="Frame of the tool; `jacokin info` lists them.")
tool = partial(
    option,
    "--tool",
    cls=NumberList,
    callback=read_tool,
    metavar="X Y Z [W X Y Z]",
    help="What is brought to the target, in the axes of --frame: position [m], orientation as a quaternion.",
)
free_axis = partial(
    option,
    "--free-axis",
    callback=read_axis,
    metavar="AXIS",
    help="The tool may turn about this axis of its own: x, y, z or X,Y,Z.",
)
free_range = partial(
    option, "--free-range", metavar="A B", help="From and to which angle it may turn; a full turn by default."
)
scene = partial(option, "--scene", metavar="FILE.yaml", help="Obstacles around the arm, .yaml or .json.")
clearance = partial(
    option, "--clearance", default=0.0, metavar="D", help="Shapes this near to each other count as touching [m]."
)
lower_corner = partial(option, "--lower", needs=("--upper",), metavar="X Y Z")
upper_corner = partial(option, "--upper", needs=("--lower",), metavar="X Y Z")
dt = partial(option, "--dt", default=0.01, metavar="T", help="Control step [s].")
velocity_limit = partial(
    option, "--velocity-limit", metavar="V ..", help="Of the joints [rad/s], one for all or one for each."
)
acceleration_limit = partial(
    option, "--acceleration-limit", metavar="A ..", help="Of the joints [rad/s^2]; 1 rad/s^2 if not given."
)
degrees = partial(
    switch,
    "--degrees",
    callback=lambda context, parameter, given: Units(given),
    help="Angles in and out in degrees.",
)
joints_topic = partial(
    option,
    "--joints-topic",
    metavar="NAME",
    help="Of a log: what reports the joints; /joint_states and kinova-ros' are found.",
)
joint_prefix = partial(
    option,
    "--joint-prefix",
    metavar="TEXT",
    help="Of a log: before the names of the joints; found where one arm is there.",
)
json = partial(switch, "--json", help="One JSON document on stdout, floats in full precision.")
seed = partial(
    option, "--seed", metavar="Q1 .. Q6", help="Joint angles to stay near to; the robot's home if not given."
)
random_seed = partial(
    option,
    "--random-seed",
    type=click.IntRange(min=0),
    metavar="N",
    help="Seed of the random numbers; fixed if not given.",
)
workers = partial(
    option,
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    metavar="N",
    help="Threads; processes where code is not compiled.",
)
dask = partial(
    option, "--dask", metavar="ADDRESS", help="Work on a dask cluster, by its scheduler: tcp://10.0.0.1:8786."
)
cameras = partial(option, "--camera", multiple=True, callback=read_cameras, metavar="NAME[=HxW]")
pace = partial(option, "--pace", type=click.FloatRange(min=0.0, min_open=True), metavar="P")
port = partial(
    option, "--port", type=click.IntRange(min=0), default=8080, metavar="N", help="Of the page; 0 for any free one."
)


def keep_degrees(output: Path | None, robot: model.Robot) -> None:
    """Refuse to write joints that slide to Kinova's files.

    Raises:
        InvalidInputError: names them.
    """
    from jacokin.motion.trajectory import FOR_KINOVA, refuse_sliding

    if output is not None and output.name.endswith(FOR_KINOVA):
        refuse_sliding(f"--output {output.name}", robot.joint_names, robot.sliding)
