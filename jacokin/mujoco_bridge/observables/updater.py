"""Observations at control rate.

A control step is a fixed number of physics steps. Each enabled observable is read every ``update_interval`` physics
steps; a reading passes through the corruptor, arrives ``delay`` physics steps later, and replaces the oldest of
``buffer_size`` readings. An observation is the buffer, oldest reading first, or the aggregator's value of it.
"""

from __future__ import annotations

from bisect import insort
from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.model import checks
from jacokin.mujoco_bridge.observables.observable import Observable
from jacokin.mujoco_bridge.observables.options import AGGREGATORS, RandomState, Steps

if TYPE_CHECKING:
    from jacokin.mujoco_bridge.simulation.physics import Physics


class _Channel:
    """One enabled observable: its pending readings and its buffer."""

    def __init__(self, name: str, observable: Observable, control_steps: int, random_state: RandomState) -> None:
        self.name = name
        self.observable = observable
        self.random_state = random_state
        self.control_steps = control_steps
        self.size = observable.buffer_size or 1
        self.interval = observable.update_interval
        self.delay = 0 if observable.delay is None else observable.delay
        aggregator = observable.aggregator
        self.aggregator = AGGREGATORS[aggregator] if isinstance(aggregator, str) else aggregator
        self.arrived: deque[NDArray[Any]] = deque(maxlen=self.size)
        self.pending: list[tuple[int, int, NDArray[Any]]] = []  # (arrival, step of the reading, value)
        self.next_reading = 0  # at this step

    def start(self, physics: Physics, pad_with_initial_value: bool) -> None:
        """Take the reading of step 0 and fill the buffer with it, or with zeros."""
        value = self.observable(physics, self.random_state)
        padding = value if pad_with_initial_value else np.zeros_like(value)
        self.shape = value.shape
        self.arrived.extend([padding] * self.size)
        self._send(0, value)
        self._schedule(0)

    def take(self, physics: Physics, step: int) -> None:
        """Read the observable at this step."""
        value = self.observable(physics, self.random_state)
        if value.shape != self.shape:
            raise InvalidInputError(f"observable {self.name!r} changed its shape from {self.shape} to {value.shape}")
        self._send(step, value)
        self._schedule(step)

    def observation(self, step: int, strip: bool) -> NDArray[Any]:
        """The observation at this step."""
        self._receive(step)
        buffer = np.array(self.arrived)
        if self.aggregator is not None:
            return np.asarray(self.aggregator(buffer))
        return buffer[0] if strip and self.size == 1 else buffer

    def _send(self, step: int, value: NDArray[Any]) -> None:
        delay = self._draw("delay", self.delay, 0)
        self._receive(step)
        insort(self.pending, (step + delay, step, value), key=lambda reading: reading[:2])

    def _receive(self, step: int) -> None:
        while self.pending and self.pending[0][0] <= step:
            self.arrived.append(self.pending.pop(0)[2])

    def _schedule(self, step: int) -> None:
        """Choose the step of the next reading, skipping those that no observation would contain.

        With constant interval and delay, the readings that arrive in the same control step as the next one are known;
        an observation contains the newest of them, as many as the buffer holds.
        """
        self.next_reading = step + self._draw("update_interval", self.interval, 1)
        if callable(self.interval) or callable(self.delay):
            return
        arrival = self.next_reading + self.delay
        shown_at = arrival + -arrival % self.control_steps
        newest = (shown_at - self.delay) // self.interval * self.interval
        self.next_reading = max(self.next_reading, newest - (self.size - 1) * self.interval)

    def _draw(self, option: str, value: Steps, lowest: int) -> int:
        if not callable(value):
            return value
        return checks.whole_number(f"{option} drawn for {self.name!r}", value(random_state=self.random_state), lowest)


class Updater:
    """Reports the enabled observables of a dictionary once per control step.

    ``advance`` steps the physics and returns the observation. To step the physics yourself, call ``update`` after each
    single step and ``get_observation`` after each control step.
    """

    def __init__(
        self,
        observables: Mapping[str, Observable],
        physics_steps_per_control_step: int = 1,
        *,
        strip_singleton_buffer_dim: bool = False,
        pad_with_initial_value: bool = False,
    ) -> None:
        """Report those of the observables that are enabled at ``reset``.

        Args:
            observables: by name, as ``observables_of(arena)`` returns them.
            physics_steps_per_control_step: physics steps between two observations.
            strip_singleton_buffer_dim: leave out the first axis where buffer_size is 1.
            pad_with_initial_value: fill the buffers at the start with the first reading instead
                of zeros.

        Raises:
            InvalidInputError: an argument has a wrong type or value.
        """
        if not isinstance(observables, Mapping):
            raise InvalidInputError(f"observables must be a dict by name, got {observables!r}")
        for name, observable in observables.items():
            if not isinstance(observable, Observable):
                raise InvalidInputError(f"observables[{name!r}] must be an Observable, got {observable!r}")
        self._observables = dict(observables)
        self._control_steps = checks.whole_number("physics_steps_per_control_step", physics_steps_per_control_step, 1)
        self._strip = strip_singleton_buffer_dim
        self._pad = pad_with_initial_value
        self._step = 0
        self._physics: Physics | None = None
        self._channels: list[_Channel] = []

    def reset(self, physics: Physics, random_state: RandomState = None) -> None:
        """Start an episode at the present state of the physics: empty buffers, first readings.

        Args:
            physics: the simulation to read.
            random_state: passed to corruptors and to drawn intervals and delays.
        """
        channels = [
            _Channel(name, observable, self._control_steps, random_state)
            for name, observable in self._observables.items()
            if observable.enabled
        ]
        for channel in channels:
            channel.start(physics, self._pad)
        self._physics, self._channels, self._step = physics, channels, 0

    def prepare_for_next_control_step(self) -> None:
        """Do nothing. Loops written for dm_control's updater call this before each control step."""

    def update(self) -> None:
        """Take the readings that are due after one more physics step.

        Raises:
            PhysicsError: ``reset`` was not called.
        """
        self._started()
        self._step += 1
        self._take_readings()

    def advance(self) -> dict[str, NDArray[Any]]:
        """Simulate one control step and return the observation after it.

        Raises:
            PhysicsError: ``reset`` was not called, or the simulation diverged.
        """
        physics = self._started()
        end = self._step + self._control_steps
        while self._step < end:
            step = min([end, *(channel.next_reading for channel in self._channels)])
            physics.step(step - self._step)
            self._step = step
            self._take_readings()
        return self.get_observation()

    def get_observation(self) -> dict[str, NDArray[Any]]:
        """Return the observation after a whole number of control steps, as new arrays.

        Returns:
            For each enabled observable its buffer (buffer_size, ...), or the aggregator's value of the
            buffer.

        Raises:
            PhysicsError: ``reset`` was not called, or a control step is not finished.
        """
        self._started()
        if self._step % self._control_steps:
            raise PhysicsError(
                f"the control step is not finished: {self._step % self._control_steps} of "
                f"{self._control_steps} physics steps are done"
            )
        return {channel.name: channel.observation(self._step, self._strip) for channel in self._channels}

    def _take_readings(self) -> None:
        physics = self._started()
        for channel in self._channels:
            if channel.next_reading == self._step:
                channel.take(physics, self._step)

    def _started(self) -> Physics:
        if self._physics is None:
            raise PhysicsError("call reset(physics, random_state) before the first observation")
        return self._physics
