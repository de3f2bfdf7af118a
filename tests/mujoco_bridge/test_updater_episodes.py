"""The updater over an episode: hooks, exceptions on the way, observations between control steps, specifications."""

from __future__ import annotations

from typing import Any, cast

import mujoco
import numpy as np
import pytest

from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.mujoco_bridge import Arena, Cradle, Entity, JacoArm, Physics
from jacokin.mujoco_bridge.distributions import Uniform
from jacokin.mujoco_bridge.observables import ArraySpec, Observable
from jacokin.mujoco_bridge.updater import Updater, observables_of
from tests.mujoco_bridge.scenes import Scene

CONTROL_STEPS = 20


class Interrupted:
    """A corruptor, or a hook, that raises at its n-th call."""

    def __init__(self, error: type[BaseException], call: int) -> None:
        self.error = error
        self.left = call

    def __call__(self, value: Any, random_state: Any = None) -> Any:
        self.left -= 1
        if self.left == 0:
            raise self.error
        return value


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
@pytest.mark.parametrize("call", [2, 3, 4])
def test_an_exception_in_a_corruptor_delays_the_observation_and_changes_nothing(
    jaco: Scene, error: type[BaseException], call: int
) -> None:
    arm = jaco.arm.observables
    twin = jaco.physics.copy()
    for each in (arm.joints_pos, arm.joints_vel):
        each.configure(buffer_size=3, delay=4, update_interval=7)
    updaters = []
    for physics in (jaco.physics, twin):
        updater = Updater(observables_of(jaco.arena), CONTROL_STEPS)
        physics.data.ctrl[:] = 0.1
        updaters.append(updater)
    arm.joints_vel.corruptor = Interrupted(error, call)
    updaters[0].reset(jaco.physics, np.random.default_rng(0))
    failures = 0
    observations: list[dict[str, Any]] = []
    while len(observations) < 3:
        try:
            observations.append(updaters[0].advance())
        except (ValueError, KeyboardInterrupt):
            failures += 1
    assert failures == 1
    arm.joints_vel.corruptor = None
    updaters[1].reset(twin, np.random.default_rng(0))
    for observation in observations:
        for name, expected in updaters[1].advance().items():
            np.testing.assert_array_equal(observation[name], expected, err_msg=name)
    assert jaco.physics.time == twin.time == pytest.approx(3 * CONTROL_STEPS * 0.002)


