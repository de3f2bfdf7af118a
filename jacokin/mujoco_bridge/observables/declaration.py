"""The observables of an entity: how its class declares them, and how they are found by name.

They are the methods marked ``@observable`` of the entity's ``Observables`` subclass, each of which makes one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from inspect import getattr_static
from typing import Any, Protocol, Self, TypeVar

from jacokin.errors import InvalidInputError, shown
from jacokin.model import checks
from jacokin.mujoco_bridge.observables.observable import CHECKS, MJCFFeature, Observable, UnknownObservableError

T = TypeVar("T")


class Observed(Protocol):
    """What the observables of an entity need of it: `Entity` itself is made of this module."""

    @property
    def prefix(self) -> str:
        """What stands before the names of its elements."""

    @property
    def observables(self) -> Observables:
        """Its own observables."""

    def iter_entities(self) -> Iterable[Observed]:
        """The entity, and all entities attached to it."""


class ObservableProperty(cached_property[T]):
    """A method of an ``Observables`` subclass that makes one of its observables; called once."""


def observable(method: Callable[[Any], T]) -> ObservableProperty[T]:
    """Mark a method of an ``Observables`` subclass that returns an ``Observable``."""
    return ObservableProperty(method)


class Observables:
    """The observables of one entity, by name.

    Each is also an attribute: ``arm.observables.joints_pos(physics)``.
    """

    def __init__(self, entity: Observed) -> None:
        """Make the observables that the class declares; they are disabled.

        Raises:
            InvalidInputError: not an entity.
        """
        _check_entity("entity", entity)
        self._entity: Any = entity  # each subclass knows what its entity has
        self._observables: dict[str, Observable] = {}
        for name in sorted(dir(type(self))):
            if isinstance(getattr_static(type(self), name), ObservableProperty):
                self._observables[name] = getattr(self, name)

    def __getattr__(self, name: str) -> Observable:
        """Return an observable that was added; those declared are found without this."""
        found: Observable | None = vars(self).get("_observables", {}).get(name)
        if found is None:
            names = ", ".join(sorted(vars(self).get("_observables", ())))
            raise AttributeError(f"unknown observable {name!r}. Valid: {names}")
        return found

    def get_observable(self, name: str) -> Observable:
        """Return the observable of this name.

        Raises:
            UnknownNameError: no observable has this name (also a ``KeyError``); lists the valid ones.
        """
        try:
            return self._observables[name]
        except (KeyError, TypeError):  # a TypeError for what cannot be a key
            raise UnknownObservableError("observable", name, sorted(self._observables)) from None

    def add_observable(self, name: str, observable: Observable, enabled: bool = True) -> None:
        """Add an observable that the class does not declare, enabled by default.

        Raises:
            InvalidInputError: the name is in use or not an identifier, or this is not an ``Observable``.
        """
        if not isinstance(observable, Observable):
            raise InvalidInputError(f"observable must be an Observable, got {shown(observable)}")
        if not isinstance(name, str) or not name.isidentifier() or hasattr(self, name):
            raise InvalidInputError(f"name must be an identifier that is not in use, got {shown(name)}")
        observable.enabled = enabled
        self._observables[name] = observable

    def continued(self, former: Observables, replaced: Callable[[Any], Any]) -> Self:
        """Take over the options of the entity's former observables, and those that were added to them.

        Args:
            former: the observables the entity had before its elements were replaced.
            replaced: gives the present element for each former one.

        Raises:
            InvalidInputError: not observables, or not a function.
        """
        if not isinstance(former, Observables):
            raise InvalidInputError(f"former must be Observables, got {shown(former)}")
        if not callable(replaced):
            raise InvalidInputError(f"replaced must be callable with an element, got {shown(replaced)}")
        for name, each in former._observables.items():
            if name in self._observables:
                self._observables[name].configure(**each.options)
            else:
                each.replace_elements(replaced)
                self._observables[name] = each
        return self

    def enable_all(self) -> None:
        """Enable every observable of this entity."""
        self.set_options({"enabled": True})

    def disable_all(self) -> None:
        """Disable every observable of this entity."""
        self.set_options({"enabled": False})

    @property
    def enabled_observables(self) -> dict[str, Observable]:
        """The enabled observables by their short names."""
        return {name: each for name, each in self.as_dict(fully_qualified=False).items() if each.enabled}

    def set_options(self, options: Mapping[str, object] | None) -> None:
        """Set options of the observables; on an error nothing is set.

        Args:
            options: ``{observable: {option: value}}``, or one ``{option: value}`` for all; None
                and an empty dict change nothing.

        Raises:
            UnknownNameError: unknown observable or option (also a ``KeyError``); lists the valid
                ones.
            InvalidInputError: an option has a wrong value.
        """
        options = {} if options is None else options
        if not isinstance(options, Mapping):
            raise InvalidInputError(f"options must be a dict, got {shown(options)}")
        if options and all(name in CHECKS for name in options) and not set(options) & set(self._observables):
            options = dict.fromkeys(self._observables, options)
        checked: list[tuple[Observable, Mapping[str, object]]] = []
        for name, values in options.items():
            each = self.get_observable(name)
            if not isinstance(values, Mapping):
                raise InvalidInputError(f"options of {name!r} must be a dict, got {shown(values)}")
            checked.append((each, each.check_options(values)))
        for each, values in checked:
            each.configure(**values)

    def as_dict(self, fully_qualified: bool = True) -> dict[str, Observable]:
        """The observables by name: those declared in alphabetical order, then those added.

        Args:
            fully_qualified: prefix the names with the entity's, as in
                ``"jaco_arm/jaco_hand/joints_pos"``.
        """
        prefix = self._entity.prefix if checks.flag("fully_qualified", fully_qualified) else ""
        return {prefix + name: each for name, each in self._observables.items()}


def _check_entity(name: str, value: object) -> None:
    """Refuse what is not an entity."""
    if isinstance(value, type) or not callable(getattr(value, "iter_entities", None)):
        raise InvalidInputError(f"{name} must be an Entity such as an Arena, got {shown(value)}")


def observables_of(root: Observed) -> dict[str, Observable]:
    """The observables of an entity and of all entities attached to it, by full name.

    They are in the order of dm_control: entity by entity as they are attached, the arm before its hand; of each entity
    those that its class declares by name, then those that were added. Observables of a task come before them:
    ``{**own, **observables_of(arena)}``.

    Raises:
        InvalidInputError: root is not an entity.
    """
    _check_entity("root", root)
    found: dict[str, Observable] = {}
    for entity in root.iter_entities():
        found.update(entity.observables.as_dict())
    return found


class JointsObservables(Observables):
    """Positions and velocities of the entity's ``joints``."""

    @observable
    def joints_pos(self) -> Observable:
        """Positions, one per joint [rad, m on slide joints]."""
        return MJCFFeature("qpos", self._entity.joints)

    @observable
    def joints_vel(self) -> Observable:
        """Velocities, one per joint [rad/s, m/s on slide joints]."""
        return MJCFFeature("qvel", self._entity.joints)
