"""`find` a configuration to start from: within the limits, and free of self-contact where there are shapes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.model.descriptions import bundled
from jacokin.model.robot import Home, Robot

RANDOM_TRIES = 200  # of a fixed seed: a real arm is free of self-contact in nine of ten
KEYFRAME = "home"  # of an MJCF file
NEAR_LIMIT = 0.1  # of a joint's range
SINGULAR = 0.02  # least to largest singular value; 0.03 to 0.08 at the documented homes
SAME_PLACE = 1e-3  # [m, or of a matrix] between the joints of a file and those of a bundled arm


def documented_home(name: str) -> Home:
    """The home of a bundled robot in the table of numbers, free of contact as tests check."""
    row = bundled.variant(name)
    source = row["doubt"].removeprefix("the home is ") if "doubt" in row else f"documented for the {name}"
    return Home(np.array(row["home"], dtype=np.float64), source)


def find(robot: Robot) -> Home:
    """The first candidate within the limits, free of contact and not singular; if none is, the one that is closest.

    A keyframe called "home" in the file; the documented home of a bundled robot whose joints stand where this one's
    do; the middle of the limits; random configurations of a fixed seed, first those above the base and away from the
    limits. Coarse shapes may always overlap; that is no reason to have no home.
    """
    from jacokin.model.contact import SelfContact  # which needs Robot

    checker = SelfContact.of(robot)
    best, fewest, singular = Home(middle(robot), "the middle of the limits"), np.inf, True
    for candidate in _candidates(robot):
        if not robot.within_limits(candidate.q):
            continue
        touching, is_singular = len(checker.touching(candidate.q)) if checker else 0, _is_singular(robot, candidate.q)
        if (touching, is_singular) < (fewest, singular):
            best, fewest, singular = candidate, touching, is_singular
        if (fewest, singular) == (0, False):
            break
    if checker is None:
        return Home(best.q, f"{best.source}; without shapes to check for contact")
    return Home(best.q, best.source if fewest == 0 else f"{best.source}; {fewest} pairs of shapes touch")


def _is_singular(robot: Robot, q: Array) -> bool:
    """Whether the tool can hardly move in some direction, as of a straight arm; solving from there goes badly."""
    values = robot.singular_values(q)
    return bool(values[-1] < SINGULAR * values[0])


def middle(robot: Robot) -> Array:
    """Middle of the limits; zero on unlimited joints, zero clipped where one side is open [rad]."""
    both = np.isfinite(robot.lower) & np.isfinite(robot.upper)
    q = np.clip(np.zeros(robot.dof), robot.lower, robot.upper)
    q[both] = 0.5 * (robot.lower[both] + robot.upper[both])
    return np.clip(q, robot.lower, robot.upper)


def _candidates(robot: Robot) -> Iterator[Home]:
    keyframe = _keyframe(robot)
    if keyframe is not None:
        yield Home(keyframe, f"keyframe {KEYFRAME!r} of the file")
    for name in bundled.NAMES:
        if _has_the_joints_of(robot, name):
            yield documented_home(name)
            break
    centre = middle(robot)
    yield Home(centre, "the middle of the limits")
    # At most half a turn from the middle: more leads to the same places.
    lower, upper = np.maximum(robot.lower, centre - np.pi), np.minimum(robot.upper, centre + np.pi)
    drawn = np.random.default_rng(0).uniform(lower, upper, (RANDOM_TRIES, robot.dof))
    for q in sorted(drawn, key=lambda q: _is_awkward(robot, q)):
        yield Home(q, "a random search within the limits")


def _is_awkward(robot: Robot, q: Array) -> tuple[bool, bool]:
    """Whether a joint or the tool is below the base, where a table may be, and whether a joint is near its limit."""
    model, data = robot.pin_model, robot.pin_model.createData()
    pin.framesForwardKinematics(model, data, q)
    heights = [placement.translation[2] for placement in list(data.oMi)[1:]]
    heights.append(data.oMf[robot.frame_id()].translation[2])
    below = min(heights) < min(0.0, heights[0])
    margin = np.minimum(q - robot.lower, robot.upper - q)
    return below, bool((margin < NEAR_LIMIT * (robot.upper - robot.lower))[~robot.unlimited].any())


def _has_the_joints_of(robot: Robot, name: str) -> bool:
    """Whether each joint has the place after the one before it that it has in a bundled arm; names do not count."""
    rows = list(bundled.arm_joints(name).values())
    if robot.dof != len(rows):
        return False
    for row, placement in zip(rows[1:], list(robot.pin_model.jointPlacements)[2:], strict=True):
        rpy = np.array([bundled.parse_angle(value) for value in row["rpy"]])
        expected = pin.SE3(pin.rpy.rpyToMatrix(rpy), np.array(row["xyz"], dtype=np.float64))
        if not np.allclose(placement.homogeneous, expected.homogeneous, rtol=0.0, atol=SAME_PLACE):
            return False
    return all(joint.shortname() == "JointModelRZ" for joint in list(robot.pin_model.joints)[1:])


def _keyframe(robot: Robot) -> Array | None:
    """The arm's part of the keyframe "home" of an MJCF file."""
    model = robot.source.content
    if model is None or isinstance(model, str):
        return None
    from jacokin.model.descriptions import mjcf

    for key in range(model.nkey):
        if model.key(key).name == KEYFRAME:
            addresses = model.jnt_qposadr[mjcf.joint_ids(model, robot.joint_names)]
            return np.array(model.key_qpos[key][addresses])
    return None
