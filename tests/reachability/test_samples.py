"""Samples against brute force: the cell and the orientation of a pose, and the nearest pose that is reached."""

from __future__ import annotations

import itertools

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.reachability import Grid, Orientations, bundled
from jacokin.reachability.samples import NO_SYMMETRIES, NOWHERE, Samples, Symmetries, turn_about_base

GRID = Grid([-0.3, -0.2, 0.0], [0.3, 0.4, 0.5], 0.1)
COUNT = 300
AXIS = np.array([0.0, 0.6, 0.8])


def random_rotations(rng: np.random.Generator, count: int) -> Array:
    """Rotations (n, 3, 3)."""
    return np.array([pin.Quaternion(rng.normal(size=4)).normalized().matrix() for _ in range(count)])


def angle_between(a: Array, b: Array, tool_axis: Array | None) -> float:
    """The angle [rad] between two rotations, or between the directions in which they turn an axis."""
    if tool_axis is None:
        return float(np.linalg.norm(pin.log3(a.T @ b)))
    return float(np.arccos(np.clip((a @ tool_axis) @ (b @ tool_axis), -1.0, 1.0)))


@pytest.mark.parametrize("turns", [False, True])
def test_the_cell_of_a_position_has_the_nearest_centre(turns: bool, rng: np.random.Generator) -> None:
    samples = Samples(GRID, Orientations.down(), Symmetries(turns, None))
    positions = rng.uniform(GRID.lower, GRID.upper, (COUNT, 3))
    centres = samples.position(np.arange(samples.positions))
    seen = positions
    if turns:
        seen = np.column_stack([np.hypot(*positions[:, :2].T), np.zeros(COUNT), positions[:, 2]])
    nearest = np.linalg.norm(centres[None] - seen[:, None], axis=2).argmin(axis=1)
    np.testing.assert_array_equal(samples.cell_of(positions), nearest)
    outside = np.array([[2.0, 0.0, 0.2], [0.0, 0.0, -0.01], [0.0, 0.0, 0.51], [np.nan, 0.0, 0.0], [np.inf, 0.0, 0.0]])
    assert (samples.cell_of(outside) == NOWHERE).all()


@pytest.mark.parametrize("symmetries", [NO_SYMMETRIES, Symmetries(True, None), Symmetries(True, AXIS)])
def test_the_orientation_of_a_pose_is_the_nearest(symmetries: Symmetries, rng: np.random.Generator) -> None:
    samples = Samples(GRID, Orientations.even(50), symmetries)
    rotations, positions = random_rotations(rng, COUNT), rng.uniform(-0.5, 0.5, (COUNT, 3))
    seen = rotations
    if symmetries.turns:
        seen = turn_about_base(rotations, -np.arctan2(positions[:, 1], positions[:, 0]))
    found = samples.orientation_of(rotations, positions)
    for rotation, index in zip(seen, found, strict=True):
        angles = [angle_between(rotation, each, symmetries.tool_axis) for each in samples.orientations.rotations]
        assert angles[index] == pytest.approx(min(angles), abs=1e-7)


def test_the_nearest_reachable_pose_is_that_of_all_samples(rng: np.random.Generator) -> None:
    """Poses in the half plane of the samples, so that nothing is turned; inside the workspace, and far from it."""
    reach = bundled()
    samples, axis = reach.samples, reach.samples.symmetries.tool_axis
    assert samples.symmetries.turns
    cells, orientations = np.nonzero(reach.counts)
    places = samples.position(cells)
    for rotation, reached_to in itertools.product(random_rotations(rng, 3), (0.5, 2.0)):
        position = np.array([rng.uniform(0.1, reached_to), 0.0, rng.uniform(0.0, reached_to)])
        wanted = pin.SE3(rotation, position)
        angles = np.array([angle_between(rotation, each, axis) for each in samples.orientations.rotations])
        costs = np.linalg.norm(places - position, axis=1) + 0.1 * angles[orientations]
        found = reach.nearest_reachable(wanted)
        cost = np.linalg.norm(found.translation - position) + 0.1 * angle_between(found.rotation, rotation, axis)
        assert cost == pytest.approx(costs.min(), abs=1e-7)
        if axis is not None:  # the roll, which is free, is that of the wanted pose as far as it can be
            rolls = [found.rotation @ pin.exp3(roll * axis) for roll in np.linspace(-np.pi, np.pi, 73)]
            least = min(angle_between(each, rotation, None) for each in rolls)
            assert angle_between(found.rotation, rotation, None) <= least + 1e-6


def test_samples_are_every_orientation_at_every_position() -> None:
    samples = Samples(GRID, Orientations.down(3), NO_SYMMETRIES)
    assert samples.shape == (6, 6, 5)
    targets = samples.targets(np.array([0, samples.positions - 1]))
    np.testing.assert_allclose(targets[0, :, :3, 3], np.tile([-0.25, -0.15, 0.05], (3, 1)))
    np.testing.assert_allclose(targets[1, :, :3, 3], np.tile([0.25, 0.35, 0.45], (3, 1)))
    for target in targets[0]:
        np.testing.assert_allclose(target[:3, 2], [0.0, 0.0, -1.0], atol=1e-12)
        np.testing.assert_allclose(jacokin.pose(target[:3, 3], rotation=target[:3, :3]).homogeneous, target)
