"""Live arrays of the values that MuJoCo keeps for some elements: what `Physics.bind` returns.

Reading ``physics.bind(elements).field`` gives a numpy view of MuJoCo's own memory. Reading a field that a forward
pass computes (``xpos``, ``sensordata``, ...) runs that pass first if anything it depends on has changed. MuJoCo's own
`MjData.bind` does neither: of several elements it gives copies, and derived fields as the last pass left them.

MuJoCo computes positions, velocities, contacts and forces in a forward pass and keeps them until the next one: after a
write to qpos they belong to the old state. `ForwardCache` remembers the inputs of the last pass, compares, and runs a
pass when one is due. Comparing finds every write, also one through ``physics.data``.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, PhysicsError, UnknownNameError, shown
from jacokin.mujoco_bridge.simulation.elements import KINDS, fields_of

Array = NDArray[Any]  # of any dtype that MuJoCo has

# A forward pass computes these, and the inverse dynamics take them in.
_DERIVED_INPUTS = ("qacc",)
_INTEGRATION = int(mujoco.mjtState.mjSTATE_INTEGRATION)
_BOUNDARIES = (
    mujoco.mjtState.mjSTATE_TIME,
    mujoco.mjtState.mjSTATE_HISTORY,
    mujoco.mjtState.mjSTATE_WARMSTART,
    mujoco.mjtState.mjSTATE_CTRL,
)
_INPUTS = (
    "qpos",
    "qvel",
    "act",
    "ctrl",
    "qfrc_applied",
    "xfrc_applied",
    "mocap_pos",
    "mocap_quat",
    "qacc_warmstart",
)
_RK4 = int(mujoco.mjtIntegrator.mjINT_RK4)
_UNSTABLE = ("mjWARN_INERTIA", "mjWARN_BADQPOS", "mjWARN_BADQVEL", "mjWARN_BADQACC", "mjWARN_BADCTRL")
_MORE_MEMORY = "give the scene more memory: mjcf_model.memory [bytes] of the root entity, before it is compiled"


# MuJoCo takes shortcuts where a frame coincides with its body's; moving such a frame must clear the flag that says so.
_SHORTCUTS = {
    "geom_pos": "geom_sameframe",
    "geom_quat": "geom_sameframe",
    "site_pos": "site_sameframe",
    "site_quat": "site_sameframe",
    "body_ipos": "body_sameframe",
    "body_iquat": "body_sameframe",
}


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


class ForwardCache:
    """MuJoCo's model and data, and whether the derived values of the data belong to its state.

    Attributes:
        rest_is_due: `forward_poses` has run at new positions, and no whole pass since.
        lock: held while MuJoCo computes; two threads in the same data would crash the interpreter.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        """Watch a model and its data; a pass is due."""
        self.model = model
        self.data = data
        self.lock = threading.RLock()
        self.rest_is_due = False
        self._options = model.opt
        self._watch = ModelWatch(model)
        self._now = _WatchedState(model)
        self._at_pass = _WatchedState(model)
        self._scale = np.full(len(self._now.all), 1e-10)
        self._is_known = False
        self._warnings: Array = data.warning.number
        self._no_warnings = np.zeros_like(self._warnings).tobytes()

    def watch(self, name: str) -> None:
        """Look for changes in an array of the model from now on."""
        with self.lock:
            self._watch.add(name)

    def invalidate(self) -> None:
        """Make a pass due, for example after a change of the options."""
        self._is_known = False

    def ensure(self) -> None:
        """Run a forward pass if the state, the controls or a watched array changed since the last.

        Raises:
            PhysicsError: the state is not finite, MuJoCo warns, or it gives up.
        """
        with self.lock:
            if self._is_stale() or self._now.ctrl.tobytes() != self._at_pass.ctrl.tobytes():
                self.forward()

    def forward(self, *, may_be_crowded: bool = False) -> None:
        """Run a forward pass.

        Args:
            may_be_crowded: do not raise yet when there is no room for all contacts; another pass is due then.

        Raises:
            PhysicsError: the state is not finite, MuJoCo warns, or it gives up.
        """
        with self.lock:
            self._is_stale()  # reads the state, and looks at the watched arrays
            self._is_known = False
            self._refuse_infinite(self._now.all)
            try:
                mujoco.mj_forward(self.model, self.data)
            except mujoco.FatalError as error:
                raise self._gave_up(error) from error
            is_complete = self._refuse_warnings(may_be_crowded)
            self._now, self._at_pass = self._at_pass, self._now  # a pass changes nothing of this but the warm start
            self._is_known = is_complete
            self.rest_is_due = False

    def forward_poses(self) -> None:
        """Compute poses, and what Jacobians are made of, alone.

        The caller holds the lock, and sets `rest_is_due` unless positions are as they were.

        Raises:
            PhysicsError: MuJoCo gives up.
        """
        if self._watch.changed():
            self._is_known = False
        try:
            mujoco.mj_fwdKinematics(self.model, self.data)
        except mujoco.FatalError as error:
            raise self._gave_up(error) from error

    def step(self, n: int) -> None:
        """Advance n time steps; what follows from positions and velocities is then that of the new state.

        Raises:
            PhysicsError: the state is not finite, MuJoCo warns, or it gives up; the state is then as before.
        """
        with self.lock:
            if self._is_stale():
                self.forward()
                before = self._at_pass
            else:
                self._refuse_infinite(self._now.ctrl)
                before = self._now
            try:
                self._advance(n)
                self._refuse_warnings()
            except PhysicsError:
                mujoco.mj_setState(self.model, self.data, before.all, _INTEGRATION)
                self._is_known = False
                raise
            mujoco.mj_getState(self.model, self.data, self._at_pass.all, _INTEGRATION)

    def _advance(self, n: int) -> None:
        model, data = self.model, self.data
        try:
            if self._options.integrator == _RK4:  # which has no mj_step2
                mujoco.mj_step(model, data, n)
            else:
                mujoco.mj_step2(model, data)
                if n > 1:
                    mujoco.mj_step(model, data, n - 1)
            mujoco.mj_step1(model, data)
        except mujoco.FatalError as error:
            raise self._gave_up(error) from error

    def _is_stale(self) -> bool:
        """Whether a step would start from old positions or forces; controls do not matter for that."""
        now, known = self._now, self._at_pass
        mujoco.mj_getState(self.model, self.data, now.all, _INTEGRATION)
        if self._watch.changed():
            self._is_known = False
        return (
            self.rest_is_due
            or not self._is_known
            or now.motion.tobytes() != known.motion.tobytes()
            or now.applied.tobytes() != known.applied.tobytes()
        )

    def _refuse_infinite(self, state: Array) -> None:
        # One dot product is the cheapest test for NaN and inf; scaled, it does not overflow.
        if math.isfinite(state.dot(self._scale[: len(state)])):
            return
        data = self.data
        wrong = [name for name in _INPUTS if not np.isfinite(getattr(data, name)).all()]
        raise PhysicsError(f"the simulation is not finite in {', '.join(wrong) or 'its state'} at {data.time:.6g} s")

    def _refuse_warnings(self, may_be_crowded: bool = False) -> bool:
        """Raise what MuJoCo warned of; returns whether there was room for all contacts."""
        if self._warnings.tobytes() == self._no_warnings:
            return True
        counts = dict(enumerate(self._warnings.tolist()))
        names = [name for name, kind in mujoco.mjtWarning.__members__.items() if counts.get(int(kind))]
        self._warnings[:] = 0
        self._is_known = False
        if any(name in _UNSTABLE for name in names):
            raise PhysicsError(f"MuJoCo warns of {', '.join(names)}: the simulation is unstable")
        is_crowded = any(name in ("mjWARN_CONTACTFULL", "mjWARN_CNSTRFULL") for name in names)
        if is_crowded and not may_be_crowded:
            raise PhysicsError(f"MuJoCo warns of {', '.join(names)}: not all contacts find room; {_MORE_MEMORY}")
        return not is_crowded

    def _gave_up(self, error: mujoco.FatalError) -> PhysicsError:
        """The error to raise; makes the data usable again, as MuJoCo leaves its stack as it was when it gave up."""
        state = np.empty_like(self._now.all)
        mujoco.mj_getState(self.model, self.data, state, _INTEGRATION)
        mujoco.mj_resetData(self.model, self.data)
        mujoco.mj_setState(self.model, self.data, state, _INTEGRATION)
        self._is_known = False
        advice = f"; {_MORE_MEMORY}" if "memory" in str(error) else ""
        return PhysicsError(f"MuJoCo gave up: {' '.join(str(error).split())}{advice}")


