"""`VirtualJoints`: every configuration of an arm of three, four or five turning joints at a target.

A freedom of the target is a turning joint after the tool, which no motor drives. With as many of them as the arm lacks
for six, the arm is a chain of six joints at a pose, which `ik.closed_form` solves:

    five joints about a free axis     a virtual joint along that axis: its angle is the parameter
    three joints at a position        three virtual joints through the tool: its free orientation
    everything else                   virtual joints anywhere: what has them at zero reaches the target

Targets of the last kind ask for more than the arm has joints, so that only those which forward kinematics made, or such
as the arm reaches by its structure, have answers.
"""

from __future__ import annotations

import copy
import functools

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import StructureError
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.fixed_joints import SIX, hold
from jacokin.ik.solutions.points import Points
from jacokin.ik.solutions.solution_set import Touching
from jacokin.ik.structures import FEWEST
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.kernels.few_joints import ROWS, FewWork, make_few_work, take_few
from jacokin.kernels.library import Call
from jacokin.model import checks
from jacokin.model.kinematics import axis_of

#: Where joints that stand at zero are: turned by [rad], moved by [lengths of the arm]. Any generic numbers will do.
ANYWHERE = (
    ((0.31, -0.74, 1.13), (0.37, -0.23, 0.41)),
    ((-0.92, 0.43, 0.58), (-0.29, 0.33, 0.19)),
    ((0.67, 1.21, -0.36), (0.17, 0.39, -0.31)),
)
#: Axes of a spherical wrist in the tool, and the orientation that it is given: none of them line up.
WRIST = (np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
ORIENTATION = pin.exp3(np.array([0.53, -0.81, 0.27]))


class PointsOfFew(Points):
    """Configurations of an arm of fewer than six joints at a target, nearest to the seed first.

    Attributes:
        angle: (k,) angle about the free axis [rad], read-only; None where the target has none.
        free_joint: name of a joint that turns about the free axis itself, so that it may have any value: it stays
            where the seed has it; empty for none.
        on_curve: whether the target is reached along a curve, as straight down by many arms: points of it are some, the
            angle of the seed among them.
        nearly: whether nothing meets the target exactly: points are some of what is within the tolerances.
    """

    __slots__ = ("_dof", "angle", "free_joint", "nearly", "on_curve")

    def __init__(
        self,
        rows: Array,
        dropped: bool,
        seed: Array,
        verifier: Verifier,
        angle: Array | None,
        free_joint: str,
        touching: Touching | None = None,
        *,
        on_curve: bool = False,
        nearly: bool = False,
    ) -> None:
        """Take rows (k, 17), whose first columns are the arm's own joints; the rest as `Points` does."""
        super().__init__(rows, dropped, seed, verifier, touching)
        self._dof, self.free_joint, self.on_curve, self.nearly = len(seed), free_joint, on_curve, nearly
        self.angle = None if angle is None else checks.sealed(angle)

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Rebuild from the arrays, which stay read-only."""
        shared = self.rows, self.dropped, self._seed, self._verifier
        made = functools.partial(type(self), on_curve=self.on_curve, nearly=self.nearly)
        return made, (*shared, self.angle, self.free_joint, self.touching)

    @property
    def q(self) -> Array:
        """(k, dof) joint angles [rad]: unlimited joints nearest to the seed."""
        return self.rows[:, : self._dof]

    @property
    def margin(self) -> Array:
        """(k, dof) distance to the nearer limit [rad]: negative outside, inf for an unlimited joint."""
        return self.rows[:, SIX : SIX + self._dof]

    @property
    def complete(self) -> bool:
        """False where a joint is free, too: each branch then stands for all its values; and where these are a curve.

        And where nothing meets the target exactly: what is within the tolerances is a region around each point.
        """
        return super().complete and not (self.free_joint or self.on_curve or self.nearly)

    @property
    def _said(self) -> str:
        """How many there are, and what they are."""
        return f"{super()._said}{', none of them exactly' if self.nearly else ''}"


class VirtualJoints:
    """One arm of fewer than six joints and one kind of target; immutable.

    Attributes:
        free_joint: as `PointsOfFew` has it.
    """

    __slots__ = (
        "_form",
        "_idle",
        "_position_only",
        "_real",
        "_sign",
        "_still",
        "_verifier",
        "free_joint",
    )

    def __init__(self, verifier: Verifier, axis: Array | None, *, position_only: bool, limit_snap: float) -> None:
        """Build the chain of six and prepare its closed form: a tenth of a second.

        Args:
            verifier: the arm, frame and tool.
            axis: (3,) free axis in the tool, a unit vector; None for none.
            position_only: whether the orientation is free.
            limit_snap: as `IKSolver` takes it.

        Raises:
            StructureError: the arm has other joints than three to five that turn, in one chain to the frame; or a
                target of this kind leaves more than points.
        """
        robot = verifier.robot
        if not FEWEST <= robot.dof < SIX or robot.sliding.any():
            raise StructureError(f"sets of points are for three to five turning joints; {robot.name} has {robot.dof}")
        if position_only and robot.dof != FEWEST:
            raise StructureError(f"a position leaves {robot.dof - FEWEST} of {robot.dof} joints free")
        self._verifier, self._position_only = verifier, position_only
        self._sign = 0.0 if axis is None else self._last_along(axis)
        self.free_joint = robot.joint_names[-1] if self._sign else ""
        self._real = robot.dof - 1 if self._sign else robot.dof
        virtual = list(WRIST) if position_only else [] if axis is None else [-axis]
        self._still = SIX - self._real - len(virtual)  # virtual joints that must stand at zero
        unbounded = np.full(SIX - self._real, np.inf)
        lower = np.concatenate([robot.lower[: self._real], -unbounded])
        upper = np.concatenate([robot.upper[: self._real], unbounded])
        self._form = ClosedForm(*self._chain(virtual), None, lower, upper, limit_snap=limit_snap)
        self._idle = [self._make_call()]  # each thread takes one, or makes one, and puts it back

    def measured_by(self, verifier: Verifier) -> VirtualJoints:
        """This chain for another solver of the same arm, frame and tool."""
        found = copy.copy(self)
        found._verifier = verifier
        return found

    def solve_all(self, target: TargetPose, seed: Array) -> PointsOfFew:
        """Every configuration, nearest to the seed (dof,) first, within the limits or not."""
        real, T, start, free = self._real, target.matrix, np.zeros(SIX), target.free_axis
        start[:real] = seed[:real]
        if self._position_only:
            T = T.copy()
            T[:3, :3] = ORIENTATION
        found = self._form.solve_all(T, start)
        try:
            call = self._idle.pop()
        except IndexError:
            call = self._make_call()
        work, given, options = call.work, found.rows, self._verifier.options
        work.T[:], work.seed[: seed.size], work.counts[ROWS], work.rows[: len(given)] = T, seed, len(given), given
        work.tolerances[:] = options.position_tolerance, options.orientation_tolerance
        if free is not None:
            work.range[:] = free.range
        count = call()
        # Copies: the call's own arrays are overwritten by its next run.
        rows, angle = work.rows[:count].copy(), None if free is None else work.angles[:count].copy()
        self._idle.append(call)
        return PointsOfFew(rows, found.dropped, seed, self._verifier, angle, self.free_joint)

    def _make_call(self) -> Call[FewWork]:
        """Work arrays that know the chain."""
        work, robot = make_few_work(), self._verifier.robot
        is_turned = self._real + self._still < SIX and not self._position_only
        work.chain[:] = self._form.chain
        work.counts[1:] = self._real, SIX - self._still, is_turned, self._sign, self._position_only
        work.bounds[:, : robot.dof] = robot.lower, robot.upper
        return Call(take_few, work)

    def _last_along(self, axis: Array) -> float:
        """Whether the last joint turns about the free axis (3,) itself: 1.0, against it -1.0, or not 0.0."""
        place, robot = self._tool_in_last(), self._verifier.robot
        own = axis_of(robot.pin_model, robot.dof).direction
        turned, arm = place.rotation @ axis, place.translation
        across = float(np.linalg.norm(np.cross(own, turned)))
        apart = float(np.linalg.norm(np.cross(own, arm)))
        along = float(own @ turned)
        is_one_line = max(across, apart) < 1e-9  # sine, and distance over the arm's length
        return (1.0 if along > 0.0 else -1.0) if is_one_line else 0.0

    def _tool_in_last(self) -> pin.SE3:
        """The tool in the axes of the joint that carries it."""
        verifier = self._verifier
        place = verifier.robot.pin_model.frames[verifier.frame_id].placement
        return place.copy() if verifier.tool is None else place * verifier.tool

    def _chain(self, virtual: list[Array]) -> tuple[pin.Model, int]:
        """The arm with virtual joints about axes (3,) in the tool, then those that stand at zero; the tool's frame."""
        verifier, robot = self._verifier, self._verifier.robot
        model, last = robot.pin_model, int(robot.pin_model.frames[verifier.frame_id].parentJoint)
        if last != robot.dof:
            raise StructureError(f"frame {verifier.frame!r} is not moved by all joints of {robot.name}")
        values = np.full(robot.dof, np.nan)
        if self._sign:
            values[-1] = 0.0
        model, frame_id = hold(model, verifier.frame_id, values)
        frame = model.frames[frame_id]
        at = frame.placement if verifier.tool is None else frame.placement * verifier.tool
        size = sum(float(np.linalg.norm(place.translation)) for place in model.jointPlacements)
        joint = int(frame.parentJoint)
        for axis in virtual:
            joint = model.addJoint(joint, pin.JointModelRevoluteUnaligned(*axis.tolist()), at, f"virtual_{joint}")
            at = pin.SE3.Identity()
        for turn, move in ANYWHERE[: self._still]:
            place = pin.SE3(pin.exp3(np.array(turn)), size * np.array(move))
            joint = model.addJoint(joint, pin.JointModelRZ(), at * place, f"virtual_{joint}")
            at = place.inverse()
        return model, model.addFrame(pin.Frame("tool", joint, 0, at, pin.FrameType.OP_FRAME), False)
