"""Attaching one `mujoco.MjSpec` to another so that it can be detached again.

MuJoCo moves a child's elements into the parent's spec for good. To undo that, a copy of the child is taken first; it
replaces the child afterwards, and every element an entity holds is replaced by its counterpart in the copy.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, MutableMapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, TypeAlias

import mujoco
import numpy as np

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError

# Bindable elements and others alike (frames, textures, keys, ...): mujoco has no base class for them.
SpecElement: TypeAlias = Any

# Elements of the tree of bodies: deleting a body deletes them.
_IN_BODIES = ("bodies", "joints", "geoms", "sites", "cameras", "lights", "frames")
# Elements that refer to those by name.
_REFERRING = ("actuators", "sensors", "tendons", "equalities", "excludes", "pairs", "flexes", "plugins")
# Elements that deleting a body leaves behind.
_ASSETS = ("materials", "textures", "meshes", "hfields", "skins", "numerics", "texts", "tuples", "keys")
# Lists of a spec whose lengths tell whether something was added by hand.
_COUNTED = ("bodies", "joints", "geoms", "sites", "cameras", "lights", "actuators", "sensors", "tendons", "equalities")
_LISTS = (*_IN_BODIES, *_REFERRING, *_ASSETS)


@dataclass(frozen=True, slots=True, eq=False)
class SpecCopy:
    """A copy of a spec, to take the place of the original.

    Attributes:
        spec: the copy.
        counterparts: for each element of the original the one of the copy; for the original spec the copy.
    """

    spec: mujoco.MjSpec
    counterparts: dict[SpecElement, SpecElement]

    def replaced(self, value: Any) -> Any:
        """A value with every element of the original in it replaced, also in lists, sets, dicts and object arrays."""
        if isinstance(value, np.ndarray):
            if value.dtype != object:
                return value
            array = np.empty(value.shape, dtype=object)
            for index, each in np.ndenumerate(value):
                array[index] = self.replaced(each)
            return array
        if isinstance(value, tuple):
            items = [self.replaced(each) for each in value]
            return type(value)(*items) if hasattr(value, "_fields") else type(value)(items)
        if isinstance(value, list | set | frozenset):
            return type(value)(self.replaced(each) for each in value)
        if isinstance(value, dict):
            return {self.replaced(key): self.replaced(each) for key, each in value.items()}
        if type(value).__module__ != mujoco.MjSpec.__module__:
            return value
        return self.counterparts.get(value, value)

    def replace_in(self, attributes: MutableMapping[str, Any]) -> None:
        """Replace the elements of the original among the attributes of an object."""
        for name, value in attributes.items():
            attributes[name] = self.replaced(value)


@dataclass(frozen=True, slots=True, eq=False)
class Attachment:
    """How an entity is attached to its parent.

    Attributes:
        body: the body made to hold it.
        site: the site it was attached to; None where it was attached to a body.
        frame: the frame made for the site; None where it was attached to a body.
        before: the entity's spec as it was before.
    """

    body: mujoco.MjsBody
    site: mujoco.MjsSite | None
    frame: mujoco.MjsFrame | None
    before: SpecCopy

    def pose(self) -> tuple[Array, Array]:
        """Position (3,) [m] and quaternion (4,) wxyz of the body in its frame."""
        return np.array(self.body.pos), np.array(self.body.quat)

    def undo(self, spec: mujoco.MjSpec) -> SpecCopy:
        """Remove what was attached from the tree; returns what takes its place."""
        _remove(spec, self.body, self.frame)
        return self.before


def attach_spec(
    spec: mujoco.MjSpec,
    child: mujoco.MjSpec,
    place: mujoco.MjsSite | mujoco.MjsBody,
    prefix: str,
    position: Array,
    quaternion: Array,
    children: Iterable[Attachment],
) -> Attachment:
    """Move all elements of a child spec into a new body of a tree.

    Args:
        spec: the spec of the tree's root.
        child: what to attach.
        place: a site or body of the tree.
        prefix: for the child's names, and the name of the new body.
        position: (3,) of the new body in the frame of the place [m].
        quaternion: (4,) of the new body in the frame of the place, wxyz.
        children: what is attached to the child.

    Raises:
        ModelError: MuJoCo refuses to join the two; the tree is then as before.
    """
    before = _copied(child, children)
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
    site = place if frame is not None else None
    attachment = Attachment(body, site, frame, before)
    try:
        spec.attach(child, frame=body.add_frame(), prefix=prefix)
    except (ValueError, mujoco.FatalError) as error:
        with suppress(ValueError):  # MuJoCo refuses further changes after some failures
            attachment.undo(spec)
        raise ModelError(f"MuJoCo cannot attach {prefix!r}: {error}") from error
    return attachment


def _copied(spec: mujoco.MjSpec, children: Iterable[Attachment]) -> SpecCopy:
    """A copy of a spec without what is attached to it."""
    copy = spec.copy()
    counterparts: dict[SpecElement, SpecElement] = {spec: copy}
    for kind in _LISTS:
        counterparts.update(zip(getattr(spec, kind, ()), getattr(copy, kind, ()), strict=True))
    for each in children:
        _remove(copy, counterparts[each.body], counterparts.get(each.frame))
    return SpecCopy(copy, counterparts)


def _remove(spec: mujoco.MjSpec, body: mujoco.MjsBody, frame: mujoco.MjsFrame | None) -> None:
    """Remove a body with all below it, the assets whose names begin with its name, and the frame that holds it."""
    prefix = body.name
    for kind in _ASSETS:
        for element in list(getattr(spec, kind)):
            if element.name.startswith(prefix):
                spec.delete(element)
    spec.delete(body)
    if frame is not None:
        spec.delete(frame)


def refuse_lost_elements(root: mujoco.MjSpec, attached: mujoco.MjSpec, before: SpecCopy, name: str) -> None:
    """Refuse elements that were added to the spec of an entity after it was attached.

    Args:
        root: the spec of the tree's root.
        attached: the entity's own spec.
        before: a copy of that from before.
        name: the entity's name.

    Raises:
        InvalidInputError: there are some; MuJoCo would leave them out silently.
    """
    for kind in _LISTS:
        if kind == "frames":
            continue  # of no effect by themselves; what they hold is found in its own list
        kept = {*getattr(root, kind, ()), *before.counterparts}
        lost = [each for each in getattr(attached, kind, ()) if each not in kept]
        if lost:
            advice = (
                "add it to the entity's root_body instead"
                if kind in _IN_BODIES
                else "add it before attaching, or to the root's mjcf_model with the full names of what it refers to"
            )
            raise InvalidInputError(
                f"{lost[0].name!r} ({kind}) was added to the mjcf_model of {name!r} after that was attached, where "
                f"MuJoCo leaves it out; {advice}"
            )


def count_elements(spec: mujoco.MjSpec) -> Counter[str]:
    """The numbers of elements of a spec by kind, without the world body."""
    found = Counter({kind: len(getattr(spec, kind)) for kind in _COUNTED})
    found["bodies"] -= 1
    return found