def test_an_interrupt_right_after_the_physics_step_is_counted(jaco: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    updater = Updater(observables_of(jaco.arena), CONTROL_STEPS)
    updater.reset(jaco.physics)
    step = jaco.physics.step

    def interrupted(n: int = 1) -> None:
        step(n)
        raise KeyboardInterrupt

    monkeypatch.setattr(jaco.physics, "step", interrupted)
    with pytest.raises(KeyboardInterrupt):
        updater.advance()
    monkeypatch.undo()
    updater.advance()
    assert jaco.physics.time == pytest.approx(CONTROL_STEPS * 0.002)
    updater.advance()
    assert jaco.physics.time == pytest.approx(2 * CONTROL_STEPS * 0.002)


def test_observations_between_control_steps_are_of_that_moment(jaco: Scene) -> None:
    updater = Updater(observables_of(jaco.arena), CONTROL_STEPS, strip_singleton_buffer_dim=True)
    updater.reset(jaco.physics)
    jaco.physics.data.ctrl[:] = 0.3
    for step in range(1, 2 * CONTROL_STEPS + 1):
        jaco.physics.step()
        updater.update()
        if step % 7 == 0 or step % CONTROL_STEPS == 0:
            for name, value in updater.get_observation().items():
                observable = observables_of(jaco.arena)[name]
                np.testing.assert_array_equal(value, observable(jaco.physics), err_msg=f"{name} at {step}")


def test_reading_between_control_steps_does_not_change_the_observation_at_their_end(jaco: Scene) -> None:
    jaco.arm.observables.joints_pos.configure(buffer_size=3, delay=2, update_interval=3)
    twin = jaco.physics.copy()
    updaters = []
    for physics in (jaco.physics, twin):
        updaters.append(Updater(observables_of(jaco.arena), CONTROL_STEPS))
        updaters[-1].reset(physics)
        physics.data.ctrl[:] = 0.3
    for step in range(1, 3 * CONTROL_STEPS + 1):
        for physics, updater in zip((jaco.physics, twin), updaters, strict=True):
            physics.step()
            updater.update()
        updaters[0].get_observation()
        if step % CONTROL_STEPS == 0:
            first, second = (updater.get_observation() for updater in updaters)
            for name, value in first.items():
                np.testing.assert_array_equal(value, second[name], err_msg=name)


class Recording(Entity):
    """An entity that writes down when it is called."""

    def _build(self) -> None:
        self._mjcf_root = mujoco.MjSpec()
        self.calls: list[tuple[str, float]] = []
        self.states: set[int] = set()

    def _note(self, name: str, physics: Physics, random_state: Any) -> None:
        self.calls.append((name, round(float(physics.time) / 0.002)))
        self.states.add(id(random_state))

    def initialize_episode(self, physics: Physics, random_state: Any) -> None:
        self._note("initialize_episode", physics, random_state)

    def before_step(self, physics: Physics, random_state: Any) -> None:
        self._note("before_step", physics, random_state)

    def after_substep(self, physics: Physics, random_state: Any) -> None:
        self._note("after_substep", physics, random_state)

    def after_step(self, physics: Physics, random_state: Any) -> None:
        self._note("after_step", physics, random_state)


def test_hooks_are_called_in_the_order_of_an_episode(jaco: Scene) -> None:
    recording, root = Recording(), Arena()
    root.attach(Cradle())  # overrides no hook
    root.attach(recording)
    updater = Updater(observables_of(jaco.arena), 3, entity=root)
    random_state = np.random.default_rng(0)
    for _ in range(2):
        jaco.physics.reset()
        jaco.arm.set_home(jaco.physics)
        updater.reset(jaco.physics, random_state)
        updater.advance()
        updater.advance()
    expected = [("initialize_episode", 0)]
    for start in (0, 3):
        expected += [
            ("before_step", start),
            *(("after_substep", start + n) for n in (1, 2, 3)),
            ("after_step", start + 3),
        ]
    assert recording.calls == 2 * expected
    assert recording.states == {id(random_state)}


def test_hooks_of_entities_act_on_the_simulation_before_it_is_observed() -> None:
    class Locked(JacoArm):
        """An arm whose last joint is set back after each control step."""

        def after_step(self, physics: Physics, random_state: Any) -> None:
            physics.bind(self.joints[5]).qpos = 1.0

        def before_substep(self, physics: Physics, random_state: Any) -> None:
            physics.bind(self.actuators[5]).ctrl = 0.5

    arm, arena = Locked(observable_options={"joints_pos": {"enabled": True}}), Arena()
    arena.attach(arm)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    plain = Updater(observables_of(arena), CONTROL_STEPS, strip_singleton_buffer_dim=True)
    hooked = Updater(observables_of(arena), CONTROL_STEPS, strip_singleton_buffer_dim=True, entity=arena)
    plain.reset(physics)
    assert plain.advance()["jaco_arm/joints_pos"][5, 0] != pytest.approx(np.sin(1.0), abs=1e-3)
    hooked.reset(physics)
    assert hooked.advance()["jaco_arm/joints_pos"][5, 0] == np.sin(1.0)
    assert physics.bind(arm.joints[5]).qvel[0] > 0.05


def test_a_hook_that_raises_does_not_lose_steps(jaco: Scene) -> None:
    class Failing(Entity):
        interrupted = Interrupted(KeyboardInterrupt, 7)

        def _build(self) -> None:
            self._mjcf_root = mujoco.MjSpec()

        def after_substep(self, physics: Physics, random_state: Any) -> None:
            self.interrupted(None)

    updater = Updater(observables_of(jaco.arena), 5, entity=Failing())
    updater.reset(jaco.physics)
    updater.advance()
    with pytest.raises(KeyboardInterrupt):
        updater.advance()
    updater.advance()
    assert jaco.physics.time == pytest.approx(10 * 0.002)


def test_specifications(jaco: Scene) -> None:
    bounded = ArraySpec((2,), minimum=-1.0, maximum=1.0)
    arm = jaco.arm.observables
    arm.add_observable("pair", Observable(lambda physics: [0.5, 0.25], array_spec=bounded, buffer_size=4))
    arm.add_observable("mean", Observable(lambda physics: [0.5, 0.25], array_spec=bounded, aggregator="mean"))
    arm.add_observable("sum", Observable(lambda physics: [0.5, 0.25], array_spec=bounded, aggregator="sum"))
    noisy = Observable(lambda physics: [0.5, 0.25], array_spec=bounded, corruptor=lambda x, random_state: x + 1)
    arm.add_observable("noisy", noisy)
    arm.add_observable("count", Observable(lambda physics: np.int32(3)))
    arm.joints_torque.enabled = False
    for strip in (False, True):
        updater = Updater(observables_of(jaco.arena), CONTROL_STEPS, strip_singleton_buffer_dim=strip)
        with pytest.raises(PhysicsError, match="reset"):
            updater.observation_spec()
        updater.reset(jaco.physics)
        specs, observation = updater.observation_spec(), updater.advance()
        assert list(specs) == list(observation)
        assert "jaco_arm/joints_torque" not in specs
        for name, spec in specs.items():
            assert spec.name == name
            assert (spec.shape, spec.dtype) == (observation[name].shape, observation[name].dtype)
        bounds = {name.split("/")[-1]: (spec.minimum, spec.maximum) for name, spec in specs.items() if spec.is_bounded}
        assert bounds == {"pair": (-1.0, 1.0), "mean": (-1.0, 1.0)}
        assert specs["jaco_arm/pair"].shape == (4, 2)
        assert specs["jaco_arm/count"].dtype == np.int32


def test_wrong_specifications_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="array_spec must be an ArraySpec"):
        Observable(lambda physics: 0.0, array_spec=cast(Any, (3,)))
    wrongs: list[Any] = [lambda: ArraySpec(cast(Any, "three")), lambda: ArraySpec((3,), cast(Any, "metres"))]
    for wrong in wrongs:
        with pytest.raises(InvalidInputError, match="shape must be"):
            wrong()
    with pytest.raises(InvalidInputError, match="entity must be an Entity"):
        Updater({}, entity=cast(Any, 3))


