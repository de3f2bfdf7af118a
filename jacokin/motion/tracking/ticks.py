"""`TickSolver`: the kernel of a tick with the arrays it works on, see `jacokin.kernels.tracking.run`."""

from __future__ import annotations

import math
import time
from typing import Any, NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.qp_backend import Backend, Inequalities
from jacokin.ik.targets import RADIAN_IN_METRES, checked_target
from jacokin.kernels.contact.shapes import CLOUD
from jacokin.kernels.contact.shapes import KIND as SHAPE_KIND
from jacokin.kernels.library import Call
from jacokin.kernels.tracking.reach import FORESIGHT, SECOND, ReachWork, make_reach_work
from jacokin.kernels.tracking.run import (
    FROM_TWIST,
    LINEARISE,
    LOOK_AHEAD,
    NOT_RIGID,
    ON_TARGET,
    REPORT,
    UNFINISHED,
    RunWork,
    run_tick,
)
from jacokin.kernels.tracking.tasks import KIND, POSE, TASK_NUMBERS, TaskRows, rows_of
from jacokin.kernels.tracking.tick import (
    AIMED,
    ANGLE,
    APART,
    AS_IT_IS,
    CAN_STOP,
    DAMPED,
    DISTANCE,
    FASTEST,
    FIRST_TASKS,
    GOES,
    GREW,
    GUARDED,
    IF_RIGID,
    IN_PARTS,
    MOVED,
    MOVED_BEFORE,
    NEAR_ENOUGH,
    NEEDS_QP,
    NEGLIGIBLE,
    PAST,
    POSED,
    REFINED,
    ROWS,
    SINGULAR,
    SLOWED,
    STAGE,
    STOPS_AT_ONCE,
    TASKS,
    TASKS_BEFORE,
    TIME_STEP,
    TURNED_ENOUGH,
    make_tick_work,
)
from jacokin.kernels.tracking.twist import make_twist_work
from jacokin.motion.tracking.joint_limits import JointLimits
from jacokin.motion.tracking.targets import Kinematics, Tasks

ROWS_OF_POSE = rows_of(POSE, 0)
FAR = 1e6  # [rad] no bound for a joint without limits


class OutOfTime(Exception):  # noqa: N818 - internal signal, never seen by users
    """The deadline of a tick has passed."""


class JointState(NamedTuple):
    """Where the arm is (dof,) [rad], and its velocity (dof,) [rad/s]."""

    q: Array
    v: Array


class Asked(NamedTuple):
    """What a tick was asked for, for the next one to look back at."""

    tasks: Tasks
    said: Array
    """What the kernel said of it, see `said_parts`; read-only."""
    has_moved: bool
    """Whether its targets moved the error."""
    is_aimed: bool
    """Whether it is known where it was to lead."""


class Report(NamedTuple):
    """What a tick has come to."""

    arm: JointState
    """Where it is, and its velocity over the tick; read-only."""
    a: Array
    """(dof,) by how much that changed [rad/s^2]; read-only."""
    position: float
    """Largest distance to a target of the first priority [m]."""
    orientation: float
    """Largest angle to one [rad]."""
    error: float
    """Both in one, as ticks make it smaller [m]."""
    fastest: float
    """The fastest joint's velocity [rad/s]."""
    past: float
    """How far joints are past their limits, at most [rad]; negative within them."""
    on_target: bool
    singular: bool
    """Whether most of the error is in directions in which the arm hardly moves the tool."""
    can_stop: bool
    """Whether braking from now on is certain to come too near to nothing."""
    is_slowed: bool
    """Whether the bounds of the tick took something from the displacement."""
    grew: bool
    """Whether every step made the error grow, so that there is none."""
    apart: bool
    """Whether shapes are moved apart."""
    asked: Asked | None
    """What it was asked for, for the next tick to look back at; None for nothing that it could."""


