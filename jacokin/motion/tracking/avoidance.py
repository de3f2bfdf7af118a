"""The tracker's guard against collisions: distances between shapes, and the inequalities that keep them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.kernels.contact.arm import SLIDE
from jacokin.kernels.contact.run import MEASURE_PAIRS, ROWS, TASK, ContactWork, make_contact_work, run_contact
from jacokin.kernels.contact.shapes import CENTRE, LINK, RADIUS
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.library import Call
from jacokin.model import checks
from jacokin.model.contact import Contact
from jacokin.model.many_configurations import cross
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene, checked_scene

CLEARANCE = 0.01  # [m] kept between shapes unless told otherwise
COLLISION = ("ignore", "reject")
APPROACH = 0.5  # part of the spare distance that may be used up in one tick
BUFFER = 5e-4  # [m] the QP stays this far above the distance, so that curvature does not cost a shortened step
LOOK_AHEAD = 3.0  # ticks at full speed before a pair could come too near, from which it is watched
MEASURED = 0.01  # [m] above the distance, from which pairs are watched however slow they are: there `least` is exact
HORIZON = 0.05  # [m] beyond the watched range up to which distances are measured
SEPARATION_WEIGHT = 100.0  # of moving too near pairs apart, against 1 for the target: its pull then costs microns
SEPARATION_PART = 0.2  # part of the missing distance asked back in one tick
WORSE = 1e-9  # [m] rounding of a distance
NO_DISTANCES, NO_POINTS, NO_PAIRS = np.empty(0), np.empty((0, 3)), np.empty(0, dtype=np.intp)


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
    """

    bound: Array
    near: NDArray[np.intp]
    distance: Array
    points: Array
    normals: Array
    exits: Mapping[int, Array]

    @property
    def least(self) -> float:
        """Smallest distance [m]: measured when it is in the watched range, a lower bound when it is larger."""
        return float(self.bound.min()) if self.bound.size else np.inf


@dataclass(frozen=True, slots=True)
class Separation:
    """What near shapes add to the QP.

    Attributes:
        inequalities: G and h of G x <= h: no pair uses up more than a part of its spare distance.
        jacobian: (k, dof) weighted, of the distances of pairs that are too near.
        error: (k,) weighted increase of distance that is asked of them.
        exits: as in `Distances`, for the coming step.
    """

    inequalities: tuple[Array, Array]
    jacobian: Array
    error: Array
    exits: Mapping[int, Array]


class ClearanceGuard:
    """Keeps given pairs of shapes a distance apart. What changes from tick to tick is in `Distances`."""

    def __init__(
        self, contact: Contact, robot: Robot, pairs: NDArray[np.int64], distance: float, velocity: Array, dt: float
    ) -> None:
        """Prepare the pairs.

        Args:
            contact: the shapes.
            robot: the arm.
            pairs: (n, 2) numbers of shapes, the one nearer to the base first.
            distance: smallest distance allowed [m].
            velocity: (dof,) velocity limits [rad/s].
            dt: control step [s].
        """
        self._geometry, self._names, self._distance = contact.geometry, contact.names, distance
        self._first, self._second = pairs.T
        links, arm = self._geometry.shapes.integers[:, LINK], self._geometry.arm
        links = np.where(links > robot.dof, 0, links)  # obstacles stand as still as the base
        joint = np.arange(robot.dof)
        inner, outer = links[pairs].T[:, :, np.newaxis]
        self._between = ((inner <= joint) & (joint < outer)).astype(np.float64)
        self._slide = arm.joint_kinds == SLIDE
        self._lever = _levers(robot, self._geometry)[self._second] * self._between
        self._watch = distance + BUFFER + np.maximum(LOOK_AHEAD * dt * (self._lever @ velocity), MEASURED)
        self._fixed = links[self._first] == 0
        # The kernels take a plane, and any obstacle, as the second shape.
        self._turned = self._first > self._second
        self._given = np.where(self._turned[:, np.newaxis], pairs[:, ::-1], pairs)
        self._call: Call[ContactWork] | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Everything but work arrays."""
        return {**self.__dict__, "_call": None}

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

    def linearise(self, q: Array, now: Distances) -> Separation:
        """Inequalities, and the error of pairs that are too near, at a configuration (dof,) [rad]."""
        normals = now.normals.copy()
        exits = self._exits(now, normals)
        leaving = self._leaving(exits)[now.near]
        for row in np.flatnonzero(leaving).tolist():
            normals[row] = exits[int(self._first[now.near[row]])]
        gradients = self._gradients(q, now, normals)
        spare = now.distance - self._distance - BUFFER
        inequalities = -gradients[~leaving], APPROACH * np.maximum(spare[~leaving], 0.0)
        rows = now.distance < self._distance + 0.5 * BUFFER
        return Separation(
            inequalities,
            jacobian=SEPARATION_WEIGHT * gradients[rows],
            error=-SEPARATION_WEIGHT * SEPARATION_PART * spare[rows],
            exits=exits,
        )

    def _leaving(self, exits: Mapping[int, Array]) -> NDArray[np.bool_]:
        """(pairs,) True for pairs with an obstacle that something is inside."""
        return np.isin(self._first, list(exits))

    def _exits(self, now: Distances, normals: Array) -> dict[int, Array]:
        """One way out of each obstacle that something is inside.

        The nearest face differs from shape to shape; each going its own way, a hand would never leave a box. The way
        is that of the deepest shape, kept until nothing is inside any more.
        """
        inside = np.flatnonzero((now.distance < 0.0) & self._fixed[now.near])
        exits: dict[int, Array] = {}
        for row in inside[np.argsort(now.distance[inside])].tolist():
            obstacle = int(self._first[now.near[row]])
            if obstacle not in exits:
                exits[obstacle] = now.exits.get(obstacle, normals[row].copy())
        return exits

    def _gradients(self, q: Array, now: Distances, normals: Array) -> Array:
        """How distances along the normals change with the joints, (near, dof) [m/rad].

        Only joints between the two shapes change their distance: hinges by n . (a x (p - c)) with the axis a through
        c, slides by n . a, for the nearest point p on the outer shape.
        """
        joints = self._run(q, NO_PAIRS).places.frames[1:-1]
        axis, anchor = joints[:, :, 2], joints[:, :, 3]
        torque = np.einsum("ijk,jk->ij", cross(now.points[:, None] - anchor, normals[:, None, :]), axis)
        if self._slide.any():
            torque[:, self._slide] = normals @ axis[self._slide].T
        return np.asarray(torque * self._between[now.near])

    def limiting(self, now: Distances) -> list[str]:
        """Names of the pairs at the distance or nearer."""
        return [self.name(pair) for pair in now.near[now.distance < self._distance + 2.0 * BUFFER].tolist()]


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
    contact = Contact(robot, around.surroundings)
    numbers = contact.pair_numbers(self_collision=self_collision)
    if pairs is not None:
        named = [_named_pair(contact, robot.dof, pair) for pair in checks.listed("pairs", pairs)]
        numbers = np.array(named, dtype=np.int64).reshape(-1, 2)
    return ClearanceGuard(contact, robot, numbers, distance, velocity, dt)


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
