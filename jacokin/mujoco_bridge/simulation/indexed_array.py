"""Arrays of entries that no slice selects, such as those of joints in any order, which still read and write through."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[Any]


class IndexedArray(np.ndarray[Any, np.dtype[Any]]):
    """Entries of another array: writes go through to it, reads fetch from it.

    Arithmetic, indexing and numpy functions see present values. Code that reads the memory directly, such as
    ``numpy.asarray``, and views with another shape see those of the last `fetch`.
    """

    _source: Array | None = None
    _index: NDArray[np.intp]

    def __new__(cls, source: Array, index: NDArray[np.intp]) -> IndexedArray:
        """Entries `index` (any shape) of the flat array `source`."""
        array: IndexedArray = source[index].view(cls)
        array._source, array._index = source, index
        return array

    def fetch(self) -> Array:
        """Refresh from the source; returns the values as a plain array."""
        plain: Array = self.view(np.ndarray)
        if self._source is not None:
            np.copyto(plain, self._source[self._index])
        return plain

    def copy(self, order: Any = "C") -> Array:  # type: ignore[override]  # a copy is a plain array
        """The present values as a plain array."""
        return self.fetch().copy(order)

    def tobytes(self, order: Any = "C") -> bytes:
        """The present values as bytes."""
        return self.fetch().tobytes(order)

    def __getitem__(self, key: Any) -> Any:
        """A number, or a live selection."""
        if self._source is None:
            return super().__getitem__(key)
        index = self._index[key]
        return IndexedArray(self._source, index) if isinstance(index, np.ndarray) else self._source[index]

    def __setitem__(self, key: Any, value: Any) -> None:
        """Write through to the source."""
        if self._source is None:
            super().__setitem__(key, value)
        else:
            self._source[self._index[key]] = value
            self.fetch()

    def __iter__(self) -> Iterator[Any]:
        """Item by item."""
        return (self[i] for i in range(len(self)))

    def __array_ufunc__(self, ufunc: np.ufunc, method: str, *inputs: Any, **kwargs: Any) -> Any:
        """Compute with present values; ``out=`` writes through."""
        outputs = kwargs.pop("out", ())
        plain = tuple(np.array(value) for value in outputs)
        if outputs:
            kwargs["out"] = plain
        result = getattr(ufunc, method)(*map(_fetched, inputs), **kwargs)
        for target, values in zip(outputs, plain, strict=True):
            target[...] = values
        return outputs[0] if len(outputs) == 1 else result

    def __array_function__(self, func: Any, types: Any, args: Any, kwargs: Any) -> Any:
        """Call numpy functions with present values."""
        self.fetch()
        return super().__array_function__(func, types, args, kwargs)


def _fetched(value: Any) -> Any:
    return value.fetch() if isinstance(value, IndexedArray) else value
