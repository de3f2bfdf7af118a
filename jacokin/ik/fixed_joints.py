"""`FixedJoints`: every branch of an arm of more than six joints, the others held at given values.

An arm whose extra joints stand still is an arm of six joints, which the closed form of six joints solves. What that
knows about the six is measured on the links between them: a joint that is held before the first or after the last of
them only moves the base or the tool, so that nothing is measured anew for its values; for a joint in between, a
link is. Which labelling of the loop suits six joints takes long to find out (``ik.structures``); it is found out once,
at values chosen here, and again for values that make axes parallel, or where doubt remains.
"""

from __future__ import annotations

import functools
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik.geometry import chain_of, measure_chain
from jacokin.ik.solutions.points import Points
from jacokin.ik.solutions.solution_set import Touching
from jacokin.ik.structures import measure_general, sine_of
from jacokin.ik.verification import Verifier
from jacokin.kernels.closed_form.batch import TargetWork, make_target_work, solve_targets
from jacokin.kernels.library import Call
from jacokin.kernels.six_joints.loop import Form
from jacokin.kernels.tolerances import DISTINCT, EXACT_MISFIT
from jacokin.model import angles, checks
from jacokin.model.kinematics import about_z
from jacokin.model.robot import Robot, limit_margins, unit_of

SIX = 6  # joints that the closed form solves for
SHARE = 0.71  # of a joint's range: a value where no axes should happen to meet or to be parallel
LABELLINGS, FORM = slice(40, 42), 42  # where the constants of six joints have them, see `closed_form.arm`


class _Joint(NamedTuple):
    """A joint between the base and the frame."""

    placement: pin.SE3  # after the joint before it
    joint: pin.JointModel
    align: pin.SE3 | None  # takes z to its axis; None for one that is held


class FixedJoints:
    """An arm of which all joints but six are held, at whichever values; may be shared between threads."""

    __slots__ = ("_arm_between", "_between", "_free", "_idle", "_last", "_limits", "_names", "_path", "_verifier")

    def __init__(self, verifier: Verifier, free: NDArray[np.bool_]) -> None:
        """Take the joints apart.

        Args:
            verifier: the arm, frame and tool.
            free: (dof,) which six joints are solved for.

        Raises:
            StructureError: those are not turning joints that all move the frame.
        """
        robot, model = verifier.robot, verifier.robot.pin_model
        lower, upper = np.maximum(robot.lower, -np.pi), np.minimum(robot.upper, np.pi)
        values = np.clip(lower + SHARE * (upper - lower), robot.lower, robot.upper)
        values[free] = np.nan
        held, frame_id = hold(model, verifier.frame_id, values)
        chain_of(held, frame_id, verifier.tool, SIX)  # says what does not fit
        self._verifier, self._free, self._names = verifier, checks.sealed(free.copy()), list(held.names)[1:]
        frame = model.frames[verifier.frame_id]
        self._last = frame.placement if verifier.tool is None else frame.placement * verifier.tool
        self._path: list[_Joint] = []
        index = frame.parentJoint
        while index > 0:
            joint, align = model.joints[index], None
            if free[joint.idx_v]:
                align = about_z(model, index)
            self._path.insert(0, _Joint(model.jointPlacements[index], joint, align))
            index = model.parents[index]
        turning = [each.align is not None for each in self._path]
        first, last = turning.index(True), len(turning) - turning[::-1].index(True)
        self._between = [each.joint.idx_v for each in self._path[first:last] if each.align is None]
        links = [sum(turning[:k]) for k in range(first, last) if not turning[k]]  # those that depend on their values
        snap = np.full(SIX, verifier.options.limit_snap)
        self._limits = checks.sealed(np.array([robot.lower[free], robot.upper[free], snap]))
        self._idle = [self._call()]  # each thread takes one, or makes one, and puts it back

        @functools.cache
        def labellings() -> list[float] | None:
            """Those that suit the arm at any values; None where each value has its own."""
            try:
                return measure_general(self._chain(values)).arm[LABELLINGS].tolist() if self._between else None
            except StructureError:
                return None

        @functools.lru_cache(maxsize=64)  # values of joints between the six whose constants are kept
        def arm_between(between: tuple[float, ...], anew: bool) -> Array | None:
            """Constants of six joints with values between them; None where they are built like a Jaco."""
            at = values.copy()
            at[self._between] = between
            chain = self._chain(at)
            try:
                measured = measure_chain(self._names, chain)
                if measured.misfit <= EXACT_MISFIT and not measured.spherical:
                    return None
            except StructureError:  # not built like a Jaco
                pass
            arm = measure_general(chain, None if anew else labellings()).arm
            if not anew and arm[FORM] == Form.GENERAL and any(sine_of(chain[link]) < DISTINCT for link in links):
                arm = measure_general(chain).arm  # other labellings may suit parallel axes
            return arm

        self._arm_between = arm_between

    def solve_all(self, values: Array, T: Array, seed: Array) -> PointsOfFixed:
        """Every branch with some values, nearest to the seed first.

        Args:
            values: (dof,) values of the joints that are held [rad or m], NaN for the six others; read-only.
            T: (4, 4) target T_base_tool.
            seed: (dof,) [rad or m].

        Raises:
            StructureError: with those values, the six joints do not move the frame in six independent ways.
        """
        chain, between = self._chain(values), tuple(values[self._between].tolist())
        arm = self._arm_between(between, anew=False)
        rows, dropped = self._branches(chain, arm, T, seed)
        if dropped and between:
            rows, dropped = self._branches(chain, self._arm_between(between, anew=True), T, seed)
        robot = self._verifier.robot
        away = angles.circular_distance(np.where(self._free, seed, values), seed, robot.unlimited)
        return PointsOfFixed(rows, dropped, seed, self._verifier, values, float(away))

    def _chain(self, values: Array) -> Array:
        """(7, 3, 4) placements between the six joints, the others at their values (dof,), NaN for the six."""
        chain, count, T = np.empty((SIX + 1, 3, 4)), 0, pin.SE3.Identity()
        for placement, joint, align in self._path:
            T = T * placement
            if align is None:
                motion = joint.createData()
                joint.calc(motion, values)
                T = T * motion.M
                continue
            chain[count] = (T * align).homogeneous[:3]
            T, count = align.inverse(), count + 1
        chain[SIX] = (T * self._last).homogeneous[:3]
        return chain

    def _call(self) -> Call[TargetWork]:
        """A call of the kernels for one target, with a chain and constants of its own."""
        T, seed = np.empty((1, 4, 4)), np.empty((1, SIX))
        return Call(solve_targets, make_target_work()._replace(limits=self._limits, T=T, seed=seed))

    def _branches(self, chain: Array, arm: Array | None, T: Array, seed: Array) -> tuple[Array, bool]:
        """Rows (k, 17) of the branches of a chain, and whether some may be missing; None for an arm like a Jaco."""
        if arm is None:
            arm = measure_chain(self._names, chain).arm
        try:
            call = self._idle.pop()
        except IndexError:
            call = self._call()
        work = call.work
        work.chain[:], work.arm[:], work.T[0], work.seed[0] = chain, arm, T, seed[self._free]
        count = call()
        rows = work.pose.branches.rows[: count if count >= 0 else ~count].copy()
        self._idle.append(call)
        return rows, count < 0


