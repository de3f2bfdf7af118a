"""The tracker's guard against collisions: distances between shapes, and the inequalities that keep them.

Obstacles may move (`moving`). A tick looks at them where they will be at its end; the QP is told how fast they come
nearer.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.kernels.contact.arm import SLIDE
from jacokin.kernels.contact.run import MEASURE_PAIRS, ROWS, TASK, ContactWork, make_contact_work, run_contact
from jacokin.kernels.contact.shapes import CENTRE, LINK, RADIUS, SIZE
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.library import Call
from jacokin.kernels.tracking.near import BUFFER, CLOSING, LEAVES, NORMAL
from jacokin.model import checks
from jacokin.model.contact import Contact
from jacokin.model.many_configurations import cross
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene, checked_scene
from jacokin.motion.tracking.joint_limits import Braking
from jacokin.motion.tracking.moving import MovableShapes, Whereabouts
from jacokin.motion.tracking.ticks import Near

CLEARANCE = 0.01  # [m] kept between shapes unless told otherwise
COLLISION = ("ignore", "reject")
LOOK_AHEAD = 3.0  # ticks at full speed, and the way to rest, before a pair could come too near: then it is watched
MEASURED = 0.01  # [m] above the distance, from which pairs are watched however slow they are: there `least` is exact
HORIZON = 0.05  # [m] beyond the watched range up to which distances are measured
WORSE = 1e-9  # [m] rounding of a distance
FORESIGHT = 0.15  # [s] a moving obstacle that would be too near by then is avoided now
BETWEEN = 0.01  # [m] shapes may come nearer than the distance between two places of a way to rest that are looked at
LOOKS = 12  # places of a way to rest that are looked at, before it counts as not clear
NO_DISTANCES, NO_POINTS = np.empty(0), np.empty((0, 3))


@dataclass(frozen=True, slots=True)
class Distances:
    """Distances at one configuration.

    Attributes:
        bound: (pairs,) each pair is at least this far apart [m].
        near: (near,) numbers of the pairs that are in the watched range.
        distance: (near,) their distances [m]; negative when they overlap.
        points: (near, 3) nearest points on the second shape [m].
        normals: (near, 3) unit vectors from the first shape to the second, along which the distance grows.
        exits: directions (3,) in which shapes leave the obstacles they are inside of, by the obstacle's number.
        measured: False where there was no time to measure: then nothing is in `near`, and `bound` still holds.
    """

    bound: Array
    near: NDArray[np.intp]
    distance: Array
    points: Array
    normals: Array
    exits: Mapping[int, Array]
    measured: bool = True

    @property
    def least(self) -> float:
        """Smallest distance [m]: measured when it is in the watched range, a lower bound when it is larger."""
        return float(self.bound.min()) if self.bound.size else np.inf


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
        velocity: Array,
        dt: float,
        reaction: float = 0.0,
    ) -> None:
        """Prepare the pairs.

        Args:
            contact: the shapes.
            robot: the arm.
            shapes: the obstacles that can move.
            pairs: (n, 2) numbers of shapes, the one nearer to the base first.
            distance: smallest distance allowed [m].
            velocity: (dof,) velocity limits [rad/s].
            dt: control step [s].
            reaction: time in which the arm can stop [s].
        """
        self.shapes, self._dt = shapes, dt
        self._foresight = max(FORESIGHT, reaction)
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
        self._between = np.column_stack([links[pairs], np.zeros(len(pairs), dtype=np.int64)])
        self._lever = _levers(robot, self._geometry)[self._second] * ((inner <= joint) & (joint < outer))
        self._watch_still = (
            distance + BUFFER + np.maximum((LOOK_AHEAD * dt + 0.5 * reaction) * (self._lever @ velocity), MEASURED)
        )
        self._watch, self._watched = self._watch_still, shapes.start.speeds
        self._fixed = links[self._first] == 0
        # The kernels take a plane, and any obstacle, as the second shape.
        self._turned = self._first > self._second
        self._given = np.where(self._turned[:, np.newaxis], pairs[:, ::-1], pairs)
        self._call: Call[ContactWork] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Everything but work arrays."""
        return {**self.__dict__, "_call": None, "_placed": None}

    def put(self, where: Whereabouts) -> None:
        """Put obstacles where they are to be measured from now on."""
        if where.poses is self._placed:
            return
        self._placed = None  # until it is done
        numbers, rows = self._geometry.shapes.numbers, self.shapes.numbers
        numbers[rows, :SIZE] = where.poses.reshape(-1, SIZE)
        numbers[rows, CENTRE:RADIUS] = self.shapes.centres(where)
        if where.speeds is not self._watched:
            self._watch = self._watch_still + self._of_movers(self._foresight * where.speeds)
            self._watched = where.speeds
        self._placed = where.poses

    def name(self, pair: int) -> str:
        """Names of the two shapes, joined by "~"."""
        return f"{self._names[self._first[pair]]}~{self._names[self._second[pair]]}"

    def start(self, q: Array) -> Distances:
        """Distances at a configuration (dof,) [rad] nothing is known about."""
        everything = np.full(len(self._first), -np.inf)
        return self._measure(q, everything, {}, horizon=np.inf)

    def move(self, q: Array, before: Distances, step: Array, exits: Mapping[int, Array]) -> Distances:
        """Distances at `q` (dof,) [rad], a displacement (dof,) [rad] away from where `before` was taken."""
        return self._measure(q, before.bound - self._lever.dot(np.abs(step)), exits)

    def refresh(self, q: Array, before: Distances, shift: Array | None) -> Distances:
        """Distances at the same configuration, after obstacles moved by at most `shift` (k,) [m], None for not."""
        bound = before.bound if shift is None else self._shifted(before.bound, shift)
        return self._measure(q, bound.copy(), before.exits)

    def unmeasured(self, before: Distances, step: Array, shift: Array | None) -> Distances:
        """What is known of distances after a displacement (dof,) [rad], without measuring."""
        bound = before.bound - self._lever.dot(np.abs(step))
        if shift is not None:
            bound = self._shifted(bound, shift)
        return Distances(
            bound, np.empty(0, dtype=np.intp), NO_DISTANCES, NO_POINTS, NO_POINTS, before.exits, measured=False
        )

    def _shifted(self, bound: Array, shift: Array) -> Array:
        """Bounds less what the obstacle of each pair moved."""
        return np.asarray(bound - self._of_movers(shift))

    def _of_movers(self, values: Array) -> Array:
        """(pairs,) of values of the obstacles (k,), zero for pairs without one that can move."""
        every = np.zeros(len(values) + 1)
        every[:-1] = values
        return np.asarray(every[self._mover])  # -1 for what stands still

    def _run(self, q: Array, near: NDArray[np.intp], horizon: float = HORIZON) -> ContactWork:
        """Measure some of the pairs at a configuration, up to a horizon [m] beyond the watched range."""
        if self._call is None:
            self._call = Call(run_contact, make_contact_work(self._geometry, 1, len(self._first)))
        work = self._call.work
        work.integers[TASK], work.integers[ROWS] = MEASURE_PAIRS, near.size
        work.q[:] = q
        work.given[: near.size] = self._given[near]
        work.reach[: near.size] = self._watch[near] + horizon
        self._call()
        return work

    def _measure(self, q: Array, bound: Array, exits: Mapping[int, Array], horizon: float = HORIZON) -> Distances:
        """Distances of the pairs that may be in the watched range; `bound` is updated in place."""
        near = np.flatnonzero(bound < self._watch)
        if not near.size:
            return Distances(bound, near, NO_DISTANCES, NO_POINTS, NO_POINTS, exits)
        measured = self._run(q, near, horizon).measured[: near.size]
        bound[near] = measured[:, 0]
        close = measured[:, 0] < self._watch[near]
        near, rows = near[close], measured[close]
        turned = self._turned[near][:, np.newaxis]
        points = np.where(turned, rows[:, 1:4], rows[:, 4:7])
        return Distances(bound, near, rows[:, 0], points, np.where(turned, -rows[:, 7:], rows[:, 7:]), exits)

    def acceptable(self, before: Distances, after: Distances) -> bool:
        """Whether a step may be taken: no pair gets too near, and pairs that are too near already get no worse.

        While anything is inside an obstacle, its pairs are free: the way out may lead other shapes deeper first.
        """
        bound_before, bound_after = before.bound, after.bound
        kept = bound_before[after.near] >= self._distance
        if after.exits:
            leaving = self._leaving(after.exits)
            kept &= ~leaving[after.near]
            bound_before, bound_after = bound_before[~leaving], bound_after[~leaving]
        if (after.distance[kept] < self._distance - WORSE).any():
            return False
        if not bound_after.size:
            return True
        return bool(bound_after.min() >= min(self._distance, bound_before.min()) - WORSE)

    def rests_clear(
        self, before: Distances, now: Distances, braking: Braking, where: Whereabouts
    ) -> tuple[bool, float]:
        """Whether an arm that brakes from now on comes to rest without coming too near to anything.

        Obstacles go on as they move, and are looked at for `FORESIGHT` at least. At the places looked at, the distance
        is kept; between them no pair can come nearer by more than `BETWEEN`, which levers and speeds say. What is too
        near already must be no worse at rest.

        Args:
            before: distances at the start of the tick.
            now: distances where braking begins.
            braking: the way to rest.
            where: the obstacles where braking begins.

        Returns:
            Whether that is certain, and the least measured distance less the one that is kept [m].
        """
        ticks, rate = braking.ticks, self._of_movers(where.speeds * self._dt)
        if where.moving:
            ticks = max(ticks, math.ceil(self._foresight / self._dt))
        needed = np.minimum(self._distance, before.bound) - WORSE
        if now.exits:
            needed[self._leaving(now.exits)] = -np.inf
        way = self._lever.dot(np.abs(braking.way)) + rate * ticks
        pairs = np.flatnonzero(now.bound - way < needed)
        if not pairs.size:
            return True, np.inf
        least, looks = np.inf, 0
        waiting = [(0, ticks, pairs, now.bound[pairs], self._look(braking, ticks, pairs, where))]
        while waiting:
            start, end, pairs, first, last = waiting.pop()
            spare = last - needed[pairs]
            least = min(least, float(spare.min(initial=np.inf)))
            if least < 0.0:
                return False, least
            way = self._lever[pairs].dot(np.abs(braking.at(end) - braking.at(start)))
            way += rate[pairs] * (end - start)
            unsure = 0.5 * (first + last - way) < needed[pairs] - BETWEEN
            unsure &= before.bound[pairs] >= self._distance
            if end - start < 2 or not unsure.any():
                continue
            looks += 1
            if looks > LOOKS:
                return False, least
            pairs, first, last = pairs[unsure], first[unsure], last[unsure]
            middle = (start + end) // 2
            between = self._look(braking, middle, pairs, where)
            waiting += [(middle, end, pairs, between, last), (start, middle, pairs, first, between)]
        return True, least

    def _look(self, braking: Braking, tick: int, pairs: NDArray[np.intp], where: Whereabouts) -> Array:
        """Distances of pairs when an arm has braked for some ticks; the obstacles are put back."""
        self.put(where.after(tick * self._dt))
        distances = self._run(braking.at(tick), pairs).measured[: pairs.size, 0].copy()
        self.put(where)
        return distances

    def _closing(self, now: Distances, where: Whereabouts) -> Array:
        """(near,) how fast obstacles come nearer, the arm standing [m/s]."""
        if not where.moving:
            return np.zeros(now.near.size)
        mover = self._mover[now.near]
        there = now.points - now.distance[:, np.newaxis] * now.normals - where.poses[mover, :, 3]
        speed = where.twists[mover, :3] + cross(where.twists[mover, 3:], there)
        return np.where(mover >= 0, np.einsum("ij,ij->i", speed, now.normals), 0.0)

    def near(self, now: Distances, where: Whereabouts) -> tuple[Near, Mapping[int, Array]]:
        """The pairs that are near, for the kernels, and the `exits` for the coming step."""
        integers, exits = self._between[now.near], self._exits(now)
        numbers = np.column_stack([now.distance, now.points, now.normals, self._closing(now, where)])
        if exits:
            leaving = self._leaving(exits)[now.near]
            integers[leaving, LEAVES] = 1
            for row in np.flatnonzero(leaving).tolist():
                numbers[row, NORMAL:CLOSING] = exits[int(self._first[now.near[row]])]
        return Near(integers, numbers, self._distance, self._foresight), exits

    def _leaving(self, exits: Mapping[int, Array]) -> NDArray[np.bool_]:
        """(pairs,) True for pairs with an obstacle that something is inside."""
        if not exits:
            return np.zeros(len(self._first), dtype=np.bool_)
        return np.isin(self._first, list(exits))

    def _exits(self, now: Distances) -> dict[int, Array]:
        """One way out of each obstacle that something is inside.

        The nearest face differs from shape to shape; each going its own way, a hand would never leave a box. The way
        is that of the deepest shape, kept until nothing is inside any more.
        """
        inside = np.flatnonzero((now.distance < 0.0) & self._fixed[now.near])
        exits: dict[int, Array] = {}
        for row in inside[np.argsort(now.distance[inside])].tolist():
            obstacle = int(self._first[now.near[row]])
            if obstacle not in exits:
                exits[obstacle] = now.exits.get(obstacle, now.normals[row].copy())
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
    velocity: Array,
    dt: float,
    *,
    scene: Scene | None,
    clearance: float | None,
    collision: str | None,
    self_collision: bool,
    pairs: Sequence[tuple[str, str]] | None,
    reaction: float = 0.0,
) -> ClearanceGuard | None:
    """What keeps shapes apart, None for nothing; arguments and errors as in `Tracker`, `reaction` as in the guard."""
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
    numbers = contact.pair_numbers(self_collision=self_collision)
    if pairs is not None:
        named = [_named_pair(contact, robot.dof, pair) for pair in checks.listed("pairs", pairs)]
        numbers = np.array(named, dtype=np.int64).reshape(-1, 2)
    shapes = MovableShapes(around.obstacles, contact)
    return ClearanceGuard(contact, robot, shapes, numbers, distance, velocity, dt, reaction)


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
