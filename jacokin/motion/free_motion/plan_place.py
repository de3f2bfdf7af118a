"""`plan_place`: what the hand holds is carried over a place, put down along a straight line, and left there."""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.fixed_joints import SIX
from jacokin.ik.results import Frozen
from jacokin.ik.seeds import DEFAULT_RANDOM_SEED, checked_start
from jacokin.ik.solver import IKSolver
from jacokin.model import checks, poses
from jacokin.model.contact import Pair
from jacokin.model.gripper import JACO, Gripper
from jacokin.model.obstacles import pose_of
from jacokin.model.poses import FreeAxis
from jacokin.model.scene import Scene, checked_scene
from jacokin.motion.free_motion.handling import (
    AHEAD,
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
from jacokin.motion.free_motion.leaving import DEEPEST, Leaving
from jacokin.motion.free_motion.plan_motion import GoalFinder, list_aims, search_of
from jacokin.motion.free_motion.plan_pick import Pick
from jacokin.motion.grasps import checked_gripper
from jacokin.motion.joint_motion import ACCELERATION
from jacokin.motion.trajectory import MotionStatus, Trajectory

TURNED = float(np.radians(15.0))  # between angles about a free axis that are tried on six and seven joints
DOWN = "straight down to the place"


@poses.giving_copies("pose")
@dataclass(frozen=True, slots=True, eq=False, repr=False)
class PutDown(Frozen):
    """To a place with an object and away without it: `carry`, then `lower`, then the fingers open, then `retreat`."""

    carry: Trajectory
    """From the start to above the place, in joints."""
    lower: Trajectory | None
    """Straight down with the object, from rest to rest; None where there is no way."""
    bring: Trajectory | None
    """`carry` and `lower` in one, to be saved in one file; None where there is no way."""
    retreat: Trajectory | None
    """Straight back along the z axis of the pads, without the object, from rest to rest; None where there is no way."""
    pose: pin.SE3 | None
    """T_base_object where it is put down, as forward kinematics has it; None where there is no way."""
    target: int | None
    """Number of the target that was taken; None where there is no way."""
    opening: float | None
    """Of the fingers once they open, and on the way back: angle [rad], or [m] where they slide; None for as the robot
    was loaded."""
    kinova_fingers: float | None
    """That opening for each finger as Kinova's driver counts, about 0 (open) to 6400 (closed); None for other hands."""
    scene: Scene | None
    """The scene in which the object stands there, for what comes next; None where there is no way."""
    success: bool
    """True when the object is put down, and the hand is back."""
    message: str
    """What happened, in a sentence."""

    def __repr__(self) -> str:
        """How long each part takes."""
        return in_words(
            "PutDown",
            self.success,
            self.message,
            self.opening,
            carry=self.carry,
            lower=self.lower,
            retreat=self.retreat,
        )


def plan_place(
    solver: IKSolver,
    start: ArrayLike,
    held: Pick | Scene,
    target: pin.SE3 | ArrayLike | FreeAxis | Sequence[Any],
    *,
    obstacle: str | None = None,
    gripper: Gripper | None = None,
    hand: str | None = None,
    height: float = 0.1,
    distance: float = 0.1,
    speed: float = 0.1,
    time_limit: float = 1.0,
    rng: np.random.Generator | None = None,
    dt: float = 0.01,
    velocity_limit: ArrayLike | None = None,
    acceleration_limit: ArrayLike = ACCELERATION,
) -> PutDown:
    """A motion with an object in the hand to above a place, straight down, and straight back once the fingers open.

    What touches the object where it is put down, up to 1 cm deep, or is nearer to it there than the clearance, may be
    so at the end of the line down, too: on the line it is nowhere nearer, and what parts stays apart, as a start in
    contact is left by `plan_motion`, backwards. The start of the carrying itself is left that way.

    Args:
        solver: knows the arm; its frame is the tool that grasped the object. Its own scene is not looked at.
        start: (dof,) where the arm is [rad], for example at the end of `Pick.lift`.
        held: what `plan_pick` returned, or a scene in which the arm holds the object (`Scene.attach`) and the fingers
            stand as wide as they are to open.
        target: where the object is to be: T_base_object, a `FreeAxis` about which it may turn, or a list of them, any
            of which will do. The frame is that of the shape; a sphere has the axes of the frame that it is attached to.
        obstacle: name of the object; None for the only one that the arm holds.
        gripper: the hand, which goes back against the z axis of its pads; None for that of the grasp, or of a scene
            `Gripper.of(robot, frame)`.
        hand: the link that may touch the object on the way back, with what it carries; None as in `plan_pick`.
        height: length of the line down, along the z axis of the base [m].
        distance: length of the line back [m].
        speed: along both [m/s].
        time_limit: for all of it but writing the rows [s].
        rng: randomness of the search; None for a fixed seed.
        dt: step from row to row [s].
        velocity_limit: (dof,) or one for all [rad/s]; None for the robot's own.
        acceleration_limit: (dof,) or one for all [rad/s^2].

    Raises:
        InvalidInputError: a malformed argument, a pick that holds nothing, or an object that does not move with the
            solver's frame.
        UnknownNameError: the arm holds no object of that name, or has no such link.
        ModelError: the shapes of the description cannot be loaded, or its gripper cannot be measured.
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
    load = _load(solver, held, obstacle, gripper)
    targets = [_checked_target(each) for each in list_aims(target, "target", "a pose, a FreeAxis")]
    down, back = checks.positive("height", height, "m"), checks.positive("distance", distance, "m")
    around = _PlaceScenes(solver, load, hand_links(robot, solver.frame, hand))
    finder = _Descents(around, np.clip(q, robot.lower, robot.upper), down, back, planner)
    found, failed = finder.find(targets), ""
    carry = planner.stand(q, finder.status, finder.reason)
    opening = load.scene.finger_angle
    fingers = kinova_fingers(robot, opening)
    for _ in range(LINES):
        if not found:
            failed = failed or f"{load.name} cannot be put down: {finder.reason}"
            break
        if planner.is_late:
            failed = failed or "the time was over before the object was put down"
            break
        carry = planner.move(around.held, q, [each.q for each in found])
        if not carry.success or carry.goal is None:
            failed = failed or carry.message
            break
        taken = found.pop(carry.goal.number)
        lower = around.lower(taken, carry.q[-1], planner)
        if isinstance(lower, str):
            failed = lower
            continue
        if (pair := around.opening(taken, lower.q[-1])) is not None:
            failed = f"the fingers cannot open at the place: {pair[0]} and {pair[1]} would touch"
            continue
        retreat = around.retreat(taken, lower.q[-1], planner)
        if isinstance(retreat, str):
            failed = retreat
            continue
        message = f"{carry.message}; then {lower.duration:.4g} s {DOWN}, and {retreat.duration:.4g} s back"
        return PutDown(
            carry=carry,
            lower=lower,
            bring=one_after_the_other(carry, lower, DOWN),
            retreat=retreat,
            pose=(pose := around.pose_at(lower.q[-1])),
            target=taken.number,
            opening=opening,
            kinova_fingers=fingers,
            scene=around.standing(pose),
            success=True,
            message=message,
        )
    return PutDown(carry, None, None, None, None, None, opening, fingers, None, False, failed)


class _Load(NamedTuple):
    """What the hand holds."""

    scene: Scene
    """In which it is held, the fingers as they are to open."""
    name: str
    """Of the object."""
    T_tool_object: pin.SE3
    """Where it is in the tool."""
    gripper: Gripper | None
    """The hand; None for one that goes back against the z axis of the tool."""


def _load(solver: IKSolver, held: Pick | Scene, obstacle: str | None, gripper: Gripper | None) -> _Load:
    """What the hand holds, checked; errors as of `plan_place`."""
    robot = solver.robot
    hand = None if gripper is None else checked_gripper(gripper)
    if isinstance(held, Pick):
        if held.held is None or held.grasp is None:
            raise InvalidInputError(f"held is a pick that holds nothing (obstacle=None, or {held.message!r})")
        scene, hand = held.held, hand or held.grasp.gripper
    else:
        scene = checked_scene("held", held)
        hand = hand or Gripper.of(robot, solver.frame)
    if hand is not None and hand is not JACO and hand.frame != solver.frame:
        raise InvalidInputError(
            f"the gripper poses the frame {hand.frame!r}, but the solver poses {solver.frame!r}: give a solver of that "
            f"frame, or gripper=Gripper.of(robot, {solver.frame!r})"
        )
    known = {each.name: each for each in scene.attached}
    if not known:
        raise InvalidInputError("held is a scene in which the arm holds nothing; see Scene.attach")
    if obstacle is None and len(known) > 1:
        raise InvalidInputError(f"the arm holds {', '.join(known)}: say which with obstacle=")
    name = checks.choice("held object", obstacle or next(iter(known)), known)
    to, model = known[name].to, robot.pin_model
    frames = [model.frames[robot.frame_id(each)] for each in (to, solver.frame)]
    if frames[0].parentJoint != frames[1].parentJoint:
        raise InvalidInputError(f"{name} is held by {to!r}, which does not move with {solver.frame!r} of the solver")
    T_frame_object = frames[1].placement.actInv(frames[0].placement) * pose_of(known[name].shape)
    return _Load(scene, name, T_frame_object if solver.tool is None else solver.tool.actInv(T_frame_object), hand)


class _Descent(NamedTuple):
    """A straight line down to a place, and one back from there."""

    number: int
    """Of the target."""
    T_base_object: pin.SE3
    """The object at the place."""
    above: pin.SE3
    """T_base_tool where the line down begins."""
    at: pin.SE3
    """T_base_tool at the place."""
    away: pin.SE3
    """T_base_tool where the line back ends."""
    q: Array
    """(dof,) where the line down begins [rad]."""
    supports: frozenset[Pair]
    """Pairs of an obstacle and the object that are near each other at the place."""


class _PlaceScenes:
    """Solvers for the object in the hand, for it at its place, and for the open hand that leaves it.

    Attributes:
        load: what is held.
        held_scene: the object in the hand, with the fingers shut on it.
        held: a solver for that.
    """

    def __init__(self, solver: IKSolver, load: _Load, hand: Sequence[str]) -> None:
        """Take a solver for the arm, and the links that may touch the object as the hand leaves it."""
        self.load, self._solver, self._hand = load, solver, hand
        self.held_scene = load.scene.with_fingers(self._shut())
        self.held = solver.in_scene(self.held_scene)
        self._obstacles = frozenset(load.scene.names)
        self._lowering = dict[frozenset[Pair], IKSolver]()

    @property
    def _leaving(self) -> Leaving:
        """What judges motions of the arm with the object that are in contact at one end."""
        return search_of(self.held).leaving

    def pose_at(self, q: Array) -> pin.SE3:
        """T_base_object while it is held, at a configuration (dof,)."""
        return self.held.verifier.tool_pose(q) * self.load.T_tool_object

    def about_object(self) -> IKSolver:
        """A solver that poses the object."""
        T, tool = self.load.T_tool_object, self._solver.tool
        return self._solver.with_tool(T if tool is None else tool * T)

    def standing(self, T_base_object: pin.SE3) -> Scene:
        """The scene in which the object stands at a place."""
        return self.load.scene.detach(self.load.name, pose=T_base_object)

    def without(self, T_base_object: pin.SE3) -> IKSolver:
        """A solver for the arm without the object, which stands at a place."""
        return self._solver.in_scene(self.standing(T_base_object))

    def let_go(self, T_base_object: pin.SE3) -> IKSolver:
        """A solver for the arm whose hand may touch the object, which stands at a place."""
        links = ((link, self.load.name) for link in self._hand)
        return self._solver.in_scene(self.standing(T_base_object).allowing(*links))

    def supports(self, q: Array) -> frozenset[Pair] | str:
        """Pairs of an obstacle and the object that are near each other at a configuration (dof,) where it is put down.

        Or why it cannot be put down there, in words.
        """
        contact, near, found = self.held.verifier.contact, self._leaving.near(q), set[Pair]()
        assert contact is not None
        for (a, b), distance in zip(near.pairs.tolist(), near.distances.tolist(), strict=True):
            pair = contact.ordered(a, b)
            if self.load.name not in pair or self._obstacles.isdisjoint(pair):
                continue
            if distance < -DEEPEST:
                return f"{pair[0]} and {pair[1]} would overlap by {-distance:.3g} m, more than {DEEPEST} m"
            found.add(pair)
        supports = frozenset(found)
        touching = self._lowered_by(supports).verifier.touching(q)
        return f"{touching[0][0]} and {touching[0][1]} would touch there" if touching else supports

    def lower(self, descent: _Descent, start: Array, planner: Planner) -> Trajectory | str:
        """The line down from a configuration (dof,), or why there is none."""
        solver = self._lowered_by(descent.supports)
        line = planner.line(solver, [descent.above, descent.at], start)
        if isinstance(line, str):
            return f"no straight line down: {line}"
        pair = self._leaving.hindrance(line.q[::-1])
        if pair is not None:
            return f"no straight line down: {pair[0]} and {pair[1]} are nearer on it than at the place"
        return line

    def retreat(self, descent: _Descent, start: Array, planner: Planner) -> Trajectory | str:
        """The line back from a configuration (dof,) at the place, or why there is none."""
        hand, T = self.load.gripper, descent.T_base_object
        line = planner.line(self.let_go(T), [descent.at, descent.away], start)
        if isinstance(line, str):
            return f"no straight line back: {line}"
        if hand is not None and hand is not JACO:  # whose pads have room on both sides of the object
            contact = self.standing(T).contact(self._solver.robot)
            if any(contact.in_the_way(q, end) is not None for q, end in pairwise(line.q)):
                return "no straight line back: the open hand touches the object"
        if touching := self.without(T).verifier.touching(line.q[-1]):
            return f"no straight line back: {touching[0][0]} and {touching[0][1]} touch at its end"
        return line

    def opening(self, descent: _Descent, q: Array) -> Pair | None:
        """What the fingers would touch, but the object, while they open at a configuration (dof,); or None."""
        opened, shut = self.load.scene.finger_angle, self.held_scene.finger_angle
        if opened is None or shut is None:
            return None
        scene = self.standing(descent.T_base_object)
        for value in np.linspace(shut, opened, 6).tolist()[1:-1]:
            pairs = scene.with_fingers(value).contact(self._solver.robot).all_touching(q)
            if others := [pair for pair in pairs if self.load.name not in pair]:
                return others[0]
        return None

    def _shut(self) -> float | None:
        """The opening at which the fingers hold the object, by halving what is between open and shut."""
        from jacokin.model.mujoco_twin import shapes_of_links

        load, robot, opened = self.load, self._solver.robot, self.load.scene.finger_angle
        links = shapes_of_links(robot)
        fingers = frozenset[str]().union(*(links[checks.choice("link", link, links)] for link in self._hand))
        if load.gripper is None or opened is None:  # nothing is known of how they move
            return opened
        q = robot.home
        scene = self.standing(self._solver.verifier.tool_pose(q) * load.T_tool_object)

        def touch(opening: float) -> bool:
            pairs = scene.with_fingers(opening).contact(robot).all_touching(q)
            return any(load.name in pair and not fingers.isdisjoint(pair) for pair in pairs)

        free, shut = opened, float(load.gripper.openings[0])
        if not touch(shut):
            return shut
        for _ in range(6):  # times, to 1 or 2 mm
            middle = 0.5 * (free + shut)
            free, shut = (free, middle) if touch(middle) else (middle, shut)
        return free

    def _lowered_by(self, supports: frozenset[Pair]) -> IKSolver:
        """A solver for the object in the hand, which may touch what it is put on."""
        if supports not in self._lowering:
            self._lowering[supports] = self._solver.in_scene(self.held_scene.allowing(*sorted(supports)))
        return self._lowering[supports]


class _Descents:
    """Finds straight lines down to places, and back from there, whose ends are clear and on one branch.

    Attributes:
        status: why there are none.
        reason: the same in words.
    """

    def __init__(self, around: _PlaceScenes, start: Array, height: float, distance: float, planner: Planner) -> None:
        """Take the scenes, where the arm is (dof,) [rad], the lengths of the lines [m], and who has the time."""
        self._around, self._start, self._planner = around, start, planner
        self._height, self._distance = height, distance
        self._finder = self._finder_of(around.held)
        self.status, self.reason = MotionStatus.UNREACHABLE, ""

    def _finder_of(self, solver: IKSolver) -> GoalFinder:
        return GoalFinder(solver, self._start, self._planner.randomness, self._planner.begun, self._planner.look_until)

    def find(self, targets: Sequence[pin.SE3 | FreeAxis]) -> list[_Descent]:
        """Lines to some of the targets, those that end near to where the arm is first."""
        ends = list(self._ends(targets))
        if not ends:
            self.reason = self._why_none(targets)
            return []
        found, faults, clear = list[_Descent](), Counter[str](), False
        solvers = dict[tuple[int, int], tuple[IKSolver, IKSolver]]()  # by number of the pose
        for k in np.argsort([float(np.abs(end.q - self._start).max()) for end in ends], kind="stable").tolist():
            if time.monotonic() >= self._planner.look_until:
                faults["there was no time to look at every configuration"] = len(ends)
                break
            q, place, number = ends[k]
            T = self._around.pose_at(q)
            supports = self._around.supports(q)
            if isinstance(supports, str):
                faults[supports] += 1
                continue
            if place not in solvers:
                solvers[place] = self._around.let_go(T), self._around.without(T)
            let_go, without = solvers[place]
            if touching := let_go.verifier.touching(q):
                faults[f"{touching[0][0]} and {touching[0][1]} would touch there once the fingers are open"] += 1
                continue
            clear = True
            at = self._around.held.verifier.tool_pose(q)
            above = pin.SE3(at.rotation, at.translation + self._height * UP)
            begins = beside(self._around.held, above, q)
            if begins is None:
                faults[f"no clear line of {self._height:.3g} m down to it: try a smaller height"] += 1
                continue
            away = at * pin.SE3(np.eye(3), -self._distance * ahead_of(self._around.load.gripper))
            if beside(without, away, q) is None:
                faults[f"no clear line of {self._distance:.3g} m back from it: try a smaller distance"] += 1
                continue
            found.append(_Descent(number, T, above, at, away, begins, supports))
            if len(found) == AHEAD:
                break
        self.status = MotionStatus.NO_WAY if clear else MotionStatus.GOAL_IN_CONTACT
        self.reason = "; ".join(fault for fault, _ in faults.most_common(2))
        return found

    def _ends(self, targets: Sequence[pin.SE3 | FreeAxis]) -> Iterator[_End]:
        """Configurations that have the object at a target, as long as there is time."""
        around, few = self._around, self._around.held.robot.dof < SIX
        places = [(number, T) for number, target in enumerate(targets) for T in _poses(target, few)]
        finder = self._finder_of(around.about_object()) if any(isinstance(T, FreeAxis) for _, T in places) else None
        order = np.random.default_rng(DEFAULT_RANDOM_SEED).permutation(len(places)).tolist()
        for place, (number, T) in enumerate(places[k] for k in order):
            if self._finder.is_late:
                break
            if isinstance(T, FreeAxis):
                assert finder is not None
                for each, goal in enumerate(finder.find(0, T, finder.check(0, T))):
                    yield _End(goal.q, (place, each), number)
                continue
            at = T * around.load.T_tool_object.inverse()
            for goal in self._finder.find(0, at, self._finder.check(0, at)):
                yield _End(goal.q, (place, 0), number)

    def _why_none(self, targets: Sequence[pin.SE3 | FreeAxis]) -> str:
        """Why no configuration has the object at a target."""
        if time.monotonic() >= self._planner.look_until:
            return "the time was over before a configuration at the place was found"
        solver = self._around.about_object()
        return self._finder_of(solver).why_none(targets)


class _End(NamedTuple):
    """A configuration that has the object at a target."""

    q: Array
    """(dof,) [rad]."""
    place: tuple[int, int]
    """Number of the pose."""
    number: int
    """Number of the target."""


def _poses(target: pin.SE3 | FreeAxis, few: bool) -> list[pin.SE3 | FreeAxis]:
    """A target as poses at some angles about its axis; arms of few joints have to find the angles."""
    if few or not isinstance(target, FreeAxis):
        return [target]
    low, high = target.range
    return [target.at(angle) for angle in np.linspace(low, high, 1 + max(1, int(np.ceil((high - low) / TURNED))))]


def _checked_target(target: Any) -> pin.SE3 | FreeAxis:
    return target if isinstance(target, FreeAxis) else poses.checked_pose(target, "target")
