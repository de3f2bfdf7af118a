"""`Contents`, what a viewer offers to show, and `Setup`, what it solves for; pages may change both."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pinocchio as pin

from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene
from jacokin.viewer.drawing import ArmPart
from jacokin.viewer.map_slices import MapSlices
from jacokin.viewer.playback import Playback


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
