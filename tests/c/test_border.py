"""Wrong input to the C library is a code: nothing is read or written that should not be."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from ctypes import byref, c_double, c_int, c_void_p
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import IKSolver, Status
from jacokin.ik.c_library import INCLUDE, check_sum, export_c, solver_file
from tests.c import binding
from tests.c.binding import C, CSolver
from tests.robot_files import ur5_text

HEADER = (INCLUDE / "jacokin_ik.h").read_text(encoding="utf-8")
STATUSES = {name: int(code) for name, code in re.findall(r"JACOKIN_IK_(\w+) = (-?\d+),? +/\*", HEADER)}


@pytest.fixture(scope="module")
def six() -> CSolver:
    return CSolver(IKSolver(jacokin.load_robot("j2n6s300"), collision="ignore"), binding.INTERVALS)


@pytest.fixture(scope="module")
def seven() -> CSolver:
    return CSolver(IKSolver(jacokin.load_robot("j2s7s300"), collision="ignore"), binding.INTERVALS)


@pytest.fixture
def target() -> Array:
    robot = jacokin.load_robot("j2n6s300")
    return np.ascontiguousarray(robot.forward_kinematics(robot.home).homogeneous)


def text(status: int) -> str:
    found: bytes = C.jacokin_ik_status_text(status)
    return found.decode()


def test_statuses_have_the_sentences_of_the_package() -> None:
    """The same beginning; the advice is what C can do."""
    for name in ("UNREACHABLE", "OUTSIDE_LIMITS", "NO_CONVERGENCE"):
        said = text(getattr(binding, name))
        assert STATUSES[name] == getattr(binding, name)
        assert not {"restart", "position only", "seed near", "load the robot"} & {
            words for words in ("restart", "position only", "seed near", "load the robot") if words in said
        }
        if name != "NO_CONVERGENCE":
            assert said.partition(":")[0] == Status[name].value.partition(":")[0]
    assert text(0) == Status.OK.value
    sentences = {text(code) for code in range(-10, 4)}
    assert len(sentences) == 14
    assert text(99) == text(-99) == "this is not a status of jacokin"
    assert C.jacokin_ik_abi_version() == int(re.findall(r"ABI_VERSION (\d+)", HEADER)[0])


def test_a_solver_says_what_it_is_for() -> None:
    robot = jacokin.load_robot("j2s6s300", limits={"joint_1": (-1.0, 7.0)})
    c = CSolver(IKSolver(robot, "pinchsite", collision="ignore"))
    assert C.jacokin_ik_dof(c.handle) == 6
    names = [C.jacokin_ik_joint_name(c.handle, j).decode() for j in range(-1, 8)]
    assert names == ["", *robot.joint_names, "", ""]
    texts = C.jacokin_ik_robot(c.handle), C.jacokin_ik_base(c.handle), C.jacokin_ik_frame(c.handle)
    assert texts == (robot.name.encode(), robot.base.encode(), b"pinchsite")
    lower, upper, home = np.empty((3, 6))
    assert C.jacokin_ik_limits(c.handle, *map(binding.address, (lower, upper, home))) == binding.OK
    assert (lower.tolist(), upper.tolist(), home.tolist()) == (
        robot.lower.tolist(),
        robot.upper.tolist(),
        robot.home.tolist(),
    )


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_a_number_that_is_not_finite_is_refused(six: CSolver, target: Array, value: float) -> None:
    for place in range(16):
        bad = target.copy()
        bad.flat[place] = value
        status, q = six.nearest(bad, None)
        assert status == binding.NOT_FINITE
        assert np.isnan(q).all()
        assert six.all(bad, None)[0] == six.intervals(bad, axis())[0] == binding.NOT_FINITE
    for joint in range(6):
        seed = np.ones(6)
        seed[joint] = value
        assert six.nearest(target, seed)[0] == six.all(target, seed)[0] == binding.NOT_FINITE
        assert C.jacokin_fk(six.handle, seed.ctypes.data, np.empty(16).ctypes.data) == binding.NOT_FINITE
    assert six.nearest(target, np.full(6, 2e6))[0] == binding.NOT_FINITE


def axis(direction: tuple[float, ...] = (1.0, 0.0, 0.0), low: float = -1.0, high: float = 1.0) -> binding.Axis:
    made = binding.Axis()
    made.direction[:], made.range[:] = direction, (low, high)
    return made


@pytest.mark.parametrize(
    "spoil",
    [
        lambda T: T * 1.01,
        lambda T: T * [[-1.0], [1.0], [1.0], [1.0]],
        lambda T: np.vstack([T[:3], [0.0, 0.0, 0.1, 1.0]]),
    ],
    ids=["scaled", "a reflection", "another last row"],
)
def test_what_is_not_a_rigid_pose_is_refused(six: CSolver, target: Array, spoil: Callable[[Array], Array]) -> None:
    bad = np.ascontiguousarray(spoil(target))
    assert six.nearest(bad, None)[0] == six.intervals(bad, axis())[0] == binding.NOT_RIGID


def test_an_axis_must_have_a_direction_and_a_range(six: CSolver, target: Array) -> None:
    bad = [axis((0.0, 0.0, 0.0)), axis(low=1.0, high=1.0), axis(low=0.0, high=6.5), axis(low=2e3, high=2e3 + 1.0)]
    assert [six.intervals(target, each)[0] for each in bad] == [binding.BAD_ARGUMENT] * 4
    assert six.intervals(target, axis((np.nan, 0.0, 0.0)))[0] == binding.NOT_FINITE
    assert six.intervals(target, None)[0] == binding.WRONG_ARM


@pytest.mark.parametrize("length", [5e-324, 1e-200, 1e200, 1.7e308])
def test_an_axis_may_have_any_length_but_zero(six: CSolver, target: Array, length: float) -> None:
    status, expected, _ = six.intervals(target, axis((1.0, 1.0, 0.0)))
    scaled, found, _ = six.intervals(target, axis((length, length, 0.0)))
    assert scaled == status == binding.OK
    assert expected
    assert list(map(bytes, found)) == list(map(bytes, expected))


def test_functions_of_another_arm_say_so(seven: CSolver, target: Array) -> None:
    assert seven.all(target, None)[0] == seven.intervals(target, axis())[0] == binding.WRONG_ARM


def test_memory_is_never_used_beyond_its_size(six: CSolver, target: Array) -> None:
    size = C.jacokin_ik_work_size(six.handle, binding.POSES)
    larger = C.jacokin_ik_work_size(six.handle, binding.INTERVALS)
    assert 30_000 < size < 90_000
    assert 3_000_000 < larger < 5_000_000
    guarded, q, count = np.full(size // 8 + 8, -1, np.int64), np.empty(6), c_int()
    here = (six.handle, target.ctypes.data, None, guarded.ctypes.data)
    assert C.jacokin_ik_nearest(*here, size - 1, q.ctypes.data) == binding.WORK_TOO_SMALL
    assert np.isnan(q).all()
    assert (guarded == -1).all()
    assert C.jacokin_ik_nearest(*here, size, q.ctypes.data) == binding.OK
    assert (guarded[size // 8 :] == -1).all()
    assert C.jacokin_ik_intervals(
        six.handle, target.ctypes.data, byref(axis()), guarded.ctypes.data, size, None, 0, byref(count), None
    ) == (binding.WORK_TOO_SMALL)
    odd = guarded.ctypes.data + 1
    assert C.jacokin_ik_nearest(*here[:3], odd, size, q.ctypes.data) == binding.BAD_ARGUMENT


def test_a_batch_that_cannot_be_done_has_no_answers(six: CSolver, target: Array) -> None:
    q, status = np.zeros((2, 6)), np.zeros(2, np.int32)
    both = np.array([target, target])
    here = (six.handle, 2, both.ctypes.data, None, six.work[0], 8, q.ctypes.data, status.ctypes.data)
    assert C.jacokin_ik_batch(*here) == binding.WORK_TOO_SMALL
    assert np.isnan(q).all()
    assert status.tolist() == [binding.WORK_TOO_SMALL] * 2


def test_null_pointers_are_refused(six: CSolver, target: Array) -> None:
    q, T, work = np.empty(6).ctypes.data, target.ctypes.data, six.work
    count = byref(c_int())
    assert C.jacokin_ik_dof(None) == C.jacokin_ik_work_size(None, 0) == 0
    assert C.jacokin_ik_robot(None) == C.jacokin_ik_joint_name(None, 0) == b""
    C.jacokin_ik_free(None)
    calls = [
        C.jacokin_ik_load(None, byref(c_void_p())),
        C.jacokin_ik_load(b"x", None),
        C.jacokin_ik_read(None, 9, byref(c_void_p())),
        C.jacokin_ik_limits(None, q, q, q),
        C.jacokin_fk(six.handle, None, T),
        C.jacokin_fk(None, q, T),
        C.jacokin_ik_nearest(six.handle, None, None, *work, q),
        C.jacokin_ik_nearest(six.handle, T, None, None, work[1], q),
        C.jacokin_ik_nearest(six.handle, T, None, *work, None),
        C.jacokin_ik_all(six.handle, T, None, *work, None, 3, count, None),
        C.jacokin_ik_all(six.handle, T, None, *work, None, -1, count, None),
        C.jacokin_ik_all(six.handle, T, None, *work, None, 0, None, None),
        C.jacokin_ik_batch(six.handle, 1, T, None, *work, q, None),
        C.jacokin_ik_intervals(six.handle, T, byref(axis()), *work, None, 1, count, None),
        C.jacokin_ik_at(six.handle, *work, None, 0.0, None, q),
        C.jacokin_ik_nearest_about(six.handle, None, byref(axis()), None, *work, q, None),
    ]
    assert calls == [binding.BAD_ARGUMENT] * len(calls)
    assert C.jacokin_ik_batch(six.handle, 0, None, None, *work, None, None) == binding.OK


@pytest.mark.parametrize("missing", ["target", "work"])
def test_without_a_target_or_memory_nothing_looks_like_an_answer(six: CSolver, target: Array, missing: str) -> None:
    T, work = (None, six.work) if missing == "target" else (target.ctypes.data, (None, six.work[1]))
    q, status, parameter = np.zeros((4, 6)), c_int(), c_double()
    place = [each.ctypes.data for each in q]
    calls = [
        C.jacokin_ik_nearest(six.handle, T, None, *work, place[0]),
        C.jacokin_ik_batch(six.handle, 1, T, None, *work, place[1], byref(status)),
        C.jacokin_ik_at(six.handle, *work, None, 0.0, None, place[2]),
        C.jacokin_ik_nearest_about(six.handle, T, byref(axis()), None, *work, place[3], byref(parameter)),
    ]
    assert [*calls, status.value] == [binding.BAD_ARGUMENT] * 5
    assert np.isnan([*q.ravel(), parameter.value]).all()


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_work_memory_may_hold_anything(name: str) -> None:
    robot = jacokin.load_robot(name)
    c = CSolver(IKSolver(robot, collision="ignore"), binding.INTERVALS)
    about = axis((0.3, 1.0, 0.2), -1.0, 1.5) if c.dof == 6 else None
    complete = 0
    for q in robot.sample(np.random.default_rng(2), 4):
        T, answers = np.ascontiguousarray(robot.forward_kinematics(q).homogeneous), []
        for byte in (0x00, 0x3F, 0x55, 0xFF):  # integers of 0, large ones and -1; doubles of 0, 5e-4, 1e103 and NaN
            calls = c.nearest, c.all, lambda T, q: c.intervals(T, about), lambda T, q: c.nearest_about(T, about, q)
            answers.append(b"")
            for call in calls:
                c.memory.view(np.uint8)[:] = byte
                for part in call(T, q):
                    answers[-1] += b"".join(map(bytes, part)) if isinstance(part, list) else np.asarray(part).tobytes()
            complete += c.intervals(T, about)[2]
        assert set(answers) == {answers[0]}
    assert complete > 0


def test_answers_that_do_not_fit_are_counted(six: CSolver, target: Array) -> None:
    status, branches, _ = six.all(target, None)
    assert status == binding.OK
    few, count = (binding.Branch * 3)(), c_int()
    done = C.jacokin_ik_all(six.handle, target.ctypes.data, None, *six.work, few, 2, byref(count), None)
    assert (done, count.value) == (binding.NO_ROOM, len(branches))
    assert [list(each.q) for each in few[:2]] == [list(each.q) for each in branches[:2]]
    assert list(few[2].q) == [0.0] * 7
    _, intervals, _ = six.intervals(target, axis())
    short = (binding.Interval * 1)()
    place = six.handle, target.ctypes.data, byref(axis()), *six.work
    assert C.jacokin_ik_intervals(*place, short, 1, byref(count), None) == binding.NO_ROOM
    assert (count.value, short[0].start) == (len(intervals), intervals[0].start)


def test_a_point_outside_its_interval_is_refused(six: CSolver, target: Array) -> None:
    _, intervals, _ = six.intervals(target, axis(low=-0.5, high=0.5))
    status, q = six.at(intervals[0], 1.5)
    assert status == binding.BAD_ARGUMENT
    assert np.isnan(q).all()
    assert six.at(intervals[0], np.nan)[0] == binding.NOT_FINITE
    made_up = binding.Interval()
    made_up.stop, made_up.piece = 1.0, 9999
    assert six.at(made_up, 0.5)[0] == binding.BAD_ARGUMENT
    six.memory[:] = 0xFFFFFFFFFFFFFFFF
    assert six.at(intervals[0], intervals[0].start)[0] < 0


def test_every_damage_to_a_file_is_noticed() -> None:
    contents = solver_file(IKSolver(jacokin.load_robot("j2n6s300"), collision="ignore"))
    for place in range(0, len(contents), 7):
        damaged = bytearray(contents)
        damaged[place] ^= 0x40
        status, solver = binding.read(bytes(damaged))
        assert status in (binding.DAMAGED_FILE, binding.OTHER_VERSION)
        assert not solver
    for size in (0, 1, 8, 23, 24, 32, len(contents) // 2, len(contents) - 1):
        assert binding.read(contents[:size])[0] == binding.DAMAGED_FILE
    assert binding.read(contents + b"\0")[0] == binding.DAMAGED_FILE


@pytest.mark.parametrize(
    ("place", "value"), [(24, np.nan), (24, 2.0), (24 + 8 * 130, np.nan), (24 + 8 * 136, 0.0), (24 + 8 * 148, -1.0)]
)
def test_numbers_that_make_no_arm_are_refused_even_with_a_check_sum(place: int, value: float) -> None:
    """A chain that is not finite or not rigid, limits without a number or crossed, a snap below zero."""
    contents = bytearray(solver_file(IKSolver(jacokin.load_robot("j2n6s300"), collision="ignore")))
    contents[place : place + 8] = np.float64(value).tobytes()
    contents[-8:] = check_sum(bytes(contents[:-8])).to_bytes(8, "little")
    assert binding.read(bytes(contents))[0] == binding.DAMAGED_FILE


@pytest.mark.parametrize("place", range(12))
def test_constants_of_another_arm_of_seven_joints_are_refused(place: int) -> None:
    """With them, poses that the arm reaches were unreachable."""
    contents = bytearray(solver_file(IKSolver(jacokin.load_robot("j2s7s300"), collision="ignore")))
    at = slice(24 + 8 * (8 * 12 + place), 32 + 8 * (8 * 12 + place))  # after the chain
    contents[at] = (np.frombuffer(contents[at]) + 0.05).tobytes()  # [m], or of a unit vector
    contents[-8:] = check_sum(bytes(contents[:-8])).to_bytes(8, "little")
    assert binding.read(bytes(contents))[0] == binding.DAMAGED_FILE


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300", "ur5"])
def test_numbers_that_do_not_belong_together_are_refused_or_solved_soon(name: str, tmp_path: Path) -> None:
    """The check sum is right, each number of some size: nothing may search without end for what is not there."""
    if name == "ur5":
        (tmp_path / "ur5.urdf").write_text(ur5_text(), encoding="utf-8")
    robot = jacokin.load_robot(tmp_path / "ur5.urdf" if name == "ur5" else name)
    whole = solver_file(IKSolver(robot, collision="ignore"))
    target = np.ascontiguousarray(robot.forward_kinematics(robot.home).homogeneous)
    about = axis((0.0, 0.0, 1.0), -np.pi, np.pi) if robot.dof == 6 else None
    doubles = (len(whole) - 32 - int.from_bytes(whole[20:24], "little")) // 8
    memory = np.zeros(C.jacokin_ik_work_size(CSolver(IKSolver(robot, collision="ignore")).handle, 1) // 8)
    work, q, parameter = (memory.ctypes.data, memory.nbytes), np.empty(7), c_double()
    rng = np.random.default_rng(3)
    refused = 0
    for place in range(doubles):
        contents = bytearray(whole)
        at = slice(24 + 8 * place, 32 + 8 * place)
        contents[at] = np.float64(rng.choice([-0.0, -0.5, 1e18, 1.35e10, rng.normal()])).tobytes()
        contents[-8:] = check_sum(bytes(contents[:-8])).to_bytes(8, "little")
        status, solver = binding.read(bytes(contents))
        if status != binding.OK:
            assert status == binding.DAMAGED_FILE
            refused += 1
            continue
        began = time.process_time()
        axis_given = None if about is None else byref(about)
        C.jacokin_ik_nearest(solver, target.ctypes.data, None, *work, q.ctypes.data)
        C.jacokin_ik_nearest_about(solver, target.ctypes.data, axis_given, None, *work, q.ctypes.data, byref(parameter))
        assert time.process_time() - began < 1.0, f"double {place}"
        C.jacokin_ik_free(solver)
    assert refused > doubles // 2


def test_another_version_is_named(tmp_path: Path) -> None:
    contents = bytearray(solver_file(IKSolver(jacokin.load_robot("j2n6s300"), collision="ignore")))
    contents[8] += 1
    path = tmp_path / "later.jacokin"
    path.write_bytes(contents)
    solver = c_void_p()
    assert C.jacokin_ik_load(bytes(path), byref(solver)) == binding.OTHER_VERSION
    assert C.jacokin_ik_load(bytes(tmp_path / "none"), byref(solver)) == binding.NO_FILE
    assert C.jacokin_ik_load(bytes(tmp_path), byref(solver)) == binding.NO_FILE
    assert not solver


def test_only_solvers_that_c_can_serve_are_exported() -> None:
    robot = jacokin.load_robot("j2n6s300")
    with pytest.raises(InvalidInputError, match="does not look for contact"):
        solver_file(IKSolver(robot, collision="reject"))
    with pytest.raises(InvalidInputError, match="closed form only"):
        solver_file(IKSolver(robot, method="qp", collision="ignore"))


def test_what_is_no_solver_or_no_folder_is_refused(tmp_path: Path) -> None:
    nothing: Any = None
    with pytest.raises(InvalidInputError, match="solver must be an IKSolver"):
        export_c(nothing, tmp_path / "arm")
    with pytest.raises(InvalidInputError, match="folder"):
        export_c(IKSolver(jacokin.load_robot("j2n6s300")), nothing)
    assert not any(tmp_path.iterdir())