class _WatchedState:
    """A buffer for MuJoCo's state, and the parts of it that derived values depend on."""

    def __init__(self, model: mujoco.MjModel) -> None:
        self.all = np.empty(mujoco.mj_stateSize(model, _INTEGRATION))
        # The state is laid out by ascending bits: time, qpos, qvel ..., warm start, ctrl, applied forces, mocap ...
        up_to = {bit: mujoco.mj_stateSize(model, 2 * int(bit) - 1) for bit in _BOUNDARIES}
        time, history, warmstart, ctrl = (up_to[bit] for bit in _BOUNDARIES)
        self.motion = self.all[time:history]
        self.ctrl = self.all[warmstart:ctrl]
        self.applied = self.all[ctrl:]


class _Span(NamedTuple):
    """A part of the model's buffer, and its bytes when it was last looked at."""

    memory: NDArray[np.uint8]
    known: bytes


class ModelWatch:
    """The arrays of one model that were handed out to be written to."""

    def __init__(self, model: mujoco.MjModel) -> None:
        """Watch nothing yet."""
        self._model = model
        self._names: set[str] = set()
        self._spans: list[_Span] = []
        self._has_changed = False
        self._frames = {name: getattr(model, name).copy() for name in _SHORTCUTS}

    def add(self, name: str) -> None:
        """Watch an array of the model from now on."""
        if name in self._names:
            return
        self._has_changed = self.changed()  # not to be forgotten by looking at the memory anew
        self._names.add(name)
        arrays = [array for each in self._names if (array := getattr(self._model, each)).size]
        spans: list[tuple[int, int, NDArray[np.uint8]]] = []
        for start, first in sorted((array.__array_interface__["data"][0], i) for i, array in enumerate(arrays)):
            array = arrays[first]
            stop = start + array.nbytes
            if spans and start - spans[-1][1] <= 4096:  # [bytes] comparing these is cheaper than a second comparison
                spans[-1] = (spans[-1][0], max(stop, spans[-1][1]), spans[-1][2])
            else:
                spans.append((start, stop, array.reshape(-1).view(np.uint8)))
        self._spans = []
        for start, stop, array in spans:
            memory = np.lib.stride_tricks.as_strided(array, shape=(stop - start,), strides=(1,))
            self._spans.append(_Span(memory, memory.tobytes()))

    def changed(self) -> bool:
        """Whether anything was written since the last call; clears the flags of frames that were moved.

        Raises:
            PhysicsError: an inertial frame was moved that MuJoCo cannot move; it is put back.
        """
        changed, self._has_changed = self._has_changed, False
        for i, (memory, known) in enumerate(self._spans):
            now = memory.tobytes()
            if now != known:
                self._spans[i] = _Span(memory, now)
                changed = True
        if changed:
            self._clear_shortcuts()
        return changed

    def _clear_shortcuts(self) -> None:
        for name, flag in _SHORTCUTS.items():
            now, known = getattr(self._model, name), self._frames[name]
            moved = (now != known).any(axis=1)
            if name in ("body_ipos", "body_iquat"):
                self._put_back(name, moved & (self._model.body_simple != 0))
            if moved.any():
                known[...] = now
                getattr(self._model, flag)[moved] = 0

    def _put_back(self, name: str, bodies: NDArray[np.bool_]) -> None:
        """Refuse to move inertial frames of bodies for whose mass matrix MuJoCo has compiled a diagonal alone."""
        if not bodies.any():
            return
        getattr(self._model, name)[bodies] = self._frames[name][bodies]
        names = ", ".join(repr(self._model.body(i).name) for i in np.flatnonzero(bodies))
        raise PhysicsError(
            f"{name} of {names} cannot be changed in a compiled model: MuJoCo has no room for the mass matrix that "
            "follows. Set it in the spec and make the physics anew"
        )
