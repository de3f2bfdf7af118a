"""What there is to show for a target, as data. Read this file first; `inspector` fills it in, `browser` draws it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.results import Status


class ShownPlaces(NamedTuple):
    """Where the parts of k arms are, in the base frame."""

    positions: NDArray[np.float32]
    """(k, parts, 3) [m]."""
    wxyzs: NDArray[np.float32]
    """(k, parts, 4) unit quaternions w, x, y, z."""


@dataclass(frozen=True, slots=True, eq=False)
class Free:
    """The free parameter of a target, and where it is: the angle about an axis of the tool, or joint 3 of seven."""

    name: str
    """What is free, in words."""
    value: float
    """[rad]."""
    lower: float
    """Least value allowed [rad]."""
    upper: float
    """Largest value allowed [rad]."""
    intervals: tuple[tuple[float, float], ...]
    """Values from start to stop that are reached within the limits [rad]; those of an angle may pass pi."""
    axis: int | None = None
    """0, 1 or 2 for x, y or z of the tool; None for a joint."""
    pose: pin.SE3 | None = None
    """T_base_tool at angle 0; None for a joint."""


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Everything there is to show for one target. Arrays are read-only."""

    target: pin.SE3
    """T_base_tool that is asked for."""
    status: Status
    """Whether the target is reached, or why not."""
    q: Array
    """(dof,) joint values of the arm that is drawn solid [rad]."""
    seed: Array
    """(dof,) where the arm was when the target was answered, from which distances are measured [rad]."""
    selected: int | None
    """The branch that the solid arm is at; None when it is at none."""
    branches: Array
    """(k, dof) every branch, nearest to where the arm was first [rad]."""
    margins: Array
    """(k, dof) distance of each branch to the nearer limit [rad]: negative outside, inf where there are none."""
    within: NDArray[np.bool_]
    """(k,) whether every joint of a branch is within its limits, exactly."""
    touching: tuple[tuple[tuple[str, str], ...], ...] | None
    """Pairs of shapes that touch in each branch; None when the solver does not look."""
    arm_touching: tuple[tuple[str, str], ...] = ()
    """Pairs of shapes of the solid arm that touch."""
    errors: tuple[float, float] = (0.0, 0.0)
    """How far the solid arm is from the target: position [m], angle [rad]."""
    message: str = ""
    """What the solver says, with numbers."""
    pending: bool = False
    """True while the closest configuration is still to be looked for."""
    note: str = ""
    """What the arm is doing, when it moves by itself."""
    free: Free | None = None
    """The free parameter; None without one."""
    commanded: Array | None = None
    """(dof,) where the arm was to be, of a log that is played [rad]; None where that is not known."""

    @property
    def gizmo(self) -> pin.SE3:
        """Where the gizmo stands: the target, at angle 0 of a free axis."""
        return self.target if self.free is None or self.free.pose is None else self.free.pose

    @property
    def feasible(self) -> NDArray[np.bool_]:
        """(k,) branches that count as reached: within the limits, and free of contact if the solver looks for it."""
        if self.touching is None:
            return self.within
        return self.within & np.array([not pairs for pairs in self.touching], dtype=np.bool_)

    @property
    def ghosts(self) -> NDArray[np.int64]:
        """Numbers of the branches that the solid arm is not at."""
        numbers = np.arange(len(self.branches))
        return numbers if self.selected is None else numbers[numbers != self.selected]
