"""Checks of arguments, used once at the public border: each returns the checked value or refuses it by name.

A number is a real Python or NumPy number: not a boolean, not digits in a string, not a date, not a masked value.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from math import isfinite
from pathlib import Path
from typing import Any, TypeGuard, TypeVar

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.errors import shown as shown

Item = TypeVar("Item")
AnyArray = TypeVar("AnyArray", bound=NDArray[Any])

FLOAT64 = np.dtype(np.float64)
NUMBER_KINDS = "iuf"  # of NumPy's dtypes: no booleans, complex numbers, strings, dates or objects
PLAIN = frozenset((float, int, np.float64))


def refusal(name: str, what: str, value: object, unit: str = "") -> InvalidInputError:
    """The error that an argument must be `what`, with the value it has."""
    return InvalidInputError(f"{name} must be {what}{_bracketed(unit)}, got {shown(value)}")


def _bracketed(unit: str) -> str:
    return f" [{unit}]" if unit else ""


def instance(name: str, value: object, kind: type[Item], what: str) -> Item:
    """A value of a class.

    Raises:
        InvalidInputError: anything else; says that `what` is needed.
    """
    if not isinstance(value, kind):
        raise refusal(name, what, value)
    return value


def optional(check: Callable[..., Item], name: str, value: object, *more: object) -> Item | None:
    """None, or what a check makes of the value. Errors as the check."""
    return None if value is None else check(name, value, *more)


def function(name: str, value: Item, what: str = "callable") -> Item:
    """A value that can be called.

    Raises:
        InvalidInputError: anything else; says that `what` is needed.
    """
    if not callable(value):
        raise refusal(name, what, value)
    return value


def mapping(name: str, value: object, what: str = "a dict") -> Mapping[Any, Any]:
    """A dict, or another mapping.

    Raises:
        InvalidInputError: anything else; says that `what` is needed.
    """
    if not isinstance(value, Mapping):
        raise refusal(name, what, value)
    return value


def path(name: str, value: object, what: str = "a str or a Path") -> Path:
    """The name of a file or folder.

    Raises:
        InvalidInputError: neither a string nor a path, or empty; says that `what` is needed.
    """
    if not isinstance(value, str | Path) or not str(value):
        raise refusal(name, what, value)
    return Path(value)


def folder(name: str, value: object) -> Path:
    """A folder that is there.

    Raises:
        InvalidInputError: not the name of one, or nothing or something else is there.
    """
    found = path(name, value, "a folder")
    try:
        is_there = found.is_dir()
    except (OSError, ValueError):  # no folder can have that name
        is_there = False
    if not is_there:
        raise InvalidInputError(f"{name}: there is no folder {str(found)!r}")
    return found


def number(name: str, value: object, unit: str = "") -> float:
    """A finite number.

    Raises:
        InvalidInputError: not a number, NaN or infinite.
    """
    result = _as_float(value)
    if math.isnan(result):
        raise refusal(name, "a finite number", value, unit)
    return result


def positive(name: str, value: object, unit: str = "") -> float:
    """A finite number > 0.

    Raises:
        InvalidInputError: not a number, not finite or not positive.
    """
    result = _as_float(value)
    if not result > 0.0:
        raise refusal(name, "a positive number", value, unit)
    return result


def non_negative(name: str, value: object, unit: str = "") -> float:
    """A finite number >= 0.

    Raises:
        InvalidInputError: not a number, not finite or negative.
    """
    result = _as_float(value)
    if not result >= 0.0:
        raise refusal(name, "a finite number >= 0", value, unit)
    return result


def _as_float(value: object) -> float:
    """A finite number as a float; NaN for whatever is not one."""
    if isinstance(value, bool | np.timedelta64) or not isinstance(value, int | float | np.integer | np.floating):
        return math.nan  # a timedelta64 is an integer to NumPy
    try:
        number = float(value)
    except OverflowError:  # a whole number beyond 1e308
        return math.nan
    return number if math.isfinite(number) else math.nan


def whole_number(name: str, value: object, lowest: int = 0, highest: int | None = None) -> int:
    """A whole number, at least `lowest` and, if given, at most `highest`.

    Raises:
        InvalidInputError: not a whole number (2.0 is a float), too small or too large.
    """
    if type(value) is int and lowest <= value and (highest is None or value <= highest):
        return value  # what is asked most often, answered first
    if isinstance(value, bool | np.timedelta64) or not isinstance(value, int | np.integer) or value < lowest:
        raise refusal(name, f"a whole number >= {lowest}", value)
    if highest is not None and value > highest:
        raise refusal(name, f"a whole number <= {highest}", value)
    return int(value)


def flag(name: str, value: object) -> bool:
    """True or False, as a Python bool.

    Raises:
        InvalidInputError: anything else, also what merely counts as true.
    """
    if value is True or value is False:
        return value
    if not isinstance(value, np.bool_):
        raise refusal(name, "True or False", value)
    return bool(value)


def choice(kind: str, value: object, valid: Iterable[str]) -> str:
    """One of the valid strings.

    Raises:
        UnknownNameError: anything else; lists the valid ones.
    """
    names = tuple(valid)
    if not isinstance(value, str) or value not in names:
        raise UnknownNameError(kind, value, names)
    return value


def text(name: str, value: object) -> str:
    """A string that other languages can keep: one that UTF-8 can write, without null characters.

    Raises:
        InvalidInputError: anything else.
    """
    string = instance(name, value, str, "a string")
    if "\0" in string or string.encode(errors="ignore").decode() != string:
        raise refusal(name, "a text that UTF-8 can write and that has no nulls", value)
    return string


def word(name: str, value: object) -> str:
    """A text as of `text` that is not empty.

    Raises:
        InvalidInputError: anything else.
    """
    if not text(name, value):
        raise refusal(name, "a word", value)
    return str(value)


def listed(name: str, items: Iterable[Item], what: str = "a list") -> tuple[Item, ...]:
    """The items of a list.

    Raises:
        InvalidInputError: not something that can be listed, or a string; says that `what` is needed.
    """
    try:
        if not isinstance(items, str | bytes):
            return tuple(items)
    except TypeError:
        pass
    raise refusal(name, what, items)


def generator(name: str, value: object) -> np.random.Generator:
    """A NumPy random generator.

    Raises:
        InvalidInputError: anything else, also `RandomState` and seeds.
    """
    return instance(name, value, np.random.Generator, "a numpy.random.Generator")


def numbers(value: ArrayLike) -> Array:
    """`value` as float64 of any shape, when it is made of real numbers; NaN and infinities pass.

    Raises:
        TypeError: booleans, complex numbers, strings, dates, masked arrays, or Python objects (whole numbers too large
            for NumPy as well).
        ValueError: rows of different lengths.
    """
    if type(value) is np.ndarray and value.dtype is FLOAT64:
        return value
    _refuse_hidden(value, nesting=3)
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        raise
    except Exception as error:  # an array of another library that does not convert
        raise TypeError(f"{type(value).__name__} does not convert to an array: {error}") from error
    if array.dtype.kind not in NUMBER_KINDS:
        raise TypeError(f"{array.dtype} is not a type of real numbers")
    if array.dtype.itemsize <= FLOAT64.itemsize:
        return array.astype(np.float64)
    with np.errstate(over="ignore"):  # of long doubles beyond 1e308: infinite, and refused where it must be finite
        return array.astype(np.float64)


def _refuse_hidden(value: object, nesting: int) -> None:
    """Refuse masked arrays, and lists with booleans or masked values: NumPy converts both without a word."""
    # Only who has loaded NumPy's masked arrays can have one.
    masked: Any = getattr(sys.modules.get("numpy.ma"), "MaskedArray", ())
    if isinstance(value, masked):
        raise TypeError("masked arrays are not accepted: fill or drop the masked values")
    if nesting and isinstance(value, list | tuple):
        kinds = set(map(type, value))
        if kinds <= PLAIN:
            return
        refused = sorted(kind.__name__ for kind in kinds if kind in (bool, np.bool_) or issubclass(kind, masked))
        if refused:
            raise TypeError(f"{', '.join(refused)} is not a number")
        if not kinds.isdisjoint((list, tuple)):
            for item in value:
                _refuse_hidden(item, nesting - 1)


def array(name: str, value: ArrayLike, what: str, unit: str = "") -> Array:
    """An array of real numbers from a user's argument; the error names it and says that `what` is needed.

    Raises:
        InvalidInputError: not made of real numbers.
    """
    try:
        return numbers(value)
    except (TypeError, ValueError) as error:
        raise refusal(name, what, value, unit) from error


def is_plain(value: object, size: int) -> TypeGuard[Array]:
    """Whether this is a contiguous float64 vector (size,) already, finite or not."""
    return type(value) is ndarray and value.dtype is FLOAT64 and value.shape == (size,) and value.flags.c_contiguous


def is_finite(values: list[float]) -> bool:
    """Whether a few numbers, and their sum, are finite: the cheapest test, and silent."""
    return isfinite(sum(values))


def is_vector(value: object, size: int) -> TypeGuard[Array]:
    """Whether this is a contiguous float64 vector (size,) already, and finite: what most calls bring."""
    return (
        type(value) is ndarray
        and value.dtype is FLOAT64
        and value.shape == (size,)
        and value.flags.c_contiguous
        # A sum of plain floats is the cheapest test, and silent; one that overflows is looked at again.
        and isfinite(sum(value.tolist()))
    )


def is_listed(value: object, size: int) -> TypeGuard[list[float] | tuple[float, ...]]:
    """Whether this is a list of so many finite plain numbers: what most other calls bring."""
    try:
        return (
            isinstance(value, list | tuple)
            and len(value) == size
            and set(map(type, value)) <= PLAIN
            and all(map(math.isfinite, value))
        )
    except OverflowError:  # a whole number too large for a float
        return False


def vector(name: str, value: ArrayLike, size: int, unit: str) -> Array:
    """A finite, contiguous float64 vector (size,).

    Raises:
        InvalidInputError: wrong shape, not numbers, or not finite.
    """
    if is_vector(value, size):
        return value
    if is_listed(value, size):
        return np.array(value, dtype=np.float64)
    checked = array(name, value, f"{size} numbers", unit)
    if checked.shape != (size,):
        raise InvalidInputError(f"{name} must have shape ({size},){_bracketed(unit)}, got shape {checked.shape}")
    if not np.isfinite(checked).all():
        raise InvalidInputError(f"{name} must be finite, got {checked.tolist()}")
    # A column of a matrix, or a reversed view: compiled kernels take neither.
    return checked if checked.flags.c_contiguous else np.ascontiguousarray(checked)


def vector_or_rows(name: str, value: ArrayLike, size: int, unit: str) -> Array:
    """A finite, contiguous float64 vector (size,), or rows (n, size) of them; n may be 0.

    Raises:
        InvalidInputError: wrong shape, not numbers, or not finite (the first bad row is named).
    """
    if is_vector(value, size):
        return value
    if is_listed(value, size):
        return np.array(value, dtype=np.float64)
    checked = array(name, value, f"{size} numbers, or rows of them", unit)
    if checked.shape == (size,):
        return vector(name, checked, size, unit)
    if checked.ndim != 2 or checked.shape[1] != size:
        raise InvalidInputError(
            f"{name} must have shape ({size},) or (n, {size}){_bracketed(unit)}, got shape {checked.shape}"
        )
    if not np.isfinite(checked).all():
        matrix(name, checked, size, unit)  # names the row
    return np.ascontiguousarray(checked)


def positive_vector(name: str, value: ArrayLike, size: int, unit: str, *, infinite: bool = False) -> Array:
    """Positive numbers (size,), read-only; one number stands for all.

    Raises:
        InvalidInputError: wrong shape, not numbers, not finite (unless `infinite`: inf is taken) or not positive.
    """
    if type(value) is float and 0.0 < value < math.inf:  # what most calls bring
        return sealed(np.full(size, value))
    given = array(name, value, f"one number or {size}", unit)
    full = np.full(size, given) if given.ndim == 0 else given
    vector(name, np.where(np.isposinf(full), 1.0, full) if infinite else full, size, unit)
    if not min(full.tolist(), default=1.0) > 0.0:
        raise InvalidInputError(f"{name} must be positive{_bracketed(unit)}, got {full.tolist()}")
    return read_only(full)


def matrix(name: str, value: ArrayLike, columns: int, unit: str) -> Array:
    """A finite float64 array of shape (n, columns) with n >= 1.

    Raises:
        InvalidInputError: wrong shape, empty, not numbers, or not finite (the first bad row is named).
    """
    rows = array(name, value, f"rows of {columns} numbers", unit)
    if rows.ndim != 2 or rows.shape[1] != columns:
        raise InvalidInputError(f"{name} must have shape (n, {columns}){_bracketed(unit)}, got shape {rows.shape}")
    if not len(rows):
        raise InvalidInputError(f"{name} is empty")
    finite = np.isfinite(rows).all(axis=1)
    if not finite.all():
        raise InvalidInputError(f"{name} must be finite; row {int(np.argmin(finite))} is not")
    return rows


def sealed(array: AnyArray) -> AnyArray:
    """The array itself, which cannot be written to any more."""
    array.setflags(write=False)
    return array


def read_only(array: ArrayLike) -> Array:
    """A private float64 copy that cannot be written to."""
    return sealed(np.array(array, np.float64))
