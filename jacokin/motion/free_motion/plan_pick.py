"""`plan_pick`: to an object, around it, and up with it: a free motion, a straight line to the grasp, and the lift."""

from __future__ import annotations

import time
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
from jacokin.model.descriptions.bundled import JACOS
from jacokin.model.gripper import JACO, Gripper
from jacokin.model.obstacles import pose_of
from jacokin.model.scene import Scene
from jacokin.motion.free_motion.handling import (
    AHEAD,
    LEAST_TIME,
    LINES,
    UP,
    Planner,
    ahead_of,
    beside,
    hand_links,
    in_words,
    kinova_fingers,
    one_after_the_other,
)
from jacokin.motion.free_motion.plan_motion import GoalFinder
from jacokin.motion.grasps import Grasp
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.trajectory import MotionStatus, Trajectory

EACH = "each is out of reach, in contact, or the line to it leaves its branch"
TO_THE_GRASP = "straight to the grasp"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Pick(Frozen):
    """To an object and up with it: `motion`, then `approach`, then the fingers close, then `lift`."""

    motion: Trajectory
    """From the start to before the object, in joints."""
    approach: Trajectory | None
    """Straight along the z axis of the pads to the grasp, from rest to rest; None where there is no way."""
    reach: Trajectory | None
    """`motion` and `approach` in one, to be saved in one file; None where there is no way."""
    lift: Trajectory | None
    """Up with the object in the hand, from rest to rest; None without a name of the object, with `lift=0`, or where
    there is no way."""
    grasp: Grasp | None
    """The grasp at the end of `reach`; the fingers stand at its `opening`, or wider, up to there."""
    opening: float | None
    """Of the fingers until they close: angle [rad], or [m] where they slide; None for as the robot was loaded."""
    kinova_fingers: float | None
    """That opening for each finger as Kinova's driver counts, about 0 (open) to 6400 (closed); None for other hands."""
    held: Scene | None
    """The scene once the fingers hold the object, for what comes next; None without a name of the object."""
    success: bool
    """True when the object is reached, and lifted if it is to be."""
    message: str
    """What happened, in a sentence."""

    def __repr__(self) -> str:
        """How long each part takes."""
        return in_words(
            "Pick", self.success, self.message, self.opening, motion=self.motion, approach=self.approach, lift=self.lift
        )


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
    hand: str | None = None,
    distance: float = 0.1,
    lift: float = 0.1,
    speed: float = 0.1,
    time_limit: float = 1.0,
    rng: np.random.Generator | None = None,
    dt: float = 0.01,
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike = ACCELERATION,
) -> Pick:
    """A motion to before an object, a straight line to one of its grasps, and a motion up with the object in the hand.

    The fingers stand as wide as the widest of the grasps asks for. What the object stands on may touch it, or be nearer
    than the clearance, until it is lifted off; meanwhile the object gets no nearer to it.

    Args:
        solver: knows the arm and its scene; its frame is the tool of the grasps.
        start: (dof,) where the arm is [rad].
        grasps: what `grasps.box`, `grasps.cylinder` or `grasps.sphere` return, or grasps of your own.
        obstacle: name of the object in the scene, which the hand may touch on the straight line, and which is lifted;
            None for none.
        hand: the link that may touch it, with what it carries; None for "hand", or where there is no such link for all
            that moves with the solver's frame.
        distance: length of the straight line [m].
        lift: how far up, along the z axis of the base [m]; 0 for not at all.
        speed: along the straight line [m/s].
        time_limit: for all of it but writing the rows [s].
        rng: randomness of the search; None for a fixed seed.
        dt: step from row to row [s].
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2].

    Raises:
        InvalidInputError: a malformed argument, or an opening that the fingers do not have.
        UnknownNameError: no obstacle or link of that name.
        ModelError: the shapes of the description cannot be loaded.
        StructureError: the robot has no closed form.
    """
    checks.instance("solver", solver, IKSolver, "an IKSolver")
    planner = Planner(
        solver.robot,
        speed=speed,
        time_limit=time_limit,
        rng=rng,
        dt=dt,
        velocity_limit=velocity_limit,
        acceleration_limit=acceleration_limit,
    )
    robot = solver.robot
    q = checked_start(robot, start, "start", outside=True)
    ways = _checked_grasps(solver, grasps)
    back = checks.positive("distance", distance, "m")
    up = 0.0 if checks.number("lift", lift, "m") == 0.0 else checks.positive("lift", lift, "m")
    gripper = next((way.gripper for way in ways if way.gripper is not None), None)
    around = _PickScenes(solver, gripper, _widest(ways, gripper), obstacle, hand)
    finder = _Approaches(around, np.clip(q, robot.lower, robot.upper), back, planner)
    found, failed = finder.find(ways), ""
    motion = planner.stand(q, MotionStatus.UNREACHABLE, finder.reason)
    opening, fingers = around.opening, kinova_fingers(robot, around.opening)
    for _ in range(LINES):
        if not found:
            failed = failed or f"no grasp can be approached: {finder.reason}"
            break
        if planner.is_late:
            failed = failed or "the time was over before a grasp was reached"
            break
        motion = planner.move(around.free, q, [each.q for each in found])
        if not motion.success or motion.goal is None:
            failed = failed or motion.message
            break
        taken = found.pop(motion.goal.number)
        line = around.approach(taken, motion.q[-1], planner)
        if isinstance(line, str):
            failed = f"no straight line to a grasp: {line}"
            continue
        message = f"{motion.message}; then {line.duration:.4g} s {TO_THE_GRASP}"
        held, raised = around.holding(line.q[-1]), None
        if held is not None and up > 0.0:
            goal = pin.SE3(taken.at.rotation, taken.at.translation + up * UP)
            raised = planner.move(solver.in_scene(held), line.q[-1], goal, least=LEAST_TIME)
            if not raised.success:
                failed = f"a grasp is reached, but the object cannot be lifted by {up:.3g} m: {raised.message}"
                continue
            message += f"; lift {raised.message}"
        reach = one_after_the_other(motion, line, TO_THE_GRASP)
        return Pick(motion, line, reach, raised, taken.grasp, opening, fingers, held, True, message)
    return Pick(motion, None, None, None, None, opening, fingers, None, False, failed)


