"""One task of each family: for the quick tests, and for slow ones of what a family has in common."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest

ONE_OF_EACH_FAMILY = (
    "reach_site",
    "lift_brick",
    "place_cradle",
    "stack_2_of_3_bricks_random_order",
    "reassemble_3_bricks_fixed_order",
)


def one_of_each_family(names: Iterable[str]) -> list[str]:
    """Of names of environments, as ``reach_site_features``, those of such a task."""
    found = [name for name in names if name.rpartition("_")[0] in ONE_OF_EACH_FAMILY]
    assert len(found) == len(ONE_OF_EACH_FAMILY)
    return found


def slow_but(names: Iterable[str], quick: Iterable[str] = ONE_OF_EACH_FAMILY) -> list[Any]:
    """Parameters of a test, slow for all tasks but some."""
    kept = tuple(quick)
    return [
        pytest.param(name, marks=[] if name.removesuffix("_features") in kept else pytest.mark.slow) for name in names
    ]
