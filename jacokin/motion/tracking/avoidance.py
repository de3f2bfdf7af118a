"""The tracker's guard against collisions: distances between shapes, and the inequalities that keep them.

Obstacles may move (`moving`). A tick looks at them where they will be at its end; the QP is told how fast they come
nearer.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.kernels.contact.arm import SLIDE
from jacokin.kernels.contact.shapes import CENTRE, LINK, RADIUS, SIZE
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.library import Call
from jacokin.kernels.tracking.near import BUFFER, CLOSING, DISTANCE, NEAR_NUMBERS, NORMAL
from jacokin.kernels.tracking.reach import (
    ASKED,
    BEYOND,
    CLOSE,
    DISTANCES,
    FORESIGHT,
    HORIZON,
    KEPT,
    LEAST,
    LEAVING,
    MOVING,
    NEAR,
    PART,
    TIME_STEP,
    ReachWork,
    make_reach_work,
    try_reach,
)
from jacokin.model import checks
from jacokin.model.contact import Contact
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene, checked_scene
from jacokin.motion.tracking.joint_limits import JointLimits
from jacokin.motion.tracking.moving import MovableShapes, Whereabouts

CLEARANCE = 0.01  # [m] kept between shapes unless told otherwise
COLLISION = ("ignore", "reject")
LOOK_AHEAD = 3.0  # ticks at full speed, and the way to rest, before a pair could come too near: then it is watched
MEASURED = 0.01  # [m] above the distance, from which pairs are always measured
LOOKED_AHEAD = 0.15  # [s] a moving obstacle that would be too near by then is avoided now
NO_PAIRS, NO_NUMBERS = np.empty(0, dtype=np.int64), np.empty((0, NEAR_NUMBERS))


@dataclass(frozen=True, slots=True)
class Distances:
    """Distances at one configuration.

    Attributes:
        bound: (pairs,) each pair is at least this far apart [m].
        near: (near,) numbers of the pairs that were measured and are in the watched range.
        numbers: (near, 8) how they are, see `jacokin.kernels.tracking.near`.
        least: smallest distance [m], inf for none: measured when it is in the watched range, a lower bound when larger.
        exits: directions (3,) in which shapes leave the obstacles they are inside of, by the obstacle's number.
        measured: False where there was no time to measure: then nothing is in `near`, and `bound` still holds.
    """

    bound: Array
    near: NDArray[np.int64]
    numbers: Array
    least: float
    exits: Mapping[int, Array]
    measured: bool = True

    @property
    def distance(self) -> Array:
        """(near,) distances of the pairs that are in the watched range [m]; negative when they overlap."""
        return self.numbers[:, DISTANCE]


class ClearanceGuard:
    """Keeps given pairs of shapes a distance apart. What changes from tick to tick is in `Distances`, `Whereabouts`.

    Attributes:
        shapes: the obstacles that can move.
    """

    def __init__(
        self,
        contact: Contact,
        robot: Robot,
        shapes: MovableShapes,
        pairs: NDArray[np.int64],
        distance: float,
        limits: JointLimits,
        dt: float,
    ) -> None:
        """Prepare the pairs.

        Args:
            contact: the shapes.
            robot: the arm.
            shapes: the obstacles that can move.
            pairs: (n, 2) numbers of shapes, the one nearer to the base first.
            distance: smallest distance allowed [m].
            limits: of the joints.
            dt: control step [s].
        """
        self.shapes, self._dt = shapes, dt
        self._foresight = max(LOOKED_AHEAD, limits.stopping_time)
        self._placed: Array | None = shapes.start.poses
        rows = np.full(len(contact.names), -1)
        rows[shapes.numbers] = np.arange(len(shapes.numbers))
        self._mover = rows[pairs[:, 0]]
        self._names, self._distance = contact.names, distance
        shapes_of_all = contact.geometry.shapes  # obstacles move in arrays of this guard's own
        own = shapes_of_all._replace(numbers=shapes_of_all.numbers.copy())
        self._geometry = contact.geometry._replace(shapes=own)
        self._first, self._second = pairs.T
        links = self._geometry.shapes.integers[:, LINK]
        links = np.where(links > robot.dof, 0, links)  # obstacles stand as still as the base
        joint = np.arange(robot.dof)
        inner, outer = links[pairs].T[:, :, np.newaxis]
        levers = _levers(robot, self._geometry)[self._second] * ((inner <= joint) & (joint < outer))
        self._levers, lever = np.unique(levers, axis=0, return_inverse=True)
        self._lever = lever.reshape(-1)  # of each pair
        way = (LOOK_AHEAD + 0.5 * limits.stopping_time / dt) * (self._levers @ limits.step)
        self._watched = distance + BUFFER + np.maximum(way, MEASURED)
        self._fixed = links[self._first] == 0
        # The kernels take a plane, and any obstacle, as the second shape.
        exchanged = self._first > self._second
        given = np.where(exchanged[:, np.newaxis], pairs[:, ::-1], pairs)
        none = np.zeros(len(pairs), dtype=np.int64)
        self._pairs = np.column_stack([given, exchanged, self._mover, none, links[pairs]])
        self._limits = limits
        self._call: Call[ReachWork] | None = None
        self._held: Distances | None = None  # what the kernel's arrays have
        self._leaves = False

    def __getstate__(self) -> dict[str, Any]:
        """Everything but work arrays."""
        return {**self.__dict__, "_call": None, "_placed": None, "_held": None, "_leaves": False}

    def put(self, where: Whereabouts) -> None:
        """Put obstacles where they are to be measured from now on."""
        if where.poses is self._placed:
            return
        self._placed = None  # until it is done
        numbers, rows = self._geometry.shapes.numbers, self.shapes.numbers
        numbers[rows, :SIZE] = where.poses.reshape(-1, SIZE)
        numbers[rows, CENTRE:RADIUS] = self.shapes.centres(where)
        work = self.work
        work.counts[MOVING] = where.moving
        work.movers.poses[:], work.movers.twists[:], work.movers.speeds[:] = where.poses, where.twists, where.speeds
        work.movers.coming[:-1] = self._foresight * where.speeds
        self._placed = where.poses

    @property
    def work(self) -> ReachWork:
        """The kernel's arrays."""
        return self._ready().work

    def _ready(self) -> Call[ReachWork]:
        """The kernel with its arrays, obstacles not moving."""
        if self._call is None:
            work = make_reach_work(self._geometry, len(self._first), len(self.shapes.numbers), len(self._levers))
            numbers, pairs = work.numbers, work.pairs
            numbers[KEPT], numbers[TIME_STEP], numbers[FORESIGHT] = self._distance, self._dt, self._foresight
            numbers[CLOSE] = self._distance + BUFFER + MEASURED
            work.limits[:] = self._limits.table
            pairs.integers[:], pairs.lever[:], pairs.mover[:] = self._pairs, self._lever, self._mover
            pairs.mover[self._mover < 0] = len(self.shapes.numbers)
            work.levers.lengths[:], work.levers.watched[:] = self._levers.ravel(), self._watched
            work.movers.shapes[:], work.movers.centres[:] = self.shapes.numbers, self.shapes.own_centres
            self._call = Call(try_reach, work)
        return self._call

    def name(self, pair: int) -> str:
        """Names of the two shapes, joined by "~"."""
        return f"{self._names[self._first[pair]]}~{self._names[self._second[pair]]}"

    def start(self, q: Array) -> Distances:
        """Distances at a configuration (dof,) [rad] nothing is known about."""
        return self._measure(q, np.full(len(self._first), -np.inf), {}, beyond=np.inf)

    def move(self, q: Array, before: Distances, step: Array) -> Distances:
        """Distances at `q` (dof,) [rad], a displacement (dof,) [rad] away from where `before` was taken."""
        return self._measure(q, before.bound - self._ways(step), {})

    def refresh(self, q: Array, before: Distances, shift: Array | None) -> Distances:
        """Distances at the same configuration, after obstacles moved by at most `shift` (k,) [m], None for not."""
        return self._measure(q, before.bound, before.exits, shift)

    def unmeasured(self, before: Distances, step: Array, shift: Array | None) -> Distances:
        """What is known of distances after a displacement (dof,) [rad], without measuring."""
        bound = before.bound - self._ways(step)
        if shift is not None:
            bound -= np.append(shift, 0.0)[self._mover]  # -1 for what stands still
        least = float(bound.min(initial=np.inf))
        return Distances(bound, NO_PAIRS, NO_NUMBERS, least, before.exits, measured=False)

    def _ways(self, step: Array) -> Array:
        """(pairs,) how far a displacement (dof,) [rad] moves pairs nearer, at most [m]."""
        return np.asarray(self._levers.dot(np.abs(step))[self._lever])

    def _measure(
        self,
        q: Array,
        bound: Array,
        exits: Mapping[int, Array],
        shift: Array | None = None,
        beyond: float = HORIZON,
    ) -> Distances:
        """Distances at a configuration of the pairs that may be close.

        Args:
            q: (dof,) the configuration [rad].
            bound: (pairs,) each pair was at least so far apart there [m].
            exits: ways out of obstacles.
            shift: (k,) how far obstacles have moved since, at most [m]; None for not.
            beyond: how far beyond the distances in question is measured [m].
        """
        call = self._ready()
        work, self._held = call.work, None
        work.start[:], work.v[:], work.displacement[:], work.pairs.before[:] = q, 0.0, 0.0, bound
        work.movers.shifts[:-1] = 0.0 if shift is None else shift
        work.numbers[BEYOND], work.numbers[PART], work.counts[ASKED] = beyond, 0.0, DISTANCES
        call()
        work.movers.shifts[:] = 0.0
        return self.found(exits)

    def found(self, exits: Mapping[int, Array]) -> Distances:
        """The distances that the kernel found last."""
        work = self.work
        count = int(work.counts[NEAR])
        self._held = Distances(
            work.pairs.bound.copy(),
            work.near[:count].copy(),
            work.rows[:count].copy(),
            float(work.numbers[LEAST]),
            exits,
        )
        return self._held

    def take(self, now: Distances) -> Mapping[int, Array]:
        """Have the kernel go on from distances; returns the `exits` for the coming step."""
        work, held, self._held = self.work, self._held, None
        if now is not held:
            count = work.counts[NEAR] = len(now.near)
            work.pairs.bound[:], work.near[:count], work.rows[:count] = now.bound, now.near, now.numbers
            work.pairs.exact[:], work.numbers[LEAST] = 0, now.least
            work.pairs.exact[now.near] = 1
        exits = self._exits(now)
        if exits or self._leaves:
            leaving = np.isin(self._first, list(exits))
            self._leaves = True  # until none is left
            work.pairs.integers[:, LEAVING] = leaving
            for pair in np.flatnonzero(leaving).tolist():
                work.pairs.exits[pair] = exits[int(self._first[pair])]
            self._leaves = bool(exits)
        return exits

    def _exits(self, now: Distances) -> dict[int, Array]:
        """One way out of each obstacle that something is inside.

        The nearest face differs from shape to shape; each going its own way, a hand would never leave a box. The way
        is that of the deepest shape, kept until nothing is inside any more.
        """
        if now.least >= 0.0:
            return {}
        inside = np.flatnonzero((now.distance < 0.0) & self._fixed[now.near])
        exits: dict[int, Array] = {}
        for row in inside[np.argsort(now.distance[inside])].tolist():
            obstacle = int(self._first[now.near[row]])
            if obstacle not in exits:
                exits[obstacle] = now.exits.get(obstacle, now.numbers[row, NORMAL:CLOSING].copy())
        return exits

    def limiting(self, now: Distances, apart: Iterable[int]) -> list[str]:
        """Names of the pairs at the distance or nearer, and of those by their numbers that are moved apart."""
        near = now.near[now.distance < self._distance + 2.0 * BUFFER].tolist()
        return [self.name(pair) for pair in dict.fromkeys((*near, *apart))]


