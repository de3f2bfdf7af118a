"""`IKSolver`: from a target pose to joint angles inside the limits. Read this file first.

The closed form gives every branch of a six-joint Jaco, so a pose is reached, or known to be out of reach, or known to
need a joint beyond its limit. What it does not cover (other structures, positions without orientation) goes to mink's
QP from many starts. For a pose that cannot be reached, descents look for the closest configuration.
"""

from __future__ import annotations

import dataclasses
import functools
import threading
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, overload

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik import preferences
from jacokin.ik.batches import batch
from jacokin.ik.families.finder import Finder
from jacokin.ik.options import (
    DEFAULT_QP_SOLVER,
    LIMIT_SNAP,
    MAX_RESTARTS,
    ORIENTATION_TOLERANCE,
    POSITION_TOLERANCE,
    Options,
)
from jacokin.ik.preferences import Prefer
from jacokin.ik.request import Request
from jacokin.ik.results import BatchResult, Branches, IKResult
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.selection import nearest_member, of_branches, of_findings
from jacokin.ik.targets import PartialTarget, Target, TargetPose, understood
from jacokin.ik.verification import Verifier
from jacokin.model import checks, poses
from jacokin.model.poses import FreeAxis
from jacokin.model.robot import Robot, checked_robot

if TYPE_CHECKING:
    from jacokin.ik.closed_form import BestBranches, ClosedForm
    from jacokin.ik.closest import ClosestSearch
    from jacokin.ik.families.family import Family
    from jacokin.ik.qp import QPSearch
    from jacokin.model.scene import Scene


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
        collision: str = "ignore",
        position_tolerance: float = POSITION_TOLERANCE,
        orientation_tolerance: float = ORIENTATION_TOLERANCE,
        limit_snap: float = LIMIT_SNAP,
        max_restarts: int = MAX_RESTARTS,
        scene: Scene | None = None,
        clearance: float = 0.0,
        warm: bool | None = False,
    ) -> None:
        """Prepare a solver, and load what solving needs: no later call waits for an import.

        Args:
            robot: the arm.
            frame: name of the frame to bring to the target; None for the robot's default frame.
            tool: T_frame_tool, a constant pose after the frame.
            method: "auto" (closed form where it applies, else QP), "closed_form" or "qp".
            qp_solver: a QP solver installed for qpsolvers: "daqp", "osqp", "proxqp", "quadprog".
            collision: contact of the arm with itself and with the scene is "ignore"d, "report"ed in the result, or
                "reject"ed for another branch.
            position_tolerance: a success is this near in position [m].
            orientation_tolerance: a success is this near in orientation [rad].
            limit_snap: a closed-form branch past a limit by no more than this [rad] is put on it and measured again.
            max_restarts: random starts of the QP after the first ones.
            scene: obstacles around the arm; they count as self-contact does.
            clearance: shapes this near to each other count as touching [m].
            warm: True compiles the closed form, if no cache holds it, before the first solve (20 s, once); False
                leaves that to the background; None loads nothing before it is needed, for programs that solve once.

        Raises:
            UnknownNameError: unknown frame, method, collision mode or QP solver.
            MissingExtraError: the QP solver comes with an extra that is not installed.
            InvalidInputError: a tolerance that is not positive, a negative number of restarts, a malformed tool, or a
                frame that no joint moves; warm is not a bool or None; a scene or clearance with collision="ignore".
            StructureError: method="closed_form" and the robot has another structure.
            JacokinError: warm=True and the closed form could not be compiled.
            ModelError: contact is asked for and the description has no shapes to check.
        """
        checked_robot("robot", robot)
        options = Options(
            method=method,
            qp_solver=qp_solver,
            collision=collision,
            position_tolerance=position_tolerance,
            orientation_tolerance=orientation_tolerance,
            limit_snap=limit_snap,
            max_restarts=max_restarts,
            scene=scene,
            clearance=clearance,
        )
        self._frame_id = robot.frame_id(frame)
        name = robot.default_frame if frame is None else frame
        if robot.pin_model.frames[self._frame_id].parentJoint == 0:
            raise InvalidInputError(f"frame {name!r} is moved by no joint of {robot.name}; choose a frame on the arm")
        self._options = options
        self._verifier = Verifier(robot, name, None if tool is None else poses.checked_pose(tool, "tool"), options)
        self._form: ClosedForm | None = None
        self._misfit: StructureError | None = None
        self._closest: ClosestSearch | None = None
        self._finder = Finder(self._verifier, method, self.closed_form)
        self._local = threading.local()
        if not isinstance(qp_solver, str) or qp_solver != DEFAULT_QP_SOLVER:
            from jacokin.ik import qp_backend

            qp_backend.checked(qp_solver)
        if method == "closed_form" and not self.has_families:
            self.closed_form()
        if warm is not None:
            self._load(checks.flag("warm", warm))

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

    def closed_form(self) -> ClosedForm:
        """The closed form of this robot, built once.

        Raises:
            StructureError: the robot has another structure; names the pair of axes and the misfit.
        """
        if self._form is None:
            if self.robot.dof == 7 and self.has_families:
                raise StructureError("closed form for six joints; on seven joints a pose has a family: use solve_all")
            if self._misfit is not None:
                raise self._misfit.with_traceback(None)  # one object, raised again and again
            from jacokin.ik.closed_form import ClosedForm

            try:
                self._form = ClosedForm(
                    self.robot.pin_model,
                    self._frame_id,
                    self._verifier.tool,
                    self.robot.lower,
                    self.robot.upper,
                    limit_snap=self._options.limit_snap,
                )
            except StructureError as error:
                self._misfit = error
                raise
        return self._form

    @property
    def has_closed_form(self) -> bool:
        """Whether the closed form fits this robot and frame, and the method allows it."""
        return self._usable_form() is not None

    @property
    def has_families(self) -> bool:
        """Whether a pose has a family: an arm of seven joints that its closed form fits, and the method allows it."""
        return self._finder.applies_to_poses

    @property
    def tolerances(self) -> tuple[float, float]:
        """Position [m] and orientation [rad] tolerance of a success."""
        return self._options.position_tolerance, self._options.orientation_tolerance

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
                holds the seed, or the best end of the QP's starts.
            prefer: which of the configurations within the limits: the one "nearest" to the seed, of the largest limit
                "margin", of the largest "manipulability", or of the least cost that a function returns for q (dof,).
                Of equal ones the nearest to the seed.

        Returns:
            The preferred configuration within the limits, unlimited joints in the 2 pi copy nearest to the seed,
            measured by Pinocchio; or why there is none. Of a family it has a `parameter`.

        Raises:
            InvalidInputError: target or seed malformed; method="closed_form" with a position-only target.
        """
        wanted = understood(target, self.frame)
        start, note = seed_within_limits(self.robot, seed)
        if rng is not None:
            checks.generator("rng", rng)
        restarts = self._options.max_restarts
        if max_restarts is not None:
            restarts = checks.whole_number("max_restarts", max_restarts)
        checks.flag("closest", closest)
        preferred = preferences.checked(prefer)
        cost = None if preferred == "nearest" else preferences.cost_of(preferred, self.robot, self.frame)
        at = TargetPose(wanted.matrix, position_only=False) if isinstance(wanted, FreeAxis) else wanted
        request = Request(at, start, note, rng, restarts, closest)
        if isinstance(wanted, FreeAxis) or self._finder.applies_to(wanted):
            if cost is None and not self._verifier.rejects_contact:
                result = nearest_member(self._finder.nearest(wanted, start), wanted, self._verifier, request)
                if result is not None:
                    return result
            found, wish = self._finder.find(wanted, start), preferences.with_ties(cost, start)
            return of_findings(found, self._verifier, request, wish, self._closest_search)
        if wanted.position_only:
            if self.method == "closed_form":
                raise InvalidInputError("the closed form needs an orientation; use method='auto' or 'qp' for positions")
            if cost is not None:
                raise InvalidInputError("prefer needs an orientation: a position is solved for one configuration only")
        elif (form := self._usable_form()) is not None:
            rows = form.solve_all(wanted.matrix, start)
            return of_branches(rows, self._verifier, request, cost, self._closest_search)
        if cost is not None:
            raise InvalidInputError("prefer needs the closed form, which gives all configurations to choose from")
        if self._misfit is not None:
            request = request._replace(note=request.message(f"no closed form: {self._misfit}"))
        return self._qp_search().solve(request)

    @overload
    def solve_all(
        self, target: FreeAxis | PartialTarget | Sequence[PartialTarget], seed: ArrayLike | None = None
    ) -> Family: ...

    @overload
    def solve_all(self, target: pin.SE3 | ArrayLike, seed: ArrayLike | None = None) -> Branches: ...

    @overload
    def solve_all(self, target: Target, seed: ArrayLike | None = None) -> Branches | Family: ...

    def solve_all(self, target: Target, seed: ArrayLike | None = None) -> Branches | Family:
        """Every branch that reaches a pose, inside the limits or not; all of a family within the limits.

        Args:
            target: T_base_tool as `pin.SE3` or (4, 4), or a `FreeAxis`.
            seed: (dof,) configuration [rad] branches are ordered by, and unlimited joints are near to; None for home.

        Returns:
            All branches, nearest first; none when the pose is out of reach. For a `FreeAxis` a `Family`.

        Raises:
            InvalidInputError: target or seed malformed, or a target without orientation.
            StructureError: the robot has no closed form.
        """
        wanted = understood(target, self.frame)
        start, _ = seed_within_limits(self.robot, seed)
        if isinstance(wanted, FreeAxis) or self._finder.applies_to(wanted):
            return self._finder.find(wanted, start).family
        if wanted.position_only:
            raise InvalidInputError("solve_all needs an orientation: a position alone is reached by infinitely many")
        raw = self.closed_form().solve_all(wanted.matrix, start)
        if not self._verifier.looks_for_contact:
            return Branches(raw)
        return Branches(raw, tuple(tuple(self._verifier.touching(q)) for q in raw.q))

    def family(self, target: Target, seed: ArrayLike | None = None) -> Family:
        """As `solve_all` for a target that has a family: a `FreeAxis`, or a pose of a seven-joint arm.

        Raises:
            InvalidInputError: target or seed malformed, or a target that has no family.
            StructureError: the robot has no closed form.
        """
        wanted = understood(target, self.frame)
        if isinstance(wanted, FreeAxis) or self._finder.applies_to(wanted):
            return self._finder.find(wanted, seed_within_limits(self.robot, seed)[0]).family
        raise InvalidInputError("only a FreeAxis, or a pose of a seven-joint arm, has a family; use solve_all")

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
        # A batch looks for contact branch by branch, which the compiled loop does not.
        nearest = preferences.checked(prefer) == "nearest"
        if callable(prefer) and workers != 1:
            batch.check_picklable("prefer", prefer)
        compiled = self._compiled if nearest and self.has_closed_form and not self._verifier.looks_for_contact else None
        single = functools.partial(self.solve, prefer=prefer)
        return batch.solve(
            self.robot, single, compiled, targets, seeds, workers=workers, progress=progress, closest=closest
        )

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Pickle the options; working memory is made anew."""
        return _rebuild, (self.robot, self.frame, self.tool, self._options)

    def _usable_form(self) -> ClosedForm | None:
        """The closed form if it fits this robot and frame and the method allows it."""
        if self._options.method == "qp":
            return None
        try:
            return self._form or self.closed_form()
        except StructureError:
            return None

    def _load(self, warm: bool) -> None:
        """Load now what the first solve would wait for."""
        if self.has_families or self.has_closed_form:
            self._finder.load()
            if warm:
                from jacokin.kernels.compiled.loading import warmup

                warmup()
        self._qp_search()

    def _qp_search(self) -> QPSearch:
        """Mink's QP on this robot, built once in each thread.

        Raises:
            UnknownNameError: the QP solver is not installed.
        """
        try:
            search: QPSearch = self._local.search
        except AttributeError:
            from jacokin.ik.qp import QPSearch

            search = self._local.search = QPSearch(self._verifier, self._closest_search(), self._finder.exact)
        return search

    def _closest_search(self) -> ClosestSearch:
        """The search for the closest configuration, built once."""
        if self._closest is None:
            from jacokin.ik.closest import ClosestSearch

            self._closest = ClosestSearch(self._verifier)
        return self._closest

    def _compiled(self, matrices: Array, seeds: Array, workers: int) -> tuple[BestBranches, NDArray[np.bool_]]:
        """The best branch of each of many poses, and which of them are successes."""
        rows = self.closed_form().solve_batch(matrices, seeds, workers)
        return rows, self._verifier.reached_rows(rows) & rows.within_limits


def _rebuild(robot: Robot, frame: str, tool: pin.SE3 | None, options: Options) -> IKSolver:
    given = {field.name: getattr(options, field.name) for field in dataclasses.fields(options)}
    return IKSolver(robot, frame, tool=tool, **given)
