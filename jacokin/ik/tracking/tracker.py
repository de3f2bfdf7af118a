"""`Tracker`: one QP a tick, from where the arm is towards a target, inside every limit. Read this file first.

A tick asks for the joint displacement that brings the tool to its target, as least squares inside a box (velocity and
position limits) and a few half-spaces (clearance). What the QP says of linearised kinematics is
checked at the new configuration: a step that makes the error grow is taken again with more damping, one that brings
shapes too near is shortened. So the error never oscillates and the limits hold exactly.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import mink
import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError
from jacokin.ik import pose_error
from jacokin.ik.qp.backend import QPFailed
from jacokin.ik.tracking import setup as tracker_setup
from jacokin.ik.tracking.clearance import Distances
from jacokin.ik.tracking.objectives import Objective
from jacokin.ik.tracking.obstacles import Clearance
from jacokin.ik.tracking.problem import Problem, linearise, null_motion
from jacokin.ik.tracking.result import TrackerStatus, TrackerStep
from jacokin.ik.tracking.step_qp import StepQP
from jacokin.ik.tracking.targets import Target
from jacokin.ik.tracking.tasks import Aim
from jacokin.model.robot import Robot

Array = NDArray[np.float64]

Drift = tuple[Array, Array]

POSITION_TOLERANCE = 1e-4  # [m] a tenth of what the arm repeats
ORIENTATION_TOLERANCE = 1e-3  # [rad] the same at the length of a hand
NEGLIGIBLE = 0.1  # of the tolerances: an error below this may grow again
DAMPING = (1e-2, 1e4)  # relative to the squared error: least, and where no step helps any more
MORE_DAMPING, LESS_DAMPING = 10.0, 3.0  # factors after a step that makes the error grow, and after a good one
RETRIES = 6  # QPs in one tick at most
SHORTENINGS = 6  # halvings of a step that comes too near, before the arm stays
STILL = 1e-5  # [rad/s] a slower arm stands
GROWTH_TIME = 0.25  # [s] of growing error until the target counts as lost
GROWTH = 1e-7  # [m] an error must grow by this in a tick to count as growing


class Place(NamedTuple):
    """A configuration (dof,) [rad] and the distances of the shapes there."""

    q: Array
    distances: Distances | None


class Tracker:
    """Follows targets with one robot and frame at a fixed rate.

    Attributes:
        robot: the arm.
        frame: the frame that follows targets which name none.
        dt: control step [s].
        velocity_limit: (dof,) [rad/s]; read-only.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str | None = None,
        *,
        dt: float = 0.01,
        q: ArrayLike | None = None,
        tool: pin.SE3 | ArrayLike | None = None,
        velocity_limit: ArrayLike | None = None,
        acceleration_limit: ArrayLike | None = None,
        collision: Clearance | None = None,
        posture: ArrayLike | None = None,
        objectives: Sequence[Objective] = (),
        qp_solver: str = "daqp",
        position_tolerance: float = POSITION_TOLERANCE,
        orientation_tolerance: float = ORIENTATION_TOLERANCE,
    ) -> None:
        """Build the QP's parts once.

        Args:
            robot: the arm.
            frame: name of the frame to move; None for the robot's default frame.
            dt: control step [s].
            q: (dof,) where the arm is [rad]; None for the robot's home.
            tool: T_frame_tool, a constant pose after the frame.
            velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
            acceleration_limit: (dof,) or one for all [rad/s^2]; None for none. A step that is shortened to keep
                shapes apart may brake harder.
            collision: shapes to keep apart; None for none.
            posture: (dof,) configuration [rad] to stay near with the freedom targets leave.
            objectives: what else to do with that freedom, see `tracking_objectives`.
            qp_solver: a QP solver installed for qpsolvers: "daqp", "quadprog", "osqp", "proxqp".
            position_tolerance: the target is reached this near [m].
            orientation_tolerance: the target is reached this near [rad].

        Raises:
            InvalidInputError: a number that is malformed or not positive, a frame that does not move, velocity limits
                missing in the robot's file and here, or `q` outside the limits.
            UnknownNameError: unknown frame, QP solver or shape.
            ModelError: `collision` and the description has no shapes.
        """
        parts = tracker_setup.prepare(
            robot, frame, dt, tool, velocity_limit, acceleration_limit, collision, posture, objectives
        )
        self.robot = robot
        self.frame = parts.frame
        self.dt = parts.dt
        self.velocity_limit = parts.velocity
        self._box = parts.box
        self._follower = parts.follower
        self._guard = parts.guard
        self._aims = parts.aims
        self._objectives = parts.objectives
        self._configuration = mink.Configuration(parts.model)
        self._qp = StepQP(qp_solver)
        self._tolerances = tracker_setup.tolerances(position_tolerance, orientation_tolerance)
        self._negligible = (NEGLIGIBLE * self._tolerances[0]) ** 2
        self.reset(q)

    @property
    def q(self) -> Array:
        """(dof,) where the arm is [rad]; read-only."""
        return self._q

    @property
    def v(self) -> Array:
        """(dof,) its velocity over the last tick [rad/s]; read-only."""
        return self._v

    def reset(self, q: ArrayLike | None = None) -> None:
        """Put the arm somewhere, standing still.

        Args:
            q: (dof,) configuration [rad]; None for the robot's home. A joint past its limit by at most 0.01 rad, as
                an encoder may report it, is put on the limit.

        Raises:
            InvalidInputError: malformed or outside the limits; the tracker stays as it was.
        """
        self._q = tracker_setup.start(self.robot, q)
        self._v = np.zeros(self.robot.dof)
        self._v.setflags(write=False)
        self._damping = DAMPING[0]
        self._error = np.inf
        self._growing = 0
        self._reference: pin.SE3 | None = None
        self._configuration.update(self._q)
        self._near = None if self._guard is None else self._guard.start(self._configuration.data)
        self._at = Place(self._q, self._near)

    def step(
        self,
        target: pin.SE3 | ArrayLike | Target | Sequence[Target] | None = None,
        *,
        twist: ArrayLike | None = None,
        reference: str = "local_world_aligned",
    ) -> TrackerStep:
        """One tick towards a target, or along a twist.

        Args:
            target: T_base_tool as `pin.SE3` or (4, 4), a position (3,) [m], or targets from `tracking_targets`.
            twist: (6,) velocity of the tool, linear [m/s] then angular [rad/s]; instead of a target.
            reference: where the twist is expressed: "local_world_aligned", "local" or "world".

        Returns:
            Where the arm is after the tick.

        Raises:
            InvalidInputError: both or none given, or malformed; the tracker stays as it was.
            UnknownNameError: unknown frame or reference.
        """
        if (target is None) == (twist is None):
            raise InvalidInputError("give either a target or twist=, not both and not none")
        if twist is None:
            self._reference = None
            return self._advance(self._aims.for_target(target))
        here = self._aims.here(self._configuration.data) if self._reference is None else self._reference
        goal = tracker_setup.moved(here, twist, reference, self.dt)
        step = self._advance(self._aims.for_target(goal))
        # Rounding does not add up while the arm keeps up; when it cannot, no backlog builds.
        self._reference = goal if step.status is TrackerStatus.OK else None
        return step

    def measure(self, target: pin.SE3 | ArrayLike | Target | Sequence[Target]) -> TrackerStep:
        """How far the tool is from a target, without moving; errors as `step`."""
        aims = self._aims.for_target(target)
        self._configuration.update(self._q)
        return self._report(aims, self._q, self._v, "", pushing=False)

    def _advance(self, aims: list[Aim]) -> TrackerStep:
        """Solve, check, and move."""
        before = self._at
        if self._follower is not None:
            self._configuration.update(before.q)
        problem = linearise(self._configuration, aims, self._guard, before.distances)
        drift = None
        if self._objectives:
            drift = null_motion(
                self.robot, self.frame, before.q, problem.rows, self._objectives, self._box.step, self.dt
            )
        place, held = self._descend(aims, problem, drift)
        self._at = place
        q_before, v_before = self._q, self._v
        if self._follower is None:
            self._move(place.q)
        else:
            self._follow(place.q, (place.q - before.q) / self.dt)
        return self._report(aims, q_before, v_before, held, pushing=problem.pushing)

    def _descend(self, aims: list[Aim], problem: Problem, drift: Drift | None) -> tuple[Place, str]:
        """The first place that is no farther from the target, with as little damping as that takes; or why none."""
        low, high = self._box.bounds(self._at.q)
        for _ in range(RETRIES):
            try:
                wanted = self._qp.solve(*problem.damped(self._damping, drift), problem.walls, low, high)
            except QPFailed:
                return self._stay(), "no QP solver solved this tick"
            place = self._try(self._at, wanted)
            if problem.pushing or self._nearer(aims, problem.cost):
                self._damping = max(self._damping / LESS_DAMPING, DAMPING[0])
                return place, ""
            drift = None
            if self._damping >= DAMPING[1]:
                break
            self._damping *= MORE_DAMPING
        return self._stay(), "every step makes the error grow"

    def _stay(self) -> Place:
        self._configuration.update(self._at.q)
        return self._at

    def _try(self, start: Place, displacement: Array) -> Place:
        """Put the configuration where a displacement leads, shortened until nothing comes too near."""
        for _ in range(SHORTENINGS):
            q = self._box.moved(start.q, displacement)
            self._configuration.update(q)
            if self._guard is None or start.distances is None:
                return Place(q, None)
            distances = self._guard.moved(self._configuration.data, start.distances, displacement)
            if self._guard.acceptable(start.distances, distances):
                return Place(q, distances)
            displacement = 0.5 * displacement
        self._configuration.update(start.q)
        return start

    def _nearer(self, aims: list[Aim], cost: float) -> bool:
        """Whether the error shrank, or is too small to matter."""
        now = 0.0
        for aim in aims:
            error = aim.wanted(self._configuration)
            now += float(error @ error)
        return now <= cost or now <= self._negligible

    def _follow(self, reference: Array, reference_velocity: Array) -> None:
        """Move the arm after its reference; an arm that an obstacle stops takes the reference with it."""
        assert self._follower is not None
        here = Place(self._q, self._near)
        wanted = self._follower.displacement(self._q, self._v, reference, reference_velocity)
        place = self._try(here, wanted)
        if not np.array_equal(place.q, self._box.moved(self._q, wanted)):
            self._at = place
        self._near = place.distances
        self._move(place.q)

    def _move(self, q: Array) -> None:
        """Commit where the arm goes."""
        self._v = (q - self._q) / self.dt
        self._q = q
        self._q.setflags(write=False)
        self._v.setflags(write=False)

    def _report(self, aims: list[Aim], q_before: Array, v_before: Array, held: str, *, pushing: bool) -> TrackerStep:
        """Measure where the arm is."""
        near = self._at.distances if self._follower is None else self._near
        measured = [aim.measure(self._configuration.data) for aim in aims]
        position, orientation = max(m[0] for m in measured), max(m[1] for m in measured)
        error = pose_error.combined(position, orientation)
        on_target = position <= self._tolerances[0] and orientation <= self._tolerances[1]
        # Shapes moving apart, or joints still gathering speed, may take the tool away from its target for a while.
        excused = on_target or pushing or (self._follower is not None and self._q is not self._at.q)
        grows = not excused and error > self._error + GROWTH
        self._growing = self._growing + 1 if grows else 0
        self._error = error
        status, limiting, message = TrackerStatus.OK, list[str](), ""
        if not on_target:
            limiting = self._box.limiting(self._q - q_before, q_before)
            if self._follower is not None:
                limiting.extend(self._follower.limiting(self._v, v_before))
            if self._guard is not None and near is not None:
                limiting.extend(self._guard.limiting(near))
            status, message = self._why(limiting, held)
        return TrackerStep(
            q=self._q,
            v=self._v,
            status=status,
            position_error=position,
            orientation_error=orientation,
            limiting=tuple(limiting),
            clearance=None if near is None else near.least,
            qp_solver=self._qp.used,
            message=message,
        )

    def _why(self, limiting: list[str], held: str) -> tuple[TrackerStatus, str]:
        """Status and sentence of a tick that is off target."""
        if self._growing * self.dt >= GROWTH_TIME:
            return TrackerStatus.LOST, f"the error has grown for {self._growing * self.dt:.2f} s"
        if float(np.abs(self._v).max()) < STILL:
            return TrackerStatus.HELD, held or "the arm has come as near as it can"
        return TrackerStatus.LIMITED, f"slowed by {', '.join(limiting) or 'damping near a singular pose'}"
