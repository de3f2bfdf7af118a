"""Live arrays of the values that MuJoCo keeps for some elements: what `Physics.bind` returns.

Reading ``physics.bind(elements).field`` gives a numpy view of MuJoCo's own memory. Reading a field that a forward
pass computes (``xpos``, ``sensordata``, ...) runs that pass first if anything it depends on has changed. MuJoCo's own
`MjData.bind` does neither: of several elements it gives copies, and derived fields as the last pass left them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, UnknownNameError, shown
from jacokin.mujoco_bridge.simulation.elements import KINDS, fields_of
from jacokin.mujoco_bridge.simulation.forward_cache import ForwardCache

Array = NDArray[Any]  # of any dtype that MuJoCo has

# A forward pass computes these, and the inverse dynamics take them in.
_DERIVED_INPUTS = ("qacc",)


class UnknownFieldError(UnknownNameError, AttributeError):
    """Elements of this kind have no such field; also an ``AttributeError``, so that ``hasattr`` works."""


class Binding:
    """The fields of some elements of one kind in one physics, as attributes.

    Scalar fields are (n,), others (n, k); of a single element (1,) and (k,). Writing an attribute, an item, a slice
    or a broadcast value changes the simulation. Every field of no elements is an empty array, which cannot be written.
    """

    __slots__ = ("_arrays", "_cache", "_element_class", "_ids", "_single")

    def __init__(self, element_class: type | None, ids: Sequence[int], *, single: bool, cache: ForwardCache) -> None:
        """Bind elements; called by `Physics.bind`.

        Args:
            element_class: class of the elements in `mujoco.MjSpec`; None for no elements.
            ids: their ids in the compiled model.
            single: whether one element was given and not a list.
            cache: MuJoCo's model and data, and what keeps their derived values up to date.
        """
        self._element_class = element_class
        self._ids = tuple(ids)
        self._single = single
        self._cache = cache
        self._arrays: dict[str, tuple[Array, bool, bool]] = {}

    @property
    def element_id(self) -> int | NDArray[np.intp]:
        """The id of the element in MuJoCo's arrays; (n,) ids for a list."""
        return self._ids[0] if self._single else np.array(self._ids, dtype=np.intp)

    @property
    def element_ids(self) -> tuple[int, ...]:
        """The ids of the elements."""
        return self._ids

    def __getattr__(self, name: str) -> Array:
        """A field as a live array; runs a forward pass first if it is derived and one is due."""
        try:
            array, derived, indexed = self._arrays[name]
        except KeyError:
            array, derived, indexed = self._find(name)
        if derived:
            self._cache.ensure()
        if indexed:
            array.fetch()  # type: ignore[attr-defined]  # an IndexedArray
        return array

    def __setattr__(self, name: str, value: ArrayLike) -> None:
        """Write a field; the value is broadcast."""
        if name in Binding.__slots__:
            object.__setattr__(self, name, value)
            return
        if self._element_class is None:
            raise InvalidInputError(f"cannot write {name}: no elements are bound")
        kind = KINDS[self._element_class]
        array, derived, _ = self._arrays.get(name) or self._find(name)
        if derived and name not in _DERIVED_INPUTS:
            raise InvalidInputError(
                f"{kind.name} field {name!r} is computed by MuJoCo; write what it follows from, such as qpos"
            )
        try:
            array[...] = value
        except (TypeError, ValueError) as error:
            raise InvalidInputError(
                f"{name} of {len(self._ids)} {kind.plural} must fit shape {array.shape}, got {shown(value)}"
            ) from error

    def __dir__(self) -> list[str]:
        """The fields, beside the usual."""
        fields = () if self._element_class is None else fields_of(self._element_class)
        return sorted({*object.__dir__(self), *fields})

    def _find(self, name: str) -> tuple[Array, bool, bool]:
        """Make the array of a field and keep it."""
        if self._element_class is None:
            if name.startswith("_"):
                raise AttributeError(name)
            return np.empty(0), False, False
        fields = fields_of(self._element_class)
        if name not in fields:
            raise UnknownFieldError(f"{KINDS[self._element_class].name} field", name, sorted(fields))
        field, cache = fields[name], self._cache
        source: Array = getattr(cache.model if field.in_model else cache.data, field.array)
        rows = [field.rows(cache.model, index) for index in self._ids]
        if field.derived and field.array not in _DERIVED_INPUTS:
            source = source.view()
            source.setflags(write=False)
        array = _selected(source, rows, self._single)
        if field.in_model:
            cache.watch(field.array)
        found = self._arrays[name] = (array, field.derived, isinstance(array, IndexedArray))
        return found


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


def _selected(array: Array, rows: Sequence[NDArray[np.intp]], single: bool) -> Array:
    """The rows of an array that belong to the elements, as a view wherever numpy can make one.

    Args:
        array: one of MuJoCo's arrays, (m,) or (m, k).
        rows: for each element its rows in the array.
        single: one element, not a list of one: leave out the axis of the elements.

    Returns:
        (n,) where each element has one number, (n, k) where each has k. Where their numbers differ, all in one row.
    """
    flat = np.concatenate(rows)
    counts = {len(each) for each in rows}
    per_element = counts.pop() if len(counts) == 1 else 0
    steps = set(np.diff(flat).tolist()) or {1}
    if len(steps) == 1 and steps != {0}:
        step = steps.pop()
        start = int(flat[0]) if len(flat) else 0
        stop = start + step * len(flat)
        view = array[start : stop if stop >= 0 else None : step]
        if view.ndim == 2:
            return view[0] if single and per_element == 1 else view
        if per_element <= 1 or single:
            return view
        if step == 1:
            return view.reshape(len(rows), per_element)
    width = array.shape[1] if array.ndim == 2 else per_element
    index = flat[:, None] * width + np.arange(width) if array.ndim == 2 else flat
    return IndexedArray(array.reshape(-1), index.reshape(-1, width) if width > 1 else index)
