"""From Python to an object file: nothing of numba remains in it, and numba works on."""

from __future__ import annotations

import numba
import numpy as np
import pytest

from build_kernels.compiling import exporting, link, translating_only
from build_kernels.emitting import emit
from build_kernels.targets import TARGETS


@pytest.mark.slow
def test_code_that_needs_numba_at_run_time_is_refused() -> None:
    function = numba.njit(lambda n: np.empty(n).sum())
    function.compile((numba.types.intp,))
    with pytest.raises(RuntimeError, match="exists within numba only"):
        emit(exporting({"jacokin_sum": function}))


def test_an_object_file_has_one_name_for_others() -> None:
    with translating_only():
        inner = numba.njit(lambda x: x + 1)
        outer = numba.njit(lambda x: 2 * inner(x))
        outer.compile((numba.types.intp,))
        module = exporting({"jacokin_twice": outer})
        code = emit(module)
    assert b"jacokin_twice" in code
    assert b"NumbaEnv" not in code


@pytest.mark.parametrize(
    ("name", "begin"),
    {
        "aarch64-linux": b"\x7fELF\2\1\1\0\0\0\0\0\0\0\0\0\1\0\xb7\0",
        "x86_64-linux": b"\x7fELF\2\1\1\0\0\0\0\0\0\0\0\0\1\0\x3e\0",
        "x86_64-windows": b"\x64\x86",
        "aarch64-macos": b"\xcf\xfa\xed\xfe\x0c\0\0\1",
        "x86_64-macos": b"\xcf\xfa\xed\xfe\x07\0\0\1",
        "wasm32": b"\0asm\1\0\0\0",
    }.items(),
)
def test_one_module_is_emitted_for_every_machine(name: str, begin: bytes) -> None:
    with translating_only():
        function = numba.njit(lambda address: 2 * address)
        function.compile((numba.types.intp,))
        module = exporting({"jacokin_twice": function})
        before = str(module)
        code = emit(module, TARGETS[name])
    assert code.startswith(begin)
    assert b"jacokin_twice" in code
    assert str(module) == before


def test_what_is_there_for_wider_vectors_has_a_name_of_its_own() -> None:
    with translating_only():
        function = numba.njit(lambda address: 2 * address)
        function.compile((numba.types.intp,))
        wide = TARGETS["x86_64-linux"].wide
        assert wide is not None
        assert b"jacokin_twice_avx2" in emit(exporting({"jacokin_twice": function}), wide)


def test_numba_works_as_before_once_functions_were_only_translated() -> None:
    with translating_only():
        inner = numba.njit(lambda x: x + 1)
        outer = numba.njit(lambda x: 2 * inner(x))
        outer.compile((numba.types.intp,))
        module = link({"jacokin_twice": outer})
    defined = [function.name for function in module.functions if not function.is_declaration]
    assert "jacokin_twice" in defined
    assert sum("lambda" in name for name in defined) == 2
    assert numba.njit(lambda x: 3 * x)(2) == 6
