"""The tracker's guard against collisions: distances between shapes, and the inequalities that keep them.

Obstacles may move (`moving`). A tick looks at them where they will be at its end; the QP is told how fast they come
nearer.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.kernels.contact.arm import SLIDE
from jacokin.kernels.contact.shapes import CENTRE, LINK, RADIUS, SIZE
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.library import Call
from jacokin.kernels.tracking.near import BUFFER, CLOSING, DISTANCE, KEPT, NEAR_NUMBERS, NORMAL
from jacokin.kernels.tracking.reach import (
    ALLOWED,
    ASKED,
    BEYOND,
    CLOSE,
    DISTANCES,
    FORESIGHT,
    HORIZON,
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
TRIED = 100  # configurations in which a pair of shapes is too near, before it counts as one that no motion parts
NEARER = 2e-3  # [m] such a pair may come nearer than it was: links that turn on the spot are not quite round
PATIENCE = 0.5  # [s] in which what is too near a shape comes no farther away: then it stays about as it is
FARTHER = 1e-4  # [m] farther away than ever before counts as farther
NO_PAIRS, NO_NUMBERS = np.empty(0, dtype=np.int64), np.empty((0, NEAR_NUMBERS))


class Parting(NamedTuple):
    """How far what is too near a shape has moved away from it."""

    first: float
    """The least distance when it was found to be too near [m]."""
    farthest: float
    """The largest least distance since [m]."""
    ticks: int
    """Since that."""


class Contacts(NamedTuple):
    """What is in contact."""

    exits: Mapping[int, Array]
    """Directions (3,) in which shapes leave the obstacles they are inside of, by the obstacle's number."""
    kept: Mapping[int, float]
    """Distances [m] that are kept instead of the clearance, by the number of a pair that no motion parts."""
    parting: Mapping[int, Parting]
    """How what is too near moves apart, by the number of the first shape of its pairs."""


NO_CONTACTS = Contacts({}, {}, {})


