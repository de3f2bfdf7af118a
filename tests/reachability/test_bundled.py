"""The maps in the package: small, of the robots they name, and what building them again gives."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from jacokin import IKSolver, Robot
from jacokin.errors import UnknownNameError
from jacokin.model.descriptions.bundled import NAMES
from jacokin.reachability import Grid, build, bundled
from jacokin.reachability.folder import count_reaching
from tests.reachability.poses import random_samples_at


@pytest.mark.parametrize("name", NAMES)
def test_a_bundled_map_is_of_its_robot_and_small(name: str) -> None:
    reach = bundled(name)
    assert reach.robot.name == name
    assert reach.robot.source.bundled == name  # the hash was compared
    assert sum(path.stat().st_size for path in reach.folder.iterdir()) < 1_000_000
    least = 0.1 if reach.robot.unlimited[0] else 0.05  # of a slice through the axis; of a block, which has more corners
    assert least < (reach.counts > 0).mean() < 0.5
    assert reach.bound is not None


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [20, pytest.param(80, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", NAMES)
def test_a_bundled_map_agrees_with_the_solver_of_its_robot(name: str, count: int, rng: np.random.Generator) -> None:
    """Contact is that of the samples themselves; kinematics are those of all poses that they stand for."""
    reach = bundled(name)
    bare = IKSolver(reach.robot, collision="ignore")
    reached = (reach.counts > 0) | (reach.touching > 0)
    targets, cells, orientations = random_samples_at(reach, rng, count)
    counts, *_ = count_reaching(bare, targets)
    np.testing.assert_array_equal(counts > 0, reached[cells, orientations])
    targets = reach.samples.targets(cells)[np.arange(len(cells)), orientations]
    counts, _, touching = count_reaching(reach.solver, np.ascontiguousarray(targets))
    np.testing.assert_array_equal(counts, reach.counts[cells, orientations])
    np.testing.assert_array_equal(touching, reach.touching[cells, orientations])


def test_building_a_bundled_map_again_gives_the_same(bundled_robot: Robot, tmp_path: Path) -> None:
    before = bundled(bundled_robot.name)
    again = build(bundled_robot, folder=tmp_path / "map", grid=Grid.around(bundled_robot, 0.05), orientations=100)
    assert again is not None
    # Machine code for another processor may round poses at the edge of reach otherwise.
    assert ((again.counts > 0) == (before.counts > 0)).mean() > 0.9999
    np.testing.assert_allclose(
        np.nan_to_num(again.margins.astype(float)).mean(), np.nan_to_num(before.margins.astype(float)).mean(), rtol=1e-3
    )


@pytest.fixture
def bundled_robot(bundled: Callable[[str], Robot]) -> Robot:
    return bundled("m1n6s300")


def test_an_unknown_robot_has_no_map() -> None:
    with pytest.raises(UnknownNameError, match="j2n6s300"):
        bundled("jaco")
