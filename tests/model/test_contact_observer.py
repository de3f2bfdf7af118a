"""The momentum observer on pushes that MuJoCo simulates, with noise, and against the filter it promises."""

from __future__ import annotations

import functools

import mujoco
import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import ContactObserver, urdf_folder

DT = 0.002  # [s]
TORQUE_NOISE, VELOCITY_NOISE = 0.1, 1e-3  # [N m], [rad/s] standard deviations of each measurement
THRESHOLD = 1.0  # [N m]
PUSH = 20.0  # [N]
PAYLOAD, LEVER = 0.8, np.array([0.0, 0.0, -0.08])  # [kg], [m] on link_6
HOME = np.array([4.8046852, 2.92482, 1.002, 4.2031852, 1.4458, 1.3233])  # [rad]


@functools.cache
def arm() -> Robot:
    robot = jacokin.load_robot(urdf_folder() / "jaco_arm.xml")
    return robot.with_payload(PAYLOAD, LEVER, 1e-3 * np.eye(3), frame="link_6")


class Simulation:
    """The arm with a payload in MuJoCo, follows a smooth motion by torques, and is measured with noise."""

    def __init__(self, rng: np.random.Generator) -> None:
        spec = mujoco.MjSpec.from_file(str(urdf_folder() / "jaco_arm.xml"))
        body = spec.body("link_6").add_body()
        body.mass, body.ipos, body.inertia, body.explicitinertial = PAYLOAD, LEVER, np.full(3, 1e-3), True
        self.model = spec.compile()
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        self.model.opt.timestep = DT
        self.model.dof_damping[:] = 0.0
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = HOME
        self.hand = self.model.body("link_6").id
        self.rng = rng
        self.time = 0.0

    def step(self, push: Array) -> tuple[Array, Array, Array]:
        """Angles, velocities and torques as measured, after a step under a force (3,) [N] at link_6."""
        phase = 0.5 * self.time + np.arange(6)
        wanted = HOME + 0.4 * (np.sin(phase) - np.sin(np.arange(6)))
        v, a = 0.2 * np.cos(phase), -0.1 * np.sin(phase)
        q = self.data.qpos.copy()
        pull = a + 100.0 * (wanted - q) + 20.0 * (v - self.data.qvel)
        torque = arm().inverse_dynamics(q, self.data.qvel, pull)
        self.data.qfrc_applied[:] = torque
        self.data.xfrc_applied[self.hand, :3] = push
        mujoco.mj_step(self.model, self.data)
        self.time += DT
        velocity = self.data.qvel + self.rng.normal(0.0, VELOCITY_NOISE, 6)
        return self.data.qpos.copy(), velocity, torque + self.rng.normal(0.0, TORQUE_NOISE, 6)


def pushes(simulation: Simulation, observer: ContactObserver, number: int) -> list[float]:
    """Time from the start of each push until it is seen [s]; infinite where it is not, within 0.3 s."""
    delays = []
    for _ in range(number):
        direction = simulation.rng.normal(size=3)
        force = PUSH * direction / np.linalg.norm(direction)
        delay = np.inf
        for tick in range(150):
            if observer.step(*simulation.step(force), DT).contact:
                delay = min(delay, (tick + 1) * DT)
        for _ in range(350):
            observer.step(*simulation.step(np.zeros(3)), DT)
        delays.append(delay)
    return delays


@pytest.mark.parametrize(("number", "quiet"), [(10, 5.0), pytest.param(40, 50.0, marks=pytest.mark.slow)])
def test_pushes_are_seen_soon_and_nothing_else_is(number: int, quiet: float, rng: np.random.Generator) -> None:
    """The figures of docs/dynamics.md are of 200 pushes and 300 s."""
    simulation, observer = Simulation(rng), ContactObserver(arm(), THRESHOLD)
    alarms = sum(observer.step(*simulation.step(np.zeros(3)), DT).contact for _ in range(int(quiet / DT)))
    assert alarms == 0
    delays = pushes(simulation, observer, number)
    assert np.median(delays) <= 0.02
    assert np.percentile(delays, 95) <= 0.06
    assert max(delays) <= 0.3  # pushes that nearly pass through the joints' axes


def test_a_steady_push_shows_as_a_first_order_filter_says(robot: Robot) -> None:
    q, zero = robot.home, np.zeros(6)
    wrench = np.array([5.0, -3.0, 4.0, 0.0, 0.2, 0.1])
    observer = ContactObserver(robot, 0.5, bandwidth=20.0)
    assert not observer.step(q, zero, robot.gravity(q), 0.01).contact
    torque = robot.inverse_dynamics(q, zero, zero, external=wrench)
    external = robot.jacobian(q).T @ wrench
    for dt in (0.01, 0.002, 0.03):  # late and early
        seen = observer.step(q, zero, torque, dt)
    np.testing.assert_allclose(seen.external_torque, external * (1.0 - np.exp(-20.0 * 0.042)), atol=1e-12)
    beyond = np.abs(seen.external_torque) > 0.5
    assert seen.joints == tuple(name for name, over in zip(robot.joint_names, beyond, strict=True) if over)
    assert seen.contact
    observer.reset()
    assert not observer.step(q, zero, torque, 0.01).contact


def test_a_tilted_base_is_no_push(robot: Robot) -> None:
    base = jacokin.pose([0, 0, 1], rpy=[0.5, 1.0, 0.0])
    q, zero = robot.home, np.zeros(6)
    observer = ContactObserver(robot, 1e-6, base=base)
    for _ in range(5):
        seen = observer.step(q, zero, robot.gravity(q, base=base), 0.1)
    assert not seen.contact


def test_a_refused_measurement_changes_nothing(robot: Robot) -> None:
    q, zero = robot.home, np.zeros(6)
    observers = [ContactObserver(robot, 1.0) for _ in range(2)]
    for observer in observers:
        observer.step(q, zero, zero, 0.01)
    for bad in ((q, [np.nan] * 6, zero, 0.01), (q, zero, zero, 0.0), (q, zero, zero, -1.0), (q[:5], zero, zero, 0.01)):
        with pytest.raises(InvalidInputError):
            observers[0].step(*bad)
    first, second = (observer.step(q, zero, zero, 0.01) for observer in observers)
    np.testing.assert_array_equal(first.external_torque, second.external_torque)
    with pytest.raises(InvalidInputError, match="threshold"):
        ContactObserver(robot, 0.0)
    with pytest.raises(InvalidInputError, match="robot"):
        ContactObserver("j2n6s300", 1.0)  # type: ignore[arg-type]  # wrong on purpose
