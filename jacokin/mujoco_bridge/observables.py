"""Quantities read from a simulation, and the collection of those of one entity.

An ``Observable`` is called on a physics and returns an array. Its options say how an ``Updater`` reports it: how often
it is read, its delay, its buffer, the aggregator of the buffer, and the corruptor of each reading. The ``Observables``
of an entity are the methods marked ``@observable`` of its ``Observables`` subclass, each of which makes one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from inspect import getattr_static
from typing import Any, ClassVar, Self, TypedDict, TypeVar, Unpack

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from jacokin.errors import InvalidInputError, UnknownNameError, shown
from jacokin.model import checks
from jacokin.mujoco_bridge.distributions import RandomState, Sampler, sampler
from jacokin.mujoco_bridge.simulation.binding import Binding
from jacokin.mujoco_bridge.simulation.physics import Physics, check_physics

T = TypeVar("T")
Steps = int | Sampler  # physics steps, or a sampler of them
Aggregator = Callable[[NDArray[Any]], ArrayLike]  # (buffer_size, ...) -> one observation
Corruptor = Callable[..., ArrayLike]  # corruptor(value, random_state=...) -> value

AGGREGATORS: Mapping[str, Aggregator] = {
    "min": partial(np.min, axis=0),
    "max": partial(np.max, axis=0),
    "mean": partial(np.mean, axis=0),
    "median": partial(np.median, axis=0),
    "sum": partial(np.sum, axis=0),
}


class UnknownObservableError(UnknownNameError, KeyError):
    """An observable, option or aggregator of this name does not exist; also a ``KeyError``."""

    __str__ = Exception.__str__  # KeyError would print the message in quotes


class ObservableOptions(TypedDict, total=False):
    """The options of every observable; see ``Observable``."""

    update_interval: Steps
    buffer_size: int | None
    delay: Steps | None
    aggregator: str | Aggregator | None
    corruptor: Corruptor | None
    enabled: bool


def _check_steps(name: str, value: object, lowest: int) -> Steps:
    if not callable(value):
        return checks.whole_number(name, value, lowest)
    sampler(name, value)
    return value  # a sampler of whole numbers, which are checked when they are drawn


def _check_aggregator(name: str, value: object) -> str | Aggregator | None:
    if isinstance(value, str) and value not in AGGREGATORS:
        raise UnknownObservableError(name, value, AGGREGATORS)
    return value if isinstance(value, str) else _check_callable(name, value)


def _check_callable(name: str, value: Any) -> Callable[..., Any] | None:
    return None if value is None else checks.function(name, value, "None or callable")


# The check of each option, called when it is set: check(name, value) -> value.
CHECKS: Mapping[str, Callable[[str, object], object]] = {
    "update_interval": lambda name, value: _check_steps(name, value, 1),
    "buffer_size": lambda name, value: None if value is None else checks.whole_number(name, value, 1),
    "delay": lambda name, value: None if value is None else _check_steps(name, value, 0),
    "aggregator": _check_aggregator,
    "corruptor": _check_callable,
    "enabled": checks.flag,
}


@dataclass(frozen=True, slots=True, eq=False)
class ArraySpec:
    """Shape, type and bounds of an array.

    Attributes:
        shape: of the array.
        dtype: type of its numbers.
        minimum: inclusive lower bound, a number or an array that broadcasts to the shape; None for no bound.
        maximum: inclusive upper bound, likewise.
        name: of the observation.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]
    minimum: ArrayLike | None
    maximum: ArrayLike | None
    name: str

    def __init__(
        self,
        shape: tuple[int, ...],
        dtype: DTypeLike = np.float64,
        *,
        minimum: ArrayLike | None = None,
        maximum: ArrayLike | None = None,
        name: str = "",
    ) -> None:
        """Describe an array.

        Raises:
            InvalidInputError: not a shape or a type of numbers.
        """
        try:
            sizes, kind = tuple(checks.whole_number("shape", size) for size in shape), np.dtype(dtype)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"shape must be whole numbers and dtype a NumPy type: {error}") from None
        for field, value in zip(self.__slots__, (sizes, kind, minimum, maximum, name), strict=True):
            object.__setattr__(self, field, value)

    @property
    def is_bounded(self) -> bool:
        """Whether there is a lower or an upper bound."""
        return self.minimum is not None or self.maximum is not None


