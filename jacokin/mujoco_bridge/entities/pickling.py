"""Pickling and copying entities, whose specs MuJoCo cannot pickle.

What is pickled is how the entity is made: its class and the arguments of its constructor, and what is attached to it
where. Changes made to elements by hand are not in there; elements added by hand are refused.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol, Self

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError

# Lists of a spec whose lengths tell whether something was added by hand.
_COUNTED = ("bodies", "joints", "geoms", "sites", "cameras", "lights", "actuators", "sensors", "tendons", "equalities")


class Rebuildable(Protocol):
    """What copying needs of an entity: `Entity` itself is made of this module. Its members are described there."""

    @property
    def name(self) -> str:
        """As in `Entity`."""

    @property
    def prefix(self) -> str:
        """As in `Entity`."""

    @property
    def root(self) -> Rebuildable:
        """As in `Entity`."""

    @property
    def recipe(self) -> Recipe:
        """As in `Entity`."""

    @property
    def mjcf_model(self) -> mujoco.MjSpec:
        """As in `Entity`."""

    @property
    def mount(self) -> mujoco.MjsBody | None:
        """As in `Entity`."""

    @property
    def freejoint(self) -> mujoco.MjsJoint | None:
        """As in `Entity`."""

    def attachments(self) -> Iterable[tuple[Self, Any]]:
        """As in `Entity`."""

    def iter_entities(self) -> Iterable[Rebuildable]:
        """As in `Entity`."""

    def attach(self, entity: Any, attach_site: Any = None, *, position: Any = None, quaternion: Any = None) -> Any:
        """As in `Entity`."""


@dataclass(frozen=True, slots=True, eq=False)
class Recipe:
    """How an entity was made.

    Attributes:
        args: positional arguments of its constructor.
        kwargs: keyword arguments of its constructor.
        counts: numbers of elements that its spec had then, by kind.
        built_in: entities that `_build` attached.
    """

    args: tuple[Any, ...]
    kwargs: dict[str, Any]
    counts: Counter[str]
    built_in: tuple[Rebuildable, ...]


@dataclass(frozen=True, slots=True, eq=False)
class _Attached:
    """An attached entity, the name of its site without the parent's prefix, and where it is in the site's frame."""

    entity: Rebuildable
    site: str | None
    position: NDArray[np.float64]
    quaternion: NDArray[np.float64]
    freejoint: str | None


def count(spec: mujoco.MjSpec) -> Counter[str]:
    """The numbers of elements of a spec by kind, without the world body."""
    found = Counter({kind: len(getattr(spec, kind)) for kind in _COUNTED})
    found["bodies"] -= 1
    return found


def reduced(entity: Rebuildable, recipe: Recipe) -> tuple[Callable[..., Rebuildable], tuple[Any, ...]]:
    """What `copy` and `pickle` make the entity from.

    Raises:
        InvalidInputError: the tree was changed by hand, or the entity was made from a `mujoco.MjSpec`.
    """
    _refuse_additions(entity.root)
    if any(isinstance(value, mujoco.MjSpec) for value in (*recipe.args, *recipe.kwargs.values())):
        raise InvalidInputError(f"{entity.name!r} cannot be pickled or copied: it was made from a mujoco.MjSpec")
    attached = []
    for child, attachment in entity.attachments():
        if child in recipe.built_in:
            continue
        free = child.freejoint
        site = None if attachment.site is None else attachment.site.name.removeprefix(entity.prefix)
        name = None if free is None else free.name.removeprefix(child.prefix)
        position, quaternion = attachment.pose()
        attached.append(_Attached(child, site, position, quaternion, name))
    return _made, (type(entity), recipe.args, recipe.kwargs, attached)


def _made(
    cls: Callable[..., Rebuildable], args: tuple[Any, ...], kwargs: dict[str, Any], attached: list[_Attached]
) -> Rebuildable:
    entity = cls(*args, **kwargs)
    for each in attached:
        site = None if each.site is None else entity.mjcf_model.site(each.site)
        body = entity.attach(each.entity, site, position=each.position, quaternion=each.quaternion)
        if each.freejoint is not None:
            body.add_freejoint(name=f"{each.entity.prefix}{each.freejoint}")
    return entity


def _refuse_additions(root: Rebuildable) -> None:
    expected: Counter[str] = Counter()
    built_in: set[Rebuildable] = set()
    for each in root.iter_entities():
        built_in.update(each.recipe.built_in)
        if each in built_in:
            continue  # counted with what built it
        expected.update(each.recipe.counts)
        expected["bodies"] += each.mount is not None
        expected["joints"] += each.freejoint is not None
    added = count(root.mjcf_model)
    added.subtract(expected)
    changed = {kind: number for kind, number in added.items() if number}
    if changed:
        what = ", ".join(f"{number:+d} {kind}" for kind, number in changed.items())
        raise InvalidInputError(
            f"{root.name!r} cannot be pickled or copied: elements were added or removed by hand ({what}); "
            "do that in _build"
        )
