"""What a viewer has to show beside the arm, and in which state it begins."""

from __future__ import annotations

from dataclasses import dataclass

from jacokin.viewer.drawing.slices import Slices
from jacokin.viewer.playback import Playback
from jacokin.viewer.setup import Setup


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """What the page offers."""

    setup: Setup
    """What is solved for."""
    axis: int | None
    """The free axis of the tool: 0, 1 or 2; None for none."""
    span: tuple[float, float]
    """Least and largest angle about it [rad]."""
    visuals: bool | None
    """Whether the visual meshes are drawn at first; None where there are none."""
    note: str
    """Why something is not drawn as was asked for; "" where it is."""
    slices: Slices | None
    """Of a reachability map."""
    playback: Playback | None
    """A trajectory to play."""