class Bound:
    """Elements whose binding in the last physics is kept."""

    def __init__(self, elements: Any) -> None:
        """Keep one element, or a sequence of elements of one kind."""
        self._elements = elements
        self._physics: Physics | None = None
        self._binding: Binding

    def replace(self, replaced: Callable[[Any], Any]) -> None:
        """Bind what ``replaced`` gives for the elements from now on."""
        self._elements = replaced(self._elements)
        self._physics = None

    def __call__(self, physics: Physics) -> Binding:
        """Return the binding of the elements in this physics.

        Raises:
            InvalidInputError: not a Physics, or one without these elements.
        """
        if physics is None or physics is not self._physics:
            self._binding = check_physics(physics).bind(self._elements)
            self._physics = physics
        return self._binding


class Observable:
    """A quantity read from a physics by a callable.

    Attributes:
        update_interval: physics steps between two readings, or a sampler that draws them anew each time: a callable
            of ``(initial_value, current_value, random_state)`` or of ``(random_state)``.
        buffer_size: number of readings an updater reports, oldest first; None means 1.
        delay: physics steps between a reading and its arrival, or a sampler; None means 0.
        aggregator: what reduces the buffer along its first axis: "min", "max", "mean", "median",
            "sum" or a callable of the buffer; None reports the whole buffer.
        corruptor: ``corruptor(value, random_state=...)`` returns the value to report; each reading
            passes through it before it enters the buffer.
        enabled: whether an updater reports this observable.
    """

    checks: ClassVar[Mapping[str, Callable[[str, object], object]]] = CHECKS

    def __init__(
        self,
        raw: Callable[[Any], ArrayLike],
        *,
        update_interval: Steps = 1,
        buffer_size: int | None = None,
        delay: Steps | None = None,
        aggregator: str | Aggregator | None = None,
        corruptor: Corruptor | None = None,
        enabled: bool = False,
        array_spec: ArraySpec | None = None,
    ) -> None:
        """Observe ``raw(physics)``.

        Args:
            raw: reads the quantity.
            update_interval: see the class, as for the other options.
            buffer_size: see the class.
            delay: see the class.
            aggregator: see the class.
            corruptor: see the class.
            enabled: see the class.
            array_spec: shape, type and bounds of what raw returns; None if bounds are not known.

        Raises:
            InvalidInputError: raw is not callable, or an option has a wrong value.
        """
        if not isinstance(array_spec, ArraySpec | None):
            raise InvalidInputError(f"array_spec must be an ArraySpec or None, got {shown(array_spec)}")
        self._raw = checks.function("raw", raw, "a callable of the physics")
        self._array_spec = array_spec
        self.update_interval = update_interval
        self.buffer_size = buffer_size
        self.delay = delay
        self.aggregator = aggregator
        self.corruptor = corruptor
        self.enabled = enabled

    def __setattr__(self, name: str, value: object) -> None:
        """Check the value if this is an option."""
        check = self.checks.get(name)
        super().__setattr__(name, check(name, value) if check else value)

    def __call__(self, physics: Physics, random_state: RandomState | None = None) -> NDArray[Any]:
        """Read the quantity now and pass it through the corruptor.

        Returns:
            A new array, which later steps of the physics do not change.
        """
        value = np.array(self._raw(physics))
        corruptor = self.corruptor
        return value if corruptor is None else np.array(corruptor(value, random_state=random_state))

    @property
    def array_spec(self) -> ArraySpec | None:
        """Shape, type and bounds of a reading before its corruptor; None if they are not known beforehand."""
        return self._array_spec

    @property
    def options(self) -> dict[str, object]:
        """The present options, as ``configure`` takes them."""
        return {name: getattr(self, name) for name in self.checks}

    @classmethod
    def check_options(cls, options: Mapping[str, object]) -> dict[str, Any]:
        """Return the checked values, or raise what ``configure`` would, changing nothing."""
        checks.mapping("options", options)
        for name in options:
            if name not in cls.checks:
                raise UnknownObservableError("option", name, cls.checks)
        return {name: cls.checks[name](name, value) for name, value in options.items()}

    def configure(self, **options: object) -> None:
        """Set several options; on an error none is set.

        Raises:
            UnknownNameError: unknown option (also a ``KeyError``); lists the valid ones.
            InvalidInputError: an option has a wrong value.
        """
        for name, value in self.check_options(options).items():
            setattr(self, name, value)

    def replace_elements(self, replaced: Callable[[Any], Any]) -> None:
        """Read what ``replaced`` gives for each element from now on; `Entity.detach` makes new elements."""
        for value in vars(self).values():
            if isinstance(value, Bound):
                value.replace(replaced)


