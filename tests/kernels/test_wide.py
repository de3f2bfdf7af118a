"""The kernels that are there a second time, for wider vectors: the same bits."""

from __future__ import annotations

import ctypes

import numpy as np
import pytest

from jacokin import IKSolver, load_robot
from jacokin.arrays import Array
from jacokin.ik.closed_form import ClosedForm
from jacokin.kernels import library
from jacokin.kernels.free_motion import run
from tests.kernels.free_motion.test_ways import ask, problem, search, way_of
from tests.kernels.six_joints.arms import ARMS, chain_of_arm, form_of, poses_and_jacobians

FUNCTIONS = ctypes.CDLL(str(library.PATH))


def form_of_name(name: str) -> ClosedForm:
    """Of an arm without limits, or of a bundled one with its own."""
    if name in ARMS:
        return form_of(chain_of_arm(name))
    return IKSolver(load_robot(name), collision="ignore").closed_form()


def branches(form: ClosedForm, function: object, T: Array, seeds: Array) -> list[bytes]:
    """The best branch of each target, and all of each."""
    best = np.empty((len(T), 20))
    call = form._call(T, seeds, best)
    call._function = function  # type: ignore[assignment]  # one of two forms of it
    found = [np.array([call()]).tobytes(), best.tobytes()]
    call, target, seed, rows = form._one_target()
    call._function = function  # type: ignore[assignment]
    for target[:], seed[:] in zip(T, seeds, strict=True):
        count = call()
        found.append(rows[: max(count, ~count)].tobytes())
    return found


@pytest.mark.skipif(not FUNCTIONS.jacokin_is_wide(), reason="the processor has no wider vectors")
@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s300", "gen3_lite", "ur5", "puma", "crx", "generic"])
def test_wider_vectors_give_the_same_bits(name: str, rng: np.random.Generator) -> None:
    """At random poses, and at those of round angles, where folds and continua are."""
    form = form_of_name(name)
    q = rng.uniform(-np.pi, np.pi, (200, 6))
    q[::4] = np.round(q[::4] / (np.pi / 4)) * np.pi / 4
    T = np.ascontiguousarray(poses_and_jacobians(form.chain, q)[0])
    seeds = q + rng.normal(scale=0.01, size=q.shape) * (np.arange(len(q)) % 3)[:, np.newaxis]
    forms = (FUNCTIONS.jacokin_solve_targets, FUNCTIONS.jacokin_solve_targets_avx2)
    for each in forms:
        each.argtypes, each.restype = [ctypes.c_void_p], ctypes.c_int64
    narrow, wide = (branches(form, each, T, seeds) for each in forms)
    assert narrow == wide


@pytest.mark.skipif(not FUNCTIONS.jacokin_is_wide(), reason="the processor has no wider vectors")
def test_ways_are_the_same_with_wider_vectors() -> None:
    found = []
    for each in (FUNCTIONS.jacokin_run_free_motion, FUNCTIONS.jacokin_run_free_motion_avx2):
        each.argtypes, each.restype = [ctypes.c_void_p], ctypes.c_int64
        call, _ = problem()
        call._function = each  # one of two forms of it
        search(call)
        while ask(call, run.MotionTask.FIND_WAYS, 50) != run.FINISHED:
            pass
        found.append((way_of(call).tobytes(), call.work.cuts.tobytes()))
    assert found[0] == found[1]


def test_the_one_for_this_processor_is_called() -> None:
    wide = "_avx2" if FUNCTIONS.jacokin_is_wide() else ""
    assert library.load().function("solve_targets").__name__ == f"jacokin_solve_targets{wide}"
    assert library.load().function("run_free_motion").__name__ == f"jacokin_run_free_motion{wide}"
    assert library.load().function("run_contact").__name__ == "jacokin_run_contact"
