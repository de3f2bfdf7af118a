"""`ClosedForm` on a model: frames, tools and bases, limits, batches, threads, and models that are refused."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot, load_robot
from jacokin.arrays import Array
from jacokin.errors import StructureError
from jacokin.ik.closed_form import ClosedForm
from jacokin.kernels.branches import COLUMNS, WITHIN_LIMITS
from tests.kernels.closed_form.tools import closed_form, contains, target, worst_error
from tests.kernels.six_joints.arms import ARMS, chain_of_arm, form_of, poses_and_jacobians


def test_reported_errors_are_those_of_pinocchio(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    for q in robot.sample(rng, 50):
        T = target(robot, q)
        for branch in form.solve_all(T, robot.home).q:
            error = robot.forward_kinematics(branch).homogeneous - T
            assert np.abs(error).max() < 1e-12


@pytest.mark.parametrize("frame", ["link_6", "wristsite", "gripsite", "pinchsite", "hand", "link_finger_tip_2"])
def test_any_frame_on_the_last_link_and_a_tool(frame: str, robot: Robot, rng: np.random.Generator) -> None:
    tool = pin.SE3(pin.exp3(np.array([0.3, -0.8, 1.1])), np.array([0.03, -0.02, 0.15]))
    form = closed_form(robot, frame, tool)
    for q in robot.sample(rng, 50):
        T = np.ascontiguousarray((robot.forward_kinematics(q, frame) * tool).homogeneous)
        rows = form.solve_all(T, robot.home)
        assert contains(rows, q)
        assert worst_error(rows) < 1e-12


def test_joints_about_any_axis(robot: Robot, rng: np.random.Generator) -> None:
    """The same arm with every joint's own axes turned: the axes are read from the joints, not taken to be z."""
    turns = [pin.SE3.Identity(), *(pin.SE3(pin.exp3(rng.normal(size=3)), np.zeros(3)) for _ in range(6))]
    source, model = robot.pin_model, pin.Model()
    for i in range(1, 7):
        axis = turns[i].rotation.T @ np.array([0.0, 0.0, 1.0])
        model.addJoint(
            i - 1,
            pin.JointModelRevoluteUnaligned(*axis),
            turns[i - 1].inverse() * source.jointPlacements[i] * turns[i],
            source.names[i],
        )
    frame = source.frames[robot.frame_id()]
    frame_id = model.addFrame(
        pin.Frame(frame.name, 6, 0, turns[6].inverse() * frame.placement, pin.FrameType.OP_FRAME), False
    )
    form = ClosedForm(model, frame_id, None, robot.lower, robot.upper)
    for q in robot.sample(rng, 50):
        rows = form.solve_all(target(robot, q), robot.home)
        assert contains(rows, q)
        assert worst_error(rows) < 1e-12


def test_branches_are_ordered_and_unlimited_joints_are_near_the_seed(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    free = np.isinf(robot.upper)
    for q, seed in zip(robot.sample(rng, 200), robot.sample(rng, 200) + 20.0 * free, strict=True):
        rows = form.solve_all(target(robot, q), seed)
        assert np.all(np.diff(rows.distance) >= 0.0)
        np.testing.assert_allclose(rows.distance, np.linalg.norm(rows.q - seed, axis=1), rtol=1e-12)
        assert np.abs(rows.q - seed)[:, free].max() <= np.pi + 1e-9


def test_a_batch_is_the_nearest_branch_within_the_limits(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    targets = np.array([target(robot, q) for q in robot.sample(rng, 300)])
    targets[7, :3, 3] += 5.0  # [m], out of reach
    seeds = robot.sample(rng, 300)
    batch = form.solve_batch(targets, seeds)
    for i in range(300):
        rows = form.solve_all(targets[i], seeds[i])
        assert batch.branches[i] == len(rows)
        assert batch.branches_within_limits[i] == rows.within_limits.sum()
        if rows.within_limits.any():
            best = int(np.argmax(rows.within_limits))
        elif len(rows):
            best = int(np.argmax(rows.margin.min(axis=1)))
        else:
            assert np.isnan(batch.q[i]).all()
            assert not batch.within_limits[i]
            continue
        np.testing.assert_array_equal(batch.q[i], rows.q[best])
        assert batch.within_limits[i] == rows.within_limits[best]
        assert batch.largest_margin[i] == rows.margin.min(axis=1).max()
    assert np.isnan(batch.largest_margin[7])
    np.testing.assert_array_equal(form.solve_batch(targets, seeds, threads=2).rows, batch.rows)
    assert len(form.solve_batch(np.empty((0, 4, 4)), np.empty((0, 6)))) == 0


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "m1n6s300", "j2s6s300", "gen3_lite", "ur5", "puma", "xarm6"])
def test_the_nearest_alone_is_the_nearest_of_all(name: str, rng: np.random.Generator) -> None:
    """At random poses, singular ones, some at limits and some out of reach, from any seeds and from some nearby."""
    form = form_of(chain_of_arm(name)) if name in ARMS else closed_form(load_robot(name))
    lower, upper, _ = np.clip(form.constants[2], -2.0 * np.pi, 2.0 * np.pi)
    q = rng.uniform(np.maximum(lower, -np.pi), np.minimum(upper, np.pi), (240, 6))
    q[1::6] = np.round(q[1::6] / (np.pi / 4)) * np.pi / 4
    q[2::6] = np.where(rng.random((40, 6)) < 0.4, upper, q[2::6])
    T = np.ascontiguousarray(poses_and_jacobians(form.chain, q)[0])
    T[3::6, :3, 3] *= rng.uniform(0.9, 1.6, (40, 1))
    seeds = rng.uniform(np.maximum(lower, -np.pi), np.minimum(upper, np.pi), q.shape)
    seeds[::4] = q[::4] + 10.0 ** rng.uniform(-8.0, 0.0, (60, 1)) * rng.normal(size=(60, 6))
    seeds[100:140] = seeds[100]
    expected = form.solve_batch(T, seeds).rows[:, :COLUMNS]
    for threads in (1, 2):
        np.testing.assert_array_equal(form.solve_nearest(T, seeds, threads).rows, expected)
    nearest = form.nearest_branch()
    for i in range(0, 240, 8):
        nearest.T[:], nearest.seed[:] = T[i], seeds[i]
        found = nearest()
        assert (found is not None) == (expected[i, WITHIN_LIMITS] == 1.0)
        if found is not None:
            np.testing.assert_array_equal(found, expected[i, :6])
    assert len(form.solve_nearest(np.empty((0, 4, 4)), np.empty((0, 6)))) == 0


