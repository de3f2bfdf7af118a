"""Payload and friction from logs whose truth is known."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import PayloadEstimate, identify_arm, identify_payload
from jacokin.model.dynamics import BODY, pseudo_inertia

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


@pytest.mark.parametrize("draws", [6, pytest.param(80, marks=pytest.mark.slow)])
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


def parameters(robot: Robot) -> Array:
    """(dof, 10) of what each joint moves."""
    return np.array([body.toDynamicParameters() for body in list(robot.pin_model.inertias)[1:]])


def other_arm(robot: Robot, rng: np.random.Generator) -> Robot:
    """An arm whose masses are off by a fifth, its centres of mass by a centimetre, its inertias by a tenth."""
    rows = []
    for body in list(robot.pin_model.inertias)[1:]:
        factor, stretch = np.exp(rng.normal(0.0, 0.2)), np.diag(np.exp(rng.normal(0.0, 0.1, 3)))
        density = factor * stretch @ (0.5 * np.trace(body.inertia) * np.eye(3) - body.inertia) @ stretch
        inertia = np.trace(density) * np.eye(3) - density
        moved = pin.Inertia(factor * body.mass, body.lever + rng.normal(0.0, 0.01, 3), inertia)
        rows.append(moved.toDynamicParameters())
    return robot.with_bodies(rows)


def rubbing(robot: Robot, log: Log) -> Array:
    return torques(robot, log) + VISCOUS * log[1] + COULOMB * np.sign(log[1])


def test_without_noise_the_torques_of_any_motion_are_found(robot: Robot, rng: np.random.Generator) -> None:
    arm, log = other_arm(robot, rng), motion(robot)
    found = identify_arm(robot, *log, rubbing(arm, log))
    assert len(found.values) == 36  # base parameters of six turning joints, the first of which is vertical
    assert found.unidentified == 24
    assert found.residual < 1e-6
    np.testing.assert_allclose(found.viscous, VISCOUS, atol=1e-6)
    np.testing.assert_allclose(found.coulomb, COULOMB, atol=1e-6)
    for _ in range(20):
        q, v, a = robot.sample(rng), rng.normal(size=6), rng.normal(size=6)
        truth = arm.inverse_dynamics(q, v, a)
        assert np.abs(robot.inverse_dynamics(q, v, a) - truth).max() > 1e-3
        np.testing.assert_allclose(found.robot.inverse_dynamics(q, v, a), truth, atol=1e-5)


@pytest.mark.parametrize("draws", [5, pytest.param(20, marks=pytest.mark.slow)])
def test_intervals_of_the_base_parameters_hold_the_truth(robot: Robot, draws: int, rng: np.random.Generator) -> None:
    log = motion(robot, 200)
    scores = list[Array]()
    for _ in range(draws):
        arm = other_arm(robot, rng)
        found = identify_arm(robot, *log, rubbing(arm, log) + rng.normal(0.0, 0.1, log[0].shape))
        values = np.einsum("rij,ij->r", found.combinations, parameters(arm))
        scores.append((found.values - values) / found.values_sigma)
        away = (found.coulomb - COULOMB) / found.coulomb_sigma
        assert np.abs(away).max() < 4.5
    errors = np.concatenate(scores)
    assert np.std(errors) == pytest.approx(1.0, abs=0.15)
    assert np.mean(np.abs(errors) < 1.96) == pytest.approx(0.95, abs=0.04)


def test_an_identified_arm_holds_itself_better_than_the_described_one(robot: Robot, rng: np.random.Generator) -> None:
    arm, log = other_arm(robot, rng), motion(robot, 200)
    found = identify_arm(robot, *log, rubbing(arm, log) + rng.normal(0.0, 0.1, log[0].shape))
    poses = [robot.sample(rng) for _ in range(50)]
    off = [np.std([one.gravity(q) - arm.gravity(q) for q in poses]) for one in (robot, found.robot)]
    assert off[1] < 0.3 * off[0]


def test_what_an_arm_is_made_of_can_exist_and_nothing_possible_explains_the_log_better(
    robot: Robot, rng: np.random.Generator
) -> None:
    arm, log = other_arm(robot, rng), motion(robot, 150)
    torque = rubbing(arm, log) + rng.normal(0.0, 0.3, log[0].shape)
    found = identify_arm(robot, *log, torque, trust=3.0)
    assert found.projected
    assert all(np.linalg.eigvalsh(pseudo_inertia(body))[0] > 0.0 for body in found.parameters)
    described, mass = parameters(robot), parameters(robot)[:, :1]
    scale = 3.0 * mass * np.array([1.0, *[0.1] * 3, *[0.01] * 6])
    unknowns = robot.dof * (BODY + 2)
    spare = torque.size - (unknowns - found.unidentified)
    # Of the log alone, without the constraint: its noise.
    data = robot.pin_model.createData()
    columns = [pin.computeJointTorqueRegressor(robot.pin_model, data, *row).copy() for row in zip(*log, strict=True)]
    friction = [np.hstack((np.diag(v), np.diag(np.sign(v)))) for v in log[1]]
    system = np.hstack((np.vstack(columns), np.vstack(friction)))
    best, *_ = np.linalg.lstsq(system, torque.ravel())
    noise = float(np.sqrt(np.sum((system @ best - torque.ravel()) ** 2) / spare))

    def cost(bodies: Array, rub: Array) -> float:
        missed = system @ np.concatenate((bodies.ravel(), rub)) - torque.ravel()
        return float(missed @ missed / noise**2 + np.sum(((bodies - described) / scale) ** 2))

    rub = np.concatenate((found.viscous, found.coulomb))
    least = cost(found.parameters, rub)
    assert cost(described, rub) > least
    for size in (1e-3, 0.03, 0.3):
        for _ in range(20):
            bodies = found.parameters + size * (parameters(other_arm(robot, rng)) - found.parameters)
            assert cost(bodies, rub + size * rng.normal(0.0, 0.01, 2 * robot.dof)) >= least - 1e-4


def test_joints_that_never_moved_keep_what_is_described(robot: Robot, rng: np.random.Generator) -> None:
    q, v, a = motion(robot)
    q[:, 1:], v[:, 1:], a[:, 1:] = robot.home[1:], 0.0, 0.0  # all but the vertical axis
    torque = torques(other_arm(robot, rng), (q, v, a))
    found = identify_arm(robot, q, v, a, torque)
    assert found.unidentified > 40
    moved = ~np.isclose(found.parameters_sigma, np.abs(parameters(robot)[:, :1]) * [1.0, *[0.1] * 3, *[0.01] * 6])
    assert moved.any()
    np.testing.assert_allclose(found.viscous[1:], 0.0, atol=1e-9)


def test_useless_logs_of_an_arm_are_refused(robot: Robot) -> None:
    q, v, a = motion(robot)
    torque = torques(robot, (q, v, a))
    with pytest.raises(InvalidInputError, match="same length"):
        identify_arm(robot, q[1:], v, a, torque)
    with pytest.raises(InvalidInputError, match="no more numbers than the 72 parameters"):
        identify_arm(robot, q[:12], v[:12], a[:12], torque[:12])
    with pytest.raises(InvalidInputError, match="too large"):
        identify_arm(robot, q, 1e200 * v, a, torque)
    with pytest.raises(InvalidInputError, match="trust must be a positive number"):
        identify_arm(robot, q, v, a, torque, trust=0.0)
    with pytest.raises(jacokin.JacokinError, match="robot"):
        identify_arm("j2n6s300", q, v, a, torque)  # type: ignore[arg-type]  # wrong on purpose


def test_other_bodies_are_checked_and_weigh_what_they_say(robot: Robot) -> None:
    same = robot.with_bodies(parameters(robot))
    np.testing.assert_allclose(same.gravity(robot.home), robot.gravity(robot.home), atol=1e-12)
    heavier = robot.with_bodies(2.0 * parameters(robot))
    np.testing.assert_allclose(heavier.mass_matrix(robot.home), 2.0 * robot.mass_matrix(robot.home), atol=1e-12)
    wrong = parameters(robot)
    wrong[2, 4:] = -wrong[2, 4:]
    with pytest.raises(InvalidInputError, match=r"parameters\[2\] are those of no body"):
        robot.with_bodies(wrong)
    with pytest.raises(InvalidInputError, match=r"parameters must have shape \(6, 10\)"):
        robot.with_bodies(parameters(robot)[:5])
