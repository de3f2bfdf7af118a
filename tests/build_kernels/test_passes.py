"""Functions translated by the kernels' passes do as plain Python does."""

from __future__ import annotations

from typing import Any, Literal

import numba
import numpy as np
import pytest
from numba.core.types.functions import BaseFunction

from build_kernels.passes import Passes, remembering
from jacokin.arrays import Array

OPTIONS = {"pipeline_class": Passes, "error_model": "numpy"}


def exchange(a: Array, counts: Array, i: int, j: int) -> float:
    """Elements by constants and by variables, from the front and from the back, of one to three dimensions."""
    row = a[i]
    row[-1, j] = 2 * counts[-2]
    a[0, 1, 2] += a[i, -j, -1] - row[1, 0]
    counts[j] = counts[0] - 1
    total = 0.0
    for k in range(-len(counts), 0):
        total += counts[k] * row[j, 0]
        row[j, 0] = total
    return total


@pytest.mark.one_quick
@pytest.mark.parametrize(("i", "j"), [(0, 1), (1, 2), (-1, -2), (-2, 0)])
@pytest.mark.parametrize("order", ["C", "F"])
def test_elements_of_arrays(i: int, j: int, order: Literal["C", "F"]) -> None:
    """Also of an array that is laid out otherwise, which is left to numba."""
    a, counts = np.arange(24.0).reshape(2, 3, 4), np.arange(7, 12)
    arrays: list[tuple[Any, Any]] = [(np.array(a, order=order), counts.copy()) for _ in range(2)]
    with remembering():
        compiled = numba.njit(**OPTIONS)(exchange)(*arrays[0], i, j)
    assert compiled == exchange(arrays[1][0], arrays[1][1], i, j)
    for made, expected in zip(*arrays, strict=True):
        np.testing.assert_array_equal(made, expected)


def test_numba_is_as_before_afterwards() -> None:
    """Also where a function did not compile."""
    before = BaseFunction.get_call_type
    with pytest.raises(numba.TypingError), remembering():  # a tuple is no number
        numba.njit(**OPTIONS)(lambda pair: -pair)((1.0, 2.0))
    assert BaseFunction.get_call_type is before
