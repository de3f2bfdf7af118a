"""A configuration every robot can start from: legal, and free of self-contact where there are shapes to check."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from jacokin.model import table

if TYPE_CHECKING:
    from jacokin.model.robot import Robot

Array = NDArray[np.float64]

RANDOM_TRIES = 200  # of a fixed seed: a real arm is free of self-contact in nine of ten
KEYFRAME = "home"  # of an MJCF file


def find(robot: Robot, hint: Array | None) -> Array:
    """The first of these that is legal and free of contact; if none is, the legal one with the fewest touching pairs.

    The hint (a bundled robot's documented home), a keyframe called "home" in the file, the j2n6s300's home for other
    six-joint arms, the middle of the limits, random legal configurations of a fixed seed. Coarse shapes may
    always overlap; that is no reason to have no home.
    """
    if hint is not None and robot.within_limits(hint):
        return hint  # documented, and checked for contact by the tests of the bundled robots
    from jacokin.model import contact

    checker = contact.SelfContact.of(robot)
    best, fewest = middle(robot), np.inf
    for q in _candidates(robot):
        if not robot.within_limits(q):
            continue
        touching = len(checker.touching(q)) if checker else 0
        if touching < fewest:
            best, fewest = q, touching
        if touching == 0:
            break
    return best


def middle(robot: Robot) -> Array:
    """Middle of the limits; zero on free joints, zero clipped where one side is open [rad]."""
    both = np.isfinite(robot.lower) & np.isfinite(robot.upper)
    q = np.clip(np.zeros(robot.dof), robot.lower, robot.upper)
    q[both] = 0.5 * (robot.lower[both] + robot.upper[both])
    return np.clip(q, robot.lower, robot.upper)


def _candidates(robot: Robot) -> list[Array]:
    found = []
    keyframe = _keyframe(robot)
    if keyframe is not None:
        found.append(keyframe)
    if robot.dof == 6:
        found.append(np.array(table.variant("j2n6s300")["home"], dtype=np.float64))
    found.append(middle(robot))
    rng = np.random.default_rng(0)
    lower = np.where(np.isfinite(robot.lower), robot.lower, np.minimum(-np.pi, robot.upper))
    upper = np.where(np.isfinite(robot.upper), robot.upper, np.maximum(np.pi, robot.lower))
    found.extend(rng.uniform(lower, upper, (RANDOM_TRIES, robot.dof)))
    return found


def _keyframe(robot: Robot) -> Array | None:
    """The arm's part of the keyframe "home" of an MJCF file."""
    if robot.source.kind != "mjcf":
        return None
    from jacokin.model import mjcf

    model = mjcf.compile_mjcf(robot.source.path)
    for key in range(model.nkey):
        if model.key(key).name == KEYFRAME:
            address = mjcf.joint_addresses(model, robot.joint_names)
            return np.array(model.key_qpos[key][address])
    return None
