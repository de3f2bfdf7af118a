"""The C library as Python sees it through ctypes: thin, and only for tests."""

from __future__ import annotations

import ctypes
import re
from collections.abc import Sequence
from ctypes import POINTER, Structure, byref, c_char_p, c_double, c_int, c_size_t, c_void_p

import numpy as np

from jacokin.arrays import Array
from jacokin.ik import FreeAxis, IKSolver
from jacokin.ik.c_library import INCLUDE, solver_file
from jacokin.kernels import library
from jacokin.model import Robot

(OK, UNREACHABLE, OUTSIDE_LIMITS, NO_CONVERGENCE) = range(4)
(BAD_ARGUMENT, NOT_FINITE, NOT_RIGID, WORK_TOO_SMALL, NO_ROOM, WRONG_ARM) = range(-1, -7, -1)
(NO_FILE, DAMAGED_FILE, OTHER_VERSION, NO_MEMORY) = range(-7, -11, -1)
POSES, INTERVALS = 0, 1
LIMIT, FOLD, RANGE, CIRCLE, LOST = range(5)
_HEADER = (INCLUDE / "jacokin_ik.h").read_text(encoding="ascii")
MAX_BRANCHES, MAX_INTERVALS = (
    int(re.findall(rf"#define JACOKIN_IK_{name} (\d+)", _HEADER)[0]) for name in ("MAX_BRANCHES", "MAX_INTERVALS")
)


class Branch(Structure):
    """`jacokin_ik_branch`."""

    _fields_ = (
        ("q", c_double * 7),
        ("position_error", c_double),
        ("orientation_error", c_double),
        ("distance", c_double),
        ("margin", c_double),
        ("success", c_int),
        ("singular", c_int),
    )


class Axis(Structure):
    """`jacokin_ik_axis`."""

    _fields_ = (("direction", c_double * 3), ("range", c_double * 2))


class Interval(Structure):
    """`jacokin_ik_interval`."""

    _fields_ = (
        ("start", c_double),
        ("stop", c_double),
        ("branch", c_int),
        ("ends", c_int * 2),
        ("joints", c_int * 2),
        ("piece", c_int),
        ("shift", c_double),
    )


_P, _NUMBERS, _WORK = c_void_p, c_void_p, (c_void_p, c_size_t)
_ARGUMENTS: dict[str, Sequence[type]] = {
    "jacokin_ik_load": (c_char_p, POINTER(c_void_p)),
    "jacokin_ik_read": (c_char_p, c_size_t, POINTER(c_void_p)),
    "jacokin_ik_free": (_P,),
    "jacokin_ik_work_size": (_P, c_int),
    "jacokin_ik_status_text": (c_int,),
    "jacokin_ik_dof": (_P,),
    "jacokin_ik_parameter": (_P,),
    "jacokin_ik_joint_name": (_P, c_int),
    "jacokin_ik_limits": (_P, _NUMBERS, _NUMBERS, _NUMBERS),
    "jacokin_fk": (_P, _NUMBERS, _NUMBERS),
    "jacokin_ik_all": (_P, _NUMBERS, _NUMBERS, *_WORK, _P, c_int, POINTER(c_int), POINTER(c_int)),
    "jacokin_ik_nearest": (_P, _NUMBERS, _NUMBERS, *_WORK, _NUMBERS),
    "jacokin_ik_batch": (_P, c_size_t, _NUMBERS, _NUMBERS, *_WORK, _NUMBERS, _P),
    "jacokin_ik_intervals": (_P, _NUMBERS, _P, *_WORK, _P, c_int, POINTER(c_int), POINTER(c_int)),
    "jacokin_ik_at": (_P, *_WORK, _P, c_double, _NUMBERS, _NUMBERS),
    "jacokin_ik_nearest_about": (_P, _NUMBERS, _P, _NUMBERS, *_WORK, _NUMBERS, _NUMBERS),
}
_TEXTS = ("jacokin_ik_robot", "jacokin_ik_base", "jacokin_ik_frame", "jacokin_ik_joint_name", "jacokin_ik_status_text")


def load_library() -> ctypes.CDLL:
    """The library of the package, its functions declared."""
    found = ctypes.CDLL(str(library.PATH))
    for name, arguments in _ARGUMENTS.items():
        getattr(found, name).argtypes = list(arguments)
    for name in _TEXTS:
        getattr(found, name).restype = c_char_p
        getattr(found, name).argtypes = list(_ARGUMENTS.get(name, (_P,)))
    found.jacokin_ik_work_size.restype = c_size_t
    found.jacokin_ik_free.restype = None
    return found


