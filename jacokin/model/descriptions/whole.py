"""What a description file holds, whatever its format."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import pinocchio as pin

from jacokin.arrays import Array

if TYPE_CHECKING:
    import mujoco


MOST_JOINTS = 200  # of an arm; Pinocchio's memory grows with the cube of their number: 6 GiB at a thousand


@dataclass(frozen=True, slots=True)
class Coupling:
    """Joints that do not move independently of each other."""

    joints: frozenset[str]
    what: str
    """Kind and name of what couples them, for messages."""


@dataclass(frozen=True, slots=True, eq=False)
class Whole:
    """A whole robot or scene, before the arm is taken out of it."""

    model: pin.Model
    reference: Array
    """(nq,) configuration at which joints off the arm rest."""
    kind: str
    """"urdf" or "mjcf"."""
    base: str
    """Name of the frame that poses are expressed in when none is named."""
    couplings: Sequence[Coupling]
    content: str | mujoco.MjModel | None
    """Checked text of a URDF, compiled MJCF; None for bundled robots."""
