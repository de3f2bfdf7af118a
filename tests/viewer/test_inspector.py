"""What is shown for a target, without a browser: branches, the arm, and why."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.errors import UnknownNameError
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.solutions.points import Points
from jacokin.ik.verification import Verifier
from jacokin.viewer import Inspector, View, texts

TURNS = (-2 * np.pi, 0.0, 2 * np.pi)
FAR = jacokin.pose([2.0, 0.0, 0.3], down=True)


@pytest.fixture(scope="module")
def inspector(bundled: Callable[[str], Robot]) -> Inspector:
    return Inspector(IKSolver(bundled("j2n6s300"), collision="ignore"))


def reaches(inspector: Inspector, view: View) -> bool:
    return bool(pin.log6(inspector.pose_of(view.q).actInv(view.target)).vector @ np.ones(6) < 1e-6)


def outside(inspector: Inspector, rng: np.random.Generator) -> View:
    """A view with branches within the limits and others outside."""
    while True:
        target = inspector.robot.forward_kinematics(inspector.robot.sample(rng))
        view = inspector.at(target, inspector.robot.home)
        if 0 < view.within.sum() < len(view.branches):
            return view


def test_the_arm_is_at_the_nearest_feasible_branch(inspector: Inspector, rng: np.random.Generator) -> None:
    robot = inspector.robot
    for _ in range(50):
        target = robot.forward_kinematics(robot.sample(rng))
        view = inspector.at(target, robot.home)
        raw = inspector.solver.solve_all(target, robot.home)
        first = int(np.flatnonzero(raw.within_limits)[0])
        assert (view.status, view.selected) == (Status.OK, first)
        assert np.array_equal(view.q, raw.q[first])
        assert robot.within_limits(view.q)
        assert reaches(inspector, view)
        assert max(view.errors) < 1e-6
        assert len(view.ghosts) == len(raw) - 1
        assert first not in view.ghosts


@pytest.mark.parametrize("prefer", ["margin", "manipulability"])
def test_another_branch_may_be_preferred(robot: Robot, rng: np.random.Generator, prefer: str) -> None:
    inspector = Inspector(IKSolver(robot, collision="ignore"), prefer=prefer)
    different = 0
    for _ in range(20):
        view = inspector.at(robot.forward_kinematics(robot.sample(rng)), robot.home)
        assert view.selected is not None
        assert view.within[view.selected]
        good = view.branches[view.within]
        if prefer == "margin":
            values = np.minimum(good - robot.lower, robot.upper - good).min(axis=1)
            chosen = inspector.margin(view.q).min()
        else:
            values = np.array([robot.manipulability(q) for q in good])
            chosen = robot.manipulability(view.q)
        assert chosen == pytest.approx(values.max())
        different += view.selected != int(np.flatnonzero(view.within)[0])
    assert different
    with pytest.raises(UnknownNameError, match="nearest, margin, manipulability"):
        Inspector(inspector.solver, prefer="best")


def test_a_seven_joint_arm_shows_postures_of_its_family(bundled: Callable[[str], Robot]) -> None:
    robot = bundled("j2s7s300")
    inspector = Inspector(IKSolver(robot))
    for view in (inspector.posture(robot.home), inspector.at(robot.forward_kinematics(robot.home), robot.home)):
        assert (view.status, view.selected) == (Status.OK, 0)
        assert len(view.branches) > 10
        for branch in range(len(view.branches)):
            chosen = inspector.choose(view, branch)
            assert robot.within_limits(chosen.q)
            assert reaches(inspector, chosen)


def test_branches_outside_say_which_joint_and_by_how_much(inspector: Inspector, rng: np.random.Generator) -> None:
    robot = inspector.robot
    view = outside(inspector, rng)
    for branch in np.flatnonzero(~view.within):
        chosen = inspector.choose(view, int(branch))
        assert chosen.status is Status.OUTSIDE_LIMITS
        assert reaches(inspector, chosen)
        excess = dict(inspector.excess(chosen.q))
        assert excess
        for joint, name in enumerate(robot.joint_names):
            wanted = max(robot.lower[joint] - chosen.q[joint], chosen.q[joint] - robot.upper[joint], 0.0)
            assert excess.get(name, 0.0) == pytest.approx(wanted, abs=1e-15)
        assert np.array_equal(inspector.margin(chosen.q) < 0.0, [name in excess for name in robot.joint_names])
    back = inspector.choose(view, int(view.ghosts[0]) if view.selected is None else view.selected)
    assert back.status is Status.OK


def test_out_of_reach_the_arm_waits_and_then_goes_to_the_closest_configuration(inspector: Inspector) -> None:
    home = inspector.robot.home
    waiting = inspector.at(FAR, home)
    assert (waiting.status, waiting.pending, waiting.selected) == (Status.UNREACHABLE, True, None)
    assert np.array_equal(waiting.q, home)
    closest = inspector.closest(waiting)
    assert (closest.status, closest.pending, closest.selected) == (Status.UNREACHABLE, False, None)
    assert inspector.robot.within_limits(closest.q)
    assert closest.errors[0] < waiting.errors[0]
    reached = inspector.pose_of(closest.q).translation
    assert closest.errors[0] == pytest.approx(float(np.linalg.norm(FAR.translation - reached)), abs=1e-9)


@pytest.mark.parametrize(
    ("branches", "dropped", "status"),
    [
        ("outside", True, Status.OK),
        ("outside", False, Status.OUTSIDE_LIMITS),
        ("none", True, Status.OK),
    ],
)
def test_the_status_is_the_solvers_also_where_branches_are_missing(
    inspector: Inspector,
    monkeypatch: pytest.MonkeyPatch,
    rng: np.random.Generator,
    branches: str,
    dropped: bool,
    status: Status,
) -> None:
    """A table of the closed form that was full does not prove that no branch is missing: it is looked for otherwise."""
    solve_rigid = ClosedForm.solve_rigid

    def cut(form: ClosedForm, T: Array, seed: Array, verifier: Verifier | None = None) -> Points:
        table = solve_rigid(form, T, seed, verifier)
        assert table is not None
        kept = ~table.within_limits if branches == "outside" else np.zeros(len(table), dtype=bool)
        return Points(table.rows[kept].copy(), dropped, seed, verifier)

    target = outside(inspector, rng).target
    monkeypatch.setattr(ClosedForm, "solve_rigid", cut)
    view = inspector.at(target, inspector.robot.home)
    answer = inspector.solver.solve(target, inspector.robot.home, closest=False)
    assert answer.status is status
    assert (view.status, view.message, view.pending) == (status, answer.message, not answer.success)
    np.testing.assert_array_equal(view.q, answer.q)
    assert answer.success or answer.message in texts.headline(inspector, view)
    assert inspector.closest(view).status in (status, Status.OK)  # which finds what was cut


def test_a_branch_that_misses_the_tolerances_is_not_reached(robot: Robot) -> None:
    """Rounding is more than such tolerances allow: the viewer says so, as the solver does."""
    inspector = Inspector(IKSolver(robot, position_tolerance=1e-30, orientation_tolerance=1e-30))
    target = jacokin.pose([0.3, -0.3, 0.45], down=True)
    view = inspector.at(target, robot.home)
    assert view.within.any()
    assert view.status is inspector.solver.solve(target, robot.home, closest=False).status is Status.NO_CONVERGENCE


def test_the_target_follows_the_joints(inspector: Inspector, rng: np.random.Generator) -> None:
    for _ in range(30):
        q = inspector.robot.sample(rng)
        view = inspector.posture(q)
        assert view.status is Status.OK
        assert np.array_equal(view.q, q)
        assert view.target.isApprox(inspector.pose_of(q), 1e-12)
        assert view.selected is not None
        assert np.abs(view.branches[view.selected] - q).max() < 1e-6


def test_joints_stop_at_their_limits(inspector: Inspector) -> None:
    robot = inspector.robot
    view = inspector.posture(np.full(6, 100.0))
    assert robot.within_limits(view.q)
    assert view.q[1] == robot.upper[1]


def test_places_are_those_of_forward_kinematics(inspector: Inspector, rng: np.random.Generator) -> None:
    robot = inspector.robot
    configurations = robot.sample(rng, 5)
    places = inspector.places(configurations)
    assert places.positions.shape == (5, 7, 3)
    for row, q in enumerate(configurations):
        for part in range(1, 7):
            link = robot.forward_kinematics(q, f"link_{part}")
            frame = robot.pin_model.frames[robot.frame_id(f"link_{part}")].placement
            w, x, y, z = (float(value) for value in places.wxyzs[row, part])
            place = pin.SE3(pin.Quaternion(w, x, y, z).normalized(), places.positions[row, part].astype(np.float64))
            assert (place * frame).isApprox(link, 1e-6)


def test_contact_that_is_looked_for_counts(bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = bundled("j2n6s300")
    watching = Inspector(IKSolver(robot, collision="reject"))
    touched = 0
    for _ in range(60):
        view = watching.at(robot.forward_kinematics(robot.sample(rng)), robot.home)
        assert view.touching is not None
        assert np.array_equal(view.feasible, view.within & np.array([not pairs for pairs in view.touching]))
        for branch in np.flatnonzero(view.within & ~view.feasible):
            chosen = watching.choose(view, int(branch))
            assert chosen.status is Status.IN_COLLISION
            assert chosen.arm_touching == view.touching[branch] != ()
            touched += 1
        assert (view.selected is None) == (not view.feasible.any())
    assert touched


def test_the_ellipsoid_is_how_fast_the_tool_can_move(robot: Robot, rng: np.random.Generator) -> None:
    tool = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([0.0, 0.05, 0.1]))
    for inspector in (Inspector(IKSolver(robot)), Inspector(IKSolver(robot, tool=tool))):
        q = robot.sample(rng)
        lengths, directions = inspector.ellipsoid(q)
        assert np.linalg.det(directions) == pytest.approx(1.0)
        rates = rng.normal(size=(2000, 6))
        rates /= np.linalg.norm(rates, axis=1)[:, None]
        step = 1e-6
        start = inspector.pose_of(q).translation
        moved = np.array([(inspector.pose_of(q + step * rate).translation - start) / step for rate in rates])
        inside = ((moved @ directions / lengths) ** 2).sum(axis=1)
        assert inside.max() <= 1.0 + 1e-4
        assert np.abs(moved @ directions[:, 0]).max() > 0.9 * lengths[0]


@pytest.mark.one_quick
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_free_axis_is_taken_where_the_arm_has_least_to_move(
    inspector: Inspector, rng: np.random.Generator, axis: int
) -> None:
    robot = inspector.robot
    for _ in range(4):
        pose = inspector.pose_of(robot.sample(rng))
        view = inspector.turned(pose, axis, robot.home)
        assert view.free is not None
        assert view.status is Status.OK
        turned = pose.rotation.T @ inspector.pose_of(view.q).rotation
        assert turned[:, axis] == pytest.approx(np.eye(3)[axis], abs=1e-6)
        assert inspector.pose_of(view.q).translation == pytest.approx(pose.translation, abs=1e-6)
        for angle in np.linspace(-3.0, 3.0, 13):
            other = inspector.turned(pose, axis, robot.home, float(angle))
            assert other.free is not None
            assert other.free.value == angle
            reached = any(start <= angle + turn <= stop for start, stop in other.free.intervals for turn in TURNS)
            assert reached == (other.status is Status.OK)
            if other.status is Status.OK:
                assert distance(robot, other.q) >= distance(robot, view.q) - 1e-6


def distance(robot: Robot, q: Array) -> float:
    """From home [rad], circular on joints without limits."""
    away = q - robot.home
    return float(np.linalg.norm(np.where(robot.unlimited, (away + np.pi) % (2 * np.pi) - np.pi, away)))


def test_a_tool_after_the_frame_counts(robot: Robot) -> None:
    tool = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([0.0, 0.05, 0.1]))
    inspector = Inspector(IKSolver(robot, tool=tool))
    view = inspector.posture(robot.home)
    assert view.target.isApprox(robot.forward_kinematics(robot.home) * tool, 1e-12)
    assert reaches(inspector, inspector.at(view.target, robot.home))


def test_a_solver_without_a_closed_form_has_one_answer(robot: Robot) -> None:
    inspector = Inspector(IKSolver(robot, "end_effector", method="qp"))
    assert inspector.solver.dimension() is None
    view = inspector.posture(robot.home)
    assert view.status is Status.OK
    moved = view.target * pin.SE3(np.eye(3), np.array([0.02, 0.0, 0.0]))
    answer = inspector.at(moved, robot.home)
    assert answer.status is Status.OK
    assert robot.within_limits(answer.q)
    assert max(answer.errors) < 1e-5


def test_a_pose_that_is_reached_only_within_the_tolerances_is_shown(inspector: Inspector) -> None:
    """The arm stretched upwards, and a target farther up by less than the tolerances: no branch reaches it."""
    robot = inspector.robot
    q = np.array([1.0, np.pi, np.pi, 0.3, np.pi, 0.7])
    target = inspector.pose_of(q)
    ways = np.linalg.svd(robot.jacobian(q))[0][:, 5]
    for side in (1.0, -1.0):
        moved = pin.SE3(pin.exp3(side * 5e-7 * ways[3:]) @ target.rotation, target.translation + side * 5e-7 * ways[:3])
        view = inspector.at(moved, robot.home)
        assert view.status is Status.OK
        assert max(view.errors) <= 1e-6
