"""`IKSolver`: from a target pose to joint angles inside the limits. Read this file first.

The closed form gives every branch of a six-joint Jaco, so a pose is reached, or known to be out of reach, or known to
need a joint beyond its limit. What it does not cover (other structures, positions without orientation) goes to mink's
QP from many starts. For a pose that cannot be reached, descents look for the closest configuration.

A solve goes through these modules:

    targets        what is asked for, checked once: a pose, a position, or a pose that may turn about an axis
    few_joints     arms of three, four and five turning joints
    closed_form    candidates: the branches of a pose;  solutions, where a parameter is free;  qp, for everything else
    verification   the check behind every success, and the selection of the first candidate that passes it
    near_misses    what is within the tolerances where no candidate meets the target exactly
    diagnosis      the status and the sentence when none does
    closest        the configuration that comes closest then

How the joints of an answer follow a target that moves is in `gradients`.
"""

from __future__ import annotations

import dataclasses
import functools
import heapq
import itertools
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik import diagnosis, forms, gradients, near_misses, preferences
from jacokin.ik.batches import batch
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.closest import ClosestSearch
from jacokin.ik.few_joints import FewJoints
from jacokin.ik.fixed_joints import SIX, FixedJoints, checked_values
from jacokin.ik.local_search import LocalSearch, PositionDescents
from jacokin.ik.near_misses import NearMisses
from jacokin.ik.options import (
    DEFAULT_QP_SOLVER,
    MAX_RESTARTS,
    ORIENTATION_TOLERANCE,
    POSITION_TOLERANCE,
    SolverOptions,
    default_collision,
)
from jacokin.ik.preferences import Prefer
from jacokin.ik.results import BatchResult, IKResult
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.solutions.points import Points
from jacokin.ik.solutions.search import SetSearch
from jacokin.ik.solutions.solution_set import SolutionSet
from jacokin.ik.targets import Request, Target, TargetPose, interpret, pose_matrix
from jacokin.ik.turned import TurnedSearch
from jacokin.ik.verification import Candidate, Verifier
from jacokin.kernels.branches import FAMILY
from jacokin.kernels.closed_form.batch import BatchColumn
from jacokin.kernels.tolerances import LIMIT_SNAP
from jacokin.model import checks, poses
from jacokin.model.loading import load_robot
from jacokin.model.robot import Robot, checked_robot

if TYPE_CHECKING:
    from jacokin.model.scene import Scene

MOVE, WAYS = 30.0, 3  # of near misses: those cross a fold unless it lies along all three ways to a thirtieth
ALL_IN_CONTACT = "every branch within the limits is in contact; the best"
HELD = 16  # choices of joints that are held, whose preparation is kept


