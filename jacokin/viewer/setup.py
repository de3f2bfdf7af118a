"""What the viewer solves for, which pages may change: frame, tool, contact, obstacles and clearance."""

from __future__ import annotations

from dataclasses import dataclass

import pinocchio as pin

from jacokin.ik.options import COLLISION as COLLISION
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene


@dataclass(frozen=True, slots=True, eq=False)
class Setup:
    """Arguments of a solver."""

    frame: str
    """The frame that is brought to the target."""
    tool: pin.SE3 | None
    """T_frame_tool, a constant pose after the frame."""
    collision: str
    """Contact: "ignore", "report" or "reject"."""
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
