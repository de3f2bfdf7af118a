"""Clouds of points before each kind of shape, against coal point by point; and the tree that holds them."""

from __future__ import annotations

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from jacokin.arrays import Array
from jacokin.kernels.contact.cloud_tree import LEAF, build_cloud, make_cloud_tree
from jacokin.kernels.contact.shapes import NODE_HALF, NODE_RADIUS
from jacokin.kernels.library import Call
from jacokin.model import PointCloud
from jacokin.model.descriptions import mjcf
from jacokin.model.mujoco_twin import shapes_of_twin
from tests.coal_shapes import coal_distance, coal_shape
from tests.compiled_twin import contact_arrays
from tests.kernels.contact.calls import least_distances, measured_pairs
from tests.kernels.contact.test_distances import Flight, configurations
from tests.kernels.plain import PlainCall

coal = pytest.importorskip("coal")
KINDS = ("sphere", "capsule", "cylinder", "box", "ellipsoid", "mesh")
RADIUS = 0.02  # [m]


class CloudFlight:
    """A shape that flies freely before a cloud."""

    def __init__(self, kind: str, rng: np.random.Generator, count: int = 40) -> None:
        flight = Flight((kind, "sphere"), rng)
        self.points = 0.3 * rng.normal(size=(count, 3))
        self.pose = pin.SE3(pin.exp3(rng.normal(size=3)), 0.2 * rng.normal(size=3))
        self.centres = self.points @ self.pose.rotation.T + self.pose.translation
        self._model, self._data = flight.model, flight.data
        flying = shapes_of_twin(flight.model)[1]
        cloud = PointCloud("cloud", self.points, RADIUS, self.pose).solid
        model = mjcf.to_pinocchio(flight.model, "flight")
        self.geometry = contact_arrays(model, [cloud, flying], [], [0]).geometry
        # The same as an obstacle among the arm's shapes, as those whose contact is allowed in part: it comes first.
        self.turned = contact_arrays(model, [cloud, flying], [(0, 1)], []).geometry
        self._shapes = coal_shape(flight.model, 1), coal.Sphere(RADIUS)

    def place(self, q: Array) -> pin.SE3:
        """Where the shape is."""
        self._data.qpos[:] = q
        mujoco.mj_kinematics(self._model, self._data)
        return pin.SE3(self._data.geom_xmat[1].reshape(3, 3).copy(), self._data.geom_xpos[1].copy())

    def by_coal(self, q: Array) -> Array:
        """Distances (points,) [m]."""
        there = self.place(q)
        return np.array([coal_distance(self._shapes, (there, pin.SE3(np.eye(3), each))) for each in self.centres])


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", KINDS)
def test_the_distance_is_that_of_the_nearest_point(kind: str, rng: np.random.Generator) -> None:
    inside = 0
    for _ in range(4):
        flight = CloudFlight(kind, rng)
        q = configurations(rng, 12)
        for geometry in (flight.geometry, flight.turned):
            found = least_distances(geometry, q).work.value[:, 0].tolist()
            for row, distance in zip(q, found, strict=True):
                theirs = flight.by_coal(row).min()
                if distance > -RADIUS:
                    assert distance == pytest.approx(theirs, abs=3e-6)
                else:  # coal finds a way out, not always the shortest
                    assert theirs - 1e-6 <= distance
                inside += distance < 0.0
    assert inside > 5


@pytest.mark.parametrize("kind", KINDS)
def test_the_nearest_points_are_on_both_surfaces(kind: str, rng: np.random.Generator) -> None:
    """They are as far apart as is said, along the normal; one is on the sphere around a point of the cloud."""
    flight = CloudFlight(kind, rng)
    for q in configurations(rng, 30):
        answers = []
        for geometry in (flight.geometry, flight.turned):
            ((found,),) = measured_pairs(geometry, np.array([[0, 1]]), q[None])
            distance, first, second, normal = np.split(found, [1, 4, 7])
            np.testing.assert_allclose(second - first, distance * normal, atol=1e-6)
            cloud, shape = (second, first) if geometry is flight.geometry else (first, second)
            answers.append((distance, cloud, shape))
            if distance > -RADIUS:  # else its centre is inside of the shape
                from_centres = np.linalg.norm(flight.centres - cloud, axis=1)
                assert from_centres.min() == pytest.approx(RADIUS, abs=1e-6)
        np.testing.assert_allclose(answers[0][0], answers[1][0], atol=1e-6)
        if answers[0][0] > 1e-3:  # else a depth may have several ways out
            np.testing.assert_allclose(np.array(answers[0][1:]), np.array(answers[1][1:]), atol=1e-4)


@pytest.mark.parametrize("kind", ["cylinder", "mesh"])
def test_plain_and_compiled_kernels_give_the_same_bits(kind: str, rng: np.random.Generator) -> None:
    flight = CloudFlight(kind, rng, 150)
    q = configurations(rng, 5)
    found = [least_distances(flight.geometry, q, form).work.value[:, 0] for form in (Call, PlainCall)]
    np.testing.assert_array_equal(found[0], found[1])


@pytest.mark.parametrize("count", [1, 2, LEAF, LEAF + 1, 100, 1000])
@pytest.mark.parametrize("kind", ["random", "flat", "rounded", "same"])
def test_every_node_holds_its_points(count: int, kind: str, rng: np.random.Generator) -> None:
    points = rng.normal(size=(count, 3))
    if kind == "flat":
        points[:, 1] = 0.3
    elif kind == "rounded":
        points = np.round(points)
    elif kind == "same":
        points[:] = 0.2
    given = points.copy()
    tree = make_cloud_tree(points)
    assert Call(build_cloud, tree)() == len(tree.nodes)
    np.testing.assert_array_equal(points, given)
    np.testing.assert_array_equal(points[np.lexsort(points.T)], tree.points[np.lexsort(tree.points.T)])
    parts = 1
    while parts <= (len(tree.nodes) + 1) // 2:
        for part, node in enumerate(tree.nodes[parts - 1 : 2 * parts - 1]):
            held = tree.points[count * part // parts : count * (part + 1) // parts]
            assert len(held) > 0
            low, high = node[:NODE_HALF] - node[NODE_HALF:NODE_RADIUS], node[:NODE_HALF] + node[NODE_HALF:NODE_RADIUS]
            np.testing.assert_allclose([low, high], [held.min(axis=0), held.max(axis=0)], atol=1e-12)
            assert node[NODE_RADIUS] == pytest.approx(np.linalg.norm(high - low) / 2.0)
        parts *= 2
    assert count <= LEAF * parts // 2


def test_halves_are_on_either_side(rng: np.random.Generator) -> None:
    """The two halves of a node do not overlap along its longest side."""
    tree = make_cloud_tree(rng.normal(size=(5000, 3)) * [3.0, 1.0, 0.2])
    Call(build_cloud, tree)()
    for node in range((len(tree.nodes) - 1) // 2):
        axis = int(tree.nodes[node, NODE_HALF:NODE_RADIUS].argmax())
        left, right = tree.nodes[2 * node + 1], tree.nodes[2 * node + 2]
        assert left[axis] + left[NODE_HALF + axis] <= right[axis] - right[NODE_HALF + axis] + 1e-12
