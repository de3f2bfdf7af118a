"""Grasps."""

from __future__ import annotations

from dataclasses import dataclass

from jacokin.model.poses import FreeAxis


@dataclass(frozen=True, slots=True, eq=False)
class Grasp:
    """One way to grasp something.

    Attributes:
        target: where the tool is: a pose that may turn about an axis.
        opening: angle of the fingers before they close [rad].
    """

    target: FreeAxis
    opening: float