class IKSolver:
    """Inverse kinematics of one robot, frame and tool; immutable, and may be shared between threads."""

    def __init__(
        self,
        robot: Robot,
        frame: str | None = None,
        *,
        tool: pin.SE3 | ArrayLike | None = None,
        method: str = "auto",
        qp_solver: str = DEFAULT_QP_SOLVER,
        collision: str | None = None,
        position_tolerance: float = POSITION_TOLERANCE,
        orientation_tolerance: float = ORIENTATION_TOLERANCE,
        limit_snap: float = LIMIT_SNAP,
        max_restarts: int = MAX_RESTARTS,
        scene: Scene | None = None,
        clearance: float = 0.0,
    ) -> None:
        """Prepare a solver and load all it needs: no later call waits for an import.

        Args:
            robot: the arm.
            frame: name of the frame to bring to the target; None for the robot's default frame.
            tool: T_frame_tool, a constant pose after the frame.
            method: "auto" (closed form where it applies, else QP), "closed_form" or "qp".
            qp_solver: a QP solver installed for qpsolvers: "daqp", "osqp", "proxqp", "quadprog".
            collision: what to do about contact of the arm with itself and with the scene. "prefer": another
                configuration is taken if one is clear, else the result says what touches; "reject": else the pose
                counts as not reached; "report": the result says so, and contact changes nothing; "ignore". None is
                "reject" with a scene or a clearance, and "prefer" without.
            position_tolerance: a success is this near in position [m].
            orientation_tolerance: a success is this near in orientation [rad].
            limit_snap: a closed-form branch past a limit by no more than this [rad] is put on it and measured again.
            max_restarts: random starts of the QP after the first ones.
            scene: obstacles around the arm; they count as self-contact does.
            clearance: shapes this near to each other count as touching [m]. Those of the arm that are nearer in nearly
                all configurations keep a tenth of the distance that they mostly have; what they keep is in the message.

        Raises:
            UnknownNameError: unknown frame, method, collision mode or QP solver.
            MissingExtraError: the QP solver comes with an extra that is not installed.
            InvalidInputError: a tolerance that is not positive, a negative number of restarts, a malformed tool, or a
                frame that no joint moves; a scene or clearance with collision="ignore".
            StructureError: method="closed_form" and the robot has another structure.
            JacokinError: the compiled kernels do not load.
            ShapeError: the description's shapes cannot be loaded, and contact is reported or rejected.
        """
        checked_robot("robot", robot)
        options = SolverOptions(
            method=method,
            qp_solver=qp_solver,
            collision=default_collision(scene, clearance) if collision is None else collision,
            position_tolerance=position_tolerance,
            orientation_tolerance=orientation_tolerance,
            limit_snap=limit_snap,
            max_restarts=max_restarts,
            scene=scene,
            clearance=clearance,
        )
        name = robot.default_frame if frame is None else frame
        if robot.pin_model.frames[robot.frame_id(name)].parentJoint == 0:
            raise InvalidInputError(f"frame {name!r} is moved by no joint of {robot.name}; choose a frame on the arm")
        self._prepare(robot, name, None if tool is None else poses.checked_pose(tool, "tool"), options)
        if not isinstance(qp_solver, str) or qp_solver != DEFAULT_QP_SOLVER:
            from jacokin.ik import qp_backend

            qp_backend.checked_solver(qp_solver)
        if self.dimension() is None and method == "closed_form":  # builds what it asks for: no solve waits for that
            self.closed_form()  # says why
        self._search()

    def _prepare(self, robot: Robot, frame: str, tool: pin.SE3 | None, options: SolverOptions) -> None:
        """Take what is checked; the rest is built when it is asked for."""
        self._options = options
        self._verifier = Verifier(robot, frame, tool, options)
        self._closest, self._near_misses = ClosestSearch(self._verifier), NearMisses(self._verifier, MOVE, WAYS)
        self._local = threading.local()

    @property
    def robot(self) -> Robot:
        """The arm."""
        return self._verifier.robot

    @property
    def frame(self) -> str:
        """The frame that is brought to the target."""
        return self._verifier.frame

    @property
    def tool(self) -> pin.SE3 | None:
        """Constant pose of the tool in that frame, a copy; or None."""
        return None if self._verifier.tool is None else self._verifier.tool.copy()

    @property
    def verifier(self) -> Verifier:
        """What measures its answers, with its options."""
        return self._verifier

    @property
    def method(self) -> str:
        """The method asked for: "auto", "closed_form" or "qp"."""
        return self._options.method

    def in_scene(self, scene: Scene | None) -> IKSolver:
        """A solver that differs in its scene only; one that ignores contact or prefers to avoid it rejects it there.

        Raises:
            InvalidInputError: the scene does not fit the robot.
            UnknownNameError: the scene speaks of a link that is not there.
        """
        options = self._options
        lenient = options.collision in ("ignore", "prefer")
        collision = "reject" if scene is not None and lenient else options.collision
        changed = dataclasses.replace(options, scene=scene, collision=collision)
        solver = object.__new__(IKSolver)
        solver._prepare(self.robot, self.frame, self._verifier.tool, changed)
        return solver

    def with_tool(self, tool: pin.SE3 | ArrayLike | None) -> IKSolver:
        """A solver that differs in its tool only: T_frame_tool, or None for the frame itself.

        What it needs to know about the arm is worked out anew, unless that was done for this tool before: 1 ms on a
        Jaco, 40 to 70 ms on other arms of five or seven joints.

        Raises:
            InvalidInputError: a malformed tool.
        """
        return _rebuild(
            self.robot, self.frame, None if tool is None else poses.checked_pose(tool, "tool"), self._options
        )

    def closed_form(self) -> ClosedForm:
        """The closed form of this robot, built once.

        Raises:
            StructureError: the robot has another structure; names the pair of axes and the misfit.
        """
        if self._at_poses is not None:
            raise StructureError("closed form for six joints; on seven a pose leaves one free: use solve_all")
        if isinstance(self._form, StructureError):
            raise self._form.with_traceback(None)  # one object, raised again and again
        return self._form

    def dimension(self, target: Target | None = None) -> Literal[0, 1] | None:
        """What `solve_all` gives for a target.

        Args:
            target: as `solve` takes it; None for a pose, whichever.

        Returns:
            0 for points, 1 for curves along which one parameter is free; None where only the QP helps, one
            configuration at a time.

        Raises:
            InvalidInputError: target malformed.
        """
        return self.dimension_of(interpret(np.eye(4) if target is None else target, self.frame))

    def dimension_of(self, wanted: TargetPose) -> Literal[0, 1] | None:
        """`dimension`, for callers inside the package, of a checked target."""
        if self._few_at(wanted) is not None:
            return 0
        if wanted.position_only:
            return None
        if wanted.free_axis is not None:
            return None if self._usable_form is None else 1
        if self._at_poses is not None:
            return 1
        return None if self._usable_form is None else 0

    @property
    def is_compiled(self) -> bool:
        """Whether many poses are solved in one compiled loop: those of six joints in closed form."""
        return self._usable_form is not None

    @property
    def parameter(self) -> str | None:
        """The joint that is the parameter of the curves of a pose; None where poses have none."""
        return None if self._at_poses is None else self._at_poses.parameter

    def solve(
        self,
        target: Target,
        seed: ArrayLike | None = None,
        rng: np.random.Generator | None = None,
        *,
        max_restarts: int | None = None,
        closest: bool = True,
        prefer: Prefer = "nearest",
    ) -> IKResult:
        """Joint angles that bring the tool to a target.

        Args:
            target: T_base_tool as `pin.SE3` or (4, 4), a `FreeAxis`, or a position (3,) [m] with free orientation; also
                targets of the tracker, such as ``[PositionTarget(...), AxisTarget(...)]``, a `FreeAxis` in other words.
            seed: (dof,) configuration [rad] to stay near to; None for the robot's home. One outside the
                limits is moved inside and the message says so.
            rng: randomness of the QP's restarts; None for a fixed seed.
            max_restarts: in place of the solver's own number of QP restarts.
            closest: on failure, look for the closest configuration within the limits. False is quick: the result then
                holds the seed, or the best end of the QP's starts. The status is the same.
            prefer: which of the configurations within the limits: the one "nearest" to the seed, of the largest limit
                "margin", of the largest "manipulability", or of the least cost that a function returns for q (dof,).
                Of equal ones the nearest to the seed. Where two parameters are free, as about a `FreeAxis` on seven
                joints, those at angles 0.3 rad apart are looked at, and "nearest" is one near the seed.

        Returns:
            The preferred configuration within the limits, unlimited joints in the 2 pi copy nearest to the seed,
            measured by Pinocchio; or why there is none. On a curve, or about an axis, it has a `parameter`.

        Raises:
            InvalidInputError: target or seed malformed; method="closed_form" with a position-only target.
        """
        verifier, form = self._verifier, self._usable_form
        robot, frame = verifier.robot, verifier.frame
        start, note = seed_within_limits(robot, seed)
        if verifier.note:
            note = f"{note}; {verifier.note}" if note else verifier.note
        if rng is not None:
            checks.generator("rng", rng)
        restarts = (
            self._options.max_restarts if max_restarts is None else checks.whole_number("max_restarts", max_restarts)
        )
        checks.flag("closest", closest)
        is_nearest = isinstance(prefer, str) and prefer == "nearest"
        cost = None if is_nearest else preferences.cost_of(prefer, robot, frame)
        pose = pose_matrix(target) if form is not None and cost is None else None
        branches = None
        if form is not None and pose is not None:
            branches = form.solve_rigid(pose, start, verifier)
            if branches is not None and (result := verifier.accept(branches, pose, note)) is not None:
                return result  # nearly always: no more is needed
        wanted = interpret(target, frame)
        request = Request(wanted, start, note, rng, restarts, closest, cost)
        few = self._few_at(wanted)
        if few is not None:
            return few.solve(request)
        curves = self._turned if self._is_turned(wanted) else self._curves(wanted)
        if curves is not None:
            return curves.solve(request)
        if form is None or wanted.position_only:
            return self._solve_by_qp(request)
        return self._solve_by_branches(form, request, branches)

    def solve_all(
        self, target: Target, seed: ArrayLike | None = None, *, fixed: Mapping[str, float] | None = None
    ) -> SolutionSet:
        """Everything that reaches a target: points inside the limits or not, or curves within them.

        Args:
            target: T_base_tool as `pin.SE3` or (4, 4), or a `FreeAxis`; on three joints a position (3,) [m].
            seed: (dof,) configuration [rad] points are ordered by, and unlimited joints are near to; None for home.
            fixed: on an arm of more than six joints, of any structure: all joints but six, held at these values
                [rad or m], such as ``{"joint_3": 0.4}``. The first call that holds other joints takes 25 to 60 ms more;
                one with other values of the same joints 1 ms, or nothing where those are the first or the last.

        Returns:
            Points, nearest first, where the target leaves no joint free; none when it is out of reach. Curves for a
            pose of seven joints without `fixed`, and for a `FreeAxis` on six. `dimension` says which.

        Raises:
            InvalidInputError: target, seed or fixed malformed, or a target without orientation.
            UnknownNameError: fixed names a joint that is not there.
            StructureError: the robot has no closed form.
        """
        verifier, form = self._verifier, self._usable_form
        pose = pose_matrix(target) if form is not None and fixed is None else None
        wanted = interpret(target, verifier.frame) if pose is None else None
        start = seed_within_limits(verifier.robot, seed)[0]
        if seed is not None:
            start = start.copy()  # the set keeps it
        if form is not None and pose is not None:
            found = form.solve_rigid(pose, start, verifier)
            return form.solve_all(pose, start, verifier) if found is None else found
        assert wanted is not None
        few = self._few_at(wanted) if fixed is None else None
        if few is not None:
            return few.solve_all(wanted, start)
        curves = self._curves(wanted) if fixed is None else None
        if curves is not None:
            return curves.find(wanted, start).curves
        if wanted.position_only:
            raise InvalidInputError("solve_all needs an orientation: a position alone is reached by infinitely many")
        if fixed is None:
            if wanted.free_axis is not None:
                self._require_all(wanted)
            return (form or self.closed_form()).solve_all(wanted.matrix, start, verifier)
        if wanted.free_axis is not None:
            raise InvalidInputError(
                "fixed is for poses; a FreeAxis leaves one more joint free: give the pose at one angle"
            )
        held = checked_values(verifier.robot, fixed)
        return self._holding(tuple(np.isnan(held).tolist())).solve_all(held, wanted.matrix, start)

    def solve_batch(
        self,
        targets: Sequence[Target] | ArrayLike,
        seeds: ArrayLike | None = None,
        *,
        workers: int = 1,
        progress: Callable[[int], None] | None = None,
        closest: bool = True,
        prefer: Prefer = "nearest",
    ) -> BatchResult:
        """Answers to many targets; row i answers target i as `solve` would.

        Only the message of a pose that is reached may differ: `solve` says which branch it is.

        Args:
            targets: (n, 4, 4) poses, (n, 3) positions [m], or a sequence of what `solve` takes.
            seeds: (dof,) for all or (n, dof), one for each [rad]; None for home.
            workers: threads of the compiled loop, and processes for what goes to the QP; a script that asks for more
                than one must do so under ``if __name__ == "__main__":``.
            progress: called with the number of targets newly finished.
            closest: as in `solve`.
            prefer: as in `solve`; a function must be one that can be pickled where there are several workers.

        Raises:
            InvalidInputError: empty, malformed targets (the row is named), seeds or workers.
            JacokinError: the worker processes did not start.
        """
        nearest = preferences.cost_of(prefer, self.robot, self.frame) is None
        if callable(prefer) and workers != 1:
            batch.check_picklable("prefer", prefer)
        compiled = self._compiled if nearest and self._usable_form is not None else None
        single = functools.partial(self.solve, prefer=prefer)
        return batch.solve(
            self.robot,
            self.frame,
            batch.Ways(single, compiled, self._verifier.note),
            targets,
            seeds,
            workers=workers,
            progress=progress,
            closest=closest,
        )

    def gradient(self, result: IKResult, *, reference: str = "local_world_aligned") -> Array:
        """How the joints of an answer follow a target that moves: dq = gradient @ twist of the target.

        Where the answers are a curve (seven joints at a pose, six about a `FreeAxis`) this is at a constant parameter:
        the joint that is the parameter stands still, or the angle about the axis does. The answer nearest to a seed
        moves along the curve besides when the target moves, and that is not in it. Where a joint is on its limit, the
        answer follows only those motions of the target that lead the joint inwards.

        Args:
            result: a success of `solve` on this solver.
            reference: of the twists, as in `Robot.jacobian`: "local_world_aligned" (velocity of the tool's origin, in
                base axes), "local" (in the axes that the tool has at the answer) or "world".

        Returns:
            (dof, 6) d q / d twist, linear columns [rad/m] first, then angular [rad/rad].

        Raises:
            InvalidInputError: not a success, not of this arm, or of a target that does not determine the joints, such
                as a position of six.
            SingularAnswerError: the joints cannot follow every motion; names the smallest singular value.
            UnknownNameError: no such reference.
        """
        return gradients.target_gradient(self._verifier, result, self.parameter, reference)

    def parameter_gradient(self, result: IKResult) -> Array:
        """How the joints of an answer move along the curve of all answers to its target, where there is one.

        Args:
            result: a success of `solve` on this solver.

        Returns:
            (dof,) d q / d parameter [rad/rad], the target at rest. The parameter is that of `IKResult.parameter`.

        Raises:
            InvalidInputError: as `gradient`, or the answers to the target are points.
            SingularAnswerError: the curve turns back here, or several meet; names the smallest singular value.
        """
        return gradients.parameter_gradient(self._verifier, result, self.parameter)

    def pull_back(self, q: ArrayLike, cotangents: ArrayLike) -> Array:
        """Derivatives of a number by the entries of poses, from those by their answers: for automatic differentiation.

        Of rotations only the part along turns counts, so what lies across the rotations is zero: it is right for poses
        that are computed as rotations. As in `gradient`, the parameter of seven joints is constant.

        Args:
            q: (n, dof) answers to n poses [rad].
            cotangents: (n, dof) derivatives of the number by each joint; NaN goes through.

        Returns:
            (n, 4, 4) derivatives by the entries of each pose. Zero where the row of cotangents is, and else NaN where
            the answer is singular.

        Raises:
            InvalidInputError: malformed arguments, or an arm of other than six joints, or seven with a parameter.
        """
        return gradients.pull_back(self._verifier, q, cotangents, self.parameter)

    def __repr__(self) -> str:
        """Robot, frame, and the options that are not as if not given."""
        given = self._options
        usual = SolverOptions(collision=default_collision(given.scene, given.clearance))
        shown = {} if self.tool is None else {"tool": self.tool}
        shown |= {
            each.name: getattr(given, each.name)
            for each in dataclasses.fields(SolverOptions)
            if getattr(given, each.name) != getattr(usual, each.name)
        }
        words = "".join(f", {name}={' '.join(repr(value).split())}" for name, value in shown.items())
        return f"IKSolver({self.robot.name!r}, frame={self.frame!r}{words})"

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Pickle the options; working memory is made anew."""
        return _rebuild, (self.robot, self.frame, self.tool, self._options)

    @property
    def _uses_qp(self) -> bool:
        return self._options.method == "qp"

    @functools.cached_property
    def _form(self) -> ClosedForm | StructureError:
        """The closed form of six joints, or why it does not fit."""
        return forms.closed_form(self._verifier)

    @functools.cached_property
    def _usable_form(self) -> ClosedForm | None:
        """The closed form of six joints if it fits, and the method allows it."""
        return self._form if not self._uses_qp and isinstance(self._form, ClosedForm) else None

    @functools.cached_property
    def _holding(self) -> Callable[[tuple[bool, ...]], FixedJoints]:
        """What solves for six joints, of (dof,) those that are True, the others held; the last ones are kept."""
        verifier = self._verifier

        @functools.lru_cache(maxsize=HELD)
        def holding(free: tuple[bool, ...]) -> FixedJoints:
            return FixedJoints(verifier, np.array(free))

        return holding

    @functools.cached_property
    def _about_axis(self) -> SetSearch:
        """What finds the curves of an arm whose poses have points, about a free axis."""
        return SetSearch(self._verifier, forms.about_axis(self._verifier))

    @functools.cached_property
    def _at_poses(self) -> SetSearch | None:
        """What finds the curves of poses; None for an arm whose poses have none."""
        if self._uses_qp:
            return None
        arm = forms.at_poses(self._verifier)
        return None if isinstance(arm, StructureError) else SetSearch(self._verifier, arm)

    @functools.cached_property
    def _few(self) -> FewJoints:
        return FewJoints(self._verifier, self._closest, self._near_misses)

    @functools.cached_property
    def _turned(self) -> TurnedSearch:
        """What finds a configuration about a free axis of an arm whose poses have curves."""
        assert self._at_poses is not None
        return TurnedSearch(self._verifier, self._at_poses)

    def _is_turned(self, target: TargetPose) -> bool:
        """Whether two parameters are free: an angle about an axis, and one of each pose."""
        return target.free_axis is not None and self._at_poses is not None

    def _few_at(self, target: TargetPose) -> FewJoints | None:
        """What finds every configuration of an arm of fewer than six joints; None where those are not points."""
        few = not self._uses_qp and self.robot.dof < SIX and self._few.covers(target)
        return self._few if few else None

    def _curves(self, target: TargetPose) -> SetSearch | None:
        """What finds the curves of a target; None where it has none, or they are not found."""
        if target.free_axis is None:
            return None if target.position_only else self._at_poses
        return None if self._usable_form is None else self._about_axis

    def _require_all(self, target: TargetPose) -> None:
        """Refuse a free axis about which not all configurations are found.

        Raises:
            InvalidInputError: poses have curves themselves, or all is left to the QP.
            StructureError: the robot has no closed form.
        """
        if self._uses_qp:
            raise InvalidInputError("a FreeAxis needs the closed form; use method='auto'")
        if self._is_turned(target):
            raise InvalidInputError(
                "a FreeAxis on seven joints leaves two free parameters: solve gives one configuration, solve_all those "
                "of the pose at one angle about it"
            )
        self.closed_form()

    def _solve_by_branches(self, form: ClosedForm, request: Request, branches: Points | None) -> IKResult:
        """The branch within the limits of the least cost, or why there is none; from all of them, if they are known."""
        beyond = self._closest.beyond_reach(request)
        if beyond is not None:
            return beyond
        target, robot = request.target, self.robot
        if branches is None:
            branches = form.solve_all(target.matrix, request.seed, self._verifier)
        candidates: Iterator[Candidate] = (
            Candidate(q, target, branches.name_of(index)) for index, q in branches.in_order(request.cost)
        )
        candidates = self._with_straight_wrists(candidates, branches, request)
        result = self._verifier.select(candidates, request, ALL_IN_CONTACT)
        if result is not None:
            return result
        starts = self._almost_reaching(form, request, branches)
        near = (Candidate(q, target, near_misses.MESSAGE) for q in self._near_misses.find(request, starts))
        result = self._verifier.select(near, request, "every configuration that was tried is in contact; the best")
        if result is not None:
            return result
        outcome = diagnosis.explain_branches(branches, robot.joint_names)
        return self._closest.solve(request, outcome, [np.clip(q, robot.lower, robot.upper) for q in branches.q])

    def _with_straight_wrists(
        self, candidates: Iterator[Candidate], branches: Points, request: Request
    ) -> Iterator[Candidate]:
        """The branches, and in their places among them what those that stand for a whole self-motion stand for."""
        if request.cost is None:
            yield from itertools.islice(candidates, 1)  # the nearest of all is a branch; who asks on avoids contact
        if branches.singular.any():
            several, target, seed = self._verifier.avoids_contact, request.target, request.seed
            found = self._about_axis.straight_wrists(target, seed, branches.q[branches.singular])
            members = (
                Candidate(member.q, target, "a member of a self-motion")
                for member in found.candidates(request.cost, several=several)
            )
            wish = preferences.with_ties(request.cost, seed)
            candidates = heapq.merge(candidates, members, key=lambda each: float(wish(each.q[np.newaxis])[0]))
        yield from candidates

    def _almost_reaching(self, form: ClosedForm, request: Request, branches: Points) -> Array:
        """Branches (k, 6) [rad] of a target that are not far outside the limits, and such beyond a fold next to it."""
        T, seed, near = request.target.matrix, request.seed, -self._near_misses.near
        moved = self._near_misses.moved(T)
        found = form.solve_few(moved, seed).rows
        more = (found[:, BatchColumn.BRANCHES] > len(branches)) & (found[:, BatchColumn.LARGEST_MARGIN] >= near)
        rows = [form.solve_all(moved[index], seed).q for index in np.flatnonzero(more).tolist()]
        if len(branches):
            rows.append(branches.q[branches.margin.min(axis=1) >= near])
            # [m or rad] with such a singular value the tool hardly moves along a curve.
            nearly_singular = [self._singular_value(q) < 1e-4 for q in branches.q]
            rows.append(self._about_axis.nearly_standing(T, branches.q[nearly_singular]))
        return np.vstack(rows) if rows else np.empty((0, 6))

    def _singular_value(self, q: Array) -> float:
        """The smallest singular value of the Jacobian at a configuration (dof,) [m or rad]."""
        return float(self.robot.singular_values(q, frame=self.frame).min())

    def _solve_by_qp(self, request: Request) -> IKResult:
        """One configuration by descents from many starts, or why there is none.

        Raises:
            InvalidInputError: the closed form is asked for a position, or a preference among all configurations.
            StructureError: the closed form is asked for, and does not cover the target.
        """
        if request.target.position_only:
            if self.method == "closed_form":
                raise InvalidInputError("the closed form needs an orientation; use method='auto' or 'qp' for positions")
            if request.cost is not None:
                raise InvalidInputError("prefer needs an orientation: a position is solved for one configuration only")
        elif request.cost is not None:
            raise InvalidInputError("prefer needs the closed form, which gives all configurations to choose from")
        elif self.method == "closed_form":
            self.closed_form()  # says why there is none
        no_form = not self._uses_qp and self._at_poses is None and isinstance(self._form, StructureError)
        if no_form and self._closest.reach.exceeded(request.target) is None:  # beyond reach it does not matter
            request = request._replace(note=request.message(f"no closed form: {self._form}"))
        return self._search().solve(request)

    def _search(self) -> LocalSearch:
        """Descents on this robot, built once in each thread: mink's QP; with a closed form for positions only.

        Raises:
            UnknownNameError: the QP solver is not installed.
        """
        try:
            search: LocalSearch = self._local.search
        except AttributeError:
            search = self._local.search = self._make_search()
        return search

    def _make_search(self) -> LocalSearch:
        nearest = None if self._at_poses is None and self._usable_form is None else self._nearest_at
        if nearest is not None and self._options.qp_solver == DEFAULT_QP_SOLVER:
            return LocalSearch(self._verifier, PositionDescents(self._verifier), nearest)
        from jacokin.ik.qp import QPDescents  # loads mink and MuJoCo

        return LocalSearch(self._verifier, QPDescents(self._verifier), nearest)

    def _nearest_at(self, pose: TargetPose, seed: Array) -> Array | None:
        """The configuration within the limits nearest to a seed (dof,) that reaches a pose; None for none."""
        if self._at_poses is None:
            return self.closed_form().solve_all(pose.matrix, seed).nearest()
        member = self._at_poses.nearest(pose, seed)
        return None if member is None else member[0]

    def _compiled(self, matrices: Array, seeds: Array, workers: int) -> batch.CompiledAnswers:
        """The best branch of each of many poses, which of them are answers, and which are in contact."""
        verifier, form, options = self._verifier, self.closed_form(), self._options
        if verifier.looks_for_contact:
            tolerances = options.position_tolerance, options.orientation_tolerance
            avoids = verifier.avoids_contact
            found, touching = form.solve_clear_batch(
                matrices, seeds, verifier.contact_work, tolerances, avoids=avoids, threads=workers
            )
        else:
            found, touching = form.solve_nearest(matrices, seeds, workers), np.zeros(len(seeds), dtype=np.bool_)
        good = verifier.reached_rows(found) & found.within_limits
        if verifier.avoids_contact:
            good &= ~touching | (found.rows[:, FAMILY] == 0.0)  # others of a self-motion may be clear
        touching &= good
        said = {}
        if verifier.avoids_contact:
            for row in np.flatnonzero(touching).tolist():
                sentence = diagnosis.explain_contact(ALL_IN_CONTACT, verifier.pairs_in_contact(found.q[row]))
                said[row] = verifier.status_in_contact, sentence
        return batch.CompiledAnswers(found, good, touching, said)


def _rebuild(robot: Robot, frame: str, tool: pin.SE3 | None, options: SolverOptions) -> IKSolver:
    given = {field.name: getattr(options, field.name) for field in dataclasses.fields(options)}
    return IKSolver(robot, frame, tool=tool, **given)


def solve_ik(
    target: Target,
    robot: Robot | str | Path | None = None,
    *,
    seed: ArrayLike | None = None,
    frame: str | None = None,
    tool: pin.SE3 | ArrayLike | None = None,
) -> IKResult:
    """Solve one pose: `IKSolver(robot, frame, tool=tool).solve(target, seed)`.

    Args:
        target: what `IKSolver.solve` takes: T_base_tool as `pin.SE3` or (4, 4), a position (3,) [m] with free
            orientation, a `FreeAxis`.
        robot: a robot, or what `load_robot` takes; None for the j2n6s300.
        seed: (dof,) configuration [rad] to stay near to.
        frame: frame to bring to the target; None for the robot's default frame.
        tool: constant pose after the frame.

    Raises:
        JacokinError: as `load_robot` and `IKSolver.solve`.
    """
    if not isinstance(robot, Robot):
        robot = load_robot() if robot is None else load_robot(robot)
    return IKSolver(robot, frame, tool=tool).solve(target, seed)
