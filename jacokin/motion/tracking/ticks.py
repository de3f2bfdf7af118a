"""`TickSolver`: the kernels of a tick with the arrays they work on, see `jacokin.kernels.tracking.tick`."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.qp_backend import Backend, Inequalities
from jacokin.kernels.library import Call
from jacokin.kernels.tracking.near import FORESIGHT, KEPT
from jacokin.kernels.tracking.tasks import KIND, rows_of
from jacokin.kernels.tracking.tick import (
    ANGLE,
    DAMPED,
    DISTANCE,
    FIRST_TASKS,
    GOES,
    INEQUALITIES,
    MOVED,
    MOVED_BEFORE,
    NEAR_ENOUGH,
    NEEDS_QP,
    NEEDS_QP_NOW,
    NEGLIGIBLE,
    REFINED,
    ROWS,
    SINGULAR,
    TASKS,
    TASKS_BEFORE,
    TIME_STEP,
    TURNED_ENOUGH,
    TickWork,
    finish_tick,
    linearise_tick,
    make_tick_work,
    report_tick,
    solve_tick,
)
from jacokin.motion.tracking.joint_limits import JointLimits
from jacokin.motion.tracking.targets import Kinematics, Tasks

NONE = np.empty(0, dtype=np.int64)
FAR = 1e6  # [rad] no bound for a joint without limits


class Near(NamedTuple):
    """Pairs of shapes that are near, see `jacokin.kernels.tracking.near`."""

    integers: NDArray[np.int64]
    """(n, 3)"""
    numbers: Array
    """(n, 8)"""
    kept: float
    """Distance kept [m]."""
    foresight: float
    """Time in which obstacles that come nearer count [s]."""


class Arm(NamedTuple):
    """Where the arm is (dof,) [rad], and its velocity (dof,) [rad/s]."""

    q: Array
    v: Array


class Asked(NamedTuple):
    """What a tick is asked for, and what the tick before was."""

    tasks: Tasks
    before: Tasks | None
    moved: Array | None
    """(rows,) by how much the targets moved the error in the tick before, weighted; None for not at all."""


class Report(NamedTuple):
    """What a tick has come to."""

    v: Array
    """(dof,) velocity over the tick [rad/s]."""
    a: Array
    """(dof,) by how much it changed [rad/s^2]."""
    position: float
    """Largest distance to a target of the first priority [m]."""
    orientation: float
    """Largest angle to one [rad]."""
    on_target: bool
    singular: bool
    """Whether most of the error is in directions in which the arm hardly moves the tool."""


class TickSolver:
    """Finds the displacement of a tick, and measures what it has come to."""

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
        self._make_room(1, 0)

    def __getstate__(self) -> dict[str, Any]:
        """Everything but work arrays."""
        return {**self.__dict__, "_work": None, "_solve": None, "_finish": None, "_linearise": None, "_report": None}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """With fresh work arrays."""
        self.__dict__.update(state)
        self._make_room(*self._size)

    def _make_room(self, tasks: int, pairs: int) -> None:
        """Make arrays for so many tasks and pairs of shapes."""
        work = make_tick_work(self._dof, tasks, pairs)
        placements, kinds = self._joints
        work.arm.placements[:], work.arm.kinds[:] = placements, kinds
        work.limits[:] = self._limits.table
        for number, value in self._constants.items():
            work.numbers[number] = value
        self._size, self._work = (tasks, pairs), work
        self._solve, self._finish = Call(solve_tick, work), Call(finish_tick, work)
        self._linearise, self._report = Call(linearise_tick, work), Call(report_tick, work)

    def _take(self, arm: Arm, near: Near | None, tasks: int = 1) -> TickWork:
        """The arrays, with where the arm is and what is near."""
        pairs = 0 if near is None else len(near.integers)
        if tasks > self._size[0] or pairs > self._size[1]:
            self._make_room(max(tasks, self._size[0]), max(2 * pairs, self._size[1]))
        work = self._work
        work.q[:], work.v[:] = arm
        work.near.counts[0] = pairs
        if near is not None and pairs:
            work.near.rule[KEPT], work.near.rule[FORESIGHT] = near.kept, near.foresight
            work.near.integers[:pairs], work.near.numbers[:pairs] = near.integers, near.numbers
        return work

    def _ask(self, work: TickWork, tasks: Tasks) -> None:
        rows, count = tasks.rows, tasks.number
        work.counts[TASKS], work.counts[FIRST_TASKS] = count, tasks.first
        work.tasks.integers[:count], work.tasks.numbers[:count] = rows.integers, rows.numbers
        work.tasks.joints[: rows.joints.size] = rows.joints

    def linearise(self, arm: Arm, near: Near | None) -> bool:
        """Fill bounds and inequalities at a configuration; whether shapes are to be moved apart first."""
        self._take(arm, near)
        return self._linearise() > 0

    def solve(self, arm: Arm, asked: Asked, near: Near | None, *, refined: bool = False) -> int:
        """Find the displacement of a tick; returns what `solve_tick` does.

        Args:
            arm: where it is.
            asked: what for.
            near: what is near.
            refined: whether the Hessian will be needed without later priorities, too.
        """
        tasks, before, moved = asked
        work = self._take(arm, near, tasks.number)
        self._ask(work, tasks)
        work.counts[REFINED] = refined
        work.counts[TASKS_BEFORE] = work.counts[MOVED_BEFORE] = 0
        if before is not None and before.first == tasks.first:
            work.counts[TASKS_BEFORE] = first = before.first
            work.before.integers[:first], work.before.numbers[:first] = (
                before.rows.integers[:first],
                before.rows.numbers[:first],
            )
            work.before.joints[: first * self._dof] = before.rows.joints[: first * self._dof]
            if moved is not None:
                work.counts[MOVED_BEFORE] = 1
                work.moved_before[: moved.size] = moved
        return self._solve()

    def use_qp(self, outcome: int, qp: Backend) -> int:
        """Go on with a QP solver, as the least value is beyond a limit or a distance; returns what `finish_tick` does.

        Raises:
            QPFailed: no QP solver solved it.
        """
        work = self._work
        low, high = self.bounds if outcome == NEEDS_QP_NOW else self.room
        hessian, gradient = self.hessian, work.problem.gradient.copy()
        found = qp.minimize(hessian, gradient, self.inequalities, np.maximum(low, -FAR), np.minimum(high, FAR))
        if outcome == NEEDS_QP:
            work.total[:] = found
            return self._finish()
        work.step[:] = found
        return outcome

    def report(self, q: Array, arm: Arm | None, tasks: Tasks, *, goes: bool) -> Report:
        """Measure where the arm is after a tick.

        Args:
            q: (dof,) where it is [rad].
            arm: where it was; None where the tick was solved: then it is found out whether the pose was singular.
            tasks: what it was asked for.
            goes: False where it has made no tick, and keeps its velocity.
        """
        work, judged = self._work, arm is None
        if arm is not None:
            work = self._take(arm, None, tasks.number)
            self._ask(work, tasks)
        dof = self._dof
        work.after[:dof] = q
        work.counts[SINGULAR], work.counts[GOES] = judged, goes
        on_target = self._report() == 1
        distance, angle = work.numbers[DISTANCE : ANGLE + 1].tolist()
        v, a = work.after[dof : 2 * dof].copy(), work.after[2 * dof :].copy()
        v.setflags(write=False)
        a.setflags(write=False)
        return Report(
            v,
            a,
            distance,
            angle,
            on_target,
            judged and not on_target and work.counts[SINGULAR] == 1,
        )

    @property
    def step(self) -> Array:
        """(dof,) the displacement [rad]; a copy."""
        return self._work.step.copy()

    @property
    def bounds(self) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] of the tick; they change with the next."""
        return self._work.bounds[: self._dof], self._work.bounds[self._dof :]

    @property
    def room(self) -> tuple[Array, Array]:
        """Least and largest displacement (dof,) [rad] to the limits; they change with the next tick."""
        return self._work.room[: self._dof], self._work.room[self._dof :]

    @property
    def inequalities(self) -> Inequalities:
        """G and h of G x <= h, copies, or (None, None)."""
        count = int(self._work.counts[INEQUALITIES])
        if not count:
            return None, None
        near = self._work.near
        return near.rows[: count * self._dof].reshape(count, self._dof).copy(), near.ends[:count].copy()

    @property
    def hessian(self) -> Array:
        """(dof, dof) damped, where it was needed; a copy."""
        return self._work.problem.matrix.reshape(self._dof, self._dof).copy()

    @property
    def damping(self) -> float:
        """How much of the Hessian is damping."""
        return float(self._work.numbers[DAMPED])

    @property
    def moved(self) -> Array | None:
        """(rows,) by how much the targets moved the error, a copy; None for not at all."""
        return self._work.moved[: self._work.counts[ROWS]].copy() if self._work.counts[MOVED] else None

    @property
    def apart(self) -> NDArray[np.int64]:
        """Which of the near pairs are moved apart; a copy."""
        if not self._work.near.counts[2]:
            return NONE
        return self._work.near.apart[: self._work.near.counts[2]].copy()

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
