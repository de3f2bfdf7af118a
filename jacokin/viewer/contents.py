"""`Contents`, what a viewer offers to show, and `Setup`, what it solves for; pages may change both.

`Playback` is a trajectory that is played: of this package, a file of another program, or a recording of ROS.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.solver import IKSolver
from jacokin.logs import Log, Recording
from jacokin.logs.bag import ENDINGS as LOGS
from jacokin.logs.motion_files import read_motion
from jacokin.model import checks
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene
from jacokin.motion.trajectory import Trajectory
from jacokin.viewer.drawing import ArmPart, Triangles

if TYPE_CHECKING:
    from jacokin.reachability import ReachabilityMap


SPEEDS = (0.1, 4.0)  # least and largest, of the recorded one


class Playback:
    """A trajectory and the time it is at: it plays, pauses, can be scrubbed and changes its speed.

    Attributes:
        commanded_t: (m,) times of what was commanded [s]; none where that is not known.
        commanded_q: (m, dof) commanded joint angles [rad].
    """

    def __init__(self, trajectory: Trajectory | Recording | str | Path, robot: Robot) -> None:
        """Read the trajectory, and check it against the robot.

        Args:
            trajectory: a `Trajectory`, or a file: .csv and .npz of theirs, .json of ROS, .kinova.csv; or a `Recording`
                of a log, or the file of one: .bag, .mcap or .db3, of which what was measured is played.
            robot: whose joints it moves. The columns of .kinova.csv have no names; those of .json come in any order,
                and may have one prefix before all names, such as j2n6s300_.

        Raises:
            InvalidInputError: not a trajectory or no such file; other joints, or a prefix that is the name of another
                bundled robot; no rows, or times that do not increase; as `Log.recording`.
            MissingExtraError: a log without rosbags.
        """
        if isinstance(trajectory, str | Path) and Path(trajectory).suffix in LOGS:
            trajectory = Log(trajectory, robot).recording()
        name = "trajectory"
        if isinstance(trajectory, str | Path):
            name = f"{trajectory}: {name}"
            t, q, _ = read_motion(trajectory, robot)
        else:
            t, q = _columns(trajectory, robot)
        q = checks.matrix(name, q, robot.dof, "rad")
        if t.ndim != 1 or not len(t) or len(q) != len(t) or not np.isfinite(t).all() or (np.diff(t) <= 0.0).any():
            raise InvalidInputError(f"{name} must have rows at finite times that increase")
        self.t, self.q = t - t[0], q
        self.commanded_t: Array = np.zeros(0)
        self.commanded_q: Array = np.zeros((0, robot.dof))
        if isinstance(trajectory, Recording):
            self.commanded_t, self.commanded_q = trajectory.commanded_t, trajectory.commanded_q
        self.time = 0.0
        self.speed = 1.0
        self.playing = False

    @property
    def duration(self) -> float:
        """Length of the trajectory at its own speed [s]."""
        return float(self.t[-1])

    @property
    def said(self) -> str:
        """How far it is, in words."""
        return f"{self.time:.2f} of {self.duration:.2f} s"

    def rows(self, most: int) -> NDArray[np.intp]:
        """Numbers of at most so many rows, evenly from the first to the last."""
        return np.unique(np.linspace(0, len(self.t) - 1, min(len(self.t), most)).astype(np.intp))

    def scrub(self, time: float) -> None:
        """Go to a time [s]; one that is not in the trajectory is brought to its nearer end."""
        self.time = min(max(checks.number("time", time, "s"), 0.0), self.duration)

    def set_speed(self, speed: float) -> None:
        """Set the speed, as a multiple of the recorded one, brought within `SPEEDS`."""
        self.speed = min(max(checks.number("speed", speed), SPEEDS[0]), SPEEDS[1])

    def toggle(self) -> None:
        """Pause; or play on, from the beginning when it is over."""
        if not self.playing and self.time >= self.duration:
            self.time = 0.0
        self.playing = not self.playing

    def advance(self, elapsed: float) -> Array:
        """Let time pass on the clock [s], up to the end; (dof,) where the arm is then [rad]."""
        if self.playing:
            self.time = min(self.time + self.speed * elapsed, self.duration)
            self.playing = self.time < self.duration
        return self.at(self.time)

    def at(self, time: float) -> Array:
        """(dof,) joint angles at a time [s], on straight lines between rows [rad]."""
        return np.array([np.interp(time, self.t, column) for column in self.q.T])

    def commanded_at(self, time: float) -> Array | None:
        """(dof,) what was commanded at a time [s], as `at`; None before the first command, and where none is known."""
        if not len(self.commanded_t) or time < self.commanded_t[0]:
            return None
        return np.array([np.interp(time, self.commanded_t, column) for column in self.commanded_q.T])


def _columns(trajectory: Trajectory | Recording, robot: Robot) -> tuple[Array, Array]:
    """Times and angles of a trajectory of this package, or of anything that has them."""
    try:
        names, t, q = tuple(trajectory.joint_names), np.array(trajectory.t, dtype=np.float64), trajectory.q
    except (AttributeError, TypeError, ValueError) as error:
        raise InvalidInputError(f"trajectory must be a Trajectory or a file, got {checks.shown(trajectory)}") from error
    if names != robot.joint_names:
        raise InvalidInputError(f"trajectory has the joints {', '.join(names)}; {robot.name} has others")
    return t, q


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