def _levers(robot: Robot, geometry: Geometry) -> Array:
    """(shapes, dof) how far any point of a shape can be from a joint's origin [m]; 1 for a slide, 0 beyond the link."""
    shapes, arm = geometry.shapes, geometry.arm
    levers = np.zeros((len(shapes.numbers), robot.dof))
    slides = arm.joint_kinds == SLIDE
    travel = np.abs([robot.lower, robot.upper]).max(axis=0)
    for shape, row in enumerate(shapes.numbers):
        reach, link = float(np.linalg.norm(row[CENTRE:RADIUS]) + row[RADIUS]), int(shapes.integers[shape, LINK])
        for joint in reversed(range(link if link <= robot.dof else 0)):
            levers[shape, joint] = 1.0 if slides[joint] else reach
            reach += float(np.linalg.norm(arm.placements[joint, :, 3]))
            reach += float(travel[joint]) if slides[joint] and np.isfinite(travel[joint]) else 0.0
    return levers


def make_guard(
    robot: Robot,
    limits: JointLimits,
    dt: float,
    *,
    scene: Scene | None,
    clearance: float | None,
    collision: str | None,
    self_collision: bool,
    pairs: Sequence[tuple[str, str]] | None,
) -> ClearanceGuard | None:
    """What keeps shapes apart, None for nothing; arguments and errors as in `Tracker`."""
    given = {"scene": scene, "clearance": clearance, "pairs": pairs}
    asked = [name for name, value in given.items() if value is not None]
    mode = checks.choice("collision", ("reject" if asked else "ignore") if collision is None else collision, COLLISION)
    checks.flag("self_collision", self_collision)
    distance = checks.non_negative("clearance", CLEARANCE if clearance is None else clearance, "m")
    around = Scene() if scene is None else checked_scene("scene", scene)
    if mode == "ignore":
        if asked:
            raise InvalidInputError(f"{asked[0]} has no effect with collision='ignore'; use 'reject'")
        return None
    contact = around.contact(robot)
    numbers = contact.with_clearance(distance).pair_numbers(self_collision=self_collision)
    if pairs is not None:
        named = [_named_pair(contact, robot.dof, pair) for pair in checks.listed("pairs", pairs)]
        numbers = np.array(named, dtype=np.int64).reshape(-1, 2)
    shapes = MovableShapes(around.obstacles, contact)
    return ClearanceGuard(contact, robot, shapes, numbers, distance, limits, dt)


def _named_pair(contact: Contact, dof: int, pair: tuple[str, str]) -> tuple[int, int]:
    """Numbers of two shapes, the one nearer to the base first."""
    if not isinstance(pair, tuple | list) or len(pair) != 2 or not all(isinstance(name, str) for name in pair):
        raise InvalidInputError(f"pairs must hold pairs of shape names, got {checks.shown(pair)}")
    first, second = (contact.names.index(checks.choice("shape", name, contact.names)) for name in pair)
    # Obstacles, whose link comes after the last, stand as still as the base.
    inner, outer = (int(contact.geometry.shapes.integers[shape, LINK]) % (dof + 1) for shape in (first, second))
    if inner == outer:
        raise InvalidInputError(f"the shapes {pair[0]!r} and {pair[1]!r} are on the same link and cannot move apart")
    return (first, second) if inner < outer else (second, first)