class PointsOfFixed(Points):
    """Points of an arm of more than six joints, those joints that are held in their places."""

    __slots__ = ("_held", "_values")

    def __init__(
        self,
        rows: Array,
        dropped: bool,
        seed: Array,
        verifier: Verifier,
        values: Array,
        held: float,
        touching: Touching | None = None,
    ) -> None:
        """Take the rows (k, 17) of the other joints.

        Args:
            rows: those.
            dropped: as `Points` takes it.
            seed: (dof,) [rad or m].
            verifier: of the whole arm.
            values: (dof,) values of the joints that are held [rad or m], NaN for the others.
            held: how far those are from the seed [rad or m].
            touching: as `Points` takes it.
        """
        super().__init__(rows, dropped, seed, verifier, touching)
        self._values, self._held = values, held

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Rebuild from the arrays, which stay read-only."""
        shared = self.rows, self.dropped, self._seed, self._verifier
        return type(self), (*shared, self._values, self._held, self.touching)

    @property
    def q(self) -> Array:
        """(k, dof) joint values [rad or m]: unlimited joints nearest to the seed, the held ones as they were given."""
        return self._placed(self._values, super().q)

    @property
    def margin(self) -> Array:
        """(k, dof) distance to the nearer limit [rad or m]: negative outside, inf for an unlimited joint."""
        return self._placed(limit_margins(self._known().robot, self._values), super().margin)

    @property
    def distance(self) -> Array:
        """(k,) distance to the seed [rad], Euclidean over all joints, circular on unlimited ones."""
        return checks.sealed(np.hypot(super().distance, self._held))

    def _placed(self, held: Array, others: Array) -> Array:
        """(k, dof): values of the joints that are held, and those of the others (k, 6)."""
        rows = np.tile(held, (len(others), 1))
        rows[:, np.isnan(self._values)] = others
        return checks.sealed(rows)


def checked_values(robot: Robot, fixed: Mapping[str, float]) -> Array:
    """Check which joints are held where; (dof,) values [rad or m], NaN for the six others.

    Raises:
        UnknownNameError: no such joint.
        InvalidInputError: a value that is not a number within the joint's limits, or not all joints but six.
    """
    values = np.full(robot.dof, np.nan)
    for name, value in checks.mapping("fixed", fixed, "a dict of joint names and values").items():
        index = robot.joint_index(name)
        values[index] = held = checks.number(f"fixed[{name!r}]", value, unit_of(robot, index))
        if not robot.lower[index] <= held <= robot.upper[index]:
            raise InvalidInputError(
                f"fixed[{name!r}] = {held:g} is outside the limits {robot.lower[index]:g} to "
                f"{robot.upper[index]:g} of that joint"
            )
    if robot.dof <= SIX:
        raise InvalidInputError(f"fixed is for arms of more than six joints; {robot.name} has {robot.dof}")
    if np.isnan(values).sum() != SIX:
        raise InvalidInputError(
            f"fixed must hold all joints but six: {robot.dof - SIX} of {robot.name}'s {robot.dof}, not {len(fixed)}"
        )
    return checks.sealed(values)


def hold(model: pin.Model, frame_id: int, values: Array) -> tuple[pin.Model, int]:
    """A model whose joints with values [rad or m] stand still, NaN for those that move; and the frame's id in it."""
    held = pin.Model()
    held.name = model.name
    # Of each joint: what carries it in the new model, and its own placement there.
    carried: list[tuple[int, pin.SE3]] = [(0, pin.SE3.Identity())]
    for index in range(1, model.njoints):
        parent, T_parent = carried[model.parents[index]]
        placement, joint = T_parent * model.jointPlacements[index], model.joints[index]
        if np.isnan(values[joint.idx_v]):
            carried.append((held.addJoint(parent, joint, placement, model.names[index]), pin.SE3.Identity()))
            continue
        motion = joint.createData()
        joint.calc(motion, values)
        carried.append((parent, placement * motion.M))
    frame = model.frames[frame_id]
    carrier, T_carrier = carried[frame.parentJoint]
    return held, held.addFrame(pin.Frame(frame.name, carrier, 0, T_carrier * frame.placement, frame.type), False)
