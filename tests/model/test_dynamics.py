"""Dynamics against MuJoCo, which gets the same description, the payload as a body and the base tilted; and by laws."""

from __future__ import annotations

import functools
import itertools
import pickle
from collections.abc import Callable
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from jacokin.model import identify_payload, urdf_folder
from jacokin.model.descriptions.bundled import JACOS
from jacokin.model.poses import quaternion
from jacokin.motion import move_joints
from tests.robot_files import load_text, skeleton, ur5_text

NAMES = ("j2n6s300", "j2n6s200", "j2s6s300", "m1n6s300", "j2s7s300", "j2s7s200", "gen3", "gen3_6dof")
FINGER_ANGLE = 0.5  # [rad]
TOLERANCE = 1e-9  # [N m], [kg m^2]
MASS, COM = 1.3, np.array([0.02, -0.05, 0.11])  # [kg], [m] in the end effector
INERTIA = np.array([[4e-3, 1e-4, -2e-4], [1e-4, 5e-3, 3e-4], [-2e-4, 3e-4, 6e-3]])  # [kg m^2]
BASE = jacokin.pose([0.4, -0.3, 1.1], rpy=[0.7, -1.1, 0.4])  # T_world_base


@functools.cache
def described(name: str) -> Robot:
    """With the armature that only the MJCF carries."""
    return jacokin.load_robot(urdf_folder() / f"{name}.xml", tip="end_effector", finger_angle=FINGER_ANGLE)


def placement(element: mujoco.MjsBody | mujoco.MjsSite) -> pin.SE3:
    return pin.SE3(pin.Quaternion(*np.asarray(element.quat).tolist()).normalized(), np.asarray(element.pos))