def _checked_grasps(solver: IKSolver, grasps: Sequence[Grasp]) -> Sequence[Grasp]:
    """Grasps of the hand of the solver's robot, all of one gripper and of the solver's tool.

    Raises:
        InvalidInputError: they are not, or there are none.
    """
    ways = checks.listed("grasps", grasps, "a list of grasps")
    for way in ways:
        checks.instance("grasps", way, Grasp, "grasps, for example grasps.box(size, pose)")
    if not ways:
        raise InvalidInputError("grasps is empty; see jacokin.motion.grasps")
    _check_hand(solver, [way.gripper for way in ways if way.gripper is not None])
    return ways


def _widest(grasps: Sequence[Grasp], gripper: Gripper | None) -> float | None:
    """The widest opening of the fingers that some grasps ask for; None where none asks for one."""
    openings = [grasp.opening for grasp in grasps if grasp.opening is not None]
    if not openings:
        return None
    return min(openings) if gripper is None else gripper.widest(openings)


class _PickScenes:
    """Solvers for the hand with its fingers open: as it comes, and as it may touch the object.

    Attributes:
        opening: of the fingers; None for as the robot was loaded.
        free: a solver whose hand must touch nothing.
        near: one whose hand may touch the object.
    """

    def __init__(
        self, solver: IKSolver, gripper: Gripper | None, opening: float | None, obstacle: str | None, hand: str | None
    ) -> None:
        """Take a solver for the arm, the gripper, its opening, the name of the object, and the link that may touch it.

        Raises:
            InvalidInputError: the fingers do not have that opening.
            UnknownNameError: no obstacle or link of that name.
        """
        self.opening = opening
        around = solver.verifier.options.scene or Scene()
        shapes = {each.name: each for each in around.obstacles}
        self._shape = None if obstacle is None else shapes[checks.choice("obstacle", obstacle, shapes)]
        self.free = self.near = _opened(solver, around, opening)
        self._scene = self.free.verifier.options.scene or Scene()
        if obstacle is not None and (touching := hand_links(solver.robot, solver.frame, hand)):
            self.near = solver.in_scene(self._scene.allowing(*((link, obstacle) for link in touching)))
        self._open_hand: IKSolver | None = None
        if gripper is not None and gripper is not JACO:  # whose pads have room on both sides of the object
            self._open_hand = IKSolver(
                solver.robot, solver.frame, tool=solver.tool, scene=self._scene, collision="reject"
            )

    def touches(self, q: Array) -> bool:
        """Whether something touches at a grasp, at a configuration (dof,) [rad], that may not."""
        return bool(self.near.verifier.touching(q)) or self._open_hand_touches(q)

    def approach(self, approach: _Approach, start: Array, planner: Planner) -> Trajectory | str:
        """The line to a grasp from a configuration (dof,), or why there is none."""
        line = planner.line(self.near, [approach.before, approach.at], start)
        if isinstance(line, Trajectory) and any(self._open_hand_touches(row) for row in line.q[::5]):
            return "the hand touches the object before it closes"
        return line

    def holding(self, q: Array) -> Scene | None:
        """The scene once the fingers hold the object, at a configuration (dof,); None without an object."""
        if self._shape is None:
            return None
        frame = self.near.frame
        T_frame_object = self.near.robot.forward_kinematics(q, frame=frame).inverse() * pose_of(self._shape)
        return self._scene.attach(self._shape.name, to=frame, pose=T_frame_object)

    def _open_hand_touches(self, q: Array) -> bool:
        """Whether a hand that must not touch the object before it closes touches anything, whatever the clearance."""
        return self._open_hand is not None and bool(self._open_hand.verifier.touching(q))


