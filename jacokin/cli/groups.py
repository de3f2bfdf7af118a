"""Options that go together, as classes that a command takes as one parameter."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING

from jacokin import files, ik, model
from jacokin.cli import options
from jacokin.cli.command import option
from jacokin.cli.units import Units
from jacokin.errors import InvalidInputError
from jacokin.model import DEFAULT_ROBOT

if TYPE_CHECKING:
    import numpy as np
    import pinocchio as pin
    from numpy.typing import ArrayLike

RADIANS = Units(degrees=False)  # of commands without --degrees


@dataclass(frozen=True, slots=True)
class RobotOptions:
    """Which robot it is."""

    robot: str | None = option("--robot", default=DEFAULT_ROBOT, metavar="NAME|FILE", help=options.NAME_OR_FILE)
    base: str | None = options.base()
    tip: str | None = options.tip()
    package_dirs: Sequence[Path] = options.package_dirs()
    limits: dict[str, tuple[float, float]] | None = options.limits()
    finger_angle: float | None = option(
        "--finger-angle", metavar="A", help="Where the fingers are held [rad], or [m], also with --degrees."
    )
    locked: dict[str, float] | None = options.locked()
    srdf: Path | None = options.srdf()
    calibration: Path | None = options.calibration()

    def load(self) -> model.Robot:
        """The robot.

        Raises:
            InvalidInputError: as `load_robot`.
        """
        given = {each.name: getattr(self, each.name) for each in fields(RobotOptions) if each.name != "robot"}
        return model.load_robot(DEFAULT_ROBOT if self.robot is None else self.robot, **given)

    def keep_apart(self, outputs: Mapping[str, Path | None], inputs: Mapping[str, Path | None] | None = None) -> None:
        """Refuse outputs that are inputs, the files of the robot among them, or one file under two options.

        Args:
            outputs: option and file; None where it is not given.
            inputs: option and file.

        Raises:
            InvalidInputError: names the two options.
        """
        written: dict[Path, str] = {}
        read = {**({} if inputs is None else inputs), "--robot": None if self.robot is None else Path(self.robot)}
        for flag, output in outputs.items():
            if output is None:
                continue
            place = _resolved(output)  # where it is written, also past a folder that is not there
            other = written.setdefault(place, flag)
            if other != flag:
                raise InvalidInputError(f"{flag} and {other} are the same file, {output}")
            for name, given in read.items() if place.is_file() else ():
                if given is not None and any(place.samefile(each) for each in _read_files(given, self.package_dirs)):
                    raise InvalidInputError(f"{flag} {output} is a file that {name} reads: it would be lost")


@dataclass(frozen=True, slots=True)
class NamedRobotOptions(RobotOptions):
    """Which robot it is, for commands that are about nothing else."""

    robot: str | None = option(
        "--robot", metavar="NAME|FILE", help="As NAME|FILE, for who is used to it from the other commands."
    )
    name: str | None = option(required=False, metavar="[NAME|FILE]", text=options.NAME_OR_FILE)

    def load(self) -> model.Robot:
        """The robot.

        Raises:
            InvalidInputError: as `load_robot`, or it is given twice.
        """
        if self.name is not None and self.robot is not None:
            raise InvalidInputError("give the robot once: as an argument, or with --robot")
        return RobotOptions.load(self if self.name is None else replace(self, robot=self.name))


# Meshes, textures and included files in a URDF or MJCF, and the folders MJCF looks for them in.
_REFERENCE = re.compile(r"""\b(?:file|filename)\s*=\s*["']([^"']+)["']""")
_FOLDER = re.compile(r"""\b(?:meshdir|texturedir|assetdir)\s*=\s*["']([^"']+)["']""")
_SCHEME = re.compile(r"^(?:package|file)://")


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


@dataclass(frozen=True, slots=True)
class MapRobotOptions(RobotOptions):
    """The robot of a map."""

    robot: str | None = option(
        "--robot", metavar="NAME|FILE", help="The robot of the map, where it is not a bundled one as it is."
    )


@dataclass(frozen=True, slots=True)
class ToolOptions:
    """What is brought to the target."""

    frame: str | None = options.frame(without=("--to",))
    tool: pin.SE3 | None = options.tool(without=("--to",))


@dataclass(frozen=True, slots=True)
class SceneOptions:
    """What the arm keeps clear of."""

    scene: Path | None = options.scene()
    clearance: float = options.clearance()

    def load(self) -> model.Scene | None:
        """The scene; None without one.

        Raises:
            InvalidInputError: as `Scene.load`.
        """
        return load_scene(self.scene)


@dataclass(frozen=True, slots=True)
class FormOptions:
    """The form of an answer."""

    units: Units = options.degrees()
    json: bool = options.json()


@dataclass(frozen=True, slots=True)
class BatchOptions:
    """A file of poses, and where its answers go."""

    targets: Path | None = option(
        "--targets",
        help="Solve every row of a .csv, .npz, .npy or .parquet: x,y,z and qw,qx,qy,qz or none; others are kept.",
    )
    output: Path | None = option(
        "--output", needs=("--targets",), help="Write the answers to --targets to this .csv, .npz or .parquet."
    )
    resume: bool | None = option(
        "--resume/--no-resume",
        needs=("--output",),
        default=None,
        help="Continue a run with --targets and --output that did not end, as happens if not given; or start again.",
    )
    workers: int = options.workers(needs=("--targets",), without=("--dask",))
    dask: str | None = options.dask(needs=("--output",))


def load_scene(path: Path | None) -> model.Scene | None:
    """The scene of a file; None without one."""
    return None if path is None else model.Scene.load(path)


def load_generator(seed: int | None) -> np.random.Generator | None:
    """Random numbers from a seed; None without one."""
    import numpy as np

    return None if seed is None else np.random.default_rng(seed)


def free_about(
    pose: pin.SE3 | ArrayLike, axis: Sequence[float], turns: tuple[float, float] | None, units: Units
) -> ik.FreeAxis:
    """A pose whose tool may turn about an axis of its own.

    Raises:
        InvalidInputError: an axis without a direction, or an empty range.
    """
    return ik.FreeAxis(pose, axis=axis) if turns is None else ik.FreeAxis(pose, axis=axis, range=units.to_si(turns))
