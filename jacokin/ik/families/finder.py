"""Families for one solver: of six joints with a free axis, of seven joints at a pose; each is measured once."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik.targets import TargetPose
from jacokin.ik.verification import Verifier
from jacokin.model.poses import FreeAxis

if TYPE_CHECKING:
    from jacokin.ik.closed_form import ClosedForm
    from jacokin.ik.families.search import Findings, SevenJointFamilies, SixJointFamilies

SEVEN = 7  # joints of an arm whose poses have families


class Finder:
    """What finds the families of one robot, frame and tool."""

    __slots__ = ("_closed_form", "_method", "_misfit", "_seven", "_six", "_verifier")

    def __init__(self, verifier: Verifier, method: str, closed_form: Callable[[], ClosedForm]) -> None:
        """Take what is needed; nothing is measured yet.

        Args:
            verifier: robot, frame and tool.
            method: of the solver.
            closed_form: makes the closed form of six joints; raises where it does not fit.
        """
        self._verifier, self._method, self._closed_form = verifier, method, closed_form
        self._six: SixJointFamilies | None = None
        self._seven: SevenJointFamilies | None = None
        self._misfit: StructureError | None = None

    @property
    def applies_to_poses(self) -> bool:
        """Whether a pose has a family: seven joints that the closed form fits, and the method allows it."""
        if self._method == "qp" or self._verifier.robot.dof != SEVEN:
            return False
        try:
            self._seven_joints()
        except StructureError:
            return False
        return True

    def applies_to(self, target: TargetPose) -> bool:
        """Whether a target without a free axis is answered by a family."""
        return not target.position_only and self.applies_to_poses

    @property
    def misfit(self) -> StructureError | None:
        """Why the closed form of seven joints does not fit, once that was tried."""
        return self._misfit

    def load(self) -> None:
        """Import what finding a family needs, so that no search waits for it."""
        from jacokin.ik.families import search  # noqa: F401  # imports the kernels of the curves

    def find(self, target: TargetPose | FreeAxis, seed: Array) -> Findings:
        """Everything that reaches a target with one free parameter.

        Raises:
            InvalidInputError: a free axis on seven joints, or with the QP.
            StructureError: the robot has no closed form.
        """
        if not isinstance(target, FreeAxis):
            return self._seven_joints().find(target, seed)
        return self._six_joints().find(target, seed)

    def nearest(self, target: TargetPose | FreeAxis, seed: Array) -> tuple[Array, float] | None:
        """The member (dof,) nearest to a seed and its parameter [rad]; None where only `find` can tell.

        Raises:
            InvalidInputError, StructureError: as `find`.
        """
        if not isinstance(target, FreeAxis):
            return self._seven_joints().nearest(target, seed)
        return self._six_joints().nearest(target, seed)

    @property
    def exact(self) -> Callable[[TargetPose, Array], Array | None] | None:
        """`nearest_at`, or None where the robot has no closed form or the method is the QP."""
        if self.applies_to_poses:
            return self.nearest_at
        if self._method == "qp":
            return None
        try:
            self._closed_form()
        except StructureError:
            return None
        return self.nearest_at

    def nearest_at(self, pose: TargetPose, seed: Array) -> Array | None:
        """The configuration within the limits nearest to a seed (dof,) that reaches a pose; None for none.

        Raises:
            StructureError: the robot has no closed form.
        """
        if self.applies_to_poses:
            member = self._seven_joints().nearest(pose, seed)
            return None if member is None else member[0]
        rows = self._closed_form().solve_all(pose.matrix, seed)
        within = rows.q[rows.within_limits]
        return within[0] if len(within) else None

    def _six_joints(self) -> SixJointFamilies:
        if self._verifier.robot.dof == SEVEN:
            raise InvalidInputError(
                "a FreeAxis on seven joints leaves two free parameters: give the pose at one angle, target.at(angle), "
                "or try several"
            )
        if self._method == "qp":
            raise InvalidInputError("a FreeAxis needs the closed form; use method='auto'")
        if self._six is None:
            from jacokin.ik.families.search import SixJointFamilies

            self._six = SixJointFamilies(self._closed_form(), self._verifier)
        return self._six

    def _seven_joints(self) -> SevenJointFamilies:
        if self._seven is None:
            if self._misfit is not None:
                raise self._misfit.with_traceback(None)
            from jacokin.ik.families.search import SevenJointFamilies

            try:
                self._seven = SevenJointFamilies(self._verifier)
            except StructureError as error:
                self._misfit = error
                raise
        return self._seven
