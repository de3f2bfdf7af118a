"""The target of `jacokin ik` from what was typed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin.cli.arguments.free_axis import free_about
from jacokin.cli.arguments.units import Units
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    import numpy as np
    import pinocchio as pin
    from numpy.typing import NDArray

    from jacokin.model.pose_targets import FreeAxis

Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]


def build(
    position: Vector3 | None,
    quat_wxyz: Vector4 | None,
    rpy: Vector3 | None,
    down: bool,
    approach: Vector3 | None,
    free_axis: str | None,
    free_range: tuple[float, float] | None,
    units: Units,
) -> pin.SE3 | NDArray[np.float64] | FreeAxis:
    """The pose; the position alone when the orientation is free; or a pose that may turn about an axis.

    Raises:
        InvalidInputError: options that do not go together, or a malformed value.
    """
    import numpy as np

    from jacokin.model.pose_targets import FreeAxis, pose

    assert position is not None  # combinations.check
    if approach is not None:
        if quat_wxyz is not None or rpy is not None or down or free_axis is not None:
            raise InvalidInputError("--approach is an orientation with a free axis: give it alone")
        target = pose(position, approach=approach)
        if free_range is None:
            return target
        return FreeAxis(target.pose, axis=target.axis, range=units.read(free_range))
    if quat_wxyz is None and rpy is None and not down:
        if free_axis is not None or free_range is not None:
            raise InvalidInputError("--free-axis and --free-range need an orientation to start from")
        return np.array(position)
    at = pose(position, quat_wxyz, rpy=None if rpy is None else units.read(rpy), down=down)
    if free_axis is None:
        if free_range is not None:
            raise InvalidInputError("--free-range goes with --free-axis or --approach")
        return at
    return free_about(at, free_axis, free_range, units)
