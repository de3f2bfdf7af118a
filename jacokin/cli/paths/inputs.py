"""What `jacokin track` and `jacokin plan` read: the path, and numbers for joints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from jacokin.cli.arguments.units import JointUnits, numbers
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.arrays import Array


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