class Distances(NamedTuple):
    """Distances at one configuration."""

    bound: Array
    """(pairs,) each pair is at least this far apart [m]."""
    near: NDArray[np.int64]
    """(near,) numbers of the pairs that were measured and are in the watched range."""
    numbers: Array
    """(near, 10) how they are, see `jacokin.kernels.tracking.near`."""
    least: float
    """Smallest distance [m], inf for none: measured when it is in the watched range, a lower bound when larger."""
    contacts: Contacts
    """What is in contact."""
    measured: bool = True
    """False where there was no time to measure: then nothing is in `near`, and `bound` still holds."""

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
        distances: Array,
        limits: JointLimits,
        dt: float,
    ) -> None:
        """Prepare the pairs.

        Args:
            contact: the shapes.
            robot: the arm.
            shapes: the obstacles that can move.
            pairs: (n, 2) numbers of shapes, the one nearer to the base first.
            distances: (n,) smallest distances allowed [m].
            limits: of the joints.
            dt: control step [s].
        """
        self.shapes, self._dt = shapes, dt
        self._foresight = max(LOOKED_AHEAD, limits.stopping_time)
        self._placed: Array | None = shapes.start.poses
        rows = np.full(len(contact.names), -1)
        rows[shapes.numbers] = np.arange(len(shapes.numbers))
        self._mover = rows[pairs[:, 0]]
        self._names, self._distances, largest = contact.names, distances, float(distances.max(initial=0.0))
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
        self._largest, self._watched = largest, largest + BUFFER + np.maximum(way, MEASURED)
        self._fixed = links[self._first] == 0
        self._lower, self._upper = _range(limits)
        # The kernels take a plane, and any obstacle, as the second shape.
        exchanged = self._first > self._second
        given = np.where(exchanged[:, np.newaxis], pairs[:, ::-1], pairs)
        none = np.zeros(len(pairs), dtype=np.int64)
        self._pairs = np.column_stack([given, exchanged, self._mover, none, links[pairs]])
        self._limits = limits
        self._call: Call[ReachWork] | None = None
        self._held: Distances | None = None  # what the kernel's arrays have
        self._leaves = self._keeps_less = False

    def __getstate__(self) -> dict[str, Any]:
        """Everything but work arrays."""
        return {**self.__dict__, "_call": None, "_placed": None, "_held": None, "_leaves": False, "_keeps_less": False}

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
            numbers[ALLOWED], numbers[TIME_STEP], numbers[FORESIGHT] = self._largest, self._dt, self._foresight
            numbers[CLOSE] = self._largest + BUFFER + MEASURED
            work.limits[:], pairs.kept[:] = self._limits.table, self._distances
            pairs.integers[:], pairs.lever[:], pairs.mover[:] = self._pairs, self._lever, self._mover
            pairs.mover[self._mover < 0] = len(self.shapes.numbers)
            work.levers.lengths[:], work.levers.watched[:] = self._levers.ravel(), self._watched
            work.movers.shapes[:], work.movers.centres[:] = self.shapes.numbers, self.shapes.own_centres
            self._call = Call(try_reach, work)
        return self._call

    def carried(self, before: ClearanceGuard, distances: Distances) -> dict[int, float]:
        """What another guard keeps of pairs that no motion parts, by the numbers that they have here."""
        kept = distances.contacts.kept
        numbers = {self.name(pair): pair for pair in range(len(self._first))} if kept else {}
        named = ((before.name(pair), distance) for pair, distance in kept.items())
        return {numbers[name]: distance for name, distance in named if name in numbers}

    def name(self, pair: int) -> str:
        """Names of the two shapes, joined by "~"."""
        return f"{self._names[self._first[pair]]}~{self._names[self._second[pair]]}"

    def start(self, q: Array, kept: Mapping[int, float] = NO_CONTACTS.kept) -> Distances:
        """Distances at a configuration (dof,) [rad] nothing is known about, but maybe pairs that no motion parts."""
        found = self._measure(q, np.full(len(self._first), -np.inf), NO_CONTACTS, beyond=np.inf)
        return self._judged(found._replace(contacts=NO_CONTACTS._replace(kept=kept)), None)

    def move(self, q: Array, before: Distances, step: Array) -> Distances:
        """Distances at `q` (dof,) [rad], a displacement (dof,) [rad] away from where `before` was taken."""
        return self._measure(q, before.bound - self._ways(step), before.contacts._replace(exits={}))

    def refresh(self, q: Array, before: Distances, shift: Array | None) -> Distances:
        """Distances at the same configuration, after obstacles moved by at most `shift` (k,) [m], None for not."""
        found = self._measure(q, before.bound, before.contacts, shift)
        if before.measured:
            return found if shift is None else self._judged(found, before.bound)
        return self._judged(found, None)

    def unmeasured(self, before: Distances, step: Array, shift: Array | None) -> Distances:
        """What is known of distances after a displacement (dof,) [rad], without measuring."""
        bound = before.bound - self._ways(step)
        if shift is not None:
            bound -= np.append(shift, 0.0)[self._mover]  # -1 for what stands still
        least = float(bound.min(initial=np.inf))
        return Distances(bound, NO_PAIRS, NO_NUMBERS, least, before.contacts, measured=False)

    def _ways(self, step: Array) -> Array:
        """(pairs,) how far a displacement (dof,) [rad] moves pairs nearer, at most [m]."""
        return np.asarray(self._levers.dot(np.abs(step))[self._lever])

    def _measure(
        self,
        q: Array,
        bound: Array,
        contacts: Contacts,
        shift: Array | None = None,
        beyond: float = HORIZON,
    ) -> Distances:
        """Distances at a configuration of the pairs that may be close.

        Args:
            q: (dof,) the configuration [rad].
            bound: (pairs,) each pair was at least so far apart there [m].
            contacts: what is in contact.
            shift: (k,) how far obstacles have moved since, at most [m]; None for not.
            beyond: how far beyond the distances in question is measured [m].
        """
        call = self._ready()
        work, self._held = call.work, None
        work.start[:], work.v[:], work.displacement[:], work.pairs.before[:] = q, 0.0, 0.0, bound
        work.movers.shifts[:-1] = 0.0 if shift is None else shift
        self._keep(contacts.kept)
        work.numbers[BEYOND], work.numbers[PART], work.counts[ASKED] = beyond, 0.0, DISTANCES
        call()
        work.movers.shifts[:] = 0.0
        return self.found(contacts)

    def _judged(self, now: Distances, before: Array | None) -> Distances:
        """The distances, where pairs that no motion parts are to be kept about as they are.

        A link that turns on the spot stays in a table that is too high whatever the joints do. Pairs are looked at when
        they come too near, and when they begin to overlap.

        Args:
            now: the distances.
            before: (pairs,) each pair was at least so far apart at this configuration [m]; None if that is not known.
        """
        close = now.distance < self._distances[now.near]
        if not close.any():
            return now
        kept, fresh = dict(now.contacts.kept), []
        near = dict(zip(now.near[close].tolist(), now.distance[close].tolist(), strict=True))
        for pair, distance in near.items():
            last = np.inf if before is None else float(before[pair])
            if pair not in kept:
                if last >= self._distances[pair] or distance < 0.0 <= last:
                    fresh.append(pair)
            elif before is not None:
                kept[pair] += distance - last  # what its obstacle has moved does not count
            elif distance < kept[pair]:
                kept[pair] = distance - NEARER
        kept.update((pair, near[pair] - NEARER) for pair in self._staying(fresh))
        self._held = None
        parting = now.contacts.parting if before is None else NO_CONTACTS.parting  # waited for anew where it moves
        return now._replace(contacts=now.contacts._replace(kept=kept, parting=parting))

    def _waited(self, now: Distances, kept: dict[int, float]) -> dict[int, Parting]:
        """How what is too near moves apart; where that has come to its end, it is added to what is kept."""
        close = now.distance < self._distances[now.near]
        measured = zip(now.near[close].tolist(), now.distance[close].tolist(), strict=True)
        near = {pair: distance for pair, distance in measured if pair not in kept}
        least, parting = dict[int, float](), dict[int, Parting]()
        for pair, distance in near.items():
            shape = int(self._first[pair])
            least[shape] = min(distance, least.get(shape, np.inf))
        for shape, distance in least.items():
            before = now.contacts.parting.get(shape)
            if before is None:
                parting[shape] = Parting(distance, distance, 0)
            elif distance > before.farthest + FARTHER:
                parting[shape] = Parting(before.first, distance, 0)
            elif (before.ticks + 1) * self._dt < PATIENCE:
                parting[shape] = before._replace(ticks=before.ticks + 1)
            else:
                nearest = before.first if before.first > 0.0 else np.inf
                kept.update((p, _about(min(each, nearest))) for p, each in near.items() if self._first[p] == shape)
        return parting

    def _staying(self, pairs: list[int]) -> list[int]:
        """Which pairs are too near in all of many configurations."""
        rng, bound = np.random.default_rng(0), np.full(len(self._first), np.inf)
        for _ in range(TRIED):
            if not pairs:
                break
            bound[:] = np.inf
            bound[pairs] = -np.inf
            there = self._measure(rng.uniform(self._lower, self._upper), bound, NO_CONTACTS).bound
            pairs = [pair for pair in pairs if there[pair] < self._distances[pair] + BUFFER]
        return pairs

    def _keep(self, kept: Mapping[int, float]) -> None:
        """Have the kernel keep the clearance, and of some pairs what is said."""
        if kept or self._keeps_less:
            self._keeps_less = True  # until it is done
            self.work.pairs.kept[:] = self._distances
            for pair, distance in kept.items():
                self.work.pairs.kept[pair] = distance
            self._keeps_less = bool(kept)

    def found(self, contacts: Contacts) -> Distances:
        """The distances that the kernel found last."""
        work = self.work
        count = int(work.counts[NEAR])
        self._held = Distances(
            work.pairs.bound.copy(),
            work.near[:count].copy(),
            work.rows[:count].copy(),
            float(work.numbers[LEAST]),
            contacts,
        )
        return self._held

    def take(self, now: Distances) -> Contacts:
        """Have the kernel go on from distances; returns what is in contact in the coming step."""
        work, held, self._held = self.work, self._held, None
        if now is not held:
            count = work.counts[NEAR] = len(now.near)
            work.pairs.bound[:], work.near[:count], work.rows[:count] = now.bound, now.near, now.numbers
            work.pairs.exact[:], work.numbers[LEAST] = 0, now.least
            work.pairs.exact[now.near] = 1
        kept = {
            pair: each for pair, each in now.contacts.kept.items() if now.bound[pair] < self._distances[pair] + BUFFER
        }
        parting = self._waited(now, kept) if now.least < self._largest else NO_CONTACTS.parting
        self._keep(kept)
        if now is not held:
            work.rows[:count, KEPT] = work.pairs.kept[now.near]
        exits = self._exits(now, kept)
        if exits or self._leaves:
            leaving = np.isin(self._first, list(exits))
            leaving[list(kept)] = False
            self._leaves = True  # until none is left
            work.pairs.integers[:, LEAVING] = leaving
            for pair in np.flatnonzero(leaving).tolist():
                work.pairs.exits[pair] = exits[int(self._first[pair])]
            self._leaves = bool(exits)
        return Contacts(exits, kept, parting)

    def _exits(self, now: Distances, kept: Mapping[int, float]) -> dict[int, Array]:
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
            if obstacle not in exits and int(now.near[row]) not in kept:
                exits[obstacle] = now.contacts.exits.get(obstacle, now.numbers[row, NORMAL:CLOSING].copy())
        return exits

    def limiting(self, now: Distances, apart: Iterable[int]) -> list[str]:
        """Names of the pairs at the distance or nearer, and of those by their numbers that are moved apart."""
        near: list[int] = []
        if now.least < self._largest + 2.0 * BUFFER or now.contacts.kept:
            near = now.near[now.distance < now.numbers[:, KEPT] + 2.0 * BUFFER].tolist()
        return [self.name(pair) for pair in dict.fromkeys((*near, *apart))]

    def staying(self, now: Distances) -> str:
        """Which pairs no motion parts, to end a sentence; "" for none."""
        kept = now.contacts.kept
        return f"; no motion parts {', '.join(map(self.name, kept))}" if kept else ""


def _about(distance: float) -> float:
    """What is kept of a distance [m] that does not become larger; what is near does not touch."""
    return distance - (min(NEARER, max(BUFFER, 0.5 * distance)) if distance > 0.0 else NEARER)


def _range(limits: JointLimits) -> tuple[Array, Array]:
    """Where joints can be, lower and upper (dof,) [rad]; a turn where there is no limit."""
    lower = np.where(np.isfinite(limits.lower), limits.lower, np.minimum(limits.upper, np.pi) - 2.0 * np.pi)
    return lower, np.where(np.isfinite(limits.upper), limits.upper, lower + 2.0 * np.pi)


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
    if pairs is None:
        clear = contact.with_clearance(distance)
        numbers = clear.pair_numbers(self_collision=self_collision)
        distances = clear.distances_kept(numbers)
    else:
        named = [_named_pair(contact, robot.dof, pair) for pair in checks.listed("pairs", pairs)]
        numbers, distances = np.array(named, dtype=np.int64).reshape(-1, 2), np.full(len(named), distance)
    shapes = MovableShapes(around.obstacles, contact)
    return ClearanceGuard(contact, robot, shapes, numbers, distances, limits, dt)


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