C = load_library()


def address(array: Array | None) -> int | None:
    """Where the numbers of an array are; None for a null pointer."""
    return None if array is None else int(array.ctypes.data)


def axis_of(target: FreeAxis) -> Axis:
    """A free axis as C takes it."""
    return Axis((c_double * 3)(*target.axis.tolist()), (c_double * 2)(*target.range))


def read(contents: bytes) -> tuple[int, c_void_p]:
    """Status and solver of a file's contents."""
    solver = c_void_p()
    return int(C.jacokin_ik_read(contents, len(contents), byref(solver))), solver


class CSolver:
    """A solver of the C library with work memory of its own, which begins as garbage."""

    def __init__(self, solver: IKSolver, task: int = POSES, *, contents: bytes | None = None) -> None:
        status, self.handle = read(solver_file(solver) if contents is None else contents)
        assert status == OK
        self.dof = solver.robot.dof
        self.memory = np.full(C.jacokin_ik_work_size(self.handle, task) // 8, 0xFFFFFFFFFFFFFFFF, np.uint64)
        self.work = self.memory.ctypes.data, self.memory.nbytes

    def __del__(self) -> None:
        C.jacokin_ik_free(self.handle)

    def all(self, target: Array, seed: Array | None) -> tuple[int, list[Branch], bool]:
        """Status, branches, and whether none is missing."""
        branches, count, complete = (Branch * MAX_BRANCHES)(), c_int(), c_int()
        status = C.jacokin_ik_all(
            self.handle,
            address(target),
            address(seed),
            *self.work,
            branches,
            MAX_BRANCHES,
            byref(count),
            byref(complete),
        )
        return status, branches[: count.value], bool(complete.value)

    def nearest(self, target: Array, seed: Array | None) -> tuple[int, Array]:
        """Status and configuration (dof,)."""
        q = np.empty(self.dof)
        return C.jacokin_ik_nearest(self.handle, address(target), address(seed), *self.work, address(q)), q

    def batch(self, targets: Array, seeds: Array | None) -> tuple[list[int], Array]:
        """Statuses and configurations (n, dof)."""
        q, status = np.empty((len(targets), self.dof)), (c_int * len(targets))()
        done = C.jacokin_ik_batch(
            self.handle, len(targets), address(targets), address(seeds), *self.work, address(q), status
        )
        assert done == OK
        return list(status), q

    def intervals(self, target: Array, about: Axis | None = None) -> tuple[int, list[Interval], bool]:
        """Status, intervals, and whether nothing is missing."""
        intervals, count, complete = (Interval * MAX_INTERVALS)(), c_int(), c_int()
        axis = None if about is None else byref(about)
        status = C.jacokin_ik_intervals(
            self.handle, address(target), axis, *self.work, intervals, MAX_INTERVALS, byref(count), byref(complete)
        )
        return status, intervals[: count.value], bool(complete.value)

    def at(self, interval: Interval, parameter: float, seed: Array | None = None) -> tuple[int, Array]:
        """Status and configuration (dof,) of an interval."""
        q = np.empty(self.dof)
        return C.jacokin_ik_at(self.handle, *self.work, byref(interval), parameter, address(seed), address(q)), q

    def nearest_about(self, target: Array, about: Axis | None, seed: Array | None) -> tuple[int, Array, float]:
        """Status, configuration (dof,) and parameter [rad]."""
        q, p = np.empty(self.dof), np.empty(1)
        axis = None if about is None else byref(about)
        status = C.jacokin_ik_nearest_about(
            self.handle, address(target), axis, address(seed), *self.work, address(q), address(p)
        )
        return status, q, float(p[0])


def make_targets(robot: Robot, n: int, seed: int) -> tuple[Array, Array]:
    """Poses (n, 4, 4), a third of them moved off, and seeds (n, dof)."""
    rng = np.random.default_rng(seed)
    T = np.array([robot.forward_kinematics(q).homogeneous for q in robot.sample(rng, n)])
    T[::3, :3, 3] += rng.normal(scale=0.2, size=(len(T[::3]), 3))  # [m]
    return T, robot.sample(rng, n)
