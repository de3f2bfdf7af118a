"""`Updater`: observations at control rate, each with its update interval, delay, buffer and aggregator.

A control step is a fixed number of physics steps. Each enabled observable is read every ``update_interval`` physics
steps; a reading passes through the corruptor, arrives ``delay`` physics steps later, and replaces the oldest of
``buffer_size`` readings. An observation is the buffer, oldest reading first, or the aggregator's value of it.
"""

from __future__ import annotations

from bisect import insort
from collections import deque
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, PhysicsError, shown
from jacokin.model import checks
from jacokin.mujoco_bridge.distributions import RandomState, sampler
from jacokin.mujoco_bridge.entity import HOOKS, Entity
from jacokin.mujoco_bridge.observables import AGGREGATORS, ArraySpec, Observable, Steps
from jacokin.mujoco_bridge.simulation.physics import Physics

# Aggregators whose value lies between the least and the greatest reading.
_KEEP_BOUNDS = tuple(AGGREGATORS[name] for name in ("min", "max", "mean", "median"))


class Channel:
    """One enabled observable: its pending readings and its buffer.

    Attributes:
        name: of the observation.
        next_reading: the physics step at which the observable is read next.
    """

    def __init__(self, name: str, observable: Observable, control_steps: int, random_state: RandomState | None) -> None:
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
        entity: Entity | None = None,
    ) -> None:
        """Report those of the observables that are enabled at ``reset``.

        Args:
            observables: by name, as ``observables_of(arena)`` returns them.
            physics_steps_per_control_step: physics steps between two observations.
            strip_singleton_buffer_dim: leave out the first axis where buffer_size is 1.
            pad_with_initial_value: fill the buffers at the start with the first reading instead
                of zeros.
            entity: the root of the scene, such as an arena: ``reset`` and ``advance`` then call the hooks of all its
                entities (``initialize_episode``, ``before_step``, ``before_substep``, ``after_substep``,
                ``after_step``). None calls none.

        Raises:
            InvalidInputError: an argument has a wrong type or value.
        """
        observables = checks.mapping("observables", observables, "a dict by name")
        for name, observable in observables.items():
            checks.instance(f"observables[{name!r}]", observable, Observable, "an Observable")
        if not isinstance(entity, Entity | None):
            raise InvalidInputError(f"entity must be an Entity such as an Arena, got {shown(entity)}")
        self._observables = dict(observables)
        self._control_steps = checks.whole_number("physics_steps_per_control_step", physics_steps_per_control_step, 1)
        self._strip = checks.flag("strip_singleton_buffer_dim", strip_singleton_buffer_dim)
        self._pad = checks.flag("pad_with_initial_value", pad_with_initial_value)
        self._entity = entity
        self._hooks: dict[str, list[Entity]] = {}
        self._step = 0
        self._end: int | None = None  # of the control step in progress
        self._physics: Physics | None = None
        self._random_state: RandomState | None = None
        self._channels: list[Channel] = []

    def reset(self, physics: Physics, random_state: RandomState | None = None) -> None:
        """Start an episode at the present state of the physics: empty buffers, first readings.

        Args:
            physics: the simulation to read.
            random_state: passed to hooks, to corruptors, and to drawn intervals and delays.
        """
        hooks = {} if self._entity is None else _overridden(self._entity)
        for entity in hooks.get("initialize_episode", ()):
            entity.initialize_episode(physics, random_state)
        channels = [
            Channel(name, observable, self._control_steps, random_state)
            for name, observable in self._observables.items()
            if observable.enabled
        ]
        for channel in channels:
            channel.start(physics, self._pad)
        self._physics, self._random_state, self._channels, self._hooks = physics, random_state, channels, hooks
        self._step, self._end = 0, None

    def observation_spec(self) -> dict[str, ArraySpec]:
        """Name, shape, type and bounds of each observation.

        Bounds are those of the observable's ``array_spec``, unless a corruptor or an aggregator may leave them.

        Raises:
            PhysicsError: ``reset`` was not called.
        """
        self._started()
        return {channel.name: channel.spec(self._strip) for channel in self._channels}

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

        If an exception ends it early, as one of a corruptor or Ctrl-C, the next call finishes the same control step.

        Raises:
            PhysicsError: ``reset`` was not called, or the simulation diverged.
        """
        physics = self._started()
        if self._end is None:
            self._end = self._step - self._step % self._control_steps + self._control_steps
            self._call("before_step")
        end = self._end
        self._take_readings()  # those that an exception prevented
        each_step = "before_substep" in self._hooks or "after_substep" in self._hooks
        while self._step < end:
            step = self._step + 1 if each_step else min([end, *(channel.next_reading for channel in self._channels)])
            self._call("before_substep")
            self._simulate(physics, step - self._step)
            self._call("after_substep")
            if step < end:
                self._take_readings()
        self._call("after_step")
        self._take_readings()
        self._end = None
        return self.get_observation()

    def get_observation(self) -> dict[str, NDArray[Any]]:
        """Return the observation at this moment, as new arrays.

        In the middle of a control step, buffers of several readings, and delayed ones, may lack readings that the
        observation at its end does not contain.

        Returns:
            For each enabled observable its buffer (buffer_size, ...), or the aggregator's value of the
            buffer.

        Raises:
            PhysicsError: ``reset`` was not called.
        """
        physics = self._started()
        if self._step % self._control_steps:
            for channel in self._channels:
                channel.take_if_skipped(physics, self._step)
        return {channel.name: channel.observation(self._step, self._strip) for channel in self._channels}

    def _simulate(self, physics: Physics, steps: int) -> None:
        """Step the physics, and count the steps even if an interrupt comes between the two."""
        before = float(physics.time)
        try:
            physics.step(steps)
        finally:
            self._step += min(steps, round((float(physics.time) - before) / float(physics.timestep)))

    def _take_readings(self) -> None:
        physics = self._started()
        for channel in self._channels:
            if channel.next_reading <= self._step:
                channel.take(physics, self._step)

    def _call(self, hook: str) -> None:
        for entity in self._hooks.get(hook, ()):
            getattr(entity, hook)(self._physics, self._random_state)

    def _started(self) -> Physics:
        if self._physics is None:
            raise PhysicsError("call reset(physics, random_state) before the first observation")
        return self._physics


def observables_of(root: Entity) -> dict[str, Observable]:
    """The observables of an entity and of all entities attached to it, by full name.

    They are in the order of dm_control: entity by entity as they are attached, the arm before its hand; of each entity
    those that its class declares by name, then those that were added. Observables of a task come before them:
    ``{**own, **observables_of(arena)}``.

    Raises:
        InvalidInputError: root is not an entity.
    """
    if not isinstance(root, Entity):
        raise InvalidInputError(f"root must be an Entity such as an Arena, got {shown(root)}")
    found: dict[str, Observable] = {}
    for entity in root.iter_entities():
        found.update(entity.observables.as_dict())
    return found


def _overridden(root: Entity) -> dict[str, list[Entity]]:
    """For each hook the entities that override it, in the order of the tree."""
    found: dict[str, list[Entity]] = {}
    for entity in root.iter_entities():
        for hook in HOOKS:
            if getattr(type(entity), hook) is not getattr(Entity, hook):
                found.setdefault(hook, []).append(entity)
    return found