def _opened(solver: IKSolver, around: Scene, opening: float | None) -> IKSolver:
    """The solver with the fingers at an opening.

    Raises:
        InvalidInputError: the fingers do not have it.
    """
    if opening is None:
        return solver.in_scene(around)
    try:
        return solver.in_scene(around.with_fingers(opening))
    except InvalidInputError as error:
        raise InvalidInputError(
            f"the fingers of {solver.robot.name} cannot stand at the opening {opening:.4g} of the grasps: {error}; "
            "openings are in the unit of the joints of the hand, [m] where they slide, and None leaves them as they are"
        ) from error


def _check_hand(solver: IKSolver, hands: Sequence[Gripper]) -> None:
    """Refuse grasps of another hand than the solver's robot has, or of another tool.

    Raises:
        InvalidInputError: they are.
    """
    robot = solver.robot
    if any(hand is JACO for hand in hands) and robot.source.bundled not in JACOS:
        raise InvalidInputError(
            f"these grasps are for the hand of a Jaco, not for that of {robot.name}: give "
            "gripper=jacokin.model.Gripper.of(robot) to grasps.box, cylinder and sphere"
        )
    for hand in hands:
        if hand is not hands[0]:
            raise InvalidInputError("grasps are of several grippers; a pick is made with one")
        if hand.frame != solver.frame and hand is not JACO:
            raise InvalidInputError(
                f"these grasps pose the frame {hand.frame!r}, but the solver poses {solver.frame!r}: "
                f"Gripper.of(robot, {solver.frame!r}) measures the gripper there"
            )


class _Approaches:
    """Finds straight lines to grasps whose ends are clear and on one branch."""

    def __init__(self, around: _PickScenes, start: Array, back: float, planner: Planner) -> None:
        """Take the solvers, where the arm is (dof,) [rad], the length of the line [m], and who has the time."""
        self._around, self._start, self._back = around, start, back
        self._until = planner.look_until
        self._finder = GoalFinder(around.near, start, planner.randomness, planner.begun, planner.look_until)
        self.reason = EACH

    def find(self, grasps: Sequence[Grasp]) -> list[_Approach]:
        """Lines to some of the grasps, those that begin near to where the arm is first."""
        ends = [(q, grasp, at) for grasp in self._spread(grasps) for q, at in self._ends(grasp)]
        far = [float(np.abs(q - self._start).max()) for q, _, _ in ends]
        found, clear_ends = list[_Approach](), 0
        for k in np.argsort(far, kind="stable").tolist():
            if time.monotonic() >= self._until:
                self.reason = f"{EACH}, as far as there was time to look"
                break
            q, grasp, at = ends[k]
            if self._around.touches(q):
                continue
            before = at * pin.SE3(np.eye(3), -self._back * ahead_of(grasp.gripper))
            begins = beside(self._around.free, before, q)
            if begins is None:
                clear_ends += 1
                continue
            found.append(_Approach(grasp, before, at, begins))
            if len(found) == AHEAD:
                break
        if clear_ends and not found and self.reason == EACH:
            self.reason = (
                f"grasps are within reach, but no clear line of {self._back:.3g} m to one: try a smaller distance"
            )
        return found

    def _spread(self, grasps: Sequence[Grasp]) -> Iterator[Grasp]:
        """The grasps in an order in which the first ones are from all sides, as long as there is time."""
        for k in np.random.default_rng(DEFAULT_RANDOM_SEED).permutation(len(grasps)).tolist():
            if self._finder.is_late:
                self.reason = f"{EACH}, as far as there was time to look"
                break
            yield grasps[k]

    def _ends(self, grasp: Grasp) -> Iterator[tuple[Array, pin.SE3]]:
        """Configurations at a grasp (dof,) [rad], and the pose of the tool there."""
        for goal in self._finder.find(0, grasp, self._finder.check(0, grasp)):
            yield goal.q, grasp.target.at(goal.parameter or 0.0)