def _bent(robot: Robot, joint: int, move: pin.SE3) -> ClosedForm:
    model = robot.pin_model.copy()
    model.jointPlacements[joint] = model.jointPlacements[joint] * move
    return ClosedForm(model, robot.frame_id(), None, robot.lower, robot.upper)


SHIFTED = pin.SE3(np.eye(3), np.array([1e-3, 0.0, 0.0])), "must meet", 1e-3, "m"
TILTED = pin.SE3(pin.exp3(np.array([0.01, 0.0, 0.0])), np.zeros(3)), "parallel", 0.01, "rad"


@pytest.mark.parametrize(("joint", "change"), [(2, SHIFTED), (4, SHIFTED), (5, SHIFTED), (3, TILTED)])
def test_an_arm_with_a_shifted_or_tilted_axis_is_solved_as_any_other(
    joint: int, change: tuple[pin.SE3, str, float, str], robot: Robot
) -> None:
    move, why, misfit, unit = change
    form = _bent(robot, joint, move)
    assert form.other is not None
    assert why in str(form.other)
    assert form.other.axes == (f"joint_{joint - 1}", f"joint_{joint}")
    assert form.other.misfit == pytest.approx(misfit, rel=1e-3)
    assert form.other.unit == unit


def test_a_frame_off_the_last_link_is_refused(robot: Robot) -> None:
    with pytest.raises(StructureError, match="link_5"):
        closed_form(robot, "link_5")


def test_results_are_read_only(robot: Robot) -> None:
    rows = closed_form(robot).solve_all(target(robot, robot.home), robot.home)
    for array in (rows.q, rows.margin, rows.distance, rows.position_error):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_two_threads_share_a_form(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    targets: list[Array] = [target(robot, q) for q in robot.sample(rng, 400)]
    alone = [form.solve_all(T, robot.home).rows for T in targets]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda T: form.solve_all(T, robot.home).rows, targets))
    assert all(np.array_equal(a, b) for a, b in zip(alone, together, strict=True))


def test_wide_limits_take_the_copy_nearest_to_the_seed(robot: Robot, rng: np.random.Generator) -> None:
    lower, upper = np.full(6, -np.inf), np.full(6, np.inf)
    lower[3], upper[3] = -10.0, 10.0  # three turns
    lower[4] = 4.0  # one-sided
    form = ClosedForm(robot.pin_model, robot.frame_id(), None, lower, upper)
    for q in robot.sample(rng, 100):
        seed = np.array([0.0, 0.0, 0.0, 9.9, 0.0, 0.0])
        rows = form.solve_all(target(robot, q), seed)
        assert rows.within_limits.all()
        assert np.all(rows.q[:, 3] > 10.0 - 2.0 * np.pi)
        assert np.all((rows.q[:, 4] >= 4.0) & (rows.q[:, 4] < 4.0 + 2.0 * np.pi))


def test_results_do_not_change_when_the_next_pose_is_solved(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    first = form.solve_all(target(robot, robot.home), robot.home)
    before = first.rows.copy()
    form.solve_all(target(robot, robot.sample(rng)), robot.home)
    np.testing.assert_array_equal(first.rows, before)


def test_a_closed_form_can_be_pickled_after_use(robot: Robot) -> None:
    form = closed_form(robot)
    T = target(robot, robot.home)
    rows = form.solve_all(T, robot.home).rows
    copy = pickle.loads(pickle.dumps(form))
    np.testing.assert_array_equal(copy.solve_all(T, robot.home).rows, rows)
    assert (copy.spherical, copy.misfit) == (form.spherical, form.misfit)
