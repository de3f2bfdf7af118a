"""Columns that are carried through: what a file of targets says beside the targets, and how each format holds it.

The rule, for every format: a column that is not understood as a part of the target is carried through unchanged, and
stands behind the answers. Left out are columns without a name, and those of a file of answers (q1, q2, ..., status,
position_error, orientation_error, method, message; of an NPZ also q, status_names, method_names), which are made anew.

A CSV file carries the text of each cell, an NPZ archive arrays (n,) of one type, a Parquet file columns of any type.
From one format to another numbers stay numbers and texts stay texts. Numbers in a CSV file read back to the same bits;
what is missing is an empty text there, and NaN among the numbers of an NPZ.
"""

from __future__ import annotations

import datetime
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pyarrow as pa

KINDS = "biufcUSMm"  # of NumPy's types that are carried; the others hold Python objects, or several values in a row

#: Some rows of each carried column: texts of a CSV file, an array of an NPZ archive, or a column of a Parquet file.
Column: TypeAlias = "list[str] | NDArray[np.generic] | pa.Array"
Carried = Mapping[str, Column]


def as_objects(column: Column) -> list[Any]:
    """The values as JSON has them where it does, else as texts; None for what is missing. Any: of any type."""
    if isinstance(column, list):
        return column
    if not isinstance(column, np.ndarray):
        return [_plain(value) for value in column.to_pylist()]
    # Python has no nanoseconds.
    return [str(value) for value in column] if column.dtype.kind in "Mm" else [_plain(each) for each in column.tolist()]


def as_texts(column: Column) -> list[str]:
    """The values as texts, numbers with the digits that read back to the same bits."""
    return column if isinstance(column, list) else ["" if each is None else str(each) for each in as_objects(column)]


def as_array(column: Column) -> NDArray[np.generic]:
    """The values as an array (n,) of numbers, truth values or dates where they are such, else of texts."""
    array = column if isinstance(column, np.ndarray | list) else column.to_numpy(zero_copy_only=False)
    if isinstance(array, np.ndarray) and array.dtype.kind in KINDS:
        return array
    return np.array(as_texts(column), dtype=np.str_)


def as_arrow(column: Column) -> pa.Array:
    """The values as a column of Arrow."""
    import pyarrow as pa

    if isinstance(column, np.ndarray) and column.dtype.kind in "biufMm":
        try:
            return pa.array(column)
        except pa.ArrowNotImplementedError:  # numbers of 16 bytes, times in hours
            return pa.array(as_texts(column), pa.string())
    return pa.array(as_texts(column), pa.string()) if isinstance(column, np.ndarray | list) else column


def _plain(value: Any) -> Any:
    """Bytes as text, dates and times as ISO 8601, all else that JSON does not have as Python writes it."""
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="backslashreplace")
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return value if value is None or isinstance(value, bool | int | float | str) else str(value)
