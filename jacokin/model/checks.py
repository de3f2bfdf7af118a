"""Checks of numeric arguments, used once at the public border."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError

Vector = NDArray[np.float64]

FLOAT64 = np.dtype(np.float64)
NUMBER_KINDS = "iuf"  # of NumPy's dtypes: no booleans, complex numbers, digits in strings, or objects


def numbers(value: ArrayLike) -> Vector:
    """`value` as float64, when it is made of real numbers.

    Raises:
        TypeError: booleans, complex numbers, strings, or Python objects (whole numbers too large for NumPy as well).
        ValueError: rows of different lengths.
    """
    if type(value) is np.ndarray and value.dtype is FLOAT64:
        return value
    array = np.asarray(value)
    if array.dtype.kind not in NUMBER_KINDS:
        raise TypeError(f"{array.dtype} is no real number")
    return array.astype(np.float64)


def vector(name: str, value: ArrayLike, size: int, unit: str) -> Vector:
    """Return `value` as a finite, contiguous float64 vector of the given size, or refuse it by name.

    Raises:
        InvalidInputError: wrong shape, not numbers, or not finite.
    """
    try:
        array = numbers(value)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name} must be {size} numbers [{unit}], got {value!r}") from error
    if array.shape != (size,):
        raise InvalidInputError(f"{name} must have shape ({size},) [{unit}], got shape {array.shape}")
    # A sum of plain floats is the cheapest test, and silent; only a suspicious one is looked at again.
    if not math.isfinite(sum(array.tolist())) and not np.isfinite(array).all():
        raise InvalidInputError(f"{name} must be finite, got {array.tolist()}")
    # A column of a matrix, or a reversed view: compiled kernels take neither.
    return array if array.flags.c_contiguous else np.ascontiguousarray(array)


def matrix(name: str, value: ArrayLike, columns: int, unit: str) -> Vector:
    """Return `value` as a finite float64 array of shape (n, columns) with n >= 1, or refuse it by name.

    Raises:
        InvalidInputError: wrong shape, empty, not numbers, or not finite (the first bad row is named).
    """
    try:
        array = numbers(value)
    except (TypeError, ValueError) as error:
        raise InvalidInputError(f"{name} must be rows of {columns} numbers [{unit}]") from error
    if array.ndim != 2 or array.shape[1] != columns:
        raise InvalidInputError(f"{name} must have shape (n, {columns}) [{unit}], got shape {array.shape}")
    if array.shape[0] == 0:
        raise InvalidInputError(f"{name} is empty")
    finite = np.isfinite(array).all(axis=1)
    if not finite.all():
        raise InvalidInputError(f"{name} must be finite; row {int(np.argmin(finite))} is not")
    return array


def read_only(array: ArrayLike) -> Vector:
    """A private float64 copy that cannot be written to."""
    copy = np.array(array, dtype=np.float64)
    copy.setflags(write=False)
    return copy
