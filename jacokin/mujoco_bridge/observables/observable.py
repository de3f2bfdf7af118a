"""Quantities read from a simulation.

An ``Observable`` is called on a physics and returns an array. Its options say how an ``Updater`` reports it: how often
it is read, its delay, its buffer, the aggregator of the buffer, and the corruptor of each reading.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError, shown
from jacokin.mujoco_bridge.observables.bound import Bound
from jacokin.mujoco_bridge.observables.options import (
    CHECKS,
    Aggregator,
    Corruptor,
    RandomState,
    Steps,
    UnknownObservableError,
)
from jacokin.mujoco_bridge.observables.specs import ArraySpec
from jacokin.mujoco_bridge.simulation.physics import Physics

T = TypeVar("T")


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

    update_interval: Steps
    buffer_size: int | None
    delay: Steps | None
    aggregator: str | Aggregator | None
    corruptor: Corruptor | None
    enabled: bool

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
        if not callable(raw):
            raise InvalidInputError(f"raw must be a callable of the physics, got {shown(raw)}")
        if not isinstance(array_spec, ArraySpec | None):
            raise InvalidInputError(f"array_spec must be an ArraySpec or None, got {shown(array_spec)}")
        self._raw = raw
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

    def __call__(self, physics: Physics, random_state: RandomState = None) -> NDArray[Any]:
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
        if not isinstance(options, Mapping):
            raise InvalidInputError(f"options must be a dict, got {shown(options)}")
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
