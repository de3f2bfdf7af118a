"""The law of own answers: a configuration is the answer to its own pose, and a member of its own family."""

from __future__ import annotations

import math

import numpy as np
import pytest

import jacokin
from fuzz import own_answers
from fuzz.findings import Finding
from jacokin import FreeAxis, IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.model.angles import wrap_to_pi

DEGREES = math.pi / 180.0


def distance(robot: Robot, rows: Array, seed: Array) -> Array:
    """From a seed (dof,), circular on unlimited joints [rad]."""
    apart = rows - seed
    return np.asarray(np.linalg.norm(np.where(robot.unlimited, wrap_to_pi(apart), apart), axis=-1))


def solver_of(name: str, **limits: tuple[float, float]) -> IKSolver:
    return IKSolver(jacokin.load_robot(name, limits=limits or None))


@pytest.mark.parametrize("kind", own_answers.CLASSES)
@pytest.mark.parametrize("name", ["j2s7s300", "j2s6s300", "j2n6s300"])
def test_a_configuration_is_its_own_answer(name: str, kind: str, rng: np.random.Generator) -> None:
    solver = solver_of(name)
    robot = solver.robot
    findings: list[Finding] = []
    for _ in range(8 if kind == "multiples of 90 degrees" else 20):
        q = np.clip(own_answers.CLASSES[kind](robot, rng), robot.lower, robot.upper)
        findings.extend(own_answers.check(solver, kind, q, rng))
    # Free axes of arms at right angles are lost in one of some hundreds of cases, see docs/families.md.
    assert [f for f in findings if "90 degrees, FreeAxis" not in f.where] == []


@pytest.mark.parametrize(
    "q",
    [
        (0.0, 90.0, 0.0, 180.0, 180.0, 180.0, 270.0),
        (0.0, 180.0, 0.0, 90.0, 0.0, 180.0, 0.0),
        (-90.0, 90.0, -90.0, 180.0, 90.0, 180.0, 180.0),
        (0.0, 90.0, -180.0, 180.0, -90.0, 180.0, -180.0),
    ],
)
@pytest.mark.parametrize("name", ["j2s7s200", "j2s7s300"])
def test_seven_joints_at_right_angles_have_a_complete_family(name: str, q: tuple[float, ...]) -> None:
    solver = solver_of(name)
    own = np.array(q) * DEGREES
    T = solver.robot.forward_kinematics(own)
    family = solver.solve_all(T, seed=own)
    assert family.complete
    assert np.abs(wrap_to_pi(solver.solve(T, seed=own).q - own)).max() < 1e-6
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-6


def circle_through(family: jacokin.ik.Family, q: Array) -> jacokin.ik.Interval:
    """The interval along which the parameter stands still that a configuration is on."""
    (found,) = [
        interval
        for interval in family
        if interval.start == interval.stop and np.abs(wrap_to_pi(interval.nearest(q) - q)).max() < 1e-9
    ]
    return found


def test_all_members_around_a_straight_wrist_belong_to_one_interval(rng: np.random.Generator) -> None:
    solver = solver_of("j2s7s300")
    robot = solver.robot
    q = robot.sample(rng)
    q[5] = math.pi
    T = robot.forward_kinematics(q)
    circle = circle_through(solver.solve_all(T), q)
    for turn in rng.uniform(-math.pi, math.pi, 20):
        # Axes 5 and 7 are one line: what joint 7 turns forth, joint 5 turns back.
        for sign in (1.0, -1.0):
            moved = q + turn * np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, sign])
            if np.linalg.norm(robot.forward_kinematics(moved).homogeneous - T.homogeneous) < 1e-9:
                break
        else:
            pytest.fail("the tool moves with joints 5 and 7, whatever their signs")
        assert np.abs(wrap_to_pi(circle.nearest(moved) - moved)).max() < 1e-9
        assert np.abs(wrap_to_pi(solver.solve(T, seed=moved).q - moved)).max() < 1e-9


def test_the_nearest_member_of_a_circle_is_nearest(rng: np.random.Generator) -> None:
    solver = solver_of("j2s6s300")
    robot = solver.robot
    for _ in range(5):
        q = robot.sample(rng)
        q[4] = math.pi
        circle = circle_through(solver.solve_all(FreeAxis(robot.forward_kinematics(q), axis=(1.0, 0.0, 0.0)), q), q)
        seed = robot.sample(rng)
        dense = np.array([circle.nearest(q + turn * np.eye(6)[3]) for turn in np.linspace(0.0, 2.0 * math.pi, 2000)])
        assert distance(robot, circle.nearest(seed), seed) <= distance(robot, dense, seed).min() + 1e-12


def test_limits_cut_a_circle(rng: np.random.Generator) -> None:
    solver = solver_of("j2s6s300", joint_4=(-1.0, 1.0), joint_6=(-0.5, 2.0))
    robot = solver.robot
    for _ in range(5):
        q = robot.sample(rng)
        q[4] = math.pi
        T = robot.forward_kinematics(q)
        family = solver.solve_all(FreeAxis(T, axis=(0.0, 1.0, 0.0)), q)
        circle = circle_through(family, q)
        assert {end.joint for end in circle.ends} <= {"joint_4", "joint_6"}
        for turn in np.linspace(-math.pi, math.pi, 50):
            assert robot.within_limits(circle.nearest(q + turn * np.eye(6)[3]))
        result = solver.solve(T, seed=q)
        assert result.status is Status.OK
        assert np.abs(result.q - q).max() < 1e-9


def test_the_answer_to_a_plain_pose_is_the_nearest_of_the_continuum(rng: np.random.Generator) -> None:
    """Joints 4 and 6 of a spherical wrist share a turn where joint 5 is straight."""
    solver = solver_of("j2s6s300")
    robot: Robot = solver.robot
    for _ in range(10):
        q = robot.sample(rng)
        q[4] = math.pi
        T = robot.forward_kinematics(q)
        seed = robot.sample(rng)
        answer = solver.solve(T, seed=seed)
        assert answer.success
        turns = np.linspace(-math.pi, math.pi, 400)
        sign = next(
            s
            for s in (1.0, -1.0)
            if np.linalg.norm(robot.forward_kinematics(q + np.array([0, 0, 0, 1, 0, s])).homogeneous - T.homogeneous)
            < 1e-9
        )
        continuum = q + turns[:, np.newaxis] * np.array([0.0, 0.0, 0.0, 1.0, 0.0, sign])
        assert distance(robot, answer.q, seed) <= distance(robot, continuum, seed).min() + 1e-9
