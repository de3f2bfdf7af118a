"""Episodes start from dm_control's distributions. `benchmarks/resets.py` compares more of them: 500 of each task."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

import jacokin.tasks
from tests.tasks.families_sample import one_of_each_family
from tests.tasks.reference.sides import FEATURES, load_reference

sys.path.append(str(Path(__file__).resolve().parents[3]))  # last: the installed package is what gets tested

from benchmarks import resets

COUNT = 60
LIKELY = 1e-3  # p-value, corrected, below which two samples are from different distributions
FIXED = 1e-4  # [m or rad] between the means of what does not vary
BITS = 0.8  # between the entropies of branches: four standard deviations of their difference in so few resets


@pytest.mark.slow
@pytest.mark.parametrize("name", one_of_each_family(FEATURES))
def test_episodes_start_from_the_same_distribution(name: str) -> None:
    reference, ours = load_reference(name, seed=1), jacokin.tasks.load(name, seed=2, contact="dm_control")
    found = resets.compare(resets.starts(reference, COUNT), resets.starts(ours, COUNT))
    assert found.count >= 12
    assert found.least_p > LIKELY, found
    assert found.largest_difference < FIXED, found
    assert abs(np.diff(found.entropies)[0]) < BITS, found


def test_props_that_have_settled_move_as_slowly() -> None:
    """Settling ends at the same step: by one more they have lost a fifth of their velocity."""
    reference, ours = load_reference("lift_brick_features", seed=1), jacokin.tasks.load("lift_brick", seed=2)
    found, wanted = (each.reset().observation["duplo2x4/linear_velocity"][0] for each in (ours, reference))
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-6)


@pytest.mark.slow
def test_other_distributions_are_told_apart() -> None:
    """The comparison itself: two tasks that start alike but for the height of the tool."""
    one, other = (
        resets.starts(jacokin.tasks.load(name, seed=0, contact="dm_control"), COUNT)
        for name in ("reach_duplo", "lift_brick")
    )
    assert resets.compare(one, one).least_p == 1.0
    one.quantities["joint 1"] = np.abs(one.quantities["joint 1"])
    assert resets.compare(one, other).least_p < LIKELY
    assert resets.compare(one, other).at == "joint 1"
