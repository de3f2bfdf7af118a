"""From Python to an object file: nothing of numba remains in it, and numba works on."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from build_kernels.compiling import link, object_file, translating_only


def test_code_that_needs_numba_at_run_time_is_refused() -> None:
    function = numba.njit(lambda n: np.empty(n).sum())
    function.compile((numba.types.intp,))
    with pytest.raises(RuntimeError, match="exists within numba only"):
        object_file(function, "jacokin_sum")


def test_an_object_file_has_one_name_for_others() -> None:
    with translating_only():
        inner = numba.njit(lambda x: x + 1)
        outer = numba.njit(lambda x: 2 * inner(x))
        outer.compile((numba.types.intp,))
        code = object_file(outer, "jacokin_twice")
    assert b"jacokin_twice" in code
    assert b"NumbaEnv" not in code


def test_numba_works_as_before_once_functions_were_only_translated() -> None:
    with translating_only():
        inner = numba.njit(lambda x: x + 1)
        outer = numba.njit(lambda x: 2 * inner(x))
        outer.compile((numba.types.intp,))
        module, name = link(outer)
    assert {function.name for function in module.functions if not function.is_declaration} > {name}
    assert numba.njit(lambda x: 3 * x)(2) == 6
