"""The updater against a plain statement of what an observation is, on a counting physics."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.mujoco_bridge.observables import Aggregator, Observable
from jacokin.mujoco_bridge.updater import Updater

if TYPE_CHECKING:
    from jacokin.mujoco_bridge.simulation.physics import Physics


class CountingPhysics:
    """Counts the physics steps and how often it was read."""

    def __init__(self) -> None:
        self.steps = 0
        self.calls = 0
        self.timestep = 0.002  # [s]

    @property
    def time(self) -> float:
        return self.steps * self.timestep

    def step(self, n: int = 1) -> None:
        self.steps += n
        self.calls += 1


def counting() -> Physics:
    return cast("Physics", CountingPhysics())


def steps_taken(physics: Any) -> list[float]:
    return [physics.steps, -physics.steps]


def expected(
    step: int, *, interval: int, delay: int, size: int, pad: bool, value: Callable[[int], NDArray[Any]]
) -> NDArray[Any]:
    """The last readings of steps k interval that are at least delay old, oldest first."""
    newest = (step - delay) // interval * interval
    wanted = [newest - k * interval for k in reversed(range(size))]
    padding = value(0) if pad else np.zeros_like(value(0))
    return np.array([value(at) if at >= 0 else padding for at in wanted])


@settings(deadline=None, max_examples=150)
@given(
    interval=st.integers(1, 9),
    delay=st.integers(0, 12),
    size=st.integers(1, 5),
    control=st.integers(1, 8),
    pad=st.booleans(),
    single_steps=st.booleans(),
)
def test_observation_is_the_last_readings_old_enough(
    interval: int, delay: int, size: int, control: int, pad: bool, single_steps: bool
) -> None:
    physics = counting()
    observable = Observable(steps_taken, update_interval=interval, delay=delay, buffer_size=size, enabled=True)
    updater = Updater({"n": observable}, control, pad_with_initial_value=pad)
    updater.reset(physics)
    for control_step in range(1, 12):
        if single_steps:
            updater.prepare_for_next_control_step()
            for _ in range(control):
                physics.step()
                updater.update()
            observation = updater.get_observation()
        else:
            observation = updater.advance()
        np.testing.assert_array_equal(
            observation["n"],
            expected(
                control_step * control,
                interval=interval,
                delay=delay,
                size=size,
                pad=pad,
                value=lambda n: np.array([n, -n]),
            ),
        )


def test_drawn_intervals_and_delays_order_the_buffer_by_arrival() -> None:
    intervals, delays = itertools.cycle([3, 2, 3, 3, 4, 1, 4]), itertools.cycle([3, 5, 2, 5, 1, 2, 4])
    observable = Observable(
        lambda physics: physics.steps,
        buffer_size=3,
        update_interval=lambda random_state: next(intervals),  # readings at 20 n + 0, 3, 5, 8, 11, 15, 16
        delay=lambda random_state: next(delays),  # arriving at 20 n + 3, 8, 7, 13, 12, 17, 20
        enabled=True,
    )
    updater = Updater({"n": observable}, 10)
    updater.reset(counting())
    for cycle in range(5):
        np.testing.assert_array_equal(updater.advance()["n"], 20 * cycle + np.array([0, 5, 3]))
        np.testing.assert_array_equal(updater.advance()["n"], 20 * cycle + np.array([8, 15, 16]))


def test_drawn_options_get_the_random_state_and_are_checked() -> None:
    rng = np.random.default_rng(0)
    seen: list[object] = []

    def draw(random_state: object) -> int:
        seen.append(random_state)
        return -1

    updater = Updater({"n": Observable(steps_taken, delay=draw, enabled=True)})
    with pytest.raises(InvalidInputError, match="delay drawn for 'n' must be a whole number >= 0"):
        updater.reset(counting(), rng)
    assert seen == [rng]
    updater = Updater({"n": Observable(steps_taken, update_interval=lambda random_state: 0, enabled=True)})
    with pytest.raises(InvalidInputError, match="update_interval drawn"):
        updater.reset(counting(), rng)


def test_only_readings_that_will_be_seen_are_taken() -> None:
    taken: list[int] = []

    def read(physics: Any) -> int:
        taken.append(physics.steps)
        return cast(int, physics.steps)

    physics = counting()
    updater = Updater({"n": Observable(read, enabled=True, buffer_size=2)}, 20)
    updater.reset(physics)
    updater.advance()
    updater.advance()
    assert taken == [0, 19, 20, 39, 40]
    assert cast(Any, physics).calls == 4  # the physics is stepped in blocks


def test_corruptor_comes_before_the_buffer_and_aggregator_after_it() -> None:
    random_states: list[object] = []

    def corrupt(value: NDArray[Any], random_state: object) -> NDArray[Any]:
        random_states.append(random_state)
        return 10.0 * value**2

    rng = np.random.RandomState(1)
    aggregators: dict[str, str | Aggregator] = {
        "min": "min",
        "max": "max",
        "mean": "mean",
        "median": "median",
        "sum": "sum",
        "spread": lambda buffer: np.ptp(buffer, axis=0),
    }
    updater = Updater(
        {
            name: Observable(steps_taken, aggregator=aggregator, buffer_size=3, corruptor=corrupt, enabled=True)
            for name, aggregator in aggregators.items()
        },
        5,
    )
    updater.reset(counting(), rng)
    observation = updater.advance()  # readings 3, 4, 5
    for name, value in {
        "min": 90,
        "max": 250,
        "mean": 500 / 3,
        "median": 160,
        "sum": 500,
        "spread": 160,
    }.items():
        np.testing.assert_allclose(observation[name], [value, value], rtol=1e-15, atol=0.0)
    assert set(map(id, random_states)) == {id(rng)}


@pytest.mark.parametrize("strip", [True, False])
def test_leading_axis(strip: bool) -> None:
    updater = Updater(
        {
            "one": Observable(steps_taken, enabled=True),
            "scalar": Observable(lambda physics: float(physics.steps), enabled=True),
            "two": Observable(steps_taken, buffer_size=2, enabled=True),
            "sum": Observable(steps_taken, buffer_size=1, aggregator="sum", enabled=True),
            "off": Observable(steps_taken),
        },
        2,
        strip_singleton_buffer_dim=strip,
    )
    updater.reset(counting())
    observation = updater.advance()
    shapes = {name: value.shape for name, value in observation.items()}
    # An aggregator always reduces the buffer, never the quantity itself.
    assert shapes == {
        "one": (2,) if strip else (1, 2),
        "scalar": () if strip else (1,),
        "two": (2, 2),
        "sum": (2,),
    }
    np.testing.assert_array_equal(observation["sum"], [2, -2])


def test_padding_keeps_the_type_and_observations_are_copies() -> None:
    picture = np.full((2, 3), 200, dtype=np.uint8)
    updater = Updater({"n": Observable(lambda physics: picture, buffer_size=2, enabled=True)})
    updater.reset(counting())
    first = updater.get_observation()["n"]
    assert first.dtype == np.uint8
    np.testing.assert_array_equal(first[:, 0, 0], [0, 200])
    first[:] = 7
    picture[:] = 9
    np.testing.assert_array_equal(updater.get_observation()["n"][:, 0, 0], [0, 200])


def test_reset_starts_anew_with_what_is_enabled_then() -> None:
    physics = counting()
    observable = Observable(steps_taken, buffer_size=2, enabled=True)
    late = Observable(steps_taken)
    updater = Updater({"n": observable, "late": late}, 3)
    updater.reset(physics)
    assert list(updater.advance()) == ["n"]
    late.enabled = True
    assert list(updater.advance()) == ["n"]
    cast(Any, physics).steps = 100
    updater.reset(physics)
    assert list(updater.get_observation()) == ["n", "late"]
    np.testing.assert_array_equal(updater.get_observation()["n"], [[0, 0], [100, -100]])


def test_wrong_use_is_refused() -> None:
    updater = Updater({"n": Observable(steps_taken, enabled=True)}, 4)
    for method in (updater.update, updater.advance, updater.get_observation):
        with pytest.raises(PhysicsError, match="reset"):
            method()
    physics = counting()
    updater.reset(physics)
    with pytest.raises(PhysicsError, match="reset"):
        Updater({}).observation_spec()
    with pytest.raises(InvalidInputError, match="physics_steps_per_control_step"):
        Updater({}, 0)
    with pytest.raises(InvalidInputError, match="must be a dict"):
        Updater(cast(Any, [Observable(steps_taken)]))
    with pytest.raises(InvalidInputError, match=r"observables\['n'\]"):
        Updater(cast(Any, {"n": steps_taken}))


def test_a_quantity_that_changes_its_shape_is_refused() -> None:
    updater = Updater({"n": Observable(lambda physics: np.zeros(physics.steps), enabled=True)})
    updater.reset(counting())
    with pytest.raises(InvalidInputError, match="'n' changed its shape from"):
        updater.advance()


def test_a_failing_reading_at_reset_leaves_the_updater_as_it_was() -> None:
    physics = counting()
    updater = Updater({"n": Observable(lambda p: 1.0 / (p.steps - 8), enabled=True)}, 4)
    updater.reset(physics)
    before = updater.advance()
    cast(Any, physics).steps = 8
    with pytest.raises(ZeroDivisionError):
        updater.reset(physics)
    np.testing.assert_array_equal(updater.get_observation()["n"], before["n"])
