"""A single pose never waits for the compiler; batches and `warmup` do, and what they made is used from then on."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from jacokin import Robot
from jacokin.errors import JacokinError
from jacokin.ik.closed_form import ClosedForm
from jacokin.kernels.compiled import cache, loading
from jacokin.kernels.compiled.loading import COMPILE_AFTER, KERNELS, WAIT_FOR, Kernels

FAILING = "raise SystemExit('no compiler here')"


@pytest.fixture(scope="session")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A file with the kernels of this machine."""
    KERNELS.warmup()
    code = cache.read().code
    assert code is not None, "the cache of whoever runs the tests must be usable"
    file = tmp_path_factory.mktemp("compiled") / "kernels"
    file.write_bytes(cache.pack(code, cache.key()))
    return file


@pytest.fixture
def runs(compiled: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """An empty cache, and a compiler that notes its runs in a file and hands out what was compiled before."""
    notes = tmp_path / "runs"
    program = (
        f"import sys; open({str(notes)!r}, 'a').write('x')\n"
        f"sys.stdout.buffer.write(b'noise' + open({str(compiled)!r}, 'rb').read())"
    )
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(loading, "_COMPILE", program)
    notes.touch()
    return notes


def how_often(runs: Path) -> int:
    return len(runs.read_text())


def background(kernels: Kernels) -> None:
    """Wait for the compiler in the background."""
    job = kernels._job
    if job is not None:
        job.join()


def until(condition: Callable[[], bool]) -> None:
    """Wait for another process."""
    end = time.monotonic() + 60.0  # [s]
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_single_poses_compile_in_the_background(runs: Path, caplog: pytest.LogCaptureFixture) -> None:
    kernels = Kernels()
    for _ in range(COMPILE_AFTER):
        assert kernels.for_poses(1) is None
    assert how_often(runs) == 0
    assert caplog.text.count("jacokin warmup") == 1
    assert kernels.for_poses(1) is None  # this one starts the compiler and does not wait
    background(kernels)
    assert kernels.for_poses(1) is not None
    assert how_often(runs) == 1


def test_a_large_batch_waits_for_the_compiler(runs: Path, caplog: pytest.LogCaptureFixture) -> None:
    kernels = Kernels()
    assert kernels.for_poses(WAIT_FOR) is not None
    assert kernels.for_poses(1) is kernels.library
    assert how_often(runs) == 1
    assert caplog.text.count("compiling the closed form") == 1


def test_a_small_batch_does_not_wait(runs: Path) -> None:
    kernels = Kernels()
    assert kernels.for_poses(WAIT_FOR - 1) is None
    background(kernels)
    assert kernels.for_poses(1) is not None


def test_a_large_batch_waits_for_a_compiler_in_the_background(runs: Path, caplog: pytest.LogCaptureFixture) -> None:
    kernels = Kernels()
    assert kernels.for_poses(COMPILE_AFTER + 1) is None
    assert kernels.for_poses(WAIT_FOR) is not None
    assert how_often(runs) == 1
    assert "jacokin warmup" in caplog.text


def test_a_cache_is_loaded_silently(runs: Path, caplog: pytest.LogCaptureFixture) -> None:
    Kernels().warmup()
    caplog.clear()
    later = Kernels()
    later.prepare()
    assert later.library is not None
    assert caplog.text == ""
    assert how_often(runs) == 1


def test_a_damaged_cache_is_rebuilt_with_one_warning(runs: Path, caplog: pytest.LogCaptureFixture) -> None:
    Kernels().warmup()
    file = cache.path()
    assert file is not None
    file.write_bytes(bytes(file.stat().st_size))
    caplog.clear()
    kernels = Kernels()
    kernels.warmup()
    kernels.warmup()
    assert kernels.library is not None
    assert caplog.text.count("damaged or incomplete") == 1
    assert cache.read().problem == ""
    assert how_often(runs) == 2


def test_what_cannot_be_kept_works_in_this_process(
    runs: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("not a folder")
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(blocked))
    kernels = Kernels()
    assert kernels.for_poses(WAIT_FOR) is not None
    kernels.warmup()
    assert caplog.text.count("cannot be kept in") == 1
    assert how_often(runs) == 1


def test_what_another_process_compiled_meanwhile_is_used(runs: Path, compiled: Path) -> None:
    kernels = Kernels()
    kernels.prepare()
    assert cache.write(cache.unpack(compiled.read_bytes())) == ""
    assert kernels.for_poses(WAIT_FOR) is not None
    assert how_often(runs) == 0


def test_a_compiler_that_fails_leaves_the_plain_form(
    runs: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    working = loading._COMPILE
    monkeypatch.setattr(loading, "_COMPILE", FAILING)
    kernels = Kernels()
    for _ in range(3):
        assert kernels.for_poses(WAIT_FOR) is None
    assert caplog.text.count("no compiler here") == 1
    with pytest.raises(JacokinError, match="no compiler here"):
        kernels.warmup()
    monkeypatch.setattr(loading, "_COMPILE", working)
    kernels.warmup()
    assert kernels.library is not None


def test_output_that_is_cut_off_is_not_run(runs: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(loading, "_COMPILE", loading._COMPILE + "[:-10]")
    program = loading._COMPILE.replace(".read())[:-10]", ".read()[:-10])")
    monkeypatch.setattr(loading, "_COMPILE", program)
    with pytest.raises(JacokinError, match="damaged or incomplete"):
        Kernels().warmup()


def test_numba_disable_jit_is_respected_and_named(
    runs: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    kernels = Kernels()
    assert kernels.for_poses(WAIT_FOR) is None
    kernels.warmup()
    assert kernels.library is None
    assert caplog.text.count("NUMBA_DISABLE_JIT is set") == 1
    assert how_often(runs) == 0


def test_options_of_numba_do_not_reach_the_compiler(
    runs: Path, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    seen = tmp_path / "environment"
    program = f"import os; open({str(seen)!r}, 'w').write(' '.join(os.environ));"
    monkeypatch.setattr(loading, "_COMPILE", program + loading._COMPILE)
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    monkeypatch.setenv("NUMBA_CPU_NAME", "generic")
    monkeypatch.setenv("SOMETHING_ELSE", "1")
    with pytest.raises(JacokinError, match="damaged"):  # made for another CPU
        Kernels().warmup()
    names = seen.read_text().split()
    assert "SOMETHING_ELSE" in names
    assert "NUMBA_CPU_NAME" in names
    assert "NUMBA_BOUNDSCHECK" not in names


def test_an_arm_with_a_cache_solves_its_first_pose_compiled(
    runs: Path, monkeypatch: pytest.MonkeyPatch, robot: Robot
) -> None:
    Kernels().warmup()
    monkeypatch.setattr("jacokin.ik.closed_form.KERNELS", fresh := Kernels())
    form = ClosedForm(robot.pin_model, robot.frame_id(), None, robot.lower, robot.upper)
    assert fresh.library is not None
    T = np.ascontiguousarray(robot.forward_kinematics(robot.home).homogeneous)
    assert len(form.solve_all(T, robot.home)) > 0
    assert fresh._plain_poses == 0


def test_no_solve_needs_numba(tmp_path: Path) -> None:
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
    environment = {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONPATH": str(Path(loading.__file__).parents[3])}
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "jacokin warmup" in done.stderr
    assert list(tmp_path.iterdir()) == []  # one pose compiles nothing


def test_no_compiler_outlives_the_process_that_started_it(tmp_path: Path) -> None:
    note = tmp_path / "pid"
    sleeping = f"open({str(note)!r}, 'w').write(str(os.getpid())); import time; time.sleep(600)"
    program = (
        "from jacokin.kernels.compiled import loading\n"
        f"loading._COMPILE = {sleeping!r}\n"
        "loading.CompileJob(lambda job: None, background=True).run()\n"
    )
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    with subprocess.Popen([sys.executable, "-P", "-c", program], env=environment) as parent:
        try:
            until(lambda: parent.poll() is not None or (note.is_file() and note.read_text() != ""))
            compiler = Path("/proc", note.read_text())
            assert compiler.exists()
        finally:
            parent.kill()
    until(lambda: not (compiler / "exe").exists())  # a process that has ended but was not waited for has none either
    assert list(tmp_path.rglob("*" + cache.ENDING)) == []