class Reference:
    """The arm in MuJoCo, fingers still at an angle, friction, damping and constraints off."""

    def __init__(self, name: str, robot: Robot, *, payload: bool, tilted: bool) -> None:
        spec = mujoco.MjSpec.from_file(str(urdf_folder() / f"{name}.xml"))
        if payload:
            tool = spec.site("end_effector")
            T_body_tool = placement(tool)
            body = tool.parent.add_body(pos=T_body_tool.translation, quat=quaternion(T_body_tool.rotation))
            body.mass, body.ipos, body.explicitinertial = MASS, COM, True
            body.fullinertia = INERTIA[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        if tilted:
            for body in spec.worldbody.bodies:
                T_world_body = BASE * placement(body)
                body.pos, body.quat = T_world_body.translation, quaternion(T_world_body.rotation)
        self.model = spec.compile()
        self.model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
        self.model.dof_damping[:] = 0.0
        self.data = mujoco.MjData(self.model)
        self.data.qpos[:] = FINGER_ANGLE
        joints = [self.model.joint(joint).id for joint in robot.joint_names]
        self.qpos, self.dofs = self.model.jnt_qposadr[joints], self.model.jnt_dofadr[joints]

    def inverse(self, q: Array, v: Array, a: Array) -> Array:
        for field in (self.data.qvel, self.data.qacc):
            field[:] = 0.0
        self.data.qpos[self.qpos], self.data.qvel[self.dofs], self.data.qacc[self.dofs] = q, v, a
        mujoco.mj_inverse(self.model, self.data)
        return np.array(self.data.qfrc_inverse[self.dofs])

    def bias(self) -> Array:
        return np.array(self.data.qfrc_bias[self.dofs])

    def mass_matrix(self) -> Array:
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        return full[np.ix_(self.dofs, self.dofs)]


@pytest.mark.one_quick("name")
@pytest.mark.parametrize("states", [30, pytest.param(1_000, marks=pytest.mark.slow)])
@pytest.mark.parametrize(("payload", "tilted"), [(False, False), (True, False), (True, True)])
@pytest.mark.parametrize("name", NAMES)
def test_every_quantity_agrees_with_mujoco(
    name: str, payload: bool, tilted: bool, states: int, rng: np.random.Generator
) -> None:
    robot = described(name)
    reference = Reference(name, robot, payload=payload, tilted=tilted)
    base = BASE if tilted else None
    if payload:
        robot = robot.with_payload(MASS, COM, INERTIA)
    zero = np.zeros(robot.dof)
    worst = dict.fromkeys(("inverse", "mass", "bias", "gravity", "forward", "com"), 0.0)
    for q in robot.sample(rng, states):
        v, a = rng.uniform(-2.0, 2.0, (2, robot.dof))
        torque = reference.inverse(q, v, a)
        found = {
            "inverse": robot.inverse_dynamics(q, v, a, base=base) - torque,
            "mass": robot.mass_matrix(q) - reference.mass_matrix(),
            "bias": robot.coriolis(q, v) @ v + robot.gravity(q, base=base) - reference.bias(),
            "forward": robot.forward_dynamics(q, v, torque, base=base) - a,
            "com": BASE.act(robot.centre_of_mass(q)) - reference.data.subtree_com[0]
            if tilted
            else robot.centre_of_mass(q) - reference.data.subtree_com[0],
        }
        found["gravity"] = robot.gravity(q, base=base) - reference.inverse(q, zero, zero)
        for key, difference in found.items():
            worst[key] = max(worst[key], float(np.abs(difference).max()))
    assert max(worst.values()) <= TOLERANCE, worst
    assert (robot.pin_model.armature.min() > 1.0) == (name in JACOS)  # no source gives that of a Gen3


def test_a_wrench_acts_as_in_mujoco(rng: np.random.Generator) -> None:
    robot = described("j2n6s300")
    reference = Reference("j2n6s300", robot, payload=False, tilted=False)
    body = reference.model.body("link_4").id
    for q in robot.sample(rng, 20):
        v, a = rng.uniform(-2.0, 2.0, (2, 6))
        wrench = rng.uniform(-10.0, 10.0, 6)
        without = reference.inverse(q, v, a)
        jacobian = np.zeros((6, reference.model.nv))
        mujoco.mj_jacBody(reference.model, reference.data, jacobian[:3], jacobian[3:], body)
        expected = without - jacobian[:, reference.dofs].T @ wrench
        torque = robot.inverse_dynamics(q, v, a, external=wrench, frame="link_4")
        np.testing.assert_allclose(torque, expected, atol=TOLERANCE)
        np.testing.assert_allclose(
            robot.forward_dynamics(q, v, torque, external=wrench, frame="link_4"), a, atol=TOLERANCE
        )


def test_rate_of_the_mass_matrix_is_twice_the_symmetric_part_of_coriolis(
    bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled("j2s7s300")
    q, v, h = robot.sample(rng), rng.uniform(-1.0, 1.0, robot.dof), 1e-5
    rate = (robot.mass_matrix(q + h * v) - robot.mass_matrix(q - h * v)) / (2.0 * h)
    C = robot.coriolis(q, v)
    np.testing.assert_allclose(rate, C + C.T, atol=1e-8)


def test_gravity_is_the_gradient_of_potential_energy_in_a_tilted_world(robot: Robot, rng: np.random.Generator) -> None:
    q, h = robot.sample(rng), 1e-5
    mass = sum(inertia.mass for inertia in robot.pin_model.inertias)

    def energy(at: Array) -> float:
        return float(mass * 9.81 * BASE.act(robot.centre_of_mass(at))[2])

    expected = [(energy(q + h * axis) - energy(q - h * axis)) / (2.0 * h) for axis in np.eye(6)]
    np.testing.assert_allclose(robot.gravity(q, base=BASE), expected, atol=1e-7)
    np.testing.assert_allclose(robot.gravity(q, base=jacokin.pose([3, 4, 5])), robot.gravity(q), atol=1e-12)
    upside_down = jacokin.pose([0, 0, 2], rpy=[np.pi, 0, 0])
    np.testing.assert_allclose(robot.gravity(q, base=upside_down), -robot.gravity(q), atol=1e-12)


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_the_wrench_behind_torques_is_found(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    for q in robot.sample(rng, 20):
        v, a = rng.uniform(-1.0, 1.0, (2, robot.dof))
        wrench = rng.uniform(-5.0, 5.0, 6)
        torque = robot.inverse_dynamics(q, v, a, external=wrench, frame="gripsite", base=BASE)
        found = robot.external_wrench(q, v, a, torque, frame="gripsite", base=BASE)
        assert found.unobservable.shape == (0, 6)
        np.testing.assert_allclose(found.wrench, wrench, atol=1e-9)
        np.testing.assert_allclose(found.residual, 0.0, atol=1e-9)
        np.testing.assert_allclose(found.joint_torque, robot.jacobian(q, "gripsite").T @ wrench, atol=1e-9)
    with pytest.raises(ValueError, match="read-only"):
        found.wrench[0] = 0.0


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_the_covariance_is_that_of_many_measurements(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    q, zero = robot.home, np.zeros(robot.dof)
    spread = rng.normal(0.0, 0.1, (robot.dof, robot.dof)) + 0.3 * np.eye(robot.dof)
    covariance = spread @ spread.T  # [N^2 m^2]
    truth = np.array([3.0, -2.0, 5.0, 0.1, 0.2, -0.3])
    torque = robot.inverse_dynamics(q, zero, zero, external=truth)
    noise = rng.multivariate_normal(zero, covariance, 3000)
    found = [robot.external_wrench(q, zero, zero, torque + e, torque_covariance=covariance) for e in noise]
    factor = np.linalg.cholesky(found[0].covariance)
    errors = np.linalg.solve(factor, np.array([row.wrench - truth for row in found]).T)
    np.testing.assert_allclose(errors.mean(axis=1), 0.0, atol=0.08)
    np.testing.assert_allclose(np.cov(errors), np.eye(6), atol=0.12)


def test_directions_that_no_joint_feels_are_said(robot: Robot) -> None:
    # A stretched elbow: moved to where the Jacobian's determinant changes its sign.
    q, zero = np.array(robot.home), np.zeros(6)
    low, high = 2.6, 3.6
    for _ in range(80):
        middle = 0.5 * (low + high)
        signs = [np.sign(np.linalg.det(robot.jacobian([*q[:2], x, *q[3:]]))) for x in (low, middle)]
        low, high = (middle, high) if signs[0] == signs[1] else (low, middle)
    q[2] = low
    assert robot.singular_values(q)[-1] < 1e-9
    truth = np.array([3.0, -2.0, 5.0, 0.1, 0.2, -0.3])
    found = robot.external_wrench(q, zero, zero, robot.inverse_dynamics(q, zero, zero, external=truth))
    (stuck,) = found.unobservable
    np.testing.assert_allclose(robot.jacobian(q).T @ stuck, 0.0, atol=1e-9)
    np.testing.assert_allclose(found.wrench, truth - (truth @ stuck) * stuck, atol=1e-6)
    np.testing.assert_allclose(found.covariance @ stuck, 0.0, atol=1e-6)
    with pytest.raises(InvalidInputError, match="cannot move along"):
        robot.operational_space_inertia(q)


def test_operational_space_inertia_turns_a_wrench_into_acceleration(robot: Robot, rng: np.random.Generator) -> None:
    q, wrench = robot.home, rng.uniform(-1.0, 1.0, 6)
    zero = np.zeros(6)
    for frame in ("pinchsite", "end_effector"):
        a = robot.forward_dynamics(q, zero, robot.gravity(q), external=wrench, frame=frame)
        inertia = robot.operational_space_inertia(q, frame)
        np.testing.assert_allclose(inertia @ (robot.jacobian(q, frame) @ a), wrench, atol=1e-9)
        np.testing.assert_allclose(inertia, inertia.T, atol=1e-9)


def test_a_payload_makes_another_robot_and_leaves_this_one(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng)
    before = robot.gravity(q)
    heavy = robot.with_payload(1.0, [0.0, 0.0, 0.0])
    np.testing.assert_array_equal(robot.gravity(q), before)
    weight = robot.jacobian(q)[:3].T @ np.array([0.0, 0.0, -9.81])  # 1 kg at the end effector
    np.testing.assert_allclose(heavy.gravity(q), before - weight, atol=1e-12)
    np.testing.assert_array_equal(heavy.forward_kinematics(q).homogeneous, robot.forward_kinematics(q).homogeneous)
    assert (heavy.frames, heavy.default_frame, heavy.name) == (robot.frames, robot.default_frame, robot.name)
    np.testing.assert_array_equal(heavy.home, robot.home)
    copy = pickle.loads(pickle.dumps(heavy))
    np.testing.assert_array_equal(copy.gravity(q), heavy.gravity(q))


def test_arms_without_masses_say_so(tmp_path: Path) -> None:
    arm = load_text(tmp_path / "ur5.urdf", ur5_text())
    q = [0.1] * 6
    with pytest.raises(ModelError, match="no masses"):
        arm.centre_of_mass(q)
    loaded = arm.with_payload(2.0, [0.1, 0.0, 0.0])
    for weightless in (arm, loaded, pickle.loads(pickle.dumps(loaded))):
        asked: tuple[Callable[[], object], ...] = (
            functools.partial(weightless.gravity, q),
            functools.partial(weightless.gravity, q, base=BASE),
            functools.partial(weightless.mass_matrix, q),
            functools.partial(weightless.coriolis, q, q),
            functools.partial(weightless.inverse_dynamics, q, q, q),
            functools.partial(weightless.forward_dynamics, q, q, q),
            functools.partial(weightless.operational_space_inertia, q),
            functools.partial(weightless.external_wrench, q, q, q, q),
            functools.partial(identify_payload, weightless, *np.zeros((4, 80, 6))),
            functools.partial(move_joints, weightless, q, [0.2] * 6, torque_limit=5.0),
        )
        for ask in asked:
            with pytest.raises(ModelError, match="no masses"):
                ask()
    weighed = arm.with_bodies([[1.0, 0.0, 0.0, 0.1, 0.1, 0.0, 0.1, 0.0, 0.0, 0.1]] * 6)
    assert np.abs(weighed.gravity(q)).max() > 0.1
    np.testing.assert_allclose(
        loaded.centre_of_mass(q), loaded.forward_kinematics(q).act(np.array([0.1, 0.0, 0.0])), atol=1e-12
    )


def test_impossible_payloads_and_covariances_are_refused(robot: Robot) -> None:
    zero = np.zeros(6)
    with pytest.raises(InvalidInputError, match="mass"):
        robot.with_payload(-1.0, [0, 0, 0])
    with pytest.raises(InvalidInputError, match="no body has"):
        robot.with_payload(1.0, [0, 0, 0], np.diag([1.0, 1.0, 3.0]))
    with pytest.raises(InvalidInputError, match="no body has"):
        robot.with_payload(1.0, [0, 0, 0], np.diag([-1.0, 1.0, 1.0]))
    with pytest.raises(InvalidInputError, match="symmetric"):
        robot.with_payload(1.0, [0, 0, 0], [[1.0, 0.5, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    with pytest.raises(UnknownNameError, match="frame"):
        robot.with_payload(1.0, [0, 0, 0], frame="nowhere")
    with pytest.raises(UnknownNameError, match="frame"):
        robot.inverse_dynamics(robot.home, zero, zero, frame="nowhere")
    with pytest.raises(InvalidInputError, match="positive definite"):
        robot.external_wrench(robot.home, zero, zero, zero, torque_covariance=np.zeros((6, 6)))
    with pytest.raises(InvalidInputError, match="too large"):
        robot.inverse_dynamics(robot.home, [1e200] * 6, zero)


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["j2n6s300", "slide"])
def test_numbers_that_are_not_finite_are_refused_where_torques_do_not_tell(
    name: str, value: float, bundled: Callable[[str], Robot], tmp_path: Path
) -> None:
    # The torque of a slide that stands alone has nothing to do with its velocity.
    arm = load_text(tmp_path / "slide.urdf", skeleton("a>b{0,1}=2")) if name == "slide" else bundled(name)
    middle = np.full(arm.dof, 0.5)
    for asked, names in ((arm.inverse_dynamics, "qva"), (arm.forward_dynamics, ("q", "v", "torque"))):
        for number, joint in itertools.product(range(3), range(arm.dof)):
            given = [middle, middle, middle.copy()]
            given[2][joint] = value
            given[number], given[2] = given[2], given[number]
            with pytest.raises(InvalidInputError, match=f"^{names[number]} must be finite"):
                asked(*given)


def test_an_answer_is_not_overwritten_by_the_next(robot: Robot, rng: np.random.Generator) -> None:
    asked: tuple[Callable[[Array], Array], ...] = (
        robot.jacobian,
        robot.gravity,
        robot.mass_matrix,
        lambda q: robot.coriolis(q, q),
        lambda q: robot.inverse_dynamics(q, q, q),
        lambda q: robot.forward_dynamics(q, q, q),
        lambda q: robot.forward_kinematics(q).homogeneous,
    )
    first, second = robot.sample(rng, 2)
    for ask in asked:
        kept = ask(first)
        before = kept.copy()
        assert not np.array_equal(ask(second), before)
        np.testing.assert_array_equal(kept, before)


def test_a_single_joint_keeps_its_dimensions(tmp_path: Path) -> None:
    path = tmp_path / "one.xml"
    path.write_text(
        '<mujoco><worldbody><body name="arm"><joint name="j"/><geom size="0.1" pos="1 0 0" mass="2"/>'
        "</body></worldbody></mujoco>"
    )
    arm = jacokin.load_robot(path)
    zero = np.zeros(1)
    assert arm.mass_matrix(zero).shape == arm.coriolis(zero, zero).shape == (1, 1)
    assert arm.inverse_dynamics(zero, zero, zero, external=np.ones(6), base=BASE).shape == (1,)
    found = arm.external_wrench(zero, zero, zero, arm.inverse_dynamics(zero, zero, zero, external=np.ones(6)))
    assert found.unobservable.shape == (5, 6)
