"""The check behind every success: measured by Pinocchio, exactly inside the limits, free of contact if asked."""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import ShapeError
from jacokin.ik import diagnosis, targets
from jacokin.ik.options import SolverOptions
from jacokin.ik.results import IKResult, Status
from jacokin.ik.seeds import inside_exactly
from jacokin.ik.solutions.points import BranchTable, Points
from jacokin.ik.solutions.solution_set import SolutionSet
from jacokin.ik.targets import Request, TargetPose
from jacokin.model import checks
from jacokin.model.many_configurations import Chain
from jacokin.model.robot import Robot

if TYPE_CHECKING:
    from jacokin.kernels.contact.run import ContactWork
    from jacokin.model.contact import Contact


class Effort(NamedTuple):
    """What it took to find a configuration by descents."""

    iterations: int
    """Over all starts."""
    starts: int
    """How many there were."""
    qp_solver: str | None = None
    """The QP solver that ran; None for none."""


class Candidate(NamedTuple):
    """A configuration that may be the answer to a request."""

    q: Array
    """(dof,) [rad]."""
    target: TargetPose
    """What it is measured against: on a curve, the pose where the parameter has its value."""
    message: str
    """Which one it is."""
    parameter: float | None = None
    """Value of the free parameter [rad]."""
    effort: Effort | None = None
    """What it took, for a descent."""


