"""`Contents`, what a viewer offers to show, and `Setup`, what it solves for; pages may change both."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene
from jacokin.viewer.drawing import ArmPart, Triangles
from jacokin.viewer.playback import Playback

if TYPE_CHECKING:
    from jacokin.reachability import ReachabilityMap


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """Arguments of a solver."""

    frame: str
    """The frame that is brought to the target."""
    tool: pin.SE3 | None
    """T_frame_tool, a constant pose after the frame."""
    collision: str
    """Contact, see `IKSolver`: "prefer", "ignore", "report" or "reject"."""
    scene: Scene | None
    """Obstacles, as they were given."""
    obstacles: bool
    """Whether they are drawn, and count."""
    clearance: float
    """Shapes this near to each other count as touching [m]."""

    def solver(self, robot: Robot) -> IKSolver:
        """A solver for this.

        Raises:
            JacokinError: as `IKSolver`.
        """
        looking = self.collision != "ignore"
        clearance = checks.non_negative("clearance", self.clearance, "m")
        return IKSolver(
            robot,
            self.frame,
            tool=self.tool,
            collision=self.collision,
            scene=self.scene if looking and self.obstacles else None,
            clearance=clearance if looking else 0.0,
        )

    def planner(self, solver: IKSolver) -> IKSolver:
        """A solver to plan motions with: as `solver`, but obstacles count also where contact is ignored.

        Raises:
            JacokinError: as `IKSolver`.
        """
        return solver if self.collision != "ignore" else replace(self, collision="prefer").solver(solver.robot)


@dataclass(frozen=True, slots=True, eq=False)
class Contents:
    """What there is to show, and in which state it begins."""

    setup: Setup
    """What is solved for."""
    axis: int | None
    """The free axis of the tool: 0, 1 or 2; None for none."""
    span: tuple[float, float]
    """Least and largest angle about it [rad]."""
    shapes: tuple[ArmPart, ...]
    """The arm by the shapes that collide, or by sticks."""
    visuals: tuple[ArmPart, ...] | None
    """The arm by the visual meshes of its file; None where there are none."""
    dressed: bool
    """Whether the visual meshes, where there are any, are drawn at first."""
    note: str
    """Why something is not drawn as was asked for; "" where it is."""
    slices: MapSlices | None
    """Of a reachability map."""
    playback: Playback | None
    """A trajectory to play."""
    velocity_limit: Array | None = None
    """(dof,) of tracking and of motions [rad/s]; None for the robot's own."""


COLOURS = np.array([[68, 1, 84], [59, 82, 139], [33, 145, 140], [94, 201, 98], [253, 231, 37]])  # 0 to 1, evenly


class Cells(NamedTuple):
    """The cells of a slice that are reached."""

    positions: NDArray[np.float32]
    """(n, 3) their centres [m]."""
    colours: NDArray[np.uint8]
    """(n, 3) red, green, blue."""
    fractions: Array
    """(n,) fraction of the orientations that are reached, above 0."""


class MapSlices:
    """The slices of a map.

    Attributes:
        heights: (nz,) of the middle of each layer of cells [m].
        caption: what the colours mean, in words.
    """

    def __init__(self, reach: ReachabilityMap) -> None:
        """Read the fractions and the grid of a map."""
        grid = reach.grid
        self._fraction = reach.fraction
        self._spacing = grid.spacing
        self._x, self._y = np.meshgrid(grid.axis(0), grid.axis(1), indexing="ij")
        self.heights: Array = np.asarray(grid.axis(2))
        tool = "" if reach.recipe["tool"] is None else " with a tool"
        self.caption = (
            f"fraction of {reach.orientations.name} that {reach.recipe['frame']}{tool} reaches "
            f"in cells of {1e3 * grid.spacing:g} mm"
        )

    def square(self) -> Triangles:
        """A cell around the origin, visible from above and from below."""
        half = 0.46 * self._spacing  # not half of it: the gaps show where cells end
        corners = np.array([[-half, -half, 0.0], [half, -half, 0.0], [half, half, 0.0], [-half, half, 0.0]])
        return Triangles(corners.astype(np.float32), np.array([[0, 1, 2], [0, 2, 3]], dtype=np.uint32))

    def layer(self, height: float) -> int:
        """The number of the layer whose middle is nearest to a height [m]."""
        return int(np.argmin(np.abs(self.heights - height)))

    def cells(self, layer: int) -> Cells:
        """The cells of a layer."""
        fraction = self._fraction[:, :, layer]
        reached = fraction > 0.0
        count = int(reached.sum())
        positions = np.column_stack((self._x[reached], self._y[reached], np.full(count, self.heights[layer])))
        return Cells(positions.astype(np.float32), colour_fractions(fraction[reached]), fraction[reached])


def colour_fractions(fraction: Array) -> NDArray[np.uint8]:
    """(n, 3) the colours of fractions (n,) from 0 to 1."""
    stops = np.linspace(0.0, 1.0, len(COLOURS))
    return np.column_stack([np.interp(fraction, stops, channel) for channel in COLOURS.T]).round().astype(np.uint8)
