"""The compiled kernels compute what their Python says, to the bit; a library that does not fit is one sentence."""

from __future__ import annotations

import os
import re
import shutil
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot, warmup
from jacokin.errors import JacokinError
from jacokin.ik import Box, Scene
from jacokin.ik import closed_form as closed_form_module
from jacokin.ik.solutions import curve_arm
from jacokin.kernels import library
from jacokin.kernels.closed_form.batch import make_target_work, solve_targets
from jacokin.kernels.entries import ENTRIES
from jacokin.kernels.library import Call, Calls, Library, SharedCalls, flatten
from jacokin.kernels.motion_rows import AverageWork, average_rows, make_average_work
from tests.kernels.closed_form.tools import closed_form, target
from tests.kernels.plain import PlainCall
from tests.programs import python

FIRST_ANSWER = (
    "import jacokin; robot = jacokin.load_robot(); solver = jacokin.IKSolver(robot);"
    "print(solver.solve(robot.forward_kinematics(robot.home)).success)"
)


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s300"])
def test_plain_and_compiled_kernels_give_the_same_bits(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    robot = bundled(name)
    compiled = closed_form(robot)
    monkeypatch.setattr(closed_form_module, "Call", PlainCall)
    plain = closed_form(robot)
    T = np.array([target(robot, q) for q in robot.sample(rng, 60)])
    seeds = robot.sample(rng, 60)
    expected = plain.solve_batch(T, seeds).rows
    for threads in (1, 3):
        np.testing.assert_array_equal(compiled.solve_batch(T, seeds, threads).rows, expected)
    for one, seed in zip(T, seeds, strict=True):
        np.testing.assert_array_equal(compiled.solve_all(one, seed).rows, plain.solve_all(one, seed).rows)


@pytest.mark.slow
def test_plain_and_compiled_kernels_choose_the_same_clear_branches(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(3)
    T, seeds = np.array([target(robot, q) for q in robot.sample(rng, 60)]), robot.sample(rng, 60)
    scene = Scene([Box("box", [0.3, 0.3, 0.3], [0.4, 0.2, 0.2])])
    solvers = [IKSolver(robot, scene=scene, collision=collision) for collision in ("prefer", "report")]
    compiled = [solver.solve_batch(T, seeds, closest=False) for solver in solvers]
    monkeypatch.setattr(closed_form_module, "Call", PlainCall)
    for solver, expected in zip(solvers, compiled, strict=True):
        found = solver.solve_batch(T, seeds, closest=False)
        np.testing.assert_array_equal(found.q, expected.q)
        np.testing.assert_array_equal(found.touching, expected.touching)
    assert (compiled[0].q != compiled[1].q).any()  # another branch is clear


@pytest.mark.slow
def test_plain_and_compiled_curves_give_the_same_bits(
    robot: Robot, bundled: Callable[[str], Robot], rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    seven = bundled("j2s7s300")
    cases = [
        (seven, seven.forward_kinematics(seven.sample(rng))),
        (robot, FreeAxis(robot.forward_kinematics(robot.sample(rng)), axis=(0.0, 0.0, 1.0), range=(-0.3, 0.2))),
    ]
    compiled = [IKSolver(arm).solve_all(wanted) for arm, wanted in cases]
    monkeypatch.setattr(curve_arm, "Call", PlainCall)
    plain = [IKSolver(arm).solve_all(wanted) for arm, wanted in cases]
    for one, other in zip(compiled, plain, strict=True):
        assert [(i.start, i.stop) for i in one.intervals] == [(i.start, i.stop) for i in other.intervals]
        for mine, theirs in zip(one.intervals, other.intervals, strict=True):
            middle = 0.5 * (mine.start + mine.stop)
            np.testing.assert_array_equal(mine.at(middle), theirs.at(middle))


def test_arrays_that_machine_code_would_misread_are_refused(robot: Robot) -> None:
    work = make_target_work()._replace(T=np.zeros((2, 4, 4)), seed=np.zeros((2, 6)))
    Call(solve_targets, work)
    wrong = [
        work._replace(T=work.T.transpose(0, 2, 1)),
        work._replace(T=work.T.astype(np.float32)),
        work._replace(T=work.T[0]),
        work._replace(seed=np.zeros((2, 7))[:, :6]),
        work._replace(chain=np.zeros((8, 3, 4))),
    ]
    for one in wrong:
        with pytest.raises(ValueError, match="solve_targets needs a C-contiguous array of float64 with shape"):
            Call(solve_targets, one)
    with pytest.raises(ValueError, match="a seed for each target, not 1 for 2"):
        closed_form(robot).solve_batch(work.T, work.seed[:1])
    with pytest.raises(ValueError, match="does not know flatten"):
        Call(flatten, work)  # type: ignore[arg-type]  # no kernel


def test_the_library_describes_the_work_arrays_of_each_entry() -> None:
    layouts = library.load().about.layouts
    assert set(layouts) == {entry.run.__name__ for entry in ENTRIES}
    for entry in ENTRIES:
        Call(entry.run, entry.make_work())


def test_what_it_says_about_itself_is_read_back() -> None:
    said = library.load().about
    assert library.about(b"noise" + said.text().encode() + b"\0noise") == said
    assert library.about(said.text().encode()) is None  # the end is missing
    assert said.version == jacokin.__version__
    assert said.size == library.PATH.stat().st_size


def damaged(path: Path, contents: bytes) -> str:
    path.write_bytes(contents)
    with pytest.raises(JacokinError) as error:
        Library(path)
    assert str(path) in str(error.value)
    assert "install jacokin again" in str(error.value)
    return str(error.value)


def test_a_library_that_does_not_fit_is_one_sentence(tmp_path: Path) -> None:
    path = tmp_path / "libjacokin.so"
    with pytest.raises(JacokinError, match=f"the compiled kernels {path} cannot be read"):
        Library(path)
    whole = library.PATH.read_bytes()
    for size in (0, 10, 4096, len(whole) // 2, len(whole) - 1):
        assert "damaged or incomplete" in damaged(path, whole[:size])
    assert "damaged or incomplete" in damaged(path, bytes(len(whole)))
    for wrong in (b"\xff", b" "):
        assert "damaged or incomplete" in damaged(path, whole.replace(b"float64:", wrong * len(b"float64:")))
    version = f"kernels {jacokin.__version__} ".encode()
    other = version.replace(jacokin.__version__.encode(), b"9" * len(jacokin.__version__))
    assert f"not {jacokin.__version__}" in damaged(path, whole.replace(version, other))
    machine = bytearray(whole)
    machine[18:20] = b"\xf3\x00"  # RISC-V, in the header of an ELF file
    assert "do not load here" in damaged(path, bytes(machine))


def test_a_clone_whose_kernels_changed_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    kernels = tmp_path / "jacokin" / "kernels"
    kernels.mkdir(parents=True)
    copy = kernels / library.PATH.name
    shutil.copy2(library.PATH, copy)
    monkeypatch.setattr(library, "PATH", copy)
    (kernels / "changed.py").write_text("")
    later = time.time() + 10.0
    os.utime(kernels / "changed.py", (later, later))
    library.load.__wrapped__()  # installed: its files do not change
    (tmp_path / "build_kernels").mkdir()
    with pytest.raises(JacokinError, match="are those of other sources: run `python -m build_kernels`"):
        library.load.__wrapped__()
    os.utime(copy, (later, later))
    library.load.__wrapped__()  # made after the change


@pytest.mark.slow
def test_nothing_names_another_library(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No environment variable, no folder of the user's."""
    for name in ("LD_LIBRARY_PATH", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "HOME"):
        monkeypatch.setenv(name, str(tmp_path))
    monkeypatch.chdir(tmp_path)
    (tmp_path / library.PATH.name).write_bytes(b"not a library")
    assert python("-c", FIRST_ANSWER).stdout == "True\n"
    assert {path.name for path in tmp_path.iterdir()} == {library.PATH.name}, "something was written"


@pytest.mark.slow
def test_the_first_answer_needs_no_home_and_no_compiler(tmp_path: Path) -> None:
    home = tmp_path / "home"
    home.mkdir()
    home.chmod(stat.S_IRUSR | stat.S_IXUSR)
    program = f"{FIRST_ANSWER}; import sys; print({{'numba', 'llvmlite', 'mink', 'mujoco'}} & set(sys.modules))"
    given = {name: value for name, value in os.environ.items() if name not in ("HOME", "PYTHONPATH")}
    for environment in (given, {**given, "HOME": str(home)}, {**given, "NUMBA_DISABLE_JIT": "1"}):
        command = [sys.executable, "-P", "-c", program]
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
        assert (done.stdout, done.stderr) == ("True\nset()\n", "")


def test_loading_again_takes_no_time() -> None:
    warmup()
    assert warmup() < 0.01


def test_the_library_exports_its_kernels_and_nothing_of_python() -> None:
    """The names that C callers see."""
    contents = library.PATH.read_bytes()
    names = set(re.findall(rb"\0([A-Za-z_]\w*)(?=\0)", contents))
    assert {b"jacokin_solve_targets", b"jacokin_solve_set", b"jacokin_about"} <= names
    assert not [name for name in names if b"Numba" in name or name.startswith((b"Py", b"NRT_"))]


def test_calls_keep_their_arrays_and_grow() -> None:
    calls = Calls(average_rows, make_average_work, kept=100)
    first = calls.with_room(2, 10)
    assert calls.with_room(2, 20) is first  # there is twice as much room as was asked for
    larger = calls.with_room(1, 30)
    assert calls.with_room(4, 60) is larger  # and no less of anything than before
    assert calls.with_room(2, 101) is not calls.with_room(2, 101)
    assert calls.with_room(2, 30) is larger
    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(calls.with_room, 2, 30).result() is not larger


def test_calls_share_what_stays() -> None:
    """Only arrays of another owner are made anew, and what is exchanged is looked at."""
    calls, owner, made = SharedCalls(average_rows), object(), list[AverageWork]()

    def make() -> AverageWork:
        made.append(make_average_work(2, 10))
        return made[-1]

    first = calls.call(owner, make, lambda work: work)
    second = calls.call(owner, make, lambda work: work._replace(taken=np.zeros(40)))
    assert len(made) == 1
    assert second is not first
    shared = [one is other for one, other in zip(first.work, second.work, strict=True)]
    assert shared.count(False) == 1
    with pytest.raises(ValueError, match="average_rows needs a C-contiguous array of float64"):
        calls.call(owner, make, lambda work: work._replace(taken=np.zeros((2, 40))))
    with ThreadPoolExecutor(1) as pool:
        pool.submit(calls.call, owner, make, lambda work: work).result()
    calls.call(object(), make, lambda work: work)
    assert len(made) == 3
