"""Compiled kernels compute what their Python says, to the bit, and need nothing but the C library."""

from __future__ import annotations

import types
from collections.abc import Callable

import numpy as np
import pytest

from jacokin import Robot
from jacokin.ik.closed_form import run_python
from jacokin.kernels.closed_form.batch import BATCH_COLUMNS
from jacokin.kernels.closed_form.pose import COLUMNS, MAX_BRANCHES
from jacokin.kernels.compiled import compiler
from jacokin.kernels.compiled.compiler import link, translating_only
from jacokin.kernels.compiled.library import NO_BATCH, KernelCall, KernelLibrary
from jacokin.kernels.compiled.loading import KERNELS
from tests.kernels.closed_form.tools import closed_form, target


@pytest.fixture(scope="module")
def library() -> KernelLibrary:
    KERNELS.warmup()
    assert KERNELS.library is not None
    return KERNELS.library


@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s300"])
def test_plain_and_compiled_kernels_give_the_same_bits(
    name: str, library: KernelLibrary, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    form = closed_form(robot)
    constants = form._chain, form._arm, form._limits
    T = np.array([target(robot, q) for q in robot.sample(rng, 60)])
    seeds = robot.sample(rng, 60)
    best = np.zeros((60, BATCH_COLUMNS))
    run_python(*constants, T, seeds, np.zeros((MAX_BRANCHES, COLUMNS)), best)
    np.testing.assert_array_equal(form.solve_batch(T, seeds).rows, best)
    for one, seed in zip(T, seeds, strict=True):
        rows = np.zeros((MAX_BRANCHES, COLUMNS))
        count = run_python(*constants, one[np.newaxis], seed[np.newaxis], rows, NO_BATCH)
        np.testing.assert_array_equal(form.solve_all(one, seed).rows, rows[:count])


def test_arrays_that_machine_code_would_misread_are_refused(library: KernelLibrary, robot: Robot) -> None:
    form = closed_form(robot)
    constants = form._chain, form._arm, form._limits
    T, seed = np.zeros((2, 4, 4)), np.zeros((2, 6))
    wrong = [
        (T.transpose(0, 2, 1), seed),
        (T.astype(np.float32), seed),
        (T, seed[:1]),
        (T, np.zeros((2, 7))[:, :6]),
        (T[0], seed),
    ]
    for targets, seeds in wrong:
        with pytest.raises(ValueError, match="the kernels need"):
            KernelCall(library, *constants, targets, seeds)


def test_a_name_with_two_meanings_is_refused() -> None:
    one, other = types.ModuleType("one"), types.ModuleType("other")
    vars(one)["errors"] = vars(other)["errors"] = len
    assert compiler.one_namespace([one, other]) == {"errors": len}
    vars(other)["errors"] = abs
    with pytest.raises(ValueError, match="errors in other has another meaning"):
        compiler.one_namespace([one, other])


def test_code_that_needs_numba_at_run_time_is_refused() -> None:
    import numba

    entry = numba.njit(lambda n: np.empty(n).sum())
    entry.compile((numba.types.intp,))
    with pytest.raises(RuntimeError, match="exists within numba only"):
        compiler._object_file(entry)


def test_a_file_without_the_kernels_is_refused() -> None:
    import llvmlite.binding as llvm

    from jacokin.kernels.compiled.library import target_machine

    other = target_machine().emit_object(llvm.parse_assembly("define i32 @other() { ret i32 0 }"))
    with pytest.raises(RuntimeError, match="does not contain the kernels"):
        KernelLibrary(other)


def test_numba_works_as_before_once_functions_were_only_translated() -> None:
    import numba

    with translating_only():
        inner = numba.njit(lambda x: x + 1)
        outer = numba.njit(lambda x: 2 * inner(x))
        outer.compile((numba.types.intp,))
        module, name = link(outer)
    assert {function.name for function in module.functions if not function.is_declaration} > {name}
    assert numba.njit(lambda x: 3 * x)(2) == 6
