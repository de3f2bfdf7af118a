"""Joining two specs so that it can be undone.

MuJoCo moves a child's elements into the parent's spec for good. To undo that, a copy of the child is taken first; it
replaces the child afterwards, and every element an entity holds is replaced by its twin in the copy.
"""

from __future__ import annotations

from collections.abc import Iterable, MutableMapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, ModelError

# Every list of elements a spec has.
_LISTS = (
    "bodies",
    "joints",
    "geoms",
    "sites",
    "cameras",
    "lights",
    "frames",
    "actuators",
    "sensors",
    "tendons",
    "equalities",
    "excludes",
    "pairs",
    "materials",
    "meshes",
    "textures",
    "hfields",
    "skins",
    "flexes",
    "numerics",
    "texts",
    "tuples",
    "keys",
    "plugins",
)
# Those that deleting a body leaves behind.
_ASSETS = ("materials", "textures", "meshes", "hfields", "skins", "numerics", "texts", "tuples", "keys")
# Elements that MuJoCo drops without a word when they are added to the world body of an attached spec.
_LOST = ("bodies", "geoms", "sites", "cameras", "lights")


@dataclass(frozen=True, slots=True, eq=False)
class Restored:
    """A spec put in the place of one that was attached, and for each element its twin."""

    spec: mujoco.MjSpec
    twins: dict[Any, Any]

    def now(self, element: Any) -> Any:
        """The twin of an element; what has none is returned as it is."""
        return self.twins.get(element, element)

    def replace_in(self, attributes: MutableMapping[str, Any]) -> None:
        """Replace the spec and the elements among the attributes of an entity, also in its lists and dicts."""
        for name, value in attributes.items():
            attributes[name] = self._replaced(value)

    def _replaced(self, value: Any) -> Any:
        if isinstance(value, list | tuple):
            return type(value)(self._replaced(each) for each in value)
        if isinstance(value, dict):
            return {key: self._replaced(each) for key, each in value.items()}
        return self.now(value) if type(value).__hash__ is not None else value


@dataclass(frozen=True, slots=True, eq=False)
class Attachment:
    """How an entity hangs in its parent's tree.

    Attributes:
        body: the body made to hold it.
        place: the site or body it was attached to.
        frame: the frame of the site, None where a body was given.
        restored: the entity's spec as it was before.
    """

    body: Any
    place: Any
    frame: Any
    restored: Restored

    def where(self) -> tuple[Any, NDArray[np.float64], NDArray[np.float64]]:
        """The site (None for a body), position [m] and quaternion wxyz with which to attach again."""
        site = self.place if isinstance(self.place, mujoco.MjsSite) else None
        return site, np.array(self.body.pos), np.array(self.body.quat)

    def undo(self, spec: mujoco.MjSpec) -> Restored:
        """Remove everything attached from the tree; returns what takes its place."""
        _remove(spec, self.body, self.frame)
        return self.restored


def attach(
    spec: mujoco.MjSpec,
    child: mujoco.MjSpec,
    place: Any,
    prefix: str,
    position: NDArray[np.float64],
    quaternion: NDArray[np.float64],
    held: Iterable[Attachment],
) -> Attachment:
    """Hang all of a child spec in a new body of a tree.

    Args:
        spec: the spec of the tree's root.
        child: what to attach.
        place: a site or body of the tree.
        prefix: for the child's names, and the name of the new body.
        position: (3,) of the new body in the frame of the place [m].
        quaternion: (4,) of the new body in the frame of the place, wxyz.
        held: what is attached to the child.

    Raises:
        ModelError: MuJoCo refuses to join the two; the tree is then as before.
    """
    restored = _copied(child, held)
    frame = None
    holder = place
    if isinstance(place, mujoco.MjsSite):
        holder = place.parent
        frame = holder.add_frame(pos=place.pos, quat=place.quat)
        for part in ("type", "axisangle", "euler", "xyaxes", "zaxis"):
            setattr(frame.alt, part, getattr(place.alt, part))
        if place.frame is not None:
            frame.set_frame(place.frame)
    body = holder.add_body(name=prefix, pos=position, quat=quaternion)
    if frame is not None:
        body.set_frame(frame)
    attachment = Attachment(body, place, frame, restored)
    try:
        spec.attach(child, frame=body.add_frame(), prefix=prefix)
    except (ValueError, mujoco.FatalError) as error:
        with suppress(ValueError):  # MuJoCo refuses further changes after some failures
            attachment.undo(spec)
        raise ModelError(f"MuJoCo cannot attach {prefix!r}: {error}") from error
    return attachment


def _copied(spec: mujoco.MjSpec, held: Iterable[Attachment]) -> Restored:
    """A copy of a spec without what is attached to it."""
    copy = spec.copy()
    twins: dict[Any, Any] = {spec: copy}
    for kind in _LISTS:
        twins.update(zip(getattr(spec, kind, ()), getattr(copy, kind, ()), strict=True))
    for each in held:
        _remove(copy, twins[each.body], twins.get(each.frame))
    return Restored(copy, twins)


def _remove(spec: mujoco.MjSpec, body: Any, frame: Any) -> None:
    """Remove a body with all below it, the assets of its name, and the frame it hangs in."""
    prefix = body.name
    for kind in _ASSETS:
        for element in list(getattr(spec, kind)):
            if element.name.startswith(prefix):
                spec.delete(element)
    spec.delete(body)
    if frame is not None:
        spec.delete(frame)


def refuse_lost_elements(root: mujoco.MjSpec, attached: mujoco.MjSpec, name: str) -> None:
    """Refuse elements that were added to the world body of a spec after it was attached.

    Raises:
        InvalidInputError: there are some; MuJoCo would leave them out without a word.
    """
    for kind in _LOST:
        in_tree = set(getattr(root, kind))
        for element in getattr(attached, kind):
            if element not in in_tree and element is not attached.worldbody:
                raise InvalidInputError(
                    f"{element.name!r} ({kind}) was added to the world body of {name!r} after that was attached, where "
                    "MuJoCo loses it; add it to the entity's root_body instead"
                )
