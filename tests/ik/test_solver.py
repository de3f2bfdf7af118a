"""The solver: every branch, the nearest one within the limits, and the reasons when there is none."""

from __future__ import annotations

import math
import pickle
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik import SolutionSet
from jacokin.model import NAMES, Floor, Scene, SelfContact, urdf_folder
from jacokin.model.descriptions.bundled import JACOS, arm_joints
from tests.programs import python

angles = st.floats(-math.pi, math.pi)
fractions = st.floats(0.0, 1.0)


@st.composite
def configurations(draw: st.DrawFn) -> Array:
    """Configurations of the j2n6s300 within its limits, the limits included."""
    q = np.array([draw(angles) for _ in range(6)])
    for joint, low, high in ((1, math.radians(47), math.radians(313)), (2, math.radians(19), math.radians(341))):
        q[joint] = min(max(low + draw(fractions) * (high - low), low), high)
    return q


def circular(difference: Array) -> Array:
    return np.abs((difference + np.pi) % (2.0 * np.pi) - np.pi)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(q=configurations())
def test_every_branch_reaches_the_pose(robot: Robot, q: Array) -> None:
    target = robot.forward_kinematics(q)
    branches = IKSolver(robot).solve_all(target)
    for row, within in zip(branches.q, branches.within_limits, strict=True):
        assert robot.within_limits(row) == within
        reached = robot.forward_kinematics(row)
        assert np.linalg.norm(reached.translation - target.translation) < 1e-9
        assert np.linalg.norm(pin.log3(reached.rotation.T @ target.rotation)) < 1e-8  # log3 loses half the digits
    apart = circular(branches.q[:, None] - branches.q[None]).max(axis=2) + 10.0 * np.eye(len(branches))
    assert apart.min() > 1e-6
    if robot.singular_values(q)[-1] > 1e-4:
        assert circular(branches.q - q).max(axis=1).min() < 1e-6


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(q=configurations())
def test_the_seed_is_its_own_answer(robot: Robot, q: Array) -> None:
    assume(robot.singular_values(q)[-1] > 1e-3)
    result = IKSolver(robot, collision="ignore").solve(robot.forward_kinematics(q), seed=q)
    assert result.success
    np.testing.assert_allclose(result.q, q, atol=1e-6)


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(q=configurations(), seed=configurations(), turns=st.lists(st.integers(-3, 3), min_size=4, max_size=4))
def test_turning_the_seed_turns_the_answer(robot: Robot, q: Array, seed: Array, turns: list[int]) -> None:
    solver = IKSolver(robot)
    target = robot.forward_kinematics(q)
    # Joints of a singular branch are known to 1e-8 only, which may put it beyond a limit.
    assume(min(robot.singular_values(row)[-1] for row in solver.solve_all(target, seed).q) > 1e-3)
    offset = np.zeros(6)
    offset[[0, 3, 4, 5]] = 2.0 * np.pi * np.array(turns)
    plain, turned = solver.solve(target, seed), solver.solve(target, seed + offset)
    assert np.abs(plain.q - seed)[robot.unlimited].max() <= math.pi + 1e-9
    # A joint half a turn away from the seed may come on either side of it.
    if np.abs(plain.q - seed)[robot.unlimited].max() < math.pi - 1e-6:
        distances = [np.linalg.norm(r.q - s) for r, s in ((plain, seed), (turned, seed + offset))]
        assert distances[0] == pytest.approx(distances[1], abs=1e-9)
        all_distances = solver.solve_all(target, seed).distance
        if len(all_distances) < 2 or np.diff(all_distances).min() > 1e-9:
            np.testing.assert_allclose(turned.q, plain.q + offset, atol=1e-9)


def test_a_posed_base_changes_nothing(
    robot: Robot, rng: np.random.Generator, tmp_path_factory: pytest.TempPathFactory
) -> None:
    T_world_base = jacokin.pose([0.4, -0.7, 1.2], rpy=[0.5, -0.3, 2.0])
    text = (urdf_folder() / "j2n6s300.xml").read_text()
    quat = pin.Quaternion(T_world_base.rotation)
    posed_text = text.replace(
        '<body name="link_base"',
        f'<body name="link_base" pos="0.4 -0.7 1.2" quat="{quat.w!r} {quat.x!r} {quat.y!r} {quat.z!r}"',
    )
    path = tmp_path_factory.mktemp("posed") / "posed.xml"
    path.write_text(posed_text)
    posed = jacokin.load_robot(path, tip="end_effector")
    for q in robot.sample(rng, 20):
        target = robot.forward_kinematics(q)
        here = IKSolver(robot).solve_all(target, seed=q)
        there = IKSolver(posed).solve_all(T_world_base * target, seed=q)
        assert len(here) == len(there)
        np.testing.assert_allclose(circular(here.q[0] - there.q[0]), 0.0, atol=1e-8)
        assert all(circular(there.q - branch).max(axis=1).min() < 1e-5 for branch in here.q)


