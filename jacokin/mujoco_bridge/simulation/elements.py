"""Elements of a `mujoco.MjSpec`: what kind they are, and where they are in a compiled model."""

from __future__ import annotations

from typing import Any

import mujoco

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge.simulation.element_arrays import KINDS, Kind


def kind_of(element: Any) -> Kind | None:
    """The kind of an element; None for anything else."""
    return KINDS.get(type(element))


def element_id(model: mujoco.MjModel, spec: mujoco.MjSpec | None, element: Any) -> int:
    """The id of an element in a compiled model.

    Args:
        model: the compiled model.
        spec: what it was compiled from; None to look the element up by its name alone.
        element: an element of a kind in `fields.KINDS`.

    Raises:
        InvalidInputError: the element is not part of the model.
    """
    kind = KINDS[type(element)]
    name = element.name
    if name:
        known = spec is None or getattr(spec, kind.name)(name) is element
        index = mujoco.mj_name2id(model, kind.object_type, name)
        if known and index >= 0:
            return int(index)
    elif spec is not None:
        # Elements without a name are numbered when the model is compiled.
        siblings = getattr(spec, kind.plural)
        if 0 <= element.id < len(siblings) and siblings[element.id] is element:
            return int(element.id)
    raise InvalidInputError(
        f"{kind.name} {name!r} is not part of this physics: it belongs to another model, "
        "or was attached or added after this one was compiled"
    )
