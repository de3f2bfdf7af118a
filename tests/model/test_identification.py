"""Payload and friction from logs whose truth is known."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import PayloadEstimate, identify_payload

MASS, COM = 1.2, np.array([0.03, -0.02, 0.08])  # [kg], [m] in the gripsite
INERTIA = np.array([[4e-3, 2e-4, 1e-4], [2e-4, 5e-3, -3e-4], [1e-4, -3e-4, 6e-3]])  # [kg m^2]
VISCOUS, COULOMB = np.linspace(0.1, 0.6, 6), np.linspace(1.0, 0.5, 6)  # [N m s/rad], [N m]
Log = tuple[Array, Array, Array]


def motion(robot: Robot, n: int = 300) -> Log:
    """Angles, velocities and accelerations (n, 6) of a motion that turns every joint."""
    rng = np.random.default_rng(5)
    t = np.linspace(0.0, 10.0, n)[:, np.newaxis]
    size, rate, shift = (rng.uniform(low, high, (3, 1, 6)) for low, high in ((0.2, 0.6), (0.5, 3.0), (0.0, 6.0)))
    phase = rate * t + shift
    q = robot.home + (size * np.sin(phase)).sum(axis=0)
    return q, (size * rate * np.cos(phase)).sum(axis=0), -(size * rate**2 * np.sin(phase)).sum(axis=0)


def torques(robot: Robot, log: Log) -> Array:
    return np.array([robot.inverse_dynamics(*row) for row in zip(*log, strict=True)])


def test_without_noise_the_truth_is_found(robot: Robot) -> None:
    log = motion(robot)
    torque = torques(robot.with_payload(MASS, COM, INERTIA, frame="gripsite"), log)
    torque += VISCOUS * log[1] + COULOMB * np.sign(log[1])
    found = identify_payload(robot, *log, torque, frame="gripsite")
    assert found.mass == pytest.approx(MASS, abs=1e-9)
    for value, truth in (
        (found.com, COM),
        (found.inertia, INERTIA),
        (found.viscous, VISCOUS),
        (found.coulomb, COULOMB),
    ):
        np.testing.assert_allclose(value, truth, atol=1e-9)
    assert (found.unidentified, found.projected) == (0, False)
    assert found.residual < 1e-9


def scores(found: PayloadEstimate) -> Array:
    """Errors over sigmas."""
    return np.concatenate(
        (
            [(found.mass - MASS) / found.mass_sigma],
            (found.com - COM) / found.com_sigma,
            (found.viscous - VISCOUS) / found.viscous_sigma,
            (found.coulomb - COULOMB) / found.coulomb_sigma,
        )
    )


@pytest.mark.parametrize("draws", [6, pytest.param(200, marks=pytest.mark.slow)])
def test_sigmas_are_those_of_many_logs(robot: Robot, draws: int, rng: np.random.Generator) -> None:
    log = motion(robot, 150)
    torque = torques(robot.with_payload(MASS, COM, INERTIA, frame="gripsite"), log)
    torque += VISCOUS * log[1] + COULOMB * np.sign(log[1])
    errors = np.array(
        [
            scores(identify_payload(robot, *log, torque + rng.normal(0.0, 0.01, torque.shape), frame="gripsite"))
            for _ in range(draws)
        ]
    )
    assert np.mean(np.abs(errors) < 1.96) == pytest.approx(0.95, abs=0.04)
    assert np.std(errors) == pytest.approx(1.0, abs=0.15)
    assert np.abs(errors.mean(axis=0)).max() < 4.0 / np.sqrt(draws)


def test_what_noise_finds_is_always_a_body(robot: Robot, rng: np.random.Generator) -> None:
    log = motion(robot, 150)
    torque = torques(robot.with_payload(0.05, [0.0, 0.0, 0.02]), log) + rng.normal(0.0, 0.3, log[0].shape)
    found = identify_payload(robot, *log, torque)
    assert found.projected
    assert found.mass == pytest.approx(0.05, abs=4.0 * found.mass_sigma)
    least, middle, most = np.linalg.eigvalsh(found.inertia)
    assert least >= -1e-12
    assert least + middle >= most * (1.0 - 1e-9)
    robot.with_payload(found.mass, found.com, found.inertia)  # takes no other

    def cost(mass: float, com: Array, inertia: Array) -> float:
        friction = found.viscous * log[1] + found.coulomb * np.sign(log[1])
        return float(np.sum((torque - friction - torques(robot.with_payload(mass, com, inertia), log)) ** 2))

    best = cost(found.mass, found.com, found.inertia)
    for _ in range(8):  # other possible bodies near by explain it worse
        stretch = np.eye(3) + rng.normal(0.0, 0.1, (3, 3))
        density = stretch @ (0.5 * np.trace(found.inertia) * np.eye(3) - found.inertia) @ stretch.T
        inertia = np.trace(density) * np.eye(3) - density
        assert cost(found.mass * rng.uniform(0.9, 1.1), found.com + rng.normal(0.0, 5e-3, 3), inertia) >= best - 1e-6


def test_joints_that_do_not_move_are_counted(robot: Robot) -> None:
    q, v, a = motion(robot)
    q[:, 4], v[:, 4], a[:, 4] = robot.home[4], 0.0, 0.0
    found = identify_payload(robot, q, v, a, torques(robot.with_payload(MASS, COM, INERTIA), (q, v, a)))
    assert found.unidentified == 2  # viscous and dry friction of joint 5
    assert found.mass == pytest.approx(MASS, abs=1e-6)


def test_useless_logs_are_refused(robot: Robot) -> None:
    q, v, a = motion(robot)
    torque = torques(robot, (q, v, a))
    with pytest.raises(InvalidInputError, match="same length"):
        identify_payload(robot, q[1:], v, a, torque)
    with pytest.raises(InvalidInputError, match="too short"):
        identify_payload(robot, q[:3], v[:3], a[:3], torque[:3])
    with pytest.raises(InvalidInputError, match="does not move"):
        identify_payload(robot, q, v, a, torque, frame="link_base")
    with pytest.raises(InvalidInputError, match="too large"):
        identify_payload(robot, q, 1e200 * v, a, torque)
    with pytest.raises(InvalidInputError, match="finite"):
        identify_payload(robot, q, v, np.full_like(a, np.nan), torque)
    with pytest.raises(jacokin.JacokinError, match="robot"):
        identify_payload("j2n6s300", q, v, a, torque)  # type: ignore[arg-type]  # wrong on purpose