class Verifier:
    """Measures configurations against targets, says which ones reach them, and writes results.

    Attributes:
        robot: the arm.
        frame: the frame that is brought to the target.
        frame_id: Pinocchio's id of it.
        tool: constant pose after the frame, or None.
        options: the solver's options.
        note: why contact is not looked for although it should be avoided, or which shapes of the arm keep less than the
            clearance; empty for most.
        avoids_contact: whether another configuration is taken where one is in contact.
    """

    def __init__(self, robot: Robot, frame: str, tool: pin.SE3 | None, options: SolverOptions) -> None:
        """Prepare measuring; the shapes for contact are loaded when asked for.

        Raises:
            UnknownNameError: unknown frame.
            InvalidInputError: an obstacle has the name of a shape of the arm, or no finger can take the scene's angle.
            ShapeError: contact is reported or rejected, or there is a scene, and the description's shapes cannot be
                loaded.
        """
        self.robot = robot
        self.frame = frame
        self.frame_id = robot.frame_id(frame)
        self.tool = tool
        self.options = options
        self._lower, self._upper = robot.limit_values
        self._contact, self.note, self._unreadable = _contact(robot, options)
        self.avoids_contact = self._contact is not None and options.collision in ("prefer", "reject")

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Pickle the options; working memory is made anew."""
        return Verifier, (self.robot, self.frame, self.tool, self.options)

    def require_contact(self) -> None:
        """Refuse to go on without looking for contact where that is only because the shapes cannot be loaded.

        Raises:
            ShapeError: contact is to be avoided, and the description's shapes cannot be loaded.
        """
        if self._unreadable is not None:
            raise ShapeError(f"{self._unreadable}; collision='ignore' goes on without looking")

    @property
    def looks_for_contact(self) -> bool:
        """Whether contact is looked for at all."""
        return self._contact is not None

    @property
    def contact(self) -> Contact | None:
        """What touches; None when the solver does not look."""
        return self._contact

    def touching(self, q: Array) -> list[tuple[str, str]]:
        """Pairs of shapes that touch at a configuration (dof,); none when the solver does not look."""
        return [] if self._contact is None else self._contact.all_touching(q)

    def pairs_in_contact(self, q: Array) -> list[tuple[str, str]]:
        """Pairs of shapes that touch at a configuration (dof,) that is known to be in contact."""
        assert self._contact is not None
        return self._contact.list_touching(q)

    def touches(self, q: Array) -> bool:
        """Whether any shapes touch at a configuration (dof,); not so when the solver does not look."""
        return self._contact is not None and self._contact.touches(q)

    def touching_rows(self, rows: Array) -> NDArray[np.bool_]:
        """Which of some configurations (n, dof) are in contact; none when the solver does not look."""
        return np.zeros(len(rows), dtype=np.bool_) if self._contact is None else self._contact.touches_at(rows)

    def contact_work(self) -> ContactWork:
        """Work arrays for kernels that see whether shapes touch, where the solver looks for contact."""
        assert self._contact is not None
        return self._contact.fresh_work()

    @functools.cached_property
    def chain(self) -> Chain:
        """The kinematics of the tool, for many configurations at once."""
        return Chain(self.robot, self.frame_id, self.tool)

    def tool_pose(self, q: Array) -> pin.SE3:
        """The pose of the tool in the base at `q`."""
        pose = self.robot.placement(q, self.frame_id)
        return pose if self.tool is None else pose * self.tool

    def distances(self, rows: Array) -> Array:
        """Smallest distance [m] of shapes that count as contact, for configurations (n, dof)."""
        assert self._contact is not None  # asked where the solver looks for contact
        return self._contact.distances(rows, self_collision=True)

    def touching_between(self, start: Array, end: Array) -> list[tuple[str, str]]:
        """Shapes in the way of the straight motion between two configurations (dof,): one pair, or none if it is clear.

        Nothing is stepped over; none where the solver does not look for contact.
        """
        pair = None if self._contact is None else self._contact.in_the_way(start, end)
        return [] if pair is None else [pair]

    def measure(self, q: Array, target: TargetPose) -> tuple[float, float]:
        """Position error [m] and orientation error [rad] at `q`, by Pinocchio."""
        return targets.pose_errors(self.tool_pose(q), target)

    def reached(self, q: Array, errors: tuple[float, float]) -> bool:
        """The condition of every success: inside the limits to the last bit, and within the tolerances."""
        return (
            errors[0] <= self.options.position_tolerance
            and errors[1] <= self.options.orientation_tolerance
            and inside_exactly(self._lower, q.tolist(), self._upper)
        )

    def reached_rows(self, rows: BranchTable | SolutionSet) -> NDArray[np.bool_]:
        """`reached` for rows of the closed form, which come with their measured errors."""
        within = ((rows.q >= self.robot.lower) & (rows.q <= self.robot.upper)).all(axis=1)
        near = rows.position_error <= self.options.position_tolerance
        return np.asarray(within & near & (rows.orientation_error <= self.options.orientation_tolerance))

    def accept(self, branches: Points, T: Array, note: str) -> IKResult | None:
        """The nearest branch within the limits at a pose (4, 4), if it is a success without contact.

        Args:
            branches: of that pose.
            T: T_base_tool.
            note: for the message; "" for none.

        Returns:
            None where there is none, or another may be the answer: `select` judges.
        """
        index = branches.first_within_limits()
        if index is None:
            return None
        q = branches.rows[index, :6]
        position, orientation = targets.matrix_errors(self.tool_pose(q), T)
        options = self.options
        near = position <= options.position_tolerance and orientation <= options.orientation_tolerance
        if not near or self.touches(q):  # that it is exactly within the limits, the kernel has seen
            return None
        message = f"{branches.name_of(index)}; {note}" if note else branches.name_of(index)
        return IKResult(q, Status.OK, position, orientation, "closed_form", None, 0, 0, message)

    def select(self, candidates: Iterable[Candidate], request: Request, in_contact: str) -> IKResult | None:
        """The result of the first candidate that is a success; None where none reaches its target.

        Args:
            candidates: the best one first.
            request: what was asked for.
            in_contact: what all have in common, and which one is named, where every candidate that reaches its target
                is in contact and that is to be avoided.
        """
        first: tuple[Candidate, tuple[float, float]] | None = None
        for each in candidates:
            if first is not None and self.touches(each.q):  # the first of those in contact is the one to name
                continue
            errors = self.measure(each.q, each.target)
            if not self.reached(each.q, errors):
                continue
            touches = first is None and self.touches(each.q)
            if not (touches and self.avoids_contact):
                pairs = self.pairs_in_contact(each.q) if touches else ()
                return self.result(each, Status.OK, request.message(each.message), errors, pairs)
            first = each, errors
        if first is None:
            return None
        pairs = self.pairs_in_contact(first[0].q)
        message = request.message(diagnosis.explain_contact(in_contact, pairs))
        return self.result(first[0], self.status_in_contact, message, first[1], pairs)

    @property
    def status_in_contact(self) -> Status:
        """Of a configuration that reaches its target in contact, where none does without."""
        return Status.IN_COLLISION if self.options.collision == "reject" else Status.OK

    def result(
        self,
        found: Candidate,
        status: Status,
        message: str,
        errors: tuple[float, float] | None = None,
        touching: Sequence[tuple[str, str]] = (),
    ) -> IKResult:
        """A candidate as a result; measured if its errors are not given, and copied if its `q` is writable."""
        q, _, _, parameter, effort = found
        kept = checks.read_only(q) if q.flags.writeable else q
        position, orientation = errors or self.measure(q, found.target)
        method, solver, iterations, starts = "closed_form", None, 0, 1
        if effort is not None:
            method, (iterations, starts, solver) = "qp", effort
        return IKResult(
            kept,
            status,
            position,
            orientation,
            method,
            solver,
            iterations,
            starts - 1,
            message,
            tuple(touching),
            parameter,
            found.target.free_axes,
        )


def _contact(robot: Robot, options: SolverOptions) -> tuple[Contact | None, str, ShapeError | None]:
    """What looks for contact, if anything does; what is to be noted about it; and why shapes cannot be loaded."""
    if options.collision == "ignore":
        return None, "", None
    from jacokin.model.contact import self_contact

    scene = options.scene
    try:
        found = self_contact(robot) if scene is None else scene.contact(robot)
    except ShapeError as error:
        if options.collision != "prefer" or (scene is not None and scene.surroundings.names):
            raise
        return None, f"contact was not checked: {error}", error
    if options.collision == "prefer" and not found.has_shapes:
        return None, "contact was not checked: the description has no collision shapes", None
    found = found.with_clearance(options.clearance)
    return found, found.keeping_less, None
