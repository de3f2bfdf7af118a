"""Poses of maps, for tests."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.reachability import ReachabilityMap
from jacokin.reachability.samples import turn_about_base


def random_samples(reach: ReachabilityMap, rng: np.random.Generator, count: int) -> tuple[Array, NDArray[np.uint8]]:
    """Poses of a map anywhere around its axes, and how many configurations it has for them."""
    targets, cells, orientations = random_samples_at(reach, rng, count)
    return targets, reach.counts[cells, orientations]


def random_samples_at(
    reach: ReachabilityMap, rng: np.random.Generator, count: int
) -> tuple[Array, NDArray[np.int_], NDArray[np.int_]]:
    """Poses of a map anywhere around its axes, and the cells and orientations that stand for them."""
    samples = reach.samples
    cells = rng.integers(samples.positions, size=count)
    orientations = rng.integers(len(samples.orientations), size=count)
    rotations = samples.orientations.rotations[orientations]
    positions = samples.position(cells)
    axis = samples.symmetries.tool_axis
    if axis is not None:
        rotations = np.array([r @ pin.exp3(rng.uniform(-np.pi, np.pi) * axis) for r in rotations])
    if samples.symmetries.turns:
        turns = turn_about_base(np.tile(np.eye(3), (count, 1, 1)), rng.uniform(-np.pi, np.pi, count))
        rotations, positions = turns @ rotations, np.einsum("nij,nj->ni", turns, positions)
    targets = np.tile(np.eye(4), (count, 1, 1))
    targets[:, :3, :3], targets[:, :3, 3] = rotations, positions
    return targets, cells, orientations
