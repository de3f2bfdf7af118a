"""An axis that the tool may turn about, from what --free-axis and --free-range say."""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin.cli.arguments.units import Units, numbers
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import pinocchio as pin
    from numpy.typing import ArrayLike

    from jacokin.model.pose_targets import FreeAxis

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
    from jacokin.model.pose_targets import FreeAxis

    if turns is None:
        return FreeAxis(pose, axis=axis_of(axis))
    return FreeAxis(pose, axis=axis_of(axis), range=units.read(turns))
