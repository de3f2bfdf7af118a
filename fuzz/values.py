"""Values that a caller might pass where something else is expected."""

from __future__ import annotations

import datetime
import decimal
import enum
import fractions
import pathlib
from collections.abc import Callable

import numpy as np
import pinocchio as pin


class _Odd:
    """An object that refuses to be looked at."""

    def __repr__(self) -> str:
        raise RuntimeError("no repr")

    def __eq__(self, other: object) -> bool:
        raise RuntimeError("no comparison")

    def __hash__(self) -> int:
        raise RuntimeError("no hash")

    def __bool__(self) -> bool:
        raise RuntimeError("no truth")

    def __len__(self) -> int:
        raise RuntimeError("no length")


class _Array:
    """Converts to an array, or fails to."""

    def __init__(self, value: object) -> None:
        self._value = value

    def __array__(self, dtype: object = None, copy: bool | None = None) -> np.ndarray:
        if self._value is None:
            raise RuntimeError("no array today")
        return np.asarray(self._value)


class _Kind(enum.Enum):
    DAQP = "daqp"


def _skewed() -> pin.SE3:
    return pin.SE3(np.diag([1.0, 2.0, 1.0]), np.zeros(3))


SCALARS: tuple[Callable[[], object], ...] = (
    lambda: None,
    lambda: True,
    lambda: np.False_,
    lambda: 0,
    lambda: -1,
    lambda: 3,
    lambda: 2**63,
    lambda: 10**400,
    lambda: 10**5000,
    lambda: 0.0,
    lambda: -0.0,
    lambda: 0.5,
    lambda: -2.5,
    lambda: 1e-320,
    lambda: 1e17,
    lambda: 1e308,
    lambda: float("nan"),
    lambda: float("inf"),
    lambda: -float("inf"),
    lambda: 1j,
    lambda: np.float32(0.5),
    lambda: np.float64("nan"),
    lambda: np.longdouble("1e4000"),
    lambda: np.int8(-3),
    lambda: np.uint64(2**64 - 1),
    lambda: np.datetime64("2020-01-01"),
    lambda: np.timedelta64(5, "s"),
    lambda: np.str_("0.5"),
    lambda: decimal.Decimal("0.5"),
    lambda: fractions.Fraction(1, 3),
    lambda: datetime.date(2020, 1, 1),
    lambda: "",
    lambda: "0.5",
    lambda: "daqp",
    lambda: "nan",
    lambda: "end_effector",
    lambda: "joint_1",
    lambda: "x" * 10_000,
    lambda: "a\0b",
    lambda: "\ud800",
    lambda: "/nonexistent/folder/file",
    lambda: b"bytes",
    lambda: bytearray(8),
    lambda: pathlib.Path("/nonexistent"),
    lambda: ...,
    lambda: NotImplemented,
    lambda: _Kind.DAQP,
    _Odd,
    object,
    lambda: int,
    lambda: np,
    lambda: id,
    lambda: lambda *_, **__: None,
    lambda: np.random.default_rng(0),
    lambda: np.random.RandomState(0),
    lambda: pin.SE3.Identity(),
    lambda: pin.SE3(np.eye(3), np.full(3, np.nan)),
    _skewed,
)
ARRAYS: tuple[Callable[[], object], ...] = (
    list,
    tuple,
    dict,
    set,
    lambda: {"a": 1},
    lambda: {1.0, 2.0},
    lambda: iter([1.0, 2.0, 3.0]),
    lambda: (value for value in (1.0, 2.0)),
    lambda: range(6),
    lambda: [0.1, 0.2, 0.3],
    lambda: [0.1] * 6,
    lambda: (3.0,) * 6,
    lambda: [1, 2, 3, 4, 5, 6],
    lambda: [True] * 6,
    lambda: [0.1, 0.2, True],
    lambda: ["0.1"] * 6,
    lambda: [None] * 6,
    lambda: [float("nan")] * 6,
    lambda: [10**400] * 6,
    lambda: [1.0, [2.0, 3.0]],
    lambda: [[1.0, 2.0], [3.0]],
    lambda: [[[1.0]]],
    lambda: [np.datetime64("2020-01-01")] * 6,
    lambda: ["end_effector", "wristsite"],
    lambda: [_Odd()],
    lambda: _Array([0.1, 0.2, 0.3]),
    lambda: _Array(None),
    lambda: memoryview(b"12345678"),
    lambda: np.zeros(0),
    lambda: np.zeros(()),
    lambda: np.zeros(3),
    lambda: np.ones(6),
    lambda: np.full(6, 1e300),
    lambda: np.zeros(7),
    lambda: np.zeros((1, 6)),
    lambda: np.zeros((6, 1)),
    lambda: np.zeros((2, 6)),
    lambda: np.zeros((0, 6)),
    lambda: np.zeros((3, 3)),
    lambda: np.eye(3),
    lambda: np.eye(4),
    lambda: np.eye(4)[None],
    lambda: np.zeros((0, 4, 4)),
    lambda: np.zeros((2, 4, 4)),
    lambda: np.zeros((1, 1, 1, 1, 1)),
    lambda: np.asfortranarray(np.random.default_rng(0).random((4, 4))),
    lambda: np.eye(4, dtype=np.float32),
    lambda: np.eye(4, dtype=complex),
    lambda: np.eye(4).astype(object),
    lambda: np.ones(6, dtype=bool),
    lambda: np.array(["a", "b"]),
    lambda: np.array([0.5] * 6, dtype=np.float16),
    lambda: np.array([0.5] * 6, dtype=">f8"),
    lambda: np.broadcast_to(0.5, 6),
    lambda: np.ones(12)[::2],
    lambda: np.zeros(6, dtype=[("a", float)]),
    lambda: np.ma.masked_array([0.1] * 6, mask=[False, True] * 3),
    lambda: np.ma.masked_array(np.eye(4), mask=np.eye(4, dtype=np.bool_)),
    lambda: [np.ma.masked] * 6,
    lambda: np.matrix("1 2 3"),
    lambda: [pin.SE3.Identity(), pin.SE3.Identity()],
    lambda: [pin.SE3.Identity(), None],
)


def value(rng: np.random.Generator) -> object:
    """A fresh value from all of these."""
    makers = SCALARS if rng.random() < 0.5 else ARRAYS
    return makers[int(rng.integers(len(makers)))]()


def described(value: object) -> str:
    """A value for a report, whatever its repr does."""
    try:
        return repr(value)[:120]
    except Exception:  # that is what some of these are for
        return f"<{type(value).__name__} without a repr>"