class MJCFFeature(Observable):
    """A field of one or several elements, such as ``MJCFFeature("qpos", arm.joints)``."""

    def __init__(self, kind: str, elements: Any, *, index: Any = None, **options: Unpack[ObservableOptions]) -> None:
        """Observe ``physics.bind(elements).<kind>``.

        Args:
            kind: name of the field, as ``Physics.bind`` knows it.
            elements: one element or a sequence of elements of one kind.
            index: what to take from the field; None takes all of it.
            options: the options of ``Observable``.

        Raises:
            InvalidInputError: an option has a wrong value.
        """
        self._bound = bound = Bound(elements)

        def read(physics: Physics) -> ArrayLike:
            value: NDArray[Any] = getattr(bound(physics), kind)
            return value if index is None else value[index]

        super().__init__(read, **options)


class ObservableProperty(cached_property[T]):
    """A method of an ``Observables`` subclass that makes one of its observables; called once."""


def observable(method: Callable[[Any], T]) -> ObservableProperty[T]:
    """Mark a method of an ``Observables`` subclass that returns an ``Observable``."""
    return ObservableProperty(method)


class Observables:
    """The observables of one entity, by name.

    Each is also an attribute: ``arm.observables.joints_pos(physics)``.
    """

    def __init__(self, entity: Any) -> None:
        """Make the observables that the class declares; they are disabled.

        Args:
            entity: the `Entity`, of the class that the observables were written for.

        Raises:
            InvalidInputError: not an entity.
        """
        if isinstance(entity, type) or not callable(getattr(entity, "iter_entities", None)):
            raise InvalidInputError(f"entity must be an Entity such as an Arena, got {shown(entity)}")
        self._entity = entity
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
        checks.instance("observable", observable, Observable, "an Observable")
        if not isinstance(name, str) or not name.isidentifier() or hasattr(self, name):
            raise InvalidInputError(f"name must be an identifier that is not in use, got {shown(name)}")
        observable.enabled = enabled
        self._observables[name] = observable

    def take_over(self, former: Observables, replaced: Callable[[Any], Any]) -> Self:
        """Take the options of the entity's former observables, and those that were added to them; returns self.

        Nothing is checked: it is called by the entity.

        Args:
            former: the observables the entity had before its elements were replaced.
            replaced: gives the present element for each former one.
        """
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
        options = {} if options is None else checks.mapping("options", options)
        if options and all(name in CHECKS for name in options) and not set(options) & set(self._observables):
            options = dict.fromkeys(self._observables, options)
        checked: list[tuple[Observable, Mapping[str, object]]] = []
        for name, values in options.items():
            each = self.get_observable(name)
            checked.append((each, each.check_options(checks.mapping(f"options of {name!r}", values))))
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
