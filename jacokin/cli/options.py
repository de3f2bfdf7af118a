"""The options that several commands have in common, and the robot they name."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from jacokin.cli.declared import Argument, Option
from jacokin.cli.units import Units, numbers
from jacokin.errors import InvalidInputError
from jacokin.model.descriptions.bundled import DEFAULT_ROBOT as DEFAULT_ROBOT

if TYPE_CHECKING:
    import pinocchio as pin
    from numpy.typing import ArrayLike

    from jacokin.model.poses import FreeAxis
    from jacokin.model.robot import Robot
    from jacokin.model.scene import Scene

RobotOption = Annotated[
    str, Option("--robot", metavar="NAME|FILE", help="A bundled robot, or the path of a .urdf or .xml (MJCF).")
]
BaseOption = Annotated[
    str | None, Option("--base", metavar="FRAME", help="Base frame of the arm; the file's root if not given.")
]
TipOption = Annotated[
    str | None, Option("--tip", metavar="FRAME", help="Frame at the end of the arm, for a file with several.")
]
PackageDirOption = Annotated[
    list[Path] | None,
    Option(
        "--package-dir",
        metavar="FOLDER",
        help="Folder that holds the packages of package:// meshes, beside ROS_PACKAGE_PATH. Repeatable.",
    ),
]
FrameOption = Annotated[
    str | None, Option("--frame", metavar="NAME", help="Frame of the tool; `jacokin info` lists them.")
]
ToolOption = Annotated[
    str | None,
    Option(
        "--tool",
        metavar="X Y Z [W X Y Z]",
        help="What is brought to the target, in the axes of --frame: position [m], orientation as a quaternion.",
    ),
]
FreeAxisOption = Annotated[
    str | None,
    Option("--free-axis", metavar="AXIS", help="The tool may turn about this axis of its own: x, y, z or X,Y,Z."),
]
FreeRangeOption = Annotated[
    tuple[float, float] | None,
    Option("--free-range", metavar="A B", help="From and to which angle it may turn; a full turn by default."),
]
LimitOption = Annotated[
    list[str] | None,
    Option(
        "--limit",
        metavar="JOINT=LOW,HIGH",
        help="Limits of a joint in place of those of the file [rad], also with --degrees. Repeatable.",
    ),
]
FingerAngleOption = Annotated[
    float | None, Option("--finger-angle", metavar="A", help="Where the fingers are held [rad], also with --degrees.")
]
PathOption = Annotated[
    Path, Option("--path", metavar="FILE.csv", help="Poses to pass through: columns x,y,z,qw,qx,qy,qz.")
]
TimeStepOption = Annotated[float, Option("--dt", metavar="T", help="Control step [s].")]
TrajectoryOption = Annotated[
    Path | None,
    Option("--output", metavar="FILE", help="Write the trajectory here, .csv, .npz, .json (ROS) or .kinova.csv."),
]
PlotOption = Annotated[
    Path | None, Option("--plot", metavar="FILE.png", help="Draw joints, limits and errors over time.")
]
SpeedOption = Annotated[float, Option("--speed", metavar="V", help="Speed along the path [m/s].")]
AngularSpeedOption = Annotated[
    float | None, Option("--angular-speed", metavar="W", help="Speed of turning [rad/s]; 0.5 if not given.")
]
VelocityLimitOption = Annotated[
    str | None,
    Option("--velocity-limit", metavar="V ..", help="Of the joints [rad/s], one for all or one for each."),
]
SceneOption = Annotated[
    Path | None, Option("--scene", metavar="FILE.yaml", help="Obstacles around the arm, .yaml or .json.")
]
ClearanceOption = Annotated[
    float | None,
    Option("--clearance", metavar="D", help="Shapes this near to each other count as touching [m]; 0 if not given."),
]
DegreesOption = Annotated[bool, Option("--degrees", help="Angles in and out in degrees.")]
JsonOption = Annotated[bool, Option("--json", help="One JSON document on stdout, floats in full precision.")]
SeedOption = Annotated[
    str | None,
    Option("--seed", metavar="Q1 .. Q6", help="Joint angles to stay near to; the robot's home if not given."),
]
RandomSeedOption = Annotated[
    int | None,
    Option("--random-seed", metavar="N", at_least=0, help="Seed of the random numbers; fixed if not given."),
]
WorkersOption = Annotated[
    int, Option("--workers", metavar="N", at_least=1, help="Threads; processes where code is not compiled.")
]
DaskOption = Annotated[
    str | None,
    Option("--dask", metavar="ADDRESS", help="Work on a dask cluster, by its scheduler: tcp://10.0.0.1:8786."),
]
QArgument = Annotated[
    list[float],
    Argument(metavar="ANGLE", help="Joint angles, base to tip, one for each joint."),
]


@dataclass(frozen=True, slots=True)
class RobotOptions:
    """Which robot it is; a command that has these options takes them as one parameter."""

    robot: RobotOption = DEFAULT_ROBOT
    base: BaseOption = None
    tip: TipOption = None
    package_dir: PackageDirOption = None
    limit: LimitOption = None
    finger_angle: FingerAngleOption = None

    def load(self) -> Robot:
        """The robot.

        Raises:
            InvalidInputError: as `load_robot`, or a limit that is not JOINT=LOW,HIGH.
        """
        return load(
            self.robot, self.base, self.tip, self.package_dir, limits=self.limit, finger_angle=self.finger_angle
        )


def load(
    robot: str,
    base: str | None = None,
    tip: str | None = None,
    package_dirs: Sequence[Path] | None = None,
    *,
    limits: Sequence[str] | None = None,
    finger_angle: float | None = None,
) -> Robot:
    """The robot the options name.

    Raises:
        InvalidInputError: a limit that is not JOINT=LOW,HIGH.
    """
    from jacokin.model.loading import load_robot

    own = dict(map(_limit, limits)) if limits else None
    return load_robot(robot, base=base, tip=tip, package_dirs=package_dirs or (), limits=own, finger_angle=finger_angle)


def _limit(text: str) -> tuple[str, tuple[float, float]]:
    """Joint, lower and upper limit from what --limit says."""
    joint, sign, values = text.rpartition("=")
    if not sign:
        raise InvalidInputError(f"--limit must be JOINT=LOW,HIGH, for example joint_2=0.9,5.4, got {text!r}")
    low, high = numbers(f"--limit {joint}", values, 2) or (0.0, 0.0)
    return joint, (low, high)


def placement(option: str, text: str | None) -> pin.SE3 | ArrayLike | None:
    """The position (3,) or the pose that an option with three or seven numbers names.

    Raises:
        InvalidInputError: another count of numbers, or not a quaternion.
    """
    values = numbers(option, text)
    if values is None or len(values) == 3:
        return values
    if len(values) != 7:
        raise InvalidInputError(f"{option} must be 3 numbers, or 7 with a quaternion, got {len(values)}")
    from jacokin.model.poses import pose

    return pose(values[:3], values[3:])


def tool_pose(text: str | None) -> pin.SE3 | ArrayLike | None:
    """T_frame_tool from what --tool says."""
    from jacokin.model.poses import pose

    place = placement("--tool", text)
    return pose(place) if isinstance(place, list) else place


def surroundings(scene: Path | None, clearance: float | None) -> tuple[Scene | None, float]:
    """The scene of a file, and the clearance [m]."""
    if scene is None:
        return None, clearance or 0.0
    from jacokin.model.scene import Scene

    return Scene.load(scene), clearance or 0.0


AXES = {"x": [1.0, 0.0, 0.0], "y": [0.0, 1.0, 0.0], "z": [0.0, 0.0, 1.0]}


def axis_of(text: str) -> list[float]:
    """An axis (3,): x, y, z, or three numbers.

    Raises:
        InvalidInputError: anything else.
    """
    word = text.strip().lower()
    if word in AXES:
        return AXES[word]
    try:
        return numbers("--free-axis", text, 3) or []
    except InvalidInputError as error:
        raise InvalidInputError(
            f"--free-axis must be x, y, z or three numbers such as 1,0,0.5, got {text!r}"
        ) from error


def free_about(pose: pin.SE3 | ArrayLike, axis: str, turns: tuple[float, float] | None, units: Units) -> FreeAxis:
    """A pose whose tool may turn about an axis of its own.

    Raises:
        InvalidInputError: a malformed axis, or an empty range.
    """
    from jacokin.model.poses import FreeAxis

    if turns is None:
        return FreeAxis(pose, axis=axis_of(axis))
    return FreeAxis(pose, axis=axis_of(axis), range=units.read(turns))