def said_parts(said: Array, dof: int) -> list[Array]:
    """The parts of what the kernel says, which lie in one array to be kept at once.

    Returns:
        (3 dof,) where the arm is [rad], its velocity [rad/s] and acceleration [rad/s^2]; (2 dof,) where the tick was to
        lead in all [rad], and how far the joints found that to come towards them, relative to how far they go; (rows,)
        by how much its targets moved the error, weighted; (tasks TASK_NUMBERS,) the numbers of its tasks.
    """
    rows = max(dof, ROWS_OF_POSE)
    tasks = (said.size - 5 * dof) // (rows + TASK_NUMBERS)
    return np.split(said, [3 * dof, 5 * dof, 5 * dof + tasks * rows])


class TickSolver:
    """Runs ticks: finds displacements, goes as much of them as is clear, and measures what that has come to.

    Attributes:
        twist: what a tick along a twist reads and writes.
    """

    def __init__(
        self, kinematics: Kinematics, limits: JointLimits, dt: float, negligible: float, tolerances: tuple[float, float]
    ) -> None:
        """Take an arm, its limits, the control step [s], a negligible error [m] and the tolerances [m], [rad]."""
        self._dof, self._limits = kinematics.robot.dof, limits
        self._joints = kinematics.joints()
        near_enough, turned_enough = tolerances
        self._constants = {
            TIME_STEP: dt,
            NEGLIGIBLE: negligible,
            NEAR_ENOUGH: near_enough,
            TURNED_ENOUGH: turned_enough,
        }
        self._make_room(1, None)

    def __getstate__(self) -> dict[str, Any]:
        """Everything but work arrays."""
        return {
            **self.__dict__,
            "_work": None,
            "_run": None,
            "_said": None,
            "_reach": None,
            "_kept": None,
            "_given": None,
            "twist": None,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        """With fresh work arrays."""
        self.__dict__.update(state)
        self._make_room(self._room, None)

    def _make_room(self, tasks: int, reach: ReachWork | None) -> None:
        """Make arrays for so many tasks, and for the pairs of shapes that are kept apart."""
        number = clouds = 0
        if reach is not None:
            kinds = reach.geometry.shapes.integers[reach.pairs.integers[:, SECOND], SHAPE_KIND]
            number, clouds = len(kinds), int((kinds == CLOUD).sum())
        said = np.zeros(5 * self._dof + tasks * (max(self._dof, ROWS_OF_POSE) + TASK_NUMBERS))
        after, aim, moved, numbers = said_parts(said, self._dof)
        work = make_tick_work(self._dof, tasks, number, clouds)
        rows = work.tasks._replace(numbers=numbers.reshape(tasks, TASK_NUMBERS))
        work = work._replace(after=after, aim=aim, moved=moved, tasks=rows)
        placements, kinds = self._joints
        work.arm.placements[:], work.arm.kinds[:] = placements, kinds
        work.limits[:] = self._limits.table
        for column, value in self._constants.items():
            work.numbers[column] = value
        work.counts[GUARDED], work.counts[STOPS_AT_ONCE] = reach is not None, self._limits.stops_at_once
        if reach is not None:
            for pairs in (work.near, work.there):
                pairs.foresight[0] = reach.numbers[FORESIGHT]
        twist = make_twist_work(self._dof)
        run = Call(run_tick, RunWork(work, make_reach_work() if reach is None else reach, twist))
        kept: Tasks | None = None  # those that the kernel knows as the ones of the tick before
        given: TaskRows | None = None  # of the tasks that are there
        # All at once: an interrupt leaves the old arrays or the new ones.
        self._room, self._reach, self._work, self._said, self._run = tasks, reach, work, said, run
        self.twist, self._kept, self._given = twist, kept, given

    def among(self, reach: ReachWork | None) -> None:
        """Say what keeps shapes apart, and has measured how near they are; None for nothing."""
        if reach is not self._reach:
            self._make_room(self._room, reach)

    def _take(self, arm: JointState, tasks: Tasks) -> None:
        """Take where the arm is, and what it is asked for."""
        rows, count = tasks.rows, tasks.number
        if count > self._room:
            self._make_room(count, self._reach)
        work = self._work
        work.q[...], work.v[...] = arm
        if rows is not self._given:
            self._given = None  # until it is done
            work.counts[TASKS], work.counts[FIRST_TASKS] = count, tasks.first
            work.tasks.integers[:count], work.tasks.numbers[:count] = rows.integers, rows.numbers
            work.tasks.joints[: rows.joints.size] = rows.joints
            self._given = rows
        work.counts[POSED] = 0
        if tasks.pose is not None:
            work.pose[...], work.counts[POSED] = tasks.pose, IF_RIGID

    def _start(self) -> int:
        """Run the kernel on what was taken; returns what `run_tick` does.

        Raises:
            InvalidInputError: the pose is malformed.
        """
        outcome = self._run()
        if outcome == NOT_RIGID:
            work = self._work
            work.pose[...], work.counts[POSED] = checked_target(work.pose.copy()).matrix, AS_IT_IS
            outcome = self._run()
        return outcome

    def linearise(self, arm: JointState, tasks: Tasks) -> bool:
        """Fill bounds and inequalities at a configuration; whether shapes are to be moved apart first."""
        self._take(arm, tasks)
        self._kept = None
        self._work.counts[STAGE] = LINEARISE
        return self._start() > 0

    def ask(self, arm: JointState, tasks: Tasks, before: Asked | None, *, refined: bool) -> None:
        """Take what a tick starts from.

        Args:
            arm: where it is.
            tasks: what it is asked for.
            before: what the tick before was asked for; None for something else.
            refined: whether something is added to the displacement without later priorities, too.
        """
        self._take(arm, tasks)
        work = self._work
        counts = work.counts
        counts[REFINED], counts[GOES], counts[SINGULAR] = refined, 1, 1
        if before is None or before.tasks.first != tasks.first:
            counts[TASKS_BEFORE] = counts[MOVED_BEFORE] = counts[AIMED] = 0
            return
        known, said, counts[MOVED_BEFORE], counts[AIMED] = before
        first = counts[TASKS_BEFORE] = known.first
        if known is not self._kept:
            _, work.aim[:], moved, numbers = said_parts(said, self._dof)
            work.moved_before[: moved.size] = moved
            work.before.integers[:first] = known.rows.integers[:first]
            work.before.numbers[:first] = numbers.reshape(-1, TASK_NUMBERS)[:first]
            work.before.joints[: first * self._dof] = known.rows.joints[: first * self._dof]

    def go(self, stage: int, deadline: float, *, can_stop: bool) -> int:
        """Go on with a tick from a stage; returns what `run_tick` does.

        Args:
            stage: of the tick.
            deadline: by `time.perf_counter` [s]; inf for none.
            can_stop: whether the arm can brake from where it is without coming too near to anything.

        Raises:
            OutOfTime: the deadline has passed.
        """
        counts = self._work.counts
        counts[STAGE], counts[CAN_STOP], counts[IN_PARTS] = stage, can_stop, deadline < math.inf
        if stage == FROM_TWIST:
            counts[GOES], counts[SINGULAR] = 1, 0
        self._kept = None
        outcome = self._start()
        while outcome >= NEEDS_QP and time.perf_counter() <= deadline:
            if outcome != UNFINISHED:
                return outcome
            outcome = self._run()
        if outcome >= NEEDS_QP:
            raise OutOfTime
        return outcome

    def use_qp(self, qp: Backend) -> None:
        """Find what is missing in all within limits and distances, to go on `FROM_TOTAL`.

        Raises:
            QPFailed: no QP solver solved it.
        """
        work = self._work
        low, high = self.room
        hessian, gradient = self.hessian, work.problem.gradient.copy()
        work.total[:] = qp.minimize(hessian, gradient, self.inequalities, np.maximum(low, -FAR), np.minimum(high, FAR))

    def measure(self, q: Array, arm: JointState, tasks: Tasks, *, goes: bool) -> Report:
        """Measure where the arm is.

        Args:
            q: (dof,) where it is [rad].
            arm: where it was.
            tasks: what it was asked for.
            goes: False where it has made no tick, and keeps its velocity.
        """
        self._take(arm, tasks)
        self._kept = None
        work = self._work
        work.after[: self._dof] = q
        counts = work.counts
        counts[STAGE], counts[SINGULAR], counts[GOES], counts[SLOWED] = REPORT, 0, goes, 0
        return self.report(self._start(), None)

    def report(self, outcome: int, tasks: Tasks | None) -> Report:
        """What a tick has come to that ended with an outcome; the next one may look back at `tasks`."""
        work, dof = self._work, self._dof
        self._kept = tasks
        # Arrays on bytes are read-only.
        said, counts, numbers = np.frombuffer(self._said.tobytes()), work.counts.tolist(), work.numbers.tolist()
        on_target = outcome == ON_TARGET
        return Report(
            JointState(said[:dof], said[dof : 2 * dof]),
            said[2 * dof : 3 * dof],
            numbers[DISTANCE],
            numbers[ANGLE],
            math.hypot(numbers[DISTANCE], RADIAN_IN_METRES * numbers[ANGLE]),
            numbers[FASTEST],
            numbers[PAST],
            on_target,
            counts[SINGULAR] == 1 and not on_target,
            counts[CAN_STOP] == 1,
            counts[SLOWED] == 1,
            counts[GREW] == 1,
            counts[APART] == 1,
            None if tasks is None else Asked(tasks, said, counts[MOVED] == 1, counts[AIMED] == 1),
        )

    @property
    def step(self) -> Array:
        """(dof,) the displacement [rad], to be changed before `FROM_STEP`."""
        return self._work.step

    @property
    def velocity(self) -> Array:
        """(dof,) of the arm over the tick [rad/s]; it changes with the next."""
        return self._work.after[self._dof : 2 * self._dof]

    @property
    def room(self) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] to the limits; they change with the next tick."""
        return self._work.room[: self._dof], self._work.room[self._dof :]

    @property
    def inequalities(self) -> Inequalities:
        """G and h of G x <= h for the pairs that are near so far, copies, or (None, None)."""
        pairs = self._work.near
        count = int(pairs.counts[1])
        if not count:
            return None, None
        return pairs.rows[: count * self._dof].reshape(count, self._dof).copy(), pairs.ends[:count].copy()

    def inequalities_towards(self, displacement: Array) -> Inequalities:
        """G and h of G x <= h for all pairs that a displacement (dof,) [rad] could bring too near, or (None, None)."""
        self._work.total[:], self._work.counts[STAGE] = displacement, LOOK_AHEAD
        self._run()
        return self.inequalities

    @property
    def hessian(self) -> Array:
        """(dof, dof) damped, where it was needed; a copy."""
        return self._work.problem.matrix.reshape(self._dof, self._dof).copy()

    @property
    def damping(self) -> float:
        """How much of the Hessian is damping."""
        return float(self._work.numbers[DAMPED])

    @property
    def apart(self) -> list[int]:
        """Which of the near pairs are moved apart."""
        pairs = self._work.near
        found: list[int] = pairs.apart[: pairs.counts[2]].tolist()
        return found

    @property
    def reached(self) -> list[int]:
        """What each joint runs into, see `jacokin.kernels.tracking.limits`."""
        found: list[int] = self._work.reached.tolist()
        return found

    def later(self, tasks: Tasks) -> list[tuple[Array, Array]]:
        """Jacobian (k, dof) and error (k,) of each later priority, weighted; copies."""
        problem, dof, found = self._work.problem, self._dof, []
        sizes = [rows_of(kind, dof) for kind in tasks.rows.integers[:, KIND].tolist()]
        at = int(self._work.counts[ROWS])
        for priority in sorted(set(tasks.priorities[tasks.first :])):
            rows = sum(size for size, each in zip(sizes, tasks.priorities, strict=True) if each == priority)
            end = at + rows
            found.append(
                (problem.jacobian[at * dof : end * dof].reshape(rows, dof).copy(), problem.error[at:end].copy())
            )
            at = end
        return found
