"""`plan_pick`: to an object and around it, by a free motion and a straight line at its end."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.results import Frozen
from jacokin.ik.seeds import DEFAULT_RANDOM_SEED, checked_start
from jacokin.ik.solver import IKSolver
from jacokin.model import checks
from jacokin.model.obstacles import pose_of
from jacokin.model.scene import Scene
from jacokin.motion.free_motion.plan_motion import GoalFinder, plan_motion
from jacokin.motion.grasps import Grasp
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.planning.plan import plan_path
from jacokin.motion.trajectory import Goal, Trajectory

HAND = "hand"  # the link whose contact with the object is allowed, with the fingers that it carries
AHEAD = 40  # configurations before grasps among which the free motion chooses
LONGEST = 1.0  # [rad] no joint moves farther along the straight line
LINES = 5  # straight lines that are tried


@dataclass(frozen=True, slots=True, eq=False)
class Pick(Frozen):
    """A way to an object: first `motion`, then `approach`."""

    motion: Trajectory
    """From the start to before the object, in joints."""
    approach: Trajectory | None
    """Straight along the tool's z axis to the grasp, from rest to rest; None where there is no way."""
    grasp: Grasp | None
    """The grasp at its end; the fingers stand at its `opening`, or wider, all along."""
    opening: float
    """Angle of the fingers all along [rad]."""
    held: Scene | None
    """The scene once the fingers hold the object, for what comes next; None without a name of the object."""
    message: str
    """What happened, in a sentence."""

    @property
    def success(self) -> bool:
        """True when the object is reached."""
        return self.approach is not None


class _Approach(NamedTuple):
    """A straight line to a grasp."""

    grasp: Grasp
    before: pin.SE3
    """T_base_tool where it begins."""
    at: pin.SE3
    """T_base_tool at the grasp."""
    q: Array
    """(dof,) where it begins [rad]."""


def plan_pick(
    solver: IKSolver,
    start: ArrayLike,
    grasps: Sequence[Grasp],
    *,
    obstacle: str | None = None,
    hand: str = HAND,
    distance: float = 0.1,
    speed: float = 0.1,
    time_limit: float = 1.0,
    rng: np.random.Generator | None = None,
    dt: float = 0.01,
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike = ACCELERATION,
) -> Pick:
    """A motion to before an object, and a straight line to one of its grasps.

    The fingers stand as wide as the widest of the grasps asks for.

    Args:
        solver: knows the arm and its scene; its frame is the tool of the grasps.
        start: (dof,) where the arm is [rad].
        grasps: what `grasps.box`, `grasps.cylinder` or `grasps.sphere` return.
        obstacle: name of the object in the scene, which the hand may touch on the straight line; None for none.
        hand: the link that may touch it, with what it carries.
        distance: length of the straight line [m].
        speed: along it [m/s].
        time_limit: for the search of the free motion [s].
        rng: randomness of the search; None for a fixed seed.
        dt: sampling step [s].
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2].

    Raises:
        InvalidInputError: a malformed argument.
        UnknownNameError: no obstacle or link of that name.
        StructureError: the robot has no closed form.
    """
    checks.instance("solver", solver, IKSolver, "an IKSolver")
    robot = solver.robot
    q = checked_start(robot, start, "start", noise=0.0)
    ways = checks.listed("grasps", grasps, "a list of grasps")
    for way in ways:
        checks.instance("grasps", way, Grasp, "grasps, for example grasps.box(size, pose)")
    if not ways:
        raise InvalidInputError("grasps is empty; see jacokin.motion.grasps")
    back = checks.positive("distance", distance, "m")
    generator = np.random.default_rng(DEFAULT_RANDOM_SEED) if rng is None else checks.generator("rng", rng)
    opening = min(way.opening for way in ways)
    around = (solver.verifier.options.scene or Scene()).with_fingers(opening)
    shapes = {each.name: each for each in around.obstacles}
    shape = None if obstacle is None else shapes[checks.choice("obstacle", obstacle, shapes)]
    free = solver.in_scene(around)
    near = free if obstacle is None else solver.in_scene(around.allowing((hand, obstacle)))
    finder = _Approaches(near, free, q, back, generator)
    found = finder.find(ways)
    if not found:
        still = plan_motion(free, q, q, dt=dt)
        return Pick(still, None, None, opening, None, f"no grasp can be approached: {finder.reason}")
    failed = ""
    for _ in range(LINES):
        motion = plan_motion(
            free,
            q,
            [each.q for each in found],
            time_limit=time_limit,
            rng=generator,
            dt=dt,
            velocity_limit=velocity_limit,
            acceleration_limit=acceleration_limit,
        )
        if not motion.success or motion.goal is None:
            return Pick(motion, None, None, opening, None, motion.message)
        taken = found[motion.goal.number]
        line = plan_path(
            near,
            [taken.before, taken.at],
            dt,
            speed=speed,
            timing="slow",
            start=motion.q[-1],
            velocity_limit=velocity_limit,
            acceleration_limit=acceleration_limit,
        )
        if line.success:
            held = None
            if shape is not None:
                T_frame_object = robot.forward_kinematics(line.q[-1], frame=solver.frame).inverse() * pose_of(shape)
                held = around.attach(shape.name, to=solver.frame, pose=T_frame_object)
            message = f"{motion.message}; then {line.duration:.4g} s straight to the grasp"
            return Pick(motion, line, taken.grasp, opening, held, message)
        failed = line.message
        del found[motion.goal.number]
        if not found:
            break
    return Pick(motion, None, None, opening, None, f"no straight line to a grasp: {failed}")


class _Approaches:
    """Finds straight lines to grasps whose ends are clear and on one branch."""

    def __init__(self, near: IKSolver, free: IKSolver, start: Array, back: float, rng: np.random.Generator) -> None:
        """Take a solver that lets the hand touch the object, one that does not, and where the arm is [rad]."""
        self._near, self._free, self._start = near, free, start
        self._back = pin.SE3(np.eye(3), np.array([0.0, 0.0, -back]))
        self._finder = GoalFinder(near, start, rng)
        self.reason = "each is out of reach, in contact, or the line to it leaves its branch"

    def find(self, grasps: Sequence[Grasp]) -> list[_Approach]:
        """Lines to some of the grasps, those that begin near to where the arm is first."""
        ends = [(goal.q, grasp, at) for grasp in grasps for goal, at in self._ends(grasp)]
        far = [float(np.abs(q - self._start).max()) for q, _, _ in ends]
        found = list[_Approach]()
        for k in np.argsort(far, kind="stable").tolist():
            q, grasp, at = ends[k]
            if self._near.verifier.touching(q):
                continue
            before = at * self._back
            result = self._free.solve(before, seed=q, closest=False)
            if result.success and not result.touching and np.abs(result.q - q).max() <= LONGEST:
                found.append(_Approach(grasp, before, at, result.q))
                if len(found) == AHEAD:
                    break
        return found

    def _ends(self, grasp: Grasp) -> Iterator[tuple[Goal, pin.SE3]]:
        """Configurations at a grasp, and the pose of the tool there."""
        goals, _ = self._finder.find(0, grasp)
        for goal in goals:
            yield goal, grasp.target.at(goal.parameter or 0.0)
