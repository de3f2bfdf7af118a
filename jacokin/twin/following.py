"""`TrajectoryController`: what ros2_control does with goals and velocities, without ROS.

Goals are answered as joint_trajectory_controller of ros2_controllers does (its documentation, trajectory
representation and parameters), velocities as a forward_command_controller, which here has a watchdog.
"""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import BPoly

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.twin.arm import ArmController, GoalStatus, SimulatedArm, TwinGoal
from jacokin.twin.faults import TICK, Faults

PATH_TOLERANCE, GOAL_TOLERANCE = -4, -5  # error codes of FollowJointTrajectory
WATCHDOG = 0.05  # [s] after which a velocity that is not said again ends; ros2_control itself would go on
STANDING = 1e-5  # [rad/s] of the last point; the controller allows numbers as small as those of single precision

logger = logging.getLogger(__name__)


@dataclass(slots=True, eq=False)
class Following:
    """A trajectory that is followed."""

    goal: TwinGoal
    path: BPoly
    begun: float
    """[s] in simulated time."""
    duration: float
    tolerances: Tolerances


@dataclass(frozen=True, slots=True)
class Tolerances:
    """How far joints may be off, by their names [rad]; 0 or no entry for any distance."""

    path: Mapping[str, float] = field(default_factory=dict, hash=False)
    goal: Mapping[str, float] = field(default_factory=dict, hash=False)
    time: float = 0.0
    """Patience after the end of the trajectory, if a goal tolerance is given [s]; 0 for any."""


