"""Options that several commands have in common, the robot that they name, and files that must not be overwritten."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from jacokin import files, ik, model
from jacokin.cli.command import NumberList, option_group, parse_numbers
from jacokin.cli.units import Units
from jacokin.errors import InvalidInputError
from jacokin.model import DEFAULT_ROBOT

if TYPE_CHECKING:
    import pinocchio as pin
    from numpy.typing import ArrayLike

FILE = click.Path(path_type=Path)
VECTOR = (float, float, float)
QUATERNION = (float, float, float, float)
AXES = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}
NAME_OR_FILE = "A bundled robot, or the path of a .urdf or .xml (MJCF)."

Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]
Vector6 = tuple[float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class RobotOptions:
    """Which robot it is; a command that has these options takes them as one parameter."""

    robot: str | None = None
    base: str | None = None
    tip: str | None = None
    package_dirs: Sequence[Path] = ()
    limits: dict[str, tuple[float, float]] | None = None
    finger_angle: float | None = None
    calibration: Path | None = None
    locked: dict[str, float] | None = None
    srdf: Path | None = None

    def load(self) -> model.Robot:
        """The robot.

        Raises:
            InvalidInputError: as `load_robot`.
        """
        return model.load_robot(
            self.robot or DEFAULT_ROBOT,
            base=self.base,
            tip=self.tip,
            package_dirs=self.package_dirs,
            limits=self.limits,
            finger_angle=self.finger_angle,
            calibration=self.calibration,
            locked=self.locked,
            srdf=self.srdf,
        )


def read_limits(
    context: click.Context, option: click.Parameter, texts: Sequence[str]
) -> dict[str, tuple[float, float]] | None:
    """Read lower and upper limits of joints from --limit.

    Raises:
        InvalidInputError: it is not JOINT=LOW,HIGH.
    """
    limits = {}
    for text in texts:
        joint, sign, values = text.rpartition("=")
        if not sign:
            raise InvalidInputError(f"--limit must be JOINT=LOW,HIGH, for example joint_2=0.9,5.4, got {text!r}")
        low, high = parse_numbers(f"--limit {joint}", values, 2)
        limits[joint] = (low, high)
    return limits or None


def read_locked(context: click.Context, option: click.Parameter, texts: Sequence[str]) -> dict[str, float] | None:
    """Read positions of joints from --lock.

    Raises:
        InvalidInputError: it is not JOINT=VALUE.
    """
    locked = {}
    for text in texts:
        joint, sign, value = text.rpartition("=")
        if not sign:
            raise InvalidInputError(f"--lock must be JOINT=VALUE, for example gripper=0.5, got {text!r}")
        (locked[joint],) = parse_numbers(f"--lock {joint}", value, 1)
    return locked or None


def read_placement(context: click.Context, option: click.Parameter, text: str | None) -> pin.SE3 | list[float] | None:
    """Read a position (3,) from three numbers, or a pose from seven.

    Raises:
        InvalidInputError: another count of numbers, or not a quaternion.
    """
    if text is None:
        return None
    values = parse_numbers(option.opts[0], text)
    if len(values) not in (3, 7):
        raise InvalidInputError(f"{option.opts[0]} must be 3 numbers, or 7 with a quaternion, got {len(values)}")
    return values if len(values) == 3 else _parse_pose(option.opts[0], values)


def read_tool(context: click.Context, option: click.Parameter, text: str | None) -> pin.SE3 | None:
    """Read T_frame_tool from --tool."""
    place = read_placement(context, option, text)
    return _parse_pose(option.opts[0], place) if isinstance(place, list) else place


def _parse_pose(flag: str, values: list[float]) -> pin.SE3:
    """The pose of a position and perhaps a quaternion in a row."""
    try:
        return model.pose(values[:3], values[3:] or None)
    except InvalidInputError as error:
        raise InvalidInputError(f"{flag}: {error}") from error


def read_axis(context: click.Context, option: click.Parameter, text: str | None) -> list[float] | None:
    """Read an axis (3,): x, y, z, or three numbers.

    Raises:
        InvalidInputError: anything else.
    """
    if text is None:
        return None
    word = text.strip().lower()
    try:
        return AXES[word] if word in AXES else parse_numbers(option.opts[0], text, 3)
    except InvalidInputError as error:
        raise InvalidInputError(
            f"{option.opts[0]} must be x, y, z or three numbers such as 1,0,0.5, got {text!r}"
        ) from error


base = click.option("--base", metavar="FRAME", help="Base frame of the arm; the file's root if not given.")
tip = click.option("--tip", metavar="FRAME", help="Frame at the end of the arm, for a file with several.")
package_dir = click.option(
    "--package-dir",
    "package_dirs",
    type=FILE,
    multiple=True,
    metavar="FOLDER",
    help="Folder that holds the packages of package:// meshes, beside ROS_PACKAGE_PATH. Repeatable.",
)
limit = click.option(
    "--limit",
    "limits",
    multiple=True,
    callback=read_limits,
    metavar="JOINT=LOW,HIGH",
    help="Limits of a joint in place of those of the file [rad], also with --degrees. Repeatable.",
)
finger_angle = click.option(
    "--finger-angle", type=float, metavar="A", help="Where the fingers are held [rad], also with --degrees."
)
lock = click.option(
    "--lock",
    "locked",
    multiple=True,
    callback=read_locked,
    metavar="JOINT=VALUE",
    help="Where a joint off the arm is locked [rad], or [m], also with --degrees. Repeatable.",
)
srdf = click.option(
    "--srdf",
    type=FILE,
    metavar="FILE.srdf",
    help="Pairs of links whose contact does not count, if not beside the URDF.",
)
calibration = click.option(
    "--calibration", type=FILE, metavar="FILE.toml", help="How this arm differs from its description."
)
frame = click.option("--frame", metavar="NAME", help="Frame of the tool; `jacokin info` lists them.")
tool = click.option(
    "--tool",
    cls=NumberList,
    callback=read_tool,
    metavar="X Y Z [W X Y Z]",
    help="What is brought to the target, in the axes of --frame: position [m], orientation as a quaternion.",
)
free_axis = click.option(
    "--free-axis",
    callback=read_axis,
    metavar="AXIS",
    help="The tool may turn about this axis of its own: x, y, z or X,Y,Z.",
)
free_range = click.option(
    "--free-range",
    type=(float, float),
    metavar="A B",
    help="From and to which angle it may turn; a full turn by default.",
)
scene = click.option("--scene", type=FILE, metavar="FILE.yaml", help="Obstacles around the arm, .yaml or .json.")
clearance = click.option(
    "--clearance", default=0.0, metavar="D", help="Shapes this near to each other count as touching [m]."
)
velocity_limit = click.option(
    "--velocity-limit", cls=NumberList, metavar="V ..", help="Of the joints [rad/s], one for all or one for each."
)
degrees = click.option(
    "--degrees",
    "units",
    is_flag=True,
    callback=lambda context, option, given: Units(given),
    help="Angles in and out in degrees.",
)
joints_topic = click.option(
    "--joints-topic", metavar="NAME", help="Of a log: what reports the joints; /joint_states and kinova-ros' are found."
)
joint_prefix = click.option(
    "--joint-prefix", metavar="TEXT", help="Of a log: before the names of the joints; found where one arm is there."
)
json = click.option("--json", is_flag=True, help="One JSON document on stdout, floats in full precision.")
seed = click.option(
    "--seed", cls=NumberList, metavar="Q1 .. Q6", help="Joint angles to stay near to; the robot's home if not given."
)
random_seed = click.option(
    "--random-seed", type=click.IntRange(min=0), metavar="N", help="Seed of the random numbers; fixed if not given."
)
workers = click.option(
    "--workers",
    type=click.IntRange(min=1),
    default=1,
    metavar="N",
    help="Threads; processes where code is not compiled.",
)
dask = click.option("--dask", metavar="ADDRESS", help="Work on a dask cluster, by its scheduler: tcp://10.0.0.1:8786.")


RADIANS = Units(degrees=False)  # of commands without --degrees


def robot(default: str | None = DEFAULT_ROBOT, text: str = NAME_OR_FILE) -> Callable[..., Any]:
    """The options that say which robot it is; the command gets them as `source`."""
    name = click.option("--robot", default=default, metavar="NAME|FILE", help=text)
    return option_group(
        "source", RobotOptions, name, base, tip, package_dir, limit, finger_angle, lock, srdf, calibration
    )


def load_scene(path: Path | None) -> model.Scene | None:
    """The scene of a file; None without one."""
    return None if path is None else model.Scene.load(path)


def free_about(
    pose: pin.SE3 | ArrayLike, axis: Sequence[float], turns: tuple[float, float] | None, units: Units
) -> ik.FreeAxis:
    """A pose whose tool may turn about an axis of its own.

    Raises:
        InvalidInputError: an axis without a direction, or an empty range.
    """
    return ik.FreeAxis(pose, axis=axis) if turns is None else ik.FreeAxis(pose, axis=axis, range=units.to_si(turns))


# Meshes, textures and included files in a URDF or MJCF, and the folders MJCF looks for them in.
_REFERENCE = re.compile(r"""\b(?:file|filename)\s*=\s*["']([^"']+)["']""")
_FOLDER = re.compile(r"""\b(?:meshdir|texturedir|assetdir)\s*=\s*["']([^"']+)["']""")
_SCHEME = re.compile(r"^(?:package|file)://")


def keep_apart(
    outputs: Mapping[str, Path | None], inputs: Mapping[str, str | Path | None], folders: Sequence[Path] = ()
) -> None:
    """Refuse outputs that are inputs, or one file under two options.

    Args:
        outputs: option and file; None where it is not given.
        inputs: option and file, or the name of a bundled robot.
        folders: where packages of robots are looked for.

    Raises:
        InvalidInputError: names the two options.
    """
    written: dict[Path, str] = {}
    for option, output in outputs.items():
        if output is None:
            continue
        other = written.setdefault(_resolved(output), option)
        if other != option:
            raise InvalidInputError(f"{option} and {other} are the same file, {output}")
        if output.is_file():
            _keep_apart(option, output, inputs, folders)


def _keep_apart(option: str, output: Path, inputs: Mapping[str, str | Path | None], packages: Sequence[Path]) -> None:
    for name, given in inputs.items():
        for read in [] if given is None else _read_files(Path(given), packages):
            if output.samefile(read):
                raise InvalidInputError(f"{option} {output} is a file that {name} reads: it would be lost")


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError):  # a loop of links, refused when it is opened
        return path


def _read_files(path: Path, packages: Sequence[Path]) -> Iterator[Path]:
    """A file and those that it names, if it is a robot description."""
    seen: set[Path] = set()
    ahead = [path]
    while ahead:
        file = ahead.pop()
        if file in seen or not file.is_file():
            continue
        seen.add(file)
        yield file
        if file.suffix.lower() in (".urdf", ".xml", ".mjcf"):
            text = files.read_bytes(file, files.DESCRIPTION).decode("utf-8", "replace")
            folders = [*packages, path.parent, file.parent, *(path.parent / folder for folder in _FOLDER.findall(text))]
            names = [_SCHEME.sub("", name) for name in _REFERENCE.findall(text)]
            ahead += [folder / name for folder in folders for name in names]
