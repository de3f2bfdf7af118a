"""What `jacokin track` and `jacokin plan` read: the path, numbers for joints, and files that will be written."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import TYPE_CHECKING

from jacokin.cli.arguments.units import JointUnits, numbers
from jacokin.errors import InvalidInputError, MissingExtraError

if TYPE_CHECKING:
    from jacokin.arrays import Array

PLOT_FORMATS = (".png", ".svg", ".pdf")


def check_files(output: Path | None, formats: tuple[str, ...], plot: Path | None) -> None:
    """Find out before the work what would fail after it.

    Raises:
        InvalidInputError: a file of another kind.
        MissingExtraError: matplotlib is needed and not installed.
    """
    for option, file, endings in (("--output", output, formats), ("--plot", plot, PLOT_FORMATS)):
        if file is not None and file.suffix not in endings:
            raise InvalidInputError(f"{option} must end in {' or '.join(endings)}, got {str(file)!r}")
    if plot is not None and importlib.util.find_spec("matplotlib") is None:
        raise MissingExtraError("matplotlib", "plot")


def of_joints(option: str, text: str | None, joints: JointUnits) -> list[float] | None:
    """Numbers for the joints, in [rad] and [m]; one number stands for all.

    Raises:
        InvalidInputError: not numbers.
    """
    values = numbers(option, text)
    if values is not None and len(values) == 1 and option.endswith("-limit"):
        values *= len(joints.sliding)
    return None if values is None else joints.read(values)


def poses(path: Path) -> Array:
    """The poses of a path file (n, 4, 4).

    Raises:
        InvalidInputError: as `read_targets`, or the file has no orientations.
    """
    from jacokin.ik.files.columns import QUATERNION, RPY
    from jacokin.ik.files.targets_csv import read_targets

    targets = read_targets(path).targets
    if targets.ndim != 3:
        raise InvalidInputError(
            f"{path}: a path needs orientations, columns {', '.join(QUATERNION)} or {', '.join(RPY)}"
        )
    return targets
