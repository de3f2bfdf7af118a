"""The kernels' plain and compiled forms agree, and compiling is never silent, never needed for one pose."""

from __future__ import annotations

import subprocess
import sys
import types
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from jacokin import Robot
from jacokin.ik.closed_form import compilation
from jacokin.ik.closed_form.kernels import batch as kernels_batch
from jacokin.ik.closed_form.kernels.batch import BATCH_COLUMNS
from jacokin.ik.closed_form.kernels.pose import COLUMNS, MAX_BRANCHES
from tests.ik.closed_form.tools import closed_form, target


@pytest.fixture
def fresh(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> list[Path | None]:
    """A process that has solved nothing yet, an empty cache folder, and a compiler that only notes its calls."""
    calls: list[Path | None] = []

    def compile_nothing(folder: Path | None) -> compilation.Solve:
        calls.append(folder)
        if folder is not None:
            (folder / "kernels.nbi").write_bytes(b"index")
        return kernels_batch.solve

    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(compilation, "_compiled", None)
    monkeypatch.setattr(compilation, "_plain_poses", 0)
    monkeypatch.setattr(compilation, "_cached", None)
    monkeypatch.setattr(compilation, "_warned", set())
    monkeypatch.setattr(compilation, "_compile", compile_nothing)
    return calls


@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s300"])
def test_plain_and_compiled_kernels_give_the_same_bits(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    compilation.warmup()
    robot = bundled(name)
    form = closed_form(robot)
    none = np.empty((0, BATCH_COLUMNS))
    for q, seed in zip(robot.sample(rng, 60), robot.sample(rng, 60), strict=True):
        T = target(robot, q)
        rows = np.zeros((MAX_BRANCHES, COLUMNS))
        arguments = (form._chain, form._arm, form._limits, T[np.newaxis], seed[np.newaxis], rows, none)
        count = kernels_batch.solve(*arguments)
        np.testing.assert_array_equal(form.solve_all(T, seed).rows, rows[:count])


def test_a_single_pose_does_not_compile(fresh: list[Path | None], caplog: pytest.LogCaptureFixture) -> None:
    assert compilation.solver() is kernels_batch.solve
    assert compilation.solver() is kernels_batch.solve
    assert fresh == []
    assert caplog.text.count("jacokin warmup") == 1


def test_many_poses_compile_once_and_say_so(fresh: list[Path | None], caplog: pytest.LogCaptureFixture) -> None:
    for _ in range(3):
        compilation.solver(compilation.COMPILE_AFTER + 1)
    assert fresh == [compilation.cache_folder()]
    assert compilation.is_cached()
    assert caplog.text.count("compiling the closed form") == 1


def test_a_warm_cache_is_loaded_silently(
    fresh: list[Path | None], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    compilation.warmup()
    caplog.clear()
    monkeypatch.setattr(compilation, "_compiled", None)
    monkeypatch.setattr(compilation, "_warned", set())
    compilation.solver()
    assert len(fresh) == 1
    compilation.solver(compilation.LOAD_AFTER)
    assert len(fresh) == 2
    assert caplog.text == ""


def test_a_damaged_cache_is_not_trusted(fresh: list[Path | None]) -> None:
    compilation.warmup()
    folder = compilation.cache_folder()
    assert folder is not None
    (folder / "kernels.nbi").write_bytes(b"cut")
    assert not compilation.is_cached()


def test_an_unwritable_cache_folder_works_and_says_so_once(
    fresh: list[Path | None],
    caplog: pytest.LogCaptureFixture,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(blocked))
    compilation.warmup()
    compilation.warmup()
    assert fresh == [None]
    assert caplog.text.count("cannot write the cache folder") == 1


def test_a_name_with_two_meanings_is_refused() -> None:
    one, other = types.ModuleType("one"), types.ModuleType("other")
    one.errors = other.errors = len  # type: ignore[attr-defined]  # a module made by hand
    assert compilation._one_namespace([one, other]) == {"errors": len}
    other.errors = abs  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="errors in other has another meaning"):
        compilation._one_namespace([one, other])


def test_one_pose_on_a_cold_cache_needs_no_numba(tmp_path: Path) -> None:
    code = (
        "import sys, numpy as np, jacokin\n"
        "robot = jacokin.load_robot()\n"
        "from jacokin.ik.closed_form import ClosedForm\n"
        "form = ClosedForm(robot.pin_model, robot.frame_id(), None, robot.lower, robot.upper)\n"
        "T = np.ascontiguousarray(robot.forward_kinematics(robot.home).homogeneous)\n"
        "rows = form.solve_all(T, robot.home)\n"
        "assert np.abs(rows.q[0] - robot.home).max() < 1e-12\n"
        "assert 'numba' not in sys.modules and 'mujoco' not in sys.modules and 'mink' not in sys.modules\n"
    )
    environment = {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(Path(compilation.__file__).parents[3])}
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "jacokin warmup" in done.stderr