@pytest.mark.parametrize("name", [name for name in NAMES if len(arm_joints(name)) == 6])
def test_every_arm_with_six_joints(name: str, bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = bundled(name)
    frame = "gripsite" if name in JACOS else "end_effector"
    solver = IKSolver(robot, frame, method="closed_form")
    own = IKSolver(robot, frame, collision="ignore")
    for q in robot.sample(rng, 200):
        target = robot.forward_kinematics(q, frame)
        result = solver.solve(target, seed=q)
        assert result.success, str(result)
        assert result.method == "closed_form"
        if robot.singular_values(q)[-1] > 1e-4:
            assert circular(own.solve(target, seed=q).q - q).max() < 1e-6
            assert circular(solver.solve_all(target).q - q).max(axis=1).min() < 1e-6


@pytest.mark.parametrize("down", [True, False])
def test_vertical_tools_keep_all_their_branches(robot: Robot, rng: np.random.Generator, down: bool) -> None:
    # Axis 4 parallel to axis 1: regular branches on a double root. Generate them from the inside: q5 = 0 keeps
    # axis 6 parallel to axis 4, and joints 2 and 3 stand axis 4 upright.
    solver = IKSolver(robot)
    found = 0
    for q in robot.sample(rng, 100):
        q[4] = 0.0
        q[2] = q[1] if down else q[1] + math.pi
        if not robot.within_limits(q) or robot.singular_values(q)[-1] < 1e-3:
            continue
        target = robot.forward_kinematics(q)
        assert abs(target.rotation[2, 2]) > 1.0 - 1e-12
        branches = solver.solve_all(target)
        assert circular(branches.q - q).max(axis=1).min() < 1e-6
        found += 1
    assert found > 20


@pytest.mark.slow
def test_points_and_curves_are_read_in_one_way(bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    six, seven = bundled("j2n6s300"), bundled("j2s7s300")
    poses = [six.forward_kinematics(six.sample(rng)), seven.forward_kinematics(seven.sample(rng))]
    about_x = jacokin.FreeAxis(poses[0], axis=(1.0, 0.0, 0.0))
    far = jacokin.pose([3.0, 0.0, 0.0])
    for robot, target, expected in (
        (six, poses[0], (0, None)),
        (six, about_x, (1, "angle")),
        (seven, poses[1], (1, "joint_3")),
    ):
        seed = robot.sample(rng)
        found: SolutionSet = IKSolver(robot).solve_all(target, seed)
        assert (found.dimension, found.parameter) == expected
        assert IKSolver(robot).dimension(target) == found.dimension
        assert found.complete
        assert found.q.shape == found.margin.shape == (len(found), robot.dof)
        assert bool(found.intervals) == (found.dimension == 1)
        assert max(found.position_error.max(), found.orientation_error.max()) < 1e-6
        np.testing.assert_allclose(
            found.distance,
            np.linalg.norm(np.where(robot.unlimited, circular(found.q - seed), found.q - seed), axis=1),
            atol=1e-9,
        )
        assert found.within_limits.shape == (len(found),)
        for row, margin, within in zip(found.q, found.margin, found.within_limits, strict=True):
            assert robot.within_limits(row) == within == (margin >= 0.0).all()
        for column in (found.q, found.within_limits, found.margin, found.distance, found.q_within_limits):
            assert not column.flags.writeable
        rows = found.q[found.within_limits]
        nearest, widest = found.nearest(), found.best("margin")
        assert nearest is not None
        assert widest is not None
        np.testing.assert_allclose(nearest, rows[np.argmin(np.linalg.norm(rows - seed, axis=1))], rtol=0.0, atol=1e-12)
        assert np.minimum(widest - robot.lower, robot.upper - widest).min() >= found.margin.min(axis=1).max() - 1e-9
        for prefer in ("nearest", "margin", "manipulability", lambda q: float(q[0])):
            answer = IKSolver(robot, collision="ignore").solve(target, seed, prefer=prefer)
            best = found.best(prefer)
            assert best is not None
            np.testing.assert_allclose(best, answer.q, rtol=0.0, atol=1e-9)
        other = robot.sample(rng)
        moved = found.nearest(other)
        assert moved is not None
        assert np.linalg.norm(moved - other) <= np.linalg.norm(found.sample(50) - other, axis=1).min() + 1e-9
        assert all(robot.within_limits(row) for row in found.sample(5))
        none: SolutionSet = IKSolver(robot).solve_all(far, seed)
        assert (len(none), none.q.shape, none.nearest(), none.best("margin")) == (0, (0, robot.dof), None, None)


def test_limits_that_exclude_every_branch_are_named(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng)
    target = robot.forward_kinematics(q)
    within = IKSolver(robot).solve_all(target).q_within_limits
    narrow = jacokin.load_robot(limits={"joint_2": (within[:, 1].max() + 0.05, robot.upper[1])})
    solver = IKSolver(narrow)
    result = solver.solve(target)
    assert result.status is Status.OUTSIDE_LIMITS
    assert "joint_2 by" in result.message
    assert result.method == "qp"
    assert narrow.within_limits(result.q)
    assert result.position_error + result.orientation_error > 1e-3
    # The excess that is named is the least over the branches of the largest one.
    excess = (-solver.solve_all(target).margin).clip(min=0.0).max(axis=1).min()
    assert f"{excess:.6g}" in result.message
    assert solver.solve(target, closest=False).status is Status.OUTSIDE_LIMITS


def test_a_pose_on_a_limit_is_solved_on_the_limit(robot: Robot, rng: np.random.Generator) -> None:
    solver = IKSolver(robot)
    for index, q in enumerate(robot.sample(rng, 200)):
        joint = 1 + index % 2
        q[joint] = (robot.lower, robot.upper)[index // 2 % 2][joint]
        result = solver.solve(robot.forward_kinematics(q), seed=q)
        assert result.success, str(result)
        assert robot.within_limits(result.q)


@pytest.mark.parametrize("position", [[0.9, 0.9, 0.9], [0.0, 0.0, 3.0], [2e3, 1e3, 0.0], [1e200, 0.0, 0.0]])
def test_unreachable_means_no_branch(robot: Robot, position: list[float]) -> None:
    solver = IKSolver(robot)
    target = jacokin.pose(position, down=True)
    assert len(solver.solve_all(target)) == 0
    result = solver.solve(target, closest=False)
    assert result.status is Status.UNREACHABLE
    np.testing.assert_array_equal(result.q, robot.home)


def test_spherical_wrists_with_aligned_axes_say_they_are_a_family() -> None:
    robot = jacokin.load_robot("j2s6s300")
    q = np.array([0.3, 2.5, 1.5, 0.4, math.pi, 1.1])
    target = robot.forward_kinematics(q)
    solver = IKSolver(robot)
    branches = solver.solve_all(target, seed=q)
    assert not branches.complete
    result = solver.solve(target, seed=q)
    assert result.success
    np.testing.assert_allclose(result.q, q, atol=1e-6)


def test_contact_free_branches_come_first_when_contact_is_rejected(robot: Robot, rng: np.random.Generator) -> None:
    contact = SelfContact(robot)
    solver = IKSolver(robot, collision="reject")
    report = IKSolver(robot, collision="report")
    avoided = refused = 0
    for q in robot.sample(rng, 600):
        if not contact.touching(q):
            continue
        target = robot.forward_kinematics(q)
        assert report.solve(target, seed=q).touching
        result = solver.solve(target, seed=q)
        branches = report.solve_all(target, seed=q)
        assert branches.touching is not None
        clear = [within and not pairs for within, pairs in zip(branches.within_limits, branches.touching, strict=True)]
        assert result.success == any(clear)
        if result.success:
            assert contact.touching(result.q) == []
            avoided += 1
        else:
            assert result.status is Status.IN_COLLISION
            assert result.touching
            refused += 1
    assert avoided > 3
    assert avoided + refused > 10


def test_batches_equal_single_solves(robot: Robot, rng: np.random.Generator) -> None:
    solver = IKSolver(robot)
    seeds_ = robot.sample(rng, 50)
    matrices = np.array([robot.forward_kinematics(q).homogeneous for q in robot.sample(rng, 50)])
    matrices[7, :3, 3] += 5.0
    done: list[int] = []
    batch = solver.solve_batch(matrices, seeds_, progress=done.append)
    threaded = solver.solve_batch(matrices, seeds_, workers=2)
    assert sum(done) == 50
    np.testing.assert_array_equal(batch.q, threaded.q)
    assert batch.success.sum() == 49
    assert batch.status[7] is Status.UNREACHABLE
    for index, (matrix, seed) in enumerate(zip(matrices, seeds_, strict=True)):
        single = solver.solve(matrix, seed)
        assert single.status is batch.status[index]
        np.testing.assert_allclose(single.q, batch.q[index], atol=1e-12)
    scaled, broken = matrices.copy(), matrices.copy()
    scaled[3, :3, :3] *= 1.1
    broken[4, 0, 0] = np.nan
    with pytest.raises(InvalidInputError, match=r"targets\[3\].*not a rotation"):
        solver.solve_batch(scaled)
    with pytest.raises(InvalidInputError, match=r"targets\[4\] must be finite"):
        solver.solve_batch(broken)


def test_a_frame_that_fewer_joints_move_goes_to_the_qp(robot: Robot) -> None:
    inner = IKSolver(robot, "link_4")
    result = inner.solve(robot.forward_kinematics(robot.home, "link_4"))
    assert result.method == "qp"
    assert "no closed form" in result.message
    with pytest.raises(StructureError, match="link_4") as error:
        inner.closed_form()
    assert not error.value.args[0].endswith(".")  # the advice of a status follows it as another sentence


def test_one_line(robot: Robot) -> None:
    target = jacokin.pose([0.35, -0.2, 0.4], down=True)
    result = jacokin.solve_ik(target).raise_for_status()
    np.testing.assert_allclose(robot.forward_kinematics(result.q).homogeneous, target.homogeneous, atol=1e-6)
    nearer = jacokin.pose([0.25, -0.15, 0.3], down=True)
    wrist = jacokin.solve_ik(nearer, "m1n6s200", frame="gripsite", tool=jacokin.pose([0, 0, 0.01]))
    assert wrist.success
    copy = pickle.loads(pickle.dumps(result))
    np.testing.assert_array_equal(copy.q, result.q)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("made", "solved"),
    [
        ("", "far, about_z, pose, pose.translation, far.translation"),
        ("collision='reject'", "far, about_z, pose, pose.translation"),
        pytest.param("method='qp'", "far, pose, pose.translation", marks=pytest.mark.slow),
        pytest.param("qp_solver='quadprog'", "far, about_z, pose, pose.translation", marks=pytest.mark.slow),
    ],
)
def test_no_solve_waits_for_an_import(made: str, solved: str) -> None:
    code = (
        "import sys, jacokin\n"
        "robot = jacokin.load_robot()\n"
        f"solver = jacokin.IKSolver(robot, {made})\n"
        "pose, far = robot.forward_kinematics(robot.home), jacokin.pose([3.0, 0.0, 0.0])\n"
        "about_z = jacokin.FreeAxis(pose, axis=(0, 0, 1))\n"
        "before = set(sys.modules)\n"
        f"for target in ({solved}):\n"
        "    solver.solve(target)\n"
        "    if 'qp' not in solver.method and not hasattr(target, 'shape'):\n"
        "        solver.solve(target, prefer='margin'), solver.solve_all(target)\n"
        "solver.solve_batch([pose, far])\n"
        "print(sorted(set(sys.modules) - before))\n"
    )
    done = python("-c", code)
    assert done.stdout == "[]\n"


def test_missing_branches_are_no_proof(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    from jacokin.ik.closed_form import ClosedForm
    from jacokin.ik.solutions.points import Points
    from jacokin.ik.verification import Verifier

    solve_rigid = ClosedForm.solve_rigid

    def full(self: ClosedForm, T: Array, seed: Array, verifier: Verifier | None = None) -> Points:
        found = solve_rigid(self, T, seed)
        assert found is not None
        return Points(found.rows, True, seed, verifier)

    monkeypatch.setattr(ClosedForm, "solve_rigid", full)
    solver = IKSolver(robot)
    for target in (jacokin.pose([0.15, -0.05, 0.1], down=True), jacokin.pose([0.75, 0.0, 0.4], down=True)):
        result = solver.solve(target, closest=False)
        assert result.status is Status.NO_CONVERGENCE
        assert "some may be missing" in result.message
    assert solver.solve(robot.forward_kinematics(robot.home)).success


def test_a_solver_shows_what_it_was_made_with(robot: Robot) -> None:
    assert repr(IKSolver(robot)) == "IKSolver('j2n6s300', frame='end_effector')"
    assert repr(IKSolver(robot, "pinchsite", collision="reject")).endswith("frame='pinchsite', collision='reject')")
    shown = repr(IKSolver(robot, scene=Scene([Floor(-0.2)]), clearance=0.01, tool=jacokin.pose([0.0, 0.0, 0.1])))
    assert shown.startswith("IKSolver('j2n6s300', frame='end_effector', tool=SE3(")
    assert shown.endswith(", scene=Scene(floor), clearance=0.01)")
