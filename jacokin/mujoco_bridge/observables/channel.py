"""One observable as an updater reports it: when it is read, what is on its way, what has arrived."""

from __future__ import annotations

from bisect import insort
from collections import deque
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.mujoco_bridge.distributions import sampler
from jacokin.mujoco_bridge.observables.observable import Observable
from jacokin.mujoco_bridge.observables.options import AGGREGATORS, RandomState, Steps
from jacokin.mujoco_bridge.observables.specs import ArraySpec

if TYPE_CHECKING:
    from jacokin.mujoco_bridge.simulation.physics import Physics

# Aggregators whose value lies between the least and the greatest reading.
_KEEP_BOUNDS = tuple(AGGREGATORS[name] for name in ("min", "max", "mean", "median"))


class Channel:
    """One enabled observable: its pending readings and its buffer.

    Attributes:
        name: of the observation.
        next_reading: the physics step at which the observable is read next.
    """

    def __init__(self, name: str, observable: Observable, control_steps: int, random_state: RandomState) -> None:
        """Report an observable with its present options.

        Args:
            name: of the observation.
            observable: what to read.
            control_steps: physics steps per control step.
            random_state: for corruptors, and for intervals and delays that are drawn.
        """
        self.name = name
        self.next_reading = 0
        self._observable = observable
        self._random_state = random_state
        self._control_steps = control_steps
        self._size = observable.buffer_size or 1
        self._interval = observable.update_interval
        self._delay = 0 if observable.delay is None else observable.delay
        aggregator = observable.aggregator
        self._aggregator = AGGREGATORS[aggregator] if isinstance(aggregator, str) else aggregator
        self._arrived: deque[NDArray[Any]] = deque(maxlen=self._size)
        self._pending: list[tuple[int, int, NDArray[Any]]] = []  # (arrival, step of the reading, value)
        self._last_reading = 0

    def start(self, physics: Physics, pad_with_initial_value: bool) -> None:
        """Take the reading of step 0 and fill the buffer with it, or with zeros."""
        value = self._observable(physics, self._random_state)
        self._shape, self._dtype = value.shape, value.dtype
        self._arrived.extend([value if pad_with_initial_value else np.zeros_like(value)] * self._size)
        self._keep(value, 0)

    def take(self, physics: Physics, step: int) -> None:
        """Read the observable at this step; an exception leaves the channel as it was."""
        value = self._observable(physics, self._random_state)
        if value.shape != self._shape:
            raise InvalidInputError(f"observable {self.name!r} changed its shape from {self._shape} to {value.shape}")
        self._keep(value, step)

    def take_if_skipped(self, physics: Physics, step: int) -> None:
        """Read the observable if it is due at this step, but was left out because no observation was expected here."""
        if callable(self._interval) or callable(self._delay):
            return  # nothing is left out then
        if step % self._interval == 0 and self._last_reading < step:
            self.take(physics, step)

    def observation(self, step: int, strip: bool) -> NDArray[Any]:
        """The observation at this step."""
        self._receive(step)
        buffer = np.array(self._arrived)
        if self._aggregator is not None:
            return np.asarray(self._aggregator(buffer))
        return buffer[0] if strip and self._size == 1 else buffer

    def spec(self, strip: bool) -> ArraySpec:
        """What the observations look like."""
        own = self._observable.array_spec
        shape = self._shape if strip and self._size == 1 else (self._size, *self._shape)
        dtype = self._dtype
        bounded = own is not None and self._observable.corruptor is None
        if self._aggregator is not None:
            value = np.asarray(self._aggregator(np.zeros((self._size, *self._shape), dtype)))
            shape, dtype = value.shape, value.dtype
            bounded = bounded and self._aggregator in _KEEP_BOUNDS
        if own is None or not bounded:
            return ArraySpec(shape, dtype, name=self.name)
        return ArraySpec(shape, dtype, minimum=own.minimum, maximum=own.maximum, name=self.name)

    def _keep(self, value: NDArray[Any], step: int) -> None:
        """Send a reading on its way and choose the step of the next; what can fail comes first."""
        arrival = step + self._draw("delay", self._delay, 0)
        next_reading = self._after(step)
        self._receive(step)
        self.next_reading, self._last_reading = next_reading, step
        insort(self._pending, (arrival, step, value), key=lambda reading: reading[:2])

    def _receive(self, step: int) -> None:
        while self._pending and self._pending[0][0] <= step:
            self._arrived.append(self._pending.pop(0)[2])

    def _after(self, step: int) -> int:
        """The step of the reading after that of this step, skipping those that no observation would contain.

        With constant interval and delay, the readings that arrive in the same control step as the next one are known;
        an observation contains the newest of them, as many as the buffer holds.
        """
        soonest = step + self._draw("update_interval", self._interval, 1)
        if callable(self._interval) or callable(self._delay):
            return soonest
        arrival = soonest + self._delay
        shown_at = arrival + -arrival % self._control_steps
        newest = (shown_at - self._delay) // self._interval * self._interval
        return max(soonest, newest - (self._size - 1) * self._interval)

    def _draw(self, option: str, value: Steps, lowest: int) -> int:
        if not callable(value):
            return value
        drawn = sampler(option, value)(None, None, self._random_state)
        return checks.whole_number(f"{option} drawn for {self.name!r}", drawn, lowest)
