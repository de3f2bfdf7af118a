"""Obstacles in their tree: each once, inside of every box around it, in halves; machine code as plain Python."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from jacokin.ik import Box, Capsule, Cylinder, Floor, Obstacle, PointCloud, Sphere
from jacokin.kernels.contact.shapes import CENTRE, MARGIN, RADIUS, SIZE
from jacokin.kernels.contact.world import build_world, make_world_work
from jacokin.kernels.library import Call
from jacokin.model import contact_arrays
from jacokin.model.contact_arrays import WorldArrays
from jacokin.model.surrounded import make_world
from tests.kernels.plain import PlainCall

CLOUD = np.array([[0.0, 0.0, 0.0], [0.1, 0.2, 0.3], [-0.1, 0.0, 0.2]])  # [m]


def obstacles(count: int, kind: str, rng: np.random.Generator) -> list[Obstacle]:
    """Shapes of all kinds, turned and far apart; or with centres in few places, or in one."""
    found: list[Obstacle] = []
    for k in range(count):
        name, (x, y, z) = f"shape_{k}", rng.normal(size=3)
        turned = pin.SE3(pin.exp3(rng.normal(size=3)), np.array([x, y, z]))
        if kind == "rounded":
            turned = pin.SE3(np.eye(3), np.round([x, y, 0.0]))
        elif kind == "same":
            turned = pin.SE3(np.eye(3), np.ones(3))
        made: list[Obstacle] = [
            Box(name, rng.uniform(0.01, 0.3, 3), turned),
            Sphere(name, 0.1, turned.translation),
            Capsule(name, 0.05, 0.3, turned),
            Cylinder(name, 0.2, 0.1, turned),
            PointCloud(name, CLOUD, 0.01, turned),
            Floor(z, name=name),
        ]
        found.append(made[k % len(made)])
    return found


def places_inside(world: WorldArrays, node: int) -> list[int]:
    """The shapes below a node, whose halves are as large as each other, or differ by one."""
    first, second = world.tree.children[node].tolist()
    if first < 0:
        return [second]
    halves = [places_inside(world, first), places_inside(world, second)]
    assert len(halves[1]) - len(halves[0]) in (0, 1)
    return halves[0] + halves[1]


@pytest.mark.parametrize("count", [0, 1, 2, 6, 17, 100])
@pytest.mark.parametrize("kind", ["turned", "rounded", "same"])
def test_every_node_holds_its_obstacles(
    count: int, kind: str, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    shapes = obstacles(count, kind, rng)
    world = make_world(shapes)
    floors = [k for k in range(count) if isinstance(shapes[k], Floor)]
    tree, numbers = world.tree, world.shapes.numbers
    assert tree.planes.tolist() == floors
    assert len(tree.boxes) == max(2 * (count - len(floors)) - 1, 0)
    if len(tree.boxes):
        assert sorted(places_inside(world, 0)) == sorted(set(range(count)) - set(floors))
    for node, (centre, half) in enumerate(zip(tree.boxes[:, :3], tree.boxes[:, 3:], strict=True)):
        rows = numbers[places_inside(world, node)]
        turns = np.abs(rows[:, :SIZE].reshape(-1, 3, 4)[:, :, :3])
        reach = (turns @ rows[:, SIZE:MARGIN, None])[:, :, 0] + rows[:, MARGIN, None]
        low, high = (rows[:, CENTRE:RADIUS] - reach).min(axis=0), (rows[:, CENTRE:RADIUS] + reach).max(axis=0)
        np.testing.assert_allclose([centre - half, centre + half], [low, high], atol=1e-12)
    monkeypatch.setattr(contact_arrays, "Call", PlainCall)
    plain = make_world(shapes)
    for one, other in zip((*world.shapes, *tree), (*plain.shapes, *plain.tree), strict=True):
        np.testing.assert_array_equal(one, other)


def test_halves_are_divided_where_centres_differ_most() -> None:
    """Of the same centre, those that come first in the scene are in the first half."""
    places = [(0.0, 3.0, 0.0), (0.1, 1.0, 0.0), (0.2, 1.0, 0.0), (0.0, 1.0, 0.5), (0.3, 0.0, 0.0), (0.1, 2.0, 0.0)]
    world = make_world([Sphere(f"ball_{k}", 0.1, place) for k, place in enumerate(places)])
    halves: list[Any] = [sorted(places_inside(world, node)) for node in world.tree.children[0].tolist()]
    assert halves == [[1, 2, 4], [0, 3, 5]]


def test_rows_are_filled_for_every_kind() -> None:
    """Half sizes of the core, margin, and the radius of the sphere around."""
    shapes: list[Obstacle] = [
        Box("box", [0.2, 0.4, 0.6], [1.0, 2.0, 3.0]),
        Sphere("sphere", 0.1, [1.0, 2.0, 3.0]),
        Capsule("capsule", 0.1, 0.4, [1.0, 2.0, 3.0]),
        Cylinder("cylinder", 0.3, 0.8, [1.0, 2.0, 3.0]),
        Floor(0.5),
    ]
    work = make_world(shapes).shapes.numbers
    half, margin, radius = work[:, SIZE:MARGIN], work[:, MARGIN], work[:, RADIUS]
    expected = [(0.1, 0.2, 0.3), (0.0, 0.0, 0.0), (0.0, 0.0, half[2, 2]), (0.3, 0.3, half[3, 2]), (0.0, 0.0, 0.0)]
    np.testing.assert_allclose(half, expected, atol=1e-15)
    np.testing.assert_allclose(margin, [0.0, 0.1, 0.1, 0.0, 0.0], atol=1e-15)
    np.testing.assert_allclose(radius[:4], [0.14**0.5, 0.1, 0.1 + half[2, 2], np.hypot(0.3, half[3, 2])])
    assert np.isinf(radius[4])
    np.testing.assert_array_equal(work[:4, CENTRE:RADIUS], np.tile([1.0, 2.0, 3.0], (4, 1)))
    assert Call(build_world, make_world_work())() == 0