def test_samplers_of_intervals_and_delays_take_the_arguments_of_a_sampler() -> None:
    drawn: list[Any] = []

    def three(initial_value: Any, current_value: Any, random_state: Any) -> int:
        drawn.append(random_state)
        return int(random_state.integers(1, 4))

    rng = np.random.default_rng(0)
    accepted: list[Any] = [
        three,
        lambda random_state: 2,
        lambda rng: 2,
        lambda a, b, c: 2,
        lambda **arguments: 2,
        lambda initial_value=None, current_value=None, random_state=None: 2,
    ]
    for delay in accepted:
        updater = Updater({"n": Observable(lambda physics: 0.0, update_interval=delay, delay=delay, enabled=True)}, 5)
        updater.reset(cast(Any, FakePhysics()), rng)
        updater.advance()
    assert drawn
    assert all(each is rng for each in drawn)
    refused: list[Any] = [lambda: 3, lambda a, b: 3, lambda *, step: 3, max]
    for interval in refused:
        with pytest.raises(InvalidInputError, match=r"update_interval.*(random_state|lambda)"):
            Observable(lambda physics: 0.0, update_interval=interval)
    updater = Updater({"n": Observable(lambda physics: 0.0, delay=Uniform(0.2, 0.9), enabled=True)}, 5)
    with pytest.raises(InvalidInputError, match="delay drawn for 'n' must be a whole number"):
        updater.reset(cast(Any, FakePhysics()), rng)


class FakePhysics:
    """Counts time."""

    timestep = 0.002
    time = 0.0

    def step(self, n: int = 1) -> None:
        self.time += n * self.timestep
