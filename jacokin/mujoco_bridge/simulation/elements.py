"""Elements of a `mujoco.MjSpec`: what kind they are, and where they are in the model compiled from it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import mujoco

from jacokin.errors import InvalidInputError, UnknownNameError, shown
from jacokin.mujoco_bridge.simulation.element_arrays import KINDS, Kind

Element: TypeAlias = (
    mujoco.MjsBody
    | mujoco.MjsJoint
    | mujoco.MjsGeom
    | mujoco.MjsSite
    | mujoco.MjsCamera
    | mujoco.MjsLight
    | mujoco.MjsActuator
    | mujoco.MjsSensor
    | mujoco.MjsTendon
    | mujoco.MjsEquality
    | mujoco.MjsMaterial
)
"""An element of a `mujoco.MjSpec` that can be bound."""


class ElementIds:
    """The ids that elements have in one compiled model.

    They are noted down when the model is compiled: the spec may be changed and compiled again later, which gives its
    elements other ids.
    """

    def __init__(self, model: mujoco.MjModel, spec: mujoco.MjSpec | None) -> None:
        """Note the ids down.

        Args:
            model: the compiled model.
            spec: what it was just compiled from; None to look elements up by their names alone.

        Raises:
            InvalidInputError: the spec has other elements than the model.
        """
        self._model = model
        self._ids: dict[Element, int] | None = None
        if spec is not None:
            if not isinstance(spec, mujoco.MjSpec):
                raise InvalidInputError(f"spec must be a mujoco.MjSpec or None, got {shown(spec)}")
            self._ids = {}
            for kind in KINDS.values():
                elements, count = getattr(spec, kind.plural), getattr(model, kind.count)
                if len(elements) != count:
                    raise InvalidInputError(
                        f"spec has {len(elements)} {kind.plural} and the model {count}: it is not what the model was "
                        "compiled from, or was changed since; compile it again"
                    )
                self._ids.update((element, i) for i, element in enumerate(elements))

    def find(self, elements: Sequence[Element | str]) -> tuple[type, list[int]]:
        """The class that elements have in common, and their ids.

        Args:
            elements: at least one element, or full name. A name that elements of several kinds have means the first
                kind of `element_arrays.KINDS` that has all names given.

        Raises:
            InvalidInputError: not elements of one kind, or not part of the model.
            UnknownNameError: there is no element of a name.
        """
        names = [element for element in elements if isinstance(element, str)]
        classes = {type(element) for element in elements if not isinstance(element, str)}
        for element in elements:
            if not isinstance(element, str) and type(element) not in KINDS:
                raise InvalidInputError(f"{shown(element)} is not an element of an MjSpec that can be bound")
        if len(classes) > 1:
            kinds = sorted(KINDS[each].name for each in classes)
            raise InvalidInputError(f"elements must be of one kind, got {' and '.join(kinds)}")
        found = classes.pop() if classes else self._class_of(names)
        kind = KINDS[found]
        return found, [self._named(kind, each) if isinstance(each, str) else self._id(kind, each) for each in elements]

    def _class_of(self, names: list[str]) -> type:
        for candidate, kind in KINDS.items():
            if all(self._index(kind, name) >= 0 for name in names):
                return candidate
        known = {name: None for kind in KINDS.values() for name in self._names(kind)}
        for name in names:
            if name not in known:
                raise UnknownNameError("element", name, known)
        raise InvalidInputError(f"elements must be of one kind; no kind has all of {', '.join(names)}")

    def _names(self, kind: Kind) -> list[str]:
        count = getattr(self._model, kind.count)
        return [name for i in range(count) if (name := mujoco.mj_id2name(self._model, kind.object_type, i))]

    def _named(self, kind: Kind, name: str) -> int:
        index = self._index(kind, name)
        if index < 0:
            raise UnknownNameError(kind.name, name, self._names(kind))
        return index

    def _index(self, kind: Kind, name: str) -> int:
        try:
            return int(mujoco.mj_name2id(self._model, kind.object_type, name))
        except TypeError:  # not a text in UTF-8, which no name in a model is
            return -1

    def _id(self, kind: Kind, element: Element) -> int:
        if self._ids is not None:
            found = self._ids.get(element, -1)
        else:
            found = self._index(kind, element.name) if element.name else -1
        if found < 0:
            raise InvalidInputError(
                f"{kind.name} {element.name!r} is not part of this physics: it belongs to another model, "
                "or was attached or added after this one was compiled"
            )
        return int(found)
