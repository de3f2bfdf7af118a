"""Distances of pairs of convex shapes, against coal, MuJoCo and brute force."""

from __future__ import annotations

import itertools
from typing import Any

import mujoco
import numpy as np
import pytest
from scipy.optimize import minimize

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import place_links, relate
from jacokin.kernels.contact.run import make_contact_work
from jacokin.kernels.contact.separation import ROUGHNESS, separation
from jacokin.kernels.library import Call
from jacokin.model.descriptions import mjcf
from jacokin.model.mujoco_twin import shapes_of_twin
from tests.coal_shapes import coal_distance, coal_shape
from tests.compiled_twin import contact_arrays
from tests.kernels.contact.calls import least_distances
from tests.kernels.plain import PlainCall

GEOM = mujoco.mjtGeom
KINDS = ("sphere", "capsule", "cylinder", "box", "mesh")
LARGEST = 0.3  # [m]


class Flight:
    """A shape that flies freely before one that stands still: for the kernels, for MuJoCo and for coal."""

    def __init__(self, kinds: tuple[str, str], rng: np.random.Generator) -> None:
        spec = mujoco.MjSpec()
        body = spec.worldbody.add_body()
        add_shape(spec, body, kinds[1], rng)
        for number, axis in enumerate(np.eye(3)[[0, 1, 2, 2, 1, 0]]):
            body = body.add_body()
            body.mass, body.inertia, body.explicitinertial = 1.0, np.ones(3), True
            body.add_joint(type=mujoco.mjtJoint.mjJNT_SLIDE if number < 3 else mujoco.mjtJoint.mjJNT_HINGE, axis=axis)
        add_shape(spec, body, kinds[0], rng)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        # MuJoCo numbers geoms by their bodies: the one that stands still is the first.
        self.geometry = contact_arrays(
            mjcf.to_pinocchio(self.model, "flight"), shapes_of_twin(self.model), [], [0]
        ).geometry
        self.shapes = coal_shape(self.model, 1), coal_shape(self.model, 0)

    def ours(self, q: Array, form: Any = Call) -> Array:
        """Distances (n,) at poses (n, 6) [m]."""
        self.call = least_distances(self.geometry, q, form)
        return np.array(self.call.work.value[:, 0])

    def way_out(self, q: Array) -> Array:
        """The direction (3,) in which the second shape was found to be free the soonest, by the last call."""
        self.place(q)
        return np.asarray(self.data.geom_xmat[1].reshape(3, 3) @ self.call.work.hits.pair.witness[0])

    def place(self, q: Array) -> None:
        """Move the first shape."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)

    def by_mujoco(self, q: Array) -> float:
        """Distance [m]."""
        self.place(q)
        return float(mujoco.mj_geomDistance(self.model, self.data, 1, 0, 10.0, None))

    def by_coal(self, q: Array) -> float:
        """Distance [m]."""
        self.place(q)
        first, second = (mjcf.placement(_quat(self.data.geom_xmat[geom]), self.data.geom_xpos[geom]) for geom in (1, 0))
        return coal_distance(self.shapes, (first, second))

    def overlap(self, q: Array, directions: Array) -> Array:
        """How far (n,) the second shape must move along unit directions (n, 3) to be free [m]."""
        self.place(q)
        return self._reach(1, directions) + self._reach(0, -directions)

    def _reach(self, geom: int, directions: Array) -> Array:
        """How far a shape reaches from the world's origin along directions [m]."""
        kind, size = int(self.model.geom_type[geom]), self.model.geom_size[geom]
        d = directions @ self.data.geom_xmat[geom].reshape(3, 3)
        across = np.hypot(d[:, 0], d[:, 1])
        if kind == GEOM.mjGEOM_SPHERE:
            own = np.full(len(d), size[0])
        elif kind == GEOM.mjGEOM_CAPSULE:
            own = size[0] + size[1] * np.abs(d[:, 2])
        elif kind == GEOM.mjGEOM_CYLINDER:
            own = size[0] * across + size[1] * np.abs(d[:, 2])
        elif kind == GEOM.mjGEOM_BOX:
            own = np.abs(d) @ size
        elif kind == GEOM.mjGEOM_ELLIPSOID:
            own = np.linalg.norm(d * size, axis=1)
        else:
            own = (d @ shapes_of_twin(self.model)[geom].vertices.T).max(axis=1)
        return np.asarray(own + directions @ self.data.geom_xpos[geom])


