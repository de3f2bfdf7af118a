"""Arms that take torques or positions, plain torques, and the examples that use them."""

from __future__ import annotations

from pathlib import Path

import mujoco
import numpy as np
import pytest

import jacokin
from examples.gravity_compensation import PUSHES, Demonstration
from examples.impedance import Impedance, perform
from jacokin import pose
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.mujoco_bridge import Arena, JacoArm, Observable, Physics, command_joint_positions, observations, robots
from tests.programs import run_drawing

REPOSITORY = Path(__file__).parents[2]


def standing(actuation: str) -> tuple[JacoArm, Physics]:
    arm = robots.make_arm(observations.PERFECT_FEATURES, actuation=actuation)
    arena = Arena()
    arena.attach(arm)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    return arm, physics


@pytest.mark.parametrize("actuation", ["velocity", "torque", "position"])
def test_every_kind_keeps_to_the_torques_of_the_table(actuation: str) -> None:
    arm, physics = standing(actuation)
    actuators = physics.bind(arm.actuators)
    assert arm.actuation == actuation
    limit = np.array([30.5, 30.5, 30.5, 6.8, 6.8, 6.8])
    actuators.ctrl = physics.bind(arm.joints).qpos + 50.0
    physics.step()
    force = physics.bind(arm.joints).qfrc_actuator
    assert (np.abs(force) <= limit + 1e-12).all()
    assert np.abs(force).max() > 6.0


def test_a_torque_arm_does_what_newton_says() -> None:
    arm, physics = standing("torque")
    joints = physics.bind(arm.joints)
    joints.frictionloss = 0.0
    asked = np.array([3.0, -5.0, 2.0, 1.0, -1.0, 0.5])
    physics.bind(arm.actuators).ctrl = asked
    physics.forward()
    np.testing.assert_allclose(joints.qfrc_actuator, asked, rtol=0.0, atol=1e-12)
    model, data = physics.model, physics.data
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    expected = np.linalg.solve(mass, asked - data.qfrc_bias + data.qfrc_passive)
    np.testing.assert_allclose(joints.qacc, expected, rtol=0.0, atol=1e-9)


def test_a_position_arm_goes_to_its_angles_and_stays() -> None:
    arm, physics = standing("position")
    joints = physics.bind(arm.joints)
    start = joints.qpos.copy()
    physics.step(200)
    assert np.abs(joints.qpos - start).max() < 5e-3  # set_home asks for home
    goal = start + np.array([0.3, -0.2, 0.2, 0.4, -0.3, 0.5])
    for part in np.linspace(0.0, 1.0, 150):
        physics.bind(arm.actuators).ctrl = start + part * (goal - start)
        physics.step(10)
    physics.step(500)
    assert np.abs(joints.qpos - goal).max() < 5e-3
    assert np.abs(joints.qvel).max() < 1e-3


def test_plain_torques_hold_the_arm_up() -> None:
    """At rest they are those of gravity, by Pinocchio; and they are the logarithmic ones undone."""
    arm = robots.make_arm(observations.PERFECT_FEATURES, actuation="torque")
    arm.attach(robots.make_hand(observations.PERFECT_FEATURES))
    arena = Arena()
    arena.attach(arm)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    joints, robot = physics.bind(arm.joints), jacokin.load_robot()
    for _ in range(1500):
        physics.bind(arm.actuators).ctrl = robot.gravity(joints.qpos) - 20.0 * joints.qvel
        physics.step()
    plain = arm.joint_torques(physics)
    np.testing.assert_allclose(plain, robot.gravity(joints.qpos), rtol=0.0, atol=1e-3)
    logarithmic = arm.observables.joints_torque(physics)
    np.testing.assert_allclose(logarithmic, np.sign(plain) * np.log1p(np.abs(plain)), rtol=0.0, atol=1e-12)
    arm.observables.add_observable("joints_effort", Observable(arm.joint_torques))
    np.testing.assert_array_equal(arm.observables.joints_effort(physics), plain)


def test_other_kinds_are_refused_and_helpers_for_velocities_say_so() -> None:
    with pytest.raises(UnknownNameError, match="unknown actuation 'force'. Valid: velocity, torque, position"):
        robots.make_arm(observations.PERFECT_FEATURES, actuation="force")
    arm, physics = standing("torque")
    with pytest.raises(InvalidInputError, match="must take velocities, this one takes a torque"):
        command_joint_positions(physics, arm, np.zeros(6))


@pytest.mark.parametrize("robot", ["j2s7s300", "m1n6s200"])
def test_every_arm_comes_in_every_kind(robot: str) -> None:
    for actuation in ("torque", "position"):
        arm = robots.make_arm(observations.PERFECT_FEATURES, robot, actuation=actuation)
        physics = Physics.from_entity(arm)
        arm.set_home(physics)
        physics.step(50)
        assert np.isfinite(physics.bind(arm.joints).qpos).all()


def test_an_arm_held_up_by_torques_stays_where_it_is_and_where_it_is_led() -> None:
    show = Demonstration()
    home = show.joints.qpos.copy()
    places = [home]
    for tick, _ in enumerate(show.perform()):
        if tick == 149:
            assert np.abs(show.joints.qpos - home).max() < 2e-3  # nothing pushed it for 1.5 s
        places.append(show.joints.qpos.copy())
    assert np.abs(np.array(places) - home).max() > 0.3
    for _ in range(400):
        show.tick()
    rest = show.joints.qpos.copy()
    for _ in range(200):
        show.tick()
    assert np.abs(show.joints.qpos - rest).max() < 5e-3
    assert len(PUSHES) == 3


def test_a_tool_like_a_spring_gives_way_and_returns() -> None:
    show = Demonstration()
    away = np.array(list(perform(show, Impedance())))
    assert away[:45].max() < 2e-3
    force = np.linalg.norm([20.0, 30.0, 0.0])
    # At the end of the push the springs balance it; it acts at the last link, 0.16 m behind the tool.
    assert 0.3 * force / 400.0 < away[240] < 3.0 * force / 400.0
    assert away[-1] < 5e-3


def test_the_springs_pull_no_harder_than_allowed_and_push_back_at_limits() -> None:
    robot, impedance = jacokin.load_robot(), Impedance()
    q, still = robot.home, np.zeros(6)
    far = pose([9.0, 0.0, 0.0], rotation=robot.forward_kinematics(q).rotation)
    pull = impedance.torque(robot, q, still, far) - robot.gravity(q)
    wrench = np.linalg.solve(robot.jacobian(q).T, pull)
    assert np.linalg.norm(wrench[:3]) == pytest.approx(impedance.most[0], rel=1e-6)
    edge = q.copy()
    edge[1] = robot.upper[1] - 0.05
    here = robot.forward_kinematics(edge)
    back = impedance.torque(robot, edge, still, here) - robot.gravity(edge)
    np.testing.assert_allclose(back, [0.0, -0.1 * impedance.limit_stiffness, 0.0, 0.0, 0.0, 0.0], atol=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gravity_compensation", "impedance"])
def test_the_examples_draw(name: str, tmp_path: Path) -> None:
    run_drawing("-m", f"examples.{name}", "--folder", tmp_path, PYTHONPATH=str(REPOSITORY))
    assert (tmp_path / f"{name}.gif").stat().st_size > 10_000
