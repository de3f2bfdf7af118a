"""The tracker's guard against collisions: distances between shapes, and the inequalities that keep them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.contact import compiled_pairs
from jacokin.model.descriptions.mjcf import body_joints, joints_above
from jacokin.model.many_configurations import cross
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene, checked_scene

CLEARANCE = 0.01  # [m] kept between shapes unless told otherwise
COLLISION = ("ignore", "reject")
APPROACH = 0.5  # part of the spare distance that may be used up in one tick
BUFFER = 5e-4  # [m] the QP stays this far above the distance, so that curvature does not cost a shortened step
LOOK_AHEAD = 3.0  # ticks at full speed before a pair could come too near, from which it is watched
HORIZON = 0.05  # [m] beyond the watched range up to which distances are measured
SEPARATION_WEIGHT = 100.0  # of moving too near pairs apart, against 1 for the target: its pull then costs microns
SEPARATION_PART = 0.2  # part of the missing distance asked back in one tick
WORSE = 1e-9  # [m] rounding of a distance
NO_DISTANCES, NO_POINTS = np.empty(0), np.empty((0, 6))
TOUCHING = 1e-12  # [m] nearest points this near to each other give no direction


@dataclass(frozen=True, slots=True)
class Distances:
    """Distances at one configuration.

    Attributes:
        bound: (pairs,) each pair is at least this far apart [m].
        near: (near,) numbers of the pairs that are in the watched range.
        distance: (near,) their distances [m]; negative when they overlap.
        points: (near, 6) nearest points on first and second shape [m].
        exits: directions (3,) in which shapes leave the obstacles they are inside of, by the obstacle's number.
    """

    bound: Array
    near: NDArray[np.intp]
    distance: Array
    points: Array
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
        self, model: mujoco.MjModel, pairs: list[tuple[int, int]], distance: float, velocity: Array, dt: float
    ) -> None:
        """Prepare the pairs.

        Args:
            model: the robot's twin with shapes, its joints in a chain.
            pairs: numbers of shapes, the one nearer to the base first.
            distance: smallest distance allowed [m].
            velocity: (dof,) velocity limits [rad/s].
            dt: control step [s].
        """
        self._model = model
        self._distance = distance
        self._pairs = pairs
        first, second = np.array(pairs, dtype=np.intp).reshape(-1, 2).T
        self._first, self._second = first, second
        self._between = _joints_between(model, first, second)
        self._lever = _levers(model, second) * self._between
        self._watch = distance + BUFFER + LOOK_AHEAD * dt * (self._lever @ velocity)
        self._slide = model.jnt_type == mujoco.mjtJoint.mjJNT_SLIDE
        self._fixed = model.body_weldid[model.geom_bodyid[first]] == 0
        self._reach = (self._watch + HORIZON).tolist()
        self._data = mujoco.MjData(model)
        self._computed: Array | None = None

    def __getstate__(self) -> dict[str, Any]:
        """Everything but what was computed last."""
        return {**self.__dict__, "_computed": None}

    def name(self, pair: int) -> str:
        """Names of the two shapes, joined by "~"."""
        return f"{self._model.geom(self._first[pair]).name}~{self._model.geom(self._second[pair]).name}"

    def start(self, q: Array) -> Distances:
        """Distances at a configuration (dof,) [rad] nothing is known about."""
        data = self._at(q)
        # Distance of the bounding spheres; planes and shapes without a sphere are measured.
        radius = self._model.geom_rbound
        gap = np.linalg.norm(data.geom_xpos[self._first] - data.geom_xpos[self._second], axis=1)
        bounded = (radius[self._first] > 0.0) & (radius[self._second] > 0.0)
        return self._measure(q, np.where(bounded, gap - radius[self._first] - radius[self._second], -np.inf), {})

    def move(self, q: Array, before: Distances, step: Array, exits: Mapping[int, Array]) -> Distances:
        """Distances at `q` (dof,) [rad], a displacement (dof,) [rad] away from where `before` was taken."""
        return self._measure(q, before.bound - self._lever.dot(np.abs(step)), exits)

    def _at(self, q: Array) -> mujoco.MjData:
        """The shapes at a configuration, computed unless it was the last one."""
        if self._computed is not q:
            self._computed = None  # until it is done
            self._data.qpos[:] = q
            mujoco.mj_kinematics(self._model, self._data)
            self._computed = q
        return self._data

    def _measure(self, q: Array, bound: Array, exits: Mapping[int, Array]) -> Distances:
        """Distances of the pairs that may be in the watched range; `bound` is updated in place."""
        near = np.flatnonzero(bound < self._watch)
        if not near.size:
            return Distances(bound, near, NO_DISTANCES, NO_POINTS, exits)
        data = self._at(q)
        distance = np.empty(near.size)
        points = np.empty((near.size, 6))
        for row, pair in enumerate(near.tolist()):
            first, second = self._pairs[pair]
            distance[row] = mujoco.mj_geomDistance(self._model, data, first, second, self._reach[pair], points[row])
        bound[near] = distance
        close = distance < self._watch[near]
        return Distances(bound, near[close], distance[close], points[close], exits)

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
        data = self._at(q)
        normals = self._normals(now)
        exits = self._exits(now, normals)
        leaving = self._leaving(exits)[now.near]
        for row in np.flatnonzero(leaving).tolist():
            normals[row] = exits[int(self._first[now.near[row]])]
        gradients = self._gradients(data, now, normals)
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

    def _normals(self, now: Distances) -> Array:
        """(near, 3) unit vectors from the first shape to the second, along which the distance grows."""
        across = now.points[:, 3:] - now.points[:, :3]
        length = np.linalg.norm(across, axis=1)
        # Shapes that just touch give no direction.
        across /= np.where(length > TOUCHING, length, np.inf)[:, None]
        return np.asarray(across * np.where(now.distance < 0.0, -1.0, 1.0)[:, None])

    def _gradients(self, data: mujoco.MjData, now: Distances, normals: Array) -> Array:
        """How distances along the normals change with the joints, (near, dof) [m/rad].

        Only joints between the two shapes change their distance: hinges by n . (a x (p - c)) with the axis a through
        c, slides by n . a, for the nearest point p on the outer shape.
        """
        arm = now.points[:, None, 3:] - data.xanchor[None]
        torque = np.einsum("ijk,jk->ij", cross(arm, normals[:, None, :]), data.xaxis)
        if self._slide.any():
            torque[:, self._slide] = normals @ data.xaxis[self._slide].T
        return np.asarray(torque * self._between[now.near])

    def limiting(self, now: Distances) -> list[str]:
        """Names of the pairs at the distance or nearer."""
        return [self.name(pair) for pair in now.near[now.distance < self._distance + 2.0 * BUFFER].tolist()]


def _joints_between(model: mujoco.MjModel, first: NDArray[np.intp], second: NDArray[np.intp]) -> Array:
    """(pairs, dof) one where a joint moves the second shape but not the first."""
    bodies = [joints_above(model, body) for body in range(model.nbody)]
    rows = [
        [float(j in bodies[model.geom_bodyid[b]] and j not in bodies[model.geom_bodyid[a]]) for j in range(model.njnt)]
        for a, b in zip(first, second, strict=True)
    ]
    return np.array(rows).reshape(-1, model.njnt)


def _levers(model: mujoco.MjModel, geoms: NDArray[np.intp]) -> Array:
    """(pairs, dof) how far any point of a shape can be from a joint's origin [m]; 1 for a slide."""
    levers = np.zeros((geoms.size, model.njnt))
    for row, geom in enumerate(geoms.tolist()):
        reach = float(np.linalg.norm(model.geom_pos[geom]) + model.geom_rbound[geom])
        body = int(model.geom_bodyid[geom])
        while body > 0:
            for joint in body_joints(model, body):
                slide = model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
                levers[row, joint] = 1.0 if slide else reach + float(np.linalg.norm(model.jnt_pos[joint]))
                reach += float(np.abs(model.jnt_range[joint]).max()) if slide else 0.0
            reach += float(np.linalg.norm(model.body_pos[body]))
            body = int(model.body_parentid[body])
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
    obstacles, angle = around.obstacles, around.finger_angle
    model, numbers = compiled_pairs(robot, obstacles, self_collision=self_collision, finger_angle=angle)
    if pairs is not None:
        names = [model.geom(index).name for index in range(model.ngeom)]
        numbers = [_named_pair(model, names, pair) for pair in checks.listed("pairs", pairs)]
    # The shape nearer to the base comes first; the chain is serial and bodies are numbered along it.
    body = model.geom_bodyid
    return ClearanceGuard(model, [(a, b) if body[a] <= body[b] else (b, a) for a, b in numbers], distance, velocity, dt)


def _named_pair(model: mujoco.MjModel, names: list[str], pair: tuple[str, str]) -> tuple[int, int]:
    if not isinstance(pair, tuple | list) or len(pair) != 2 or not all(isinstance(name, str) for name in pair):
        raise InvalidInputError(f"pairs must hold pairs of shape names, got {checks.shown(pair)}")
    first, second = (names.index(checks.choice("shape", name, names)) for name in pair)
    if model.body_weldid[model.geom_bodyid[first]] == model.body_weldid[model.geom_bodyid[second]]:
        raise InvalidInputError(f"the shapes {pair[0]!r} and {pair[1]!r} are on the same link and cannot move apart")
    return first, second
