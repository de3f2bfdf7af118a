"""Forward kinematics and Jacobians: laws, golden numbers, and agreement of two engines."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable

import mujoco
import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, RepresentationSingularity, UnknownNameError
from jacokin.model import NAMES, poses, to_mujoco

STEP = 1e-6  # [rad] central differences: truncation and rounding both near 1e-10


def central_difference(function: Callable[[Array], Array], q: Array) -> Array:
    columns = [(function(q + STEP * e) - function(q - STEP * e)) / (2.0 * STEP) for e in np.eye(q.size)]
    return np.stack(columns, axis=-1)


def test_published_home_pose(robot: Robot) -> None:
    # Kinova's driver states this pose for the home of the real arm; its home angles are given to 0.1 degree.
    documented = np.radians([275.0, 167.4, 57.4, 241.0, 82.7, 75.5])
    published = pin.SE3(
        pin.utils.rotate("x", 1.63771402836)
        @ pin.utils.rotate("y", 1.11316478252)
        @ pin.utils.rotate("z", 0.134094119072),
        np.array([0.212322831154, -0.257197618484, 0.509646713734]),
    )
    reached = robot.forward_kinematics(documented)
    assert np.linalg.norm(reached.translation - published.translation) < 5e-3
    assert np.linalg.norm(pin.log3(reached.rotation.T @ published.rotation)) < 0.02


def test_home_of_moveit_description(robot: Robot) -> None:
    # Kinova's MoveIt home, position given to 1e-6 m.
    position = robot.forward_kinematics([4.8046852, 2.92482, 1.002, 4.2031852, 1.4458, 1.3233]).translation
    np.testing.assert_allclose(position, [0.212743, -0.256609, 0.506962], atol=1e-6)


@pytest.mark.parametrize("name", NAMES)
def test_every_frame_agrees_with_mujoco(name: str, bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = bundled(name)
    report = jacokin.crosscheck(robot, samples=1000, rng=rng)
    assert report.within(), str(report)
    compared = {row.frame for row in report.deviations if row.frame}
    sites = {"wristsite", "end_effector", "gripsite"} | ({"pinchsite"} if name.endswith("300") else set())
    assert {"link_base", "link_6", "hand"} | sites <= compared


@pytest.mark.parametrize("reference", ["local", "world", "local_world_aligned"])
def test_jacobian_derivatives(robot: Robot, rng: np.random.Generator, reference: str) -> None:
    for q in robot.sample(rng, 20):
        v = rng.normal(size=robot.dof)

        def jacobian(at: Array) -> Array:
            return robot.jacobian(at, "gripsite", reference)

        hessian = robot.jacobian_derivative(q, "gripsite", reference)
        np.testing.assert_allclose(hessian, central_difference(jacobian, q), atol=1e-6)
        rate = robot.jacobian_time_derivative(q, v, "gripsite", reference)
        along = (jacobian(q + STEP * v) - jacobian(q - STEP * v)) / (2.0 * STEP)
        np.testing.assert_allclose(rate, along, atol=1e-6)
        np.testing.assert_allclose(hessian @ v, rate, atol=1e-12)


def test_jacobian_references_are_one_motion(robot: Robot, rng: np.random.Generator) -> None:
    q, v = robot.sample(rng), rng.normal(size=6)
    placement = robot.forward_kinematics(q)
    local, world = robot.jacobian(q, reference="local") @ v, robot.jacobian(q, reference="world") @ v
    aligned = robot.jacobian(q) @ v
    np.testing.assert_allclose(placement.action @ local, world, atol=1e-13)
    np.testing.assert_allclose(
        np.concatenate((placement.rotation @ local[:3], placement.rotation @ local[3:])), aligned
    )
    moved = (
        robot.forward_kinematics(q + STEP * v).translation - robot.forward_kinematics(q - STEP * v).translation
    ) / (2.0 * STEP)
    np.testing.assert_allclose(aligned[:3], moved, atol=1e-9)


def representation(robot: Robot, q: Array, kind: str) -> Array:
    placement = robot.forward_kinematics(q)
    if kind == "rpy":
        orientation = pin.rpy.matrixToRpy(placement.rotation)
    elif kind == "rotation_vector":
        orientation = pin.log3(placement.rotation)
    else:
        orientation = poses.quat_wxyz(placement.rotation)
    return np.concatenate((placement.translation, orientation))


@pytest.mark.parametrize("kind", ["rpy", "rotation_vector", "quaternion"])
def test_analytical_jacobians(robot: Robot, rng: np.random.Generator, kind: str) -> None:
    checked = 0
    for q in robot.sample(rng, 40):
        rotation = robot.forward_kinematics(q).rotation
        if kind == "rpy" and math.hypot(rotation[0, 0], rotation[1, 0]) < 0.05:
            continue
        if kind != "rpy" and np.linalg.norm(pin.log3(rotation)) > math.pi - 0.05:
            continue
        numeric = central_difference(lambda at: representation(robot, at, kind), q)
        np.testing.assert_allclose(robot.analytical_jacobian(q, representation=kind), numeric, atol=1e-6)
        checked += 1
    assert checked > 30


def test_analytical_jacobian_at_its_singularity(robot: Robot) -> None:
    solver = jacokin.IKSolver(robot)
    upright = solver.solve(jacokin.pose([0.3, 0.2, 0.5], rpy=[0.3, math.pi / 2, 0.0])).raise_for_status()
    with pytest.raises(RepresentationSingularity, match="pitch") as error:
        robot.analytical_jacobian(upright.q, representation="rpy")
    assert error.value.angle == pytest.approx(math.pi / 2, abs=1e-6)
    flipped = solver.solve(jacokin.pose([0.3, 0.2, 0.3], down=True)).raise_for_status()
    with pytest.raises(RepresentationSingularity, match="rotation angle"):
        robot.analytical_jacobian(flipped.q, representation="rotation_vector")
    assert np.isfinite(robot.analytical_jacobian(flipped.q, representation="quaternion")).all()


def test_manipulability_vanishes_with_the_smallest_singular_value(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng)
    jacobian = robot.jacobian(q)
    assert robot.manipulability(q) == pytest.approx(math.sqrt(np.linalg.det(jacobian @ jacobian.T)), rel=1e-9)
    straight = np.array([0.0, math.pi, math.pi, 0.0, 0.0, 0.0])  # the arm stretched straight up
    assert robot.singular_values(straight)[-1] < 1e-12
    assert robot.manipulability(straight) < 1e-12


def test_twin_in_mujoco_has_every_frame(robot: Robot, rng: np.random.Generator) -> None:
    model = to_mujoco(robot)
    data = mujoco.MjData(model)
    assert [model.joint(i).name for i in range(model.njnt)] == list(robot.joint_names)
    for q in robot.sample(rng, 50):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        for frame in robot.frames:
            placement = robot.forward_kinematics(q, frame)
            np.testing.assert_allclose(data.site(frame).xpos, placement.translation, atol=1e-12)
            np.testing.assert_allclose(data.site(frame).xmat.reshape(3, 3), placement.rotation, atol=1e-12)


def test_samples_are_within_limits_and_fill_the_ranges(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng, 4000)
    assert all(robot.within_limits(row) for row in q)
    low, high = np.where(robot.unlimited, -np.pi, robot.lower), np.where(robot.unlimited, np.pi, robot.upper)
    assert (q >= low).all()
    assert (q < high).all()
    np.testing.assert_allclose(q.mean(axis=0), 0.5 * (low + high), atol=0.15)
    np.testing.assert_allclose(q.std(axis=0), (high - low) / math.sqrt(12.0), rtol=0.05)


def test_limits_are_exact(robot: Robot) -> None:
    q = np.array(robot.home)
    q[1] = math.radians(313)
    assert robot.within_limits(q)
    q[1] = np.nextafter(q[1], 10.0)
    assert not robot.within_limits(q)
    assert robot.within_limits(q, tolerance=1e-12)
    q[0] = 1e3  # joint 1 turns freely
    q[1] = math.radians(47)
    assert robot.within_limits(q)


def test_poses_are_copies_and_the_robot_does_not_change(robot: Robot, rng: np.random.Generator) -> None:
    first = robot.forward_kinematics(robot.home)
    before = first.homogeneous.copy()
    robot.forward_kinematics(robot.sample(rng))
    np.testing.assert_array_equal(first.homogeneous, before)
    with pytest.raises(AttributeError):
        robot.lower = np.zeros(6)
    with pytest.raises(ValueError, match="read-only"):
        robot.lower[1] = 0.0


def test_a_pickled_robot_is_the_same(robot: Robot, rng: np.random.Generator) -> None:
    copy = pickle.loads(pickle.dumps(robot))
    q = robot.sample(rng)
    assert (copy.name, copy.frames, copy.joint_names) == (robot.name, robot.frames, robot.joint_names)
    np.testing.assert_array_equal(copy.forward_kinematics(q).homogeneous, robot.forward_kinematics(q).homogeneous)
    np.testing.assert_array_equal(copy.home, robot.home)


@pytest.mark.parametrize(
    ("q", "text"),
    [
        ([0.0] * 5, r"q must have shape \(6,\)"),
        ([[0.0] * 6], "shape"),
        ([math.nan] + [1.0] * 5, "finite"),
        ([math.inf] + [1.0] * 5, "finite"),
        ("abcdef", "q must be 6 numbers"),
        (None, "q must"),
    ],
)
def test_malformed_configurations_are_refused(robot: Robot, q: object, text: str) -> None:
    for call in (robot.forward_kinematics, robot.jacobian, robot.within_limits, robot.manipulability):
        with pytest.raises(InvalidInputError, match=text):
            call(q)  # type: ignore[arg-type]  # wrong on purpose


def test_unknown_names_list_the_valid_ones(robot: Robot) -> None:
    with pytest.raises(
        UnknownNameError, match=r"unknown frame 'grip_site'. Did you mean 'gripsite'\?.*link_base"
    ) as error:
        robot.forward_kinematics(robot.home, "grip_site")
    assert error.value.valid == robot.frames
    with pytest.raises(UnknownNameError, match="reference.*local_world_aligned"):
        robot.jacobian(robot.home, reference="body")
    with pytest.raises(UnknownNameError, match="representation.*rotation_vector"):
        robot.analytical_jacobian(robot.home, representation="euler")
    with pytest.raises(UnknownNameError, match="joint_7"):
        robot.joint_index("joint_7")


def test_strided_configurations_become_contiguous(robot: Robot) -> None:
    column = np.tile(robot.home[:, None], (1, 3))[:, 1]
    for view in (column, robot.home[::-1].copy()[::-1], robot.home.astype(">f8")):
        checked = robot.configuration(view)
        assert checked.flags.c_contiguous
        np.testing.assert_array_equal(checked, robot.home)


def test_a_single_joint_has_a_jacobian_of_one_column() -> None:
    one = jacokin.load_robot(tip="link_1", base="link_base")
    assert one.jacobian(one.home).shape == (6, 1)
    assert one.singular_values(one.home).shape == (1,)
    assert one.manipulability(one.home) == pytest.approx(np.linalg.norm(one.jacobian(one.home)))
    assert jacokin.crosscheck(one, jacokin.load_robot(tip="link_1"), samples=5).within()


@pytest.mark.parametrize("tolerance", ["a", np.ones(3), -1.0, math.nan, True])
def test_tolerances_are_one_number(robot: Robot, tolerance: object) -> None:
    with pytest.raises(InvalidInputError, match="tolerance"):
        robot.within_limits(robot.home, tolerance)  # type: ignore[arg-type]  # wrong on purpose


def test_absurd_requests_are_refused(robot: Robot) -> None:
    with pytest.raises(InvalidInputError, match="too large"):
        robot.sample(np.random.default_rng(0), 10**15)
    with pytest.raises(InvalidInputError, match="robot_a"):
        jacokin.crosscheck("j2n6s300")  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="robot_b"):
        jacokin.crosscheck(robot, "x")  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="frame_map"):
        jacokin.crosscheck(robot, frame_map=["a"])  # type: ignore[arg-type]  # wrong on purpose
    with pytest.raises(InvalidInputError, match="joint_map"):
        jacokin.crosscheck(robot, joint_map=["a"])  # type: ignore[arg-type]  # wrong on purpose
