"""What `plan_pick` and `plan_place` share: the hand, and a planner of motions and straight lines within a time."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.descriptions.bundled import JACOS
from jacokin.model.gripper import JACO, Gripper
from jacokin.model.robot import Robot, acceleration_limits, velocity_limits
from jacokin.motion.free_motion.plan_motion import plan_motion
from jacokin.motion.free_motion.search import Randomness
from jacokin.motion.planning.plan import plan_path
from jacokin.motion.rows import joined, resting
from jacokin.motion.trajectory import MotionStatus, Trajectory

HAND = "hand"  # of bundled robots: the link whose contact with the object is allowed, with the fingers that it carries
AHEAD = 40  # lines among which the free motion chooses where it leads
LINES = 5  # straight lines that are tried
LEAST_TIME = 0.1  # [s] for each straight line, and to lift an object, whatever time is left
UP = np.array([0.0, 0.0, 1.0])


def hand_links(robot: Robot, frame: str, hand: str | None) -> list[str]:
    """Links that may touch the object: the one that is given, or those of the hand that carries a frame."""
    from jacokin.model.mujoco_twin import shapes_of_links

    if hand is not None:
        return [hand]
    links = shapes_of_links(robot)
    if HAND in links:
        return [HAND]
    joints = {link: robot.pin_model.frames[robot.frame_id(link)].parentJoint for link in (*links, frame)}
    return [link for link in links if joints[link] == joints[frame]]


def ahead_of(gripper: Gripper | None) -> Array:
    """(3,) the direction in which a hand comes to an object, in its tool."""
    return UP if gripper is None else np.asarray(gripper.pads.rotation[:, 2])


def kinova_fingers(robot: Robot, opening: float | None) -> float | None:
    """An opening [rad] as Kinova's driver counts it; None for other hands."""
    if opening is None or robot.source.bundled not in JACOS:
        return None
    share = (opening - JACO.openings[-1]) / (JACO.openings[0] - JACO.openings[-1])
    return 6400.0 * float(np.clip(share, 0.0, 1.0))  # it counts about 6400 for a closed one (kinova-ros, README)


def beside(solver: IKSolver, pose: pin.SE3, q: Array) -> Array | None:
    """The clear configuration (dof,) at a pose T_base_tool that is nearest to another one [rad].

    None where there is none, or a joint would move farther than along a straight line.
    """
    found = solver.solve(pose, seed=q, closest=False)
    return found.q if found.success and np.abs(found.q - q).max() <= 1.0 else None  # [rad]


def in_words(name: str, success: bool, message: str, opening: float | None, **parts: Trajectory | None) -> str:
    """A pick or a place as a text: how long each part takes, and how wide the fingers are."""
    took = ", ".join(
        f"{part} {'none' if motion is None else f'{motion.duration:.3g} s'}" for part, motion in parts.items()
    )
    wide = "as loaded" if opening is None else f"{opening:.3g}"
    return f"{name}({'OK' if success else 'no way'}: {took}; opening {wide}; {message})"


def one_after_the_other(first: Trajectory, then: Trajectory, words: str) -> Trajectory:
    """Two motions from rest to rest in one; words say where the second leads."""
    rows = joined(first.rows, then.rows)
    return Trajectory(
        joint_names=first.joint_names,
        t=checks.sealed(rows.t),
        q=checks.sealed(rows.q),
        v=checks.sealed(rows.v),
        lower=first.lower,
        upper=first.upper,
        velocity_limit=first.velocity_limit,
        a=checks.sealed(rows.a),
        clearance=checks.read_only(np.concatenate([first.clearance, then.clearance[1:]])),
        message=f"{first.message}; then {then.duration:.4g} s {words}",
        sliding=first.sliding,
    )


class Planner:
    """Plans motions and straight lines of one arm at one pace, within a time that begins as it is made.

    Attributes:
        begun: when it was made, by `time.monotonic` [s].
        look_until: when to end looking for configurations at an object [s].
        randomness: of the search.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        speed: float,
        time_limit: float,
        rng: np.random.Generator | None,
        dt: float,
        velocity_limit: ArrayLike | None,
        acceleration_limit: ArrayLike,
    ) -> None:
        """Take what `plan_pick` and `plan_place` both are given.

        Raises:
            InvalidInputError: malformed.
        """
        self.begun, self._robot = time.monotonic(), robot
        self._speed, self._dt = checks.positive("speed", speed, "m/s"), checks.positive("dt", dt, "s")
        limit = checks.positive("time_limit", time_limit, "s")
        # Most of it, at most, is for finding configurations at an object.
        self._end, self.look_until = self.begun + limit, self.begun + 0.6 * limit
        self.randomness = Randomness(None if rng is None else checks.generator("rng", rng))
        self._velocity = velocity_limits(robot, velocity_limit)
        self._acceleration = acceleration_limits(robot, acceleration_limit)

    @property
    def is_late(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() >= self._end

    def stand(self, q: Array, status: MotionStatus, message: str) -> Trajectory:
        """No motion from a configuration (dof,) [rad], and why."""
        return Trajectory.of(self._robot, self._velocity, resting(q), status=status, message=message)

    def move(self, solver: IKSolver, start: Array, goal: Any, *, least: float = 1e-6) -> Trajectory:
        """A motion of `plan_motion` from a configuration (dof,) [rad] in the time that is left, or the least [s]."""
        return plan_motion(
            solver,
            start,
            goal,
            time_limit=max(self._end - time.monotonic(), least),
            rng=self.randomness.generator,
            dt=self._dt,
            velocity_limit=self._velocity,
            acceleration_limit=self._acceleration,
        )

    def line(self, solver: IKSolver, poses: Sequence[pin.SE3], start: Array) -> Trajectory | str:
        """A straight line through poses T_base_tool from a configuration (dof,) [rad], or why there is none."""
        try:
            line = plan_path(
                solver,
                poses,
                dt=self._dt,
                speed=self._speed,
                timing="slow",
                start=start,
                velocity_limit=self._velocity,
                acceleration_limit=self._acceleration,
                time_limit=max(self._end - time.monotonic(), LEAST_TIME),
            )
        except InvalidInputError as error:  # a line that joints cannot follow in any reasonable time
            return str(error)
        return line if line.success else line.message
