"""The surface of a cloud of points, as a point that moves along it finds it."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.kernels.contact.cloud import find_points, separate_point
from jacokin.kernels.contact.cloud_surface import AROUND_NUMBERS, MOST_AROUND, find_surface
from jacokin.kernels.contact.separation import make_separation_work
from jacokin.kernels.contact.shapes import MARGIN, Shapes
from jacokin.model import PointCloud
from jacokin.model.descriptions import mjcf
from jacokin.model.mujoco_twin import shapes_of_twin
from tests.compiled_twin import contact_arrays
from tests.kernels.contact.test_distances import Flight

RADIUS, HEIGHT = 0.002, 0.0125  # [m]
DOWN = np.array([0.0, 0.0, -1.0])


def cloud_of(points: Array, rng: np.random.Generator) -> Shapes:
    """Points (n, 3) as the second of two shapes."""
    flight = Flight(("sphere", "sphere"), rng)
    model, flying = mjcf.to_pinocchio(flight.model, "flight"), shapes_of_twin(flight.model)[1]
    solid = PointCloud("cloud", points, RADIUS).solid
    return contact_arrays(model, [solid, flying], [], [0]).geometry.shapes


def seen(shapes: Shapes, points: Array, at: Array) -> tuple[Array, float, Array]:
    """From a point (3,): direction (3,) and distance [m] of the surface, and the direction of the nearest point."""
    work, away = make_separation_work(), points - at
    work.relative[:] = np.eye(3, 4)
    lengths = np.linalg.norm(away, axis=1)
    nearest = int(lengths.argmin())
    way = away[nearest] / lengths[nearest]
    around = np.zeros((MOST_AROUND, AROUND_NUMBERS))
    x, y, z = way.tolist()
    normal, level = find_surface(shapes, 1, work, tuple(at), (x, y, z), float(lengths[nearest]) - RADIUS, around)
    return np.array(normal), level, way


@pytest.mark.parametrize("spacing", [0.002, 0.004, 0.008])
def test_along_a_plane_of_points_the_surface_is_that_plane(spacing: float, rng: np.random.Generator) -> None:
    """The nearest point is up to 25 degrees aside."""
    steps = np.arange(-0.06, 0.06, spacing)
    grid = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
    points = np.column_stack([grid, np.zeros(len(grid))])
    shapes, before, aside = cloud_of(points, rng), DOWN, []
    for x in np.linspace(-0.01, 0.01, 201):
        normal, level, way = seen(shapes, points, np.array([x, 0.3 * x, HEIGHT]))
        aside.append(np.linalg.norm(way - DOWN))
        assert np.linalg.norm(normal - DOWN) < 0.04
        assert np.linalg.norm(normal - before) < 0.02
        assert abs(level - (HEIGHT - RADIUS)) < 4e-4
        before = normal
    assert max(aside) > 0.4 * spacing / HEIGHT


def test_noise_of_points_is_no_slope_and_none_comes_nearer_unseen(rng: np.random.Generator) -> None:
    points = np.column_stack([rng.uniform(-0.05, 0.05, (1500, 2)), 1e-3 * rng.normal(size=1500)])
    shapes, slopes = cloud_of(points, rng), []
    for x, y in rng.uniform(-0.02, 0.02, (50, 2)):
        at = np.array([x, y, HEIGHT])
        normal, level, way = seen(shapes, points, at)
        least = np.linalg.norm(points - at, axis=1).min() - RADIUS
        assert level <= least + 1e-12
        assert level > least - 2.5e-3
        slopes.append((np.linalg.norm(normal - DOWN), np.linalg.norm(way - DOWN)))
    told, nearest = np.mean(slopes, axis=0)
    assert told < 0.4 * nearest


def test_between_a_floor_and_a_wall_it_looks_away_from_both(rng: np.random.Generator) -> None:
    """As the point goes from one to the other the direction turns by degrees: the nearest one's leaps by ninety."""
    steps = np.arange(0.0, 0.06, 0.003)
    grid = np.stack(np.meshgrid(steps, steps - 0.03), axis=-1).reshape(-1, 2)
    floor, wall = np.column_stack([grid, np.zeros(len(grid))]), np.column_stack([np.zeros(len(grid)), grid[:, ::-1]])
    points = np.vstack([floor, wall])
    shapes, before = cloud_of(points, rng), None
    for part in np.linspace(0.0, 1.0, 101):
        at = np.array([0.02 - 0.01 * part, 0.0, 0.01 + 0.01 * part])
        normal, level, _ = seen(shapes, points, at)
        assert -4e-3 < level - (min(at[0], at[2]) - RADIUS) < 2e-4  # the corner is filled a little
        assert max(normal[0], normal[2]) < 0.1
        assert before is None or np.linalg.norm(normal - before) < 0.1
        before = normal


@pytest.mark.parametrize("within", [0.01, 0.03, 0.2])
def test_all_points_that_are_near_are_found(within: float, rng: np.random.Generator) -> None:
    points = rng.uniform(-0.1, 0.1, (200, 3))
    shapes, work, found = cloud_of(points, rng), make_separation_work(), np.zeros(50, dtype=np.int64)
    pair, ball = np.array([0, 1]), float(shapes.numbers[0, MARGIN])
    for at in rng.uniform(-0.1, 0.1, (10, 3)):
        work.relative[:, :3], work.relative[:, 3] = np.eye(3), -at
        count = find_points(shapes, pair, work, within, found)
        distances = np.linalg.norm(shapes.points - at, axis=1) - ball - RADIUS
        if np.count_nonzero(distances <= within) > len(found):
            assert count > len(found)
            continue
        np.testing.assert_array_equal(np.sort(found[:count]), np.flatnonzero(distances <= within))
        for k in found[:count]:
            assert separate_point(shapes, pair, work, int(k)) == pytest.approx(distances[k], abs=1e-9)
            np.testing.assert_allclose(work.relative[:, 3], -at)
