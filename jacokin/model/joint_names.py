"""`find_joints`: the joints of a robot among the names that ROS has for them."""

from __future__ import annotations

from collections.abc import Sequence

from jacokin.errors import InvalidInputError
from jacokin.model.descriptions.bundled import NAMES
from jacokin.model.robot import Robot


def find_joints(names: Sequence[str], robot: Robot, prefix: str | None = None) -> tuple[int, ...]:
    """Where the joints of a robot are in a list of names.

    The list may have others, as those of fingers or of another arm. Those of the robot are called as in its
    description, or all with one prefix, such as j2n6s300_joint_1.

    Args:
        names: as a message of ROS has them.
        robot: whose joints to find.
        prefix: before each name; None to find it.

    Returns:
        (dof,) indices, in the order of `robot.joint_names`.

    Raises:
        InvalidInputError: joints are missing, there several times, or have the prefix of another bundled robot.
    """
    own = robot.joint_names
    there = set(names)
    found = sorted({name.removesuffix(own[0]) for name in names if name.endswith(own[0])})
    wanted = found if prefix is None else [prefix]
    fitting = [each for each in wanted if all(each + name in there for name in own)]
    listed = ", ".join(names) or "none"
    if not fitting:
        before = "" if prefix is None else f" with {prefix!r} before their names"
        raise InvalidInputError(f"the joints {listed}; {robot.name} has others{before}: {', '.join(own)}")
    if len(fitting) > 1:
        raise InvalidInputError(f"the joints {listed}: several arms; the prefix must be one of {', '.join(fitting)}")
    if prefix is None and fitting[0].rstrip("_/") in set(NAMES) - {robot.name}:
        raise InvalidInputError(f"the joints {listed}; the robot is {robot.name}")
    wanted_names = [fitting[0] + name for name in own]
    if any(names.count(name) > 1 for name in wanted_names):
        raise InvalidInputError(f"the joints {listed}: one is there twice")
    return tuple(names.index(name) for name in wanted_names)