def add_shape(spec: mujoco.MjSpec, body: mujoco.MjsBody, kind: str, rng: np.random.Generator) -> None:
    """Add a shape of random size."""
    size = LARGEST * 10.0 ** rng.uniform(-1.5, 0.0, 3)
    if kind != "mesh":
        body.add_geom(type=getattr(GEOM, f"mjGEOM_{kind.upper()}"), size=size)
        return
    points = rng.normal(size=(int(rng.integers(5, 40)), 3))
    if rng.random() < 0.5:
        points /= np.linalg.norm(points, axis=1, keepdims=True)
    name = f"mesh_{len(spec.meshes)}"
    spec.add_mesh(name=name, uservert=(points * size).ravel(), inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
    body.add_geom(type=GEOM.mjGEOM_MESH, meshname=name)


def _quat(matrix: Array) -> Array:
    quat = np.empty(4)
    mujoco.mju_mat2Quat(quat, matrix)
    return quat


def configurations(rng: np.random.Generator, n: int) -> Array:
    """Poses (n, 6): far, near and deep, some of them turned by right angles and on round numbers."""
    places = rng.normal(size=(n, 3)) * rng.choice([0.02, 0.1, 0.3, 0.6], size=(n, 1))
    places = np.where(rng.random((n, 1)) < 0.05, np.round(places, 1), places)
    square = 0.5 * np.pi * rng.integers(4, size=(n, 3))
    return np.hstack([places, np.where(rng.random((n, 1)) < 0.2, square, rng.uniform(-4.0, 4.0, (n, 3)))])


def judge(rng: np.random.Generator, pairs: int, each: int) -> int:
    """Compare pairs of shapes with both references; returns how many were apart."""
    apart = 0
    for _ in range(pairs):
        flight = Flight((str(rng.choice(KINDS)), str(rng.choice(KINDS))), rng)
        q = configurations(rng, each)
        for distance, row in zip(flight.ours(q).tolist(), q, strict=True):
            theirs = [flight.by_coal(row), flight.by_mujoco(row)]
            if distance <= 0.0 and max(theirs) <= 0.0:
                continue
            apart += 1
            if max(theirs) - min(theirs) > 1e-7:  # the references disagree: a search for the widest gap decides
                theirs = [widest_gap(flight, row, rng)]
                if distance <= 0.0 and theirs[0] <= 0.0:
                    continue
            np.testing.assert_allclose(distance, theirs, rtol=0.0, atol=1e-6)
    return apart


def widest_gap(flight: Flight, q: Array, rng: np.random.Generator) -> float:
    """The distance of two shapes is the widest gap between parallel planes that separate them [m]."""
    directions = rng.normal(size=(500, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    order = np.argsort(flight.overlap(q, directions))
    return -min(shortest_way(flight, q, directions[start]) for start in order[:3])


@pytest.mark.slow
def test_random_pairs_of_shapes(rng: np.random.Generator) -> None:
    assert judge(rng, 60, 50) > 1500


@pytest.mark.slow
def test_many_random_pairs_of_shapes(rng: np.random.Generator) -> None:
    assert judge(rng, 250, 200) > 25_000


@pytest.mark.parametrize("kind", [*KINDS, "ellipsoid"])
def test_ellipsoids_are_shapes_too(kind: str, rng: np.random.Generator) -> None:
    flight = Flight(("ellipsoid", kind), rng)
    q = configurations(rng, 100)
    for distance, row in zip(flight.ours(q).tolist(), q, strict=True):
        theirs = flight.by_mujoco(row)
        if max(distance, theirs) > 1e-6:
            assert distance == pytest.approx(theirs, abs=2e-6)


@pytest.mark.one_quick
@pytest.mark.parametrize("kinds", list(itertools.combinations_with_replacement((*KINDS, "ellipsoid"), 2)))
def test_the_depth_of_an_overlap_is_the_shortest_way_out(kinds: tuple[str, str], rng: np.random.Generator) -> None:
    flight = Flight(kinds, rng)
    directions = rng.normal(size=(2000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    deep = 0
    for row in configurations(rng, 30) * [0.2, 0.2, 0.2, 1.0, 1.0, 1.0]:
        depth = -float(flight.ours(row[np.newaxis])[0])
        if depth > 0.0:
            assert depth <= flight.overlap(row, directions).min() + 1e-9
            way = flight.way_out(row)
            assert flight.overlap(row, way[np.newaxis])[0] == pytest.approx(depth, rel=0.01, abs=2e-7)
            deep += 1
    assert deep > 5


def shortest_way(flight: Flight, q: Array, start: Array) -> float:
    """The smallest overlap near a direction [m], by a search without derivatives."""

    def overlap(x: Array) -> float:
        return float(flight.overlap(q, x[np.newaxis] / np.linalg.norm(x))[0])

    found = minimize(overlap, start, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-9, "maxiter": 2000})
    return float(found.fun)


def test_plain_and_compiled_kernels_give_the_same_bits(rng: np.random.Generator) -> None:
    for kinds in itertools.product(("cylinder", "mesh"), ("box", "capsule")):
        flight = Flight(kinds, rng)
        q = configurations(rng, 10) * [0.5, 0.5, 0.5, 1.0, 1.0, 1.0]
        np.testing.assert_array_equal(flight.ours(q), flight.ours(q, PlainCall))


@pytest.mark.parametrize("kinds", [("cylinder", "box"), ("mesh", "capsule"), ("box", "mesh")])
def test_rough_distances_are_lower_bounds_near_to_the_exact_ones(
    kinds: tuple[str, str], rng: np.random.Generator
) -> None:
    flight, enough = Flight(kinds, rng), 0.01
    work = make_contact_work(flight.geometry, 1)
    shapes, arm = flight.geometry.shapes, flight.geometry.arm
    less = 0
    for q in configurations(rng, 30):
        place_links(arm, 6, len(arm.groups), q, work.places)
        relate(shapes, work.places.frames, 0, 1, work.hits.pair.relative)
        exact, rough = (
            separation(shapes, (0, 1), work.hits.pair, np.inf, -np.inf, limit, True) for limit in (np.inf, enough)
        )
        assert exact - ROUGHNESS * max(exact - enough, 0.0) - 1e-9 <= rough <= exact + 1e-9
        less += rough < exact - 1e-6
    assert less > 5
