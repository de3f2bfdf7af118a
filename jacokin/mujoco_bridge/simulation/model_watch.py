"""Noticing writes to the arrays of a model.

Users get live arrays of the model, and numpy does not tell who writes to them; so their bytes are compared. All arrays
of a MuJoCo model lie in one buffer. Those that were handed out are compared in spans of that buffer: what a comparison
costs depends on the size of the model, not on how often something was bound.
"""

from __future__ import annotations

from typing import NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.errors import PhysicsError

_GAP = 4096  # [bytes] comparing these is cheaper than a second comparison

# MuJoCo takes shortcuts where a frame coincides with its body's; moving such a frame must clear the flag that says so.
_SHORTCUTS = {
    "geom_pos": ("geom_sameframe",),
    "geom_quat": ("geom_sameframe",),
    "site_pos": ("site_sameframe",),
    "site_quat": ("site_sameframe",),
    "body_ipos": ("body_sameframe",),
    "body_iquat": ("body_sameframe",),
}
_INERTIAL = ("body_ipos", "body_iquat")


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
            if spans and start - spans[-1][1] <= _GAP:
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
        for name, flags in _SHORTCUTS.items():
            now, known = getattr(self._model, name), self._frames[name]
            moved = (now != known).any(axis=1)
            if name in _INERTIAL:
                self._put_back(name, moved & (self._model.body_simple != 0))
            if moved.any():
                known[...] = now
                for flag in flags:
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