class TrajectoryController(ArmController[tuple[bool, Array]]):
    """ros2_control and an arm, a tick after the other. Several threads may call it.

    Attributes:
        arm: that it moves.
        names: of its joints, in their order.
    """

    def __init__(self, arm: SimulatedArm, names: Sequence[str], *, faults: Faults | None = None, seed: int = 0) -> None:
        """Control an arm.

        Args:
            arm: to control.
            names: of the joints, from the base to the tool.
            faults: what goes wrong; None for nothing.
            seed: from which faults are drawn.

        Raises:
            InvalidInputError: one is something else, or not one name for each joint.
        """
        super().__init__(arm, faults, seed)
        self.names = _checked_names(names)
        if len(set(self.names)) != arm.robot.dof or len(self.names) != arm.robot.dof:
            raise checks.refusal("names", f"{arm.robot.dof} different names", names)
        self._following: Following | None = None
        self._velocity, self._until = np.zeros(len(self.names)), -np.inf
        self._position: Array | None = None  # that the base is to lead the joints to
        self._held: Array | None = None  # the end of a trajectory, which is sent on and on

    def follow(
        self,
        names: Sequence[str],
        times: ArrayLike,
        positions: Sequence[Sequence[float]],
        velocities: Sequence[Sequence[float]] = (),
        accelerations: Sequence[Sequence[float]] = (),
        tolerances: Tolerances | None = None,
    ) -> TwinGoal:
        """Accept a goal, which ends the one before; from where the arm is, it goes over to the first point.

        Args:
            names: of the joints of each row, all of them, in any order.
            times: (n,) from now [s].
            positions: (n, dof) [rad].
            velocities: (n, dof) [rad/s]; without any, the joints move on straight lines.
            accelerations: (n, dof) [rad/s^2]; without any, along cubics.
            tolerances: None for any distance.

        Raises:
            InvalidInputError: the controller rejects the goal; says why.
        """
        at, rows = self.check(names, times, positions, velocities, accelerations)
        allowed = (
            Tolerances() if tolerances is None else checks.instance("tolerances", tolerances, Tolerances, "Tolerances")
        )
        with self._lock:
            self._end(GoalStatus.ABORTED, "another goal came")
            self._goals += 1
            logger.info("a trajectory of %d points, %.2f s", len(at), at[-1])
            state = self._line.measured
            if at[0] > 0.0:
                start = [state.command, state.v, np.zeros_like(state.v)]
                rows = [np.vstack([first, rest]) for first, rest in zip(start, rows, strict=False)]
                at = np.append(0.0, at)
            path = _path(at, rows)
            goal = TwinGoal()
            self._following = Following(goal, path, self.arm.state.time, float(at[-1]), allowed)
            self._last = self.arm.state.time
            return goal

    def check(
        self,
        names: Sequence[str],
        times: ArrayLike,
        positions: Sequence[Sequence[float]],
        velocities: Sequence[Sequence[float]] = (),
        accelerations: Sequence[Sequence[float]] = (),
    ) -> tuple[Array, list[Array]]:
        """Check a goal, as for `follow`; returns its times, and its rows in the order of the joints.

        Raises:
            InvalidInputError: as `follow`.
        """
        at, given_names = checks.array("times", times, "numbers", "s"), _checked_names(names)
        if sorted(given_names) != sorted(self.names):
            raise InvalidInputError(f"joints must be {', '.join(self.names)}, got {', '.join(given_names)}")
        at = checks.vector("times", at, at.size, "s")
        if not len(at) or at[0] < 0.0 or not (np.diff(at) > 0.0).all():
            raise InvalidInputError("there must be points, from time 0 on, at times that strictly increase")
        order = [given_names.index(name) for name in self.names]
        kinds = {"positions": positions, "velocities": velocities, "accelerations": accelerations}
        found = {kind: _rows(kind, given, len(at), order) for kind, given in kinds.items()}
        if not len(found["positions"]):
            raise InvalidInputError("positions must be given")
        rows = [each for each in found.values() if len(each)]
        if len(rows) > 1 and np.abs(rows[1][-1]).max() > STANDING:
            raise InvalidInputError("the last point must have no velocity")
        return at, rows

    def cancel(self, goal: TwinGoal) -> None:
        """Cancel a goal: the arm stops and holds its place."""
        with self._lock:
            if self._following is not None and self._following.goal is goal:
                self._last = self.arm.state.time
                self._end(GoalStatus.CANCELLED, "")

    def velocity(self, v: ArrayLike) -> None:
        """Turn the joints with velocities (dof,) [rad/s], until the watchdog ends that; ends a goal.

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        values = checks.vector("velocities", v, len(self.names), "rad/s")
        with self._lock:
            self._end(GoalStatus.ABORTED, "velocities came")
            self._send_velocity((True, values))

    def move_fingers(self, angles: ArrayLike) -> None:
        """Let the fingers go to angles (k,) [rad].

        Raises:
            InvalidInputError: not so many finite numbers.
        """
        count = len(self.arm.state.fingers)
        with self._lock:
            self.arm.move_fingers(checks.vector("fingers", angles, count, "rad"))

    def _end(self, status: GoalStatus, text: str, code: int = 0) -> None:
        following, self._following, self._held = self._following, None, None
        if following is None:
            return
        following.goal.end(status, text, code)
        if status is GoalStatus.SUCCEEDED:
            self._held = following.path(following.duration)
        else:
            self._line.clear()
            self._position = None

    def tick(self) -> None:
        """Let 10 ms pass."""
        with self._lock:
            now = self.arm.state.time
            if self._following is not None:
                self._last = now
                self._follow(self._following, now + TICK)
            elif self._held is not None:
                self._line.send((False, self._held))
            for is_velocity, values in self._line.arrived():
                if is_velocity:
                    self._velocity, self._until, self._position = values, now + WATCHDOG, None
                else:
                    self._position = values
            v = np.zeros(len(self.names))
            if self._position is not None:
                v = (self._position - self.arm.state.command) / TICK
            elif now < self._until:
                v = self._velocity
            self._line.tick(self.arm.tick(v))

    def _follow(self, following: Following, now: float) -> None:
        """Send where a trajectory is at a time, and look how its goal stands."""
        time, allowed = now - following.begun, following.tolerances
        wanted = following.path(min(time, following.duration))
        error = np.abs(wanted - self._line.measured.q)
        self._line.send((False, wanted))
        if time <= following.duration:
            off = self._off(error, allowed.path)
            if off:
                self._end(GoalStatus.ABORTED, f"{off} is off the path by more than its tolerance", PATH_TOLERANCE)
            return
        off = self._off(error, allowed.goal)
        if not off:
            self._end(GoalStatus.SUCCEEDED, "")
        elif 0.0 < allowed.time < time - following.duration:
            self._end(GoalStatus.ABORTED, f"{off} is off the goal by more than its tolerance", GOAL_TOLERANCE)

    def _off(self, error: Array, tolerances: Mapping[str, float]) -> str:
        """The first joint that is off by more than its tolerance; empty without one."""
        off = (name for name, far in zip(self.names, error, strict=True) if 0.0 < tolerances.get(name, 0.0) < far)
        return next(off, "")


def _checked_names(names: Sequence[str]) -> tuple[str, ...]:
    """Names of joints.

    Raises:
        InvalidInputError: something else.
    """
    return tuple(checks.text("a name of a joint", name) for name in checks.listed("names", names, "names of joints"))


def _rows(kind: str, given: Sequence[Sequence[float]], count: int, order: list[int]) -> Array:
    """Rows of a goal (count, dof), in the order of the controller's joints; none where all are empty."""
    lengths = [len(checks.listed(kind, row)) for row in checks.listed(kind, given, "rows of numbers")]
    if not any(lengths):
        return np.zeros((0, len(order)))
    if lengths != [len(order)] * count:
        raise InvalidInputError(f"{kind} must be {len(order)} numbers at each of the {count} points")
    return checks.matrix(kind, [list(row) for row in given], len(order), "")[:, order]


def _path(times: Array, rows: Sequence[Array]) -> BPoly:
    """Straight lines, cubics or quintics through points: positions, and derivatives as far as they are given."""
    if len(times) == 1:
        times, rows = np.append(times, times[0] + TICK), [np.vstack([row, row]) for row in rows]
    return BPoly.from_derivatives(times, np.stack(rows, axis=1))
