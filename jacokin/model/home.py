"""A configuration every robot can start from: within the limits, and free of self-contact where there are shapes."""

from __future__ import annotations

import numpy as np

from jacokin.arrays import Array
from jacokin.model.descriptions import table
from jacokin.model.mujoco_twin.contact import SelfContact
from jacokin.model.robot import Robot

RANDOM_TRIES = 200  # of a fixed seed: a real arm is free of self-contact in nine of ten
KEYFRAME = "home"  # of an MJCF file


def find(robot: Robot) -> Array:
    """The first candidate within the limits and free of contact; if none is, the one with the fewest touching pairs.

    A keyframe called "home" in the file, the j2n6s300's home for other six-joint arms, the middle of the limits,
    random configurations of a fixed seed. Coarse shapes may always overlap; that is no reason to have no home.
    """
    checker = SelfContact.of(robot)
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
    """Middle of the limits; zero on unlimited joints, zero clipped where one side is open [rad]."""
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
    from jacokin.model.descriptions import mjcf

    model = mjcf.compile_mjcf(robot.source.path)
    for key in range(model.nkey):
        if model.key(key).name == KEYFRAME:
            address = mjcf.joint_addresses(model, robot.joint_names)
            return np.array(model.key_qpos[key][address])
    return None
