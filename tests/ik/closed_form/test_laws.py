"""Laws of the closed form: every branch closes, none is missing, none twice, limits are exact."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import StructureError
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.geometry import measure
from jacokin.kernels import chain as kernels_chain
from jacokin.kernels.compiled.loading import warmup
from tests.ik.closed_form.tools import (
    brute_force,
    circular,
    closed_form,
    closest_pair,
    contains,
    target,
    worst_error,
)

FAMILY = ("j2n6s300", "j2n6s200", "j2s6s300", "j2s6s200", "m1n6s300", "m1n6s200")


@pytest.fixture(scope="module", autouse=True)
def compiled() -> None:
    warmup()


@pytest.mark.parametrize("name", FAMILY)
def test_every_branch_closes_and_the_generating_one_is_among_them(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    form = closed_form(robot)
    assert form.spherical == name.startswith("j2s")
    assert form.misfit < 1e-12
    for q in robot.sample(rng, 1500):
        rows = form.solve_all(target(robot, q), robot.home)
        assert contains(rows, q)
        assert worst_error(rows) < 1e-12
        assert closest_pair(rows) > 1e-6
        assert len(rows) <= 16
        assert not rows.singular.any()


def test_reported_errors_are_those_of_pinocchio(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    for q in robot.sample(rng, 50):
        T = target(robot, q)
        for branch in form.solve_all(T, robot.home).q:
            error = robot.forward_kinematics(branch).homogeneous - T
            assert np.abs(error).max() < 1e-12


@pytest.mark.slow
def test_the_chain_is_pinocchio_s(bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    for name in FAMILY[::2]:
        robot = bundled(name)
        tool = pin.exp6(rng.normal(size=6))
        geometry = measure(robot.pin_model, robot.frame_id(), tool)
        for q in robot.sample(rng, 34_000):
            x, y, z, p = kernels_chain.forward(geometry.chain, q)
            reached = robot.forward_kinematics(q) * tool
            assert np.abs(np.column_stack([x, y, z]) - reached.rotation).max() < 1e-13
            assert np.abs(p - reached.translation).max() < 1e-13


def test_the_branches_are_those_of_a_brute_force_search(
    bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    for name in ("j2n6s300", "j2s6s300"):
        robot = bundled(name)
        form = closed_form(robot)
        down = jacokin.pose([0.25, -0.3, 0.15], down=True).homogeneous
        for T in [*(target(robot, q) for q in robot.sample(rng, 3)), np.ascontiguousarray(down)]:
            rows = form.solve_all(T, robot.home)
            found = brute_force(robot, T, rng, 150)
            assert len(found) == len(rows)
            assert all(contains(rows, q, 1e-5) for q in found)


@pytest.mark.parametrize("frame", ["link_6", "wristsite", "gripsite", "pinchsite", "hand", "link_finger_tip_2"])
def test_any_frame_on_the_last_link_and_a_tool(frame: str, robot: Robot, rng: np.random.Generator) -> None:
    tool = pin.SE3(pin.exp3(np.array([0.3, -0.8, 1.1])), np.array([0.03, -0.02, 0.15]))
    form = closed_form(robot, frame, tool)
    for q in robot.sample(rng, 50):
        T = np.ascontiguousarray((robot.forward_kinematics(q, frame) * tool).homogeneous)
        rows = form.solve_all(T, robot.home)
        assert contains(rows, q)
        assert worst_error(rows) < 1e-12


def test_a_posed_base_has_the_same_joints(robot: Robot, rng: np.random.Generator) -> None:
    base = pin.SE3(pin.exp3(np.array([0.4, 1.2, -0.7])), np.array([1.5, -0.4, 0.8]))
    model = robot.pin_model.copy()
    model.jointPlacements[1] = base * model.jointPlacements[1]
    moved = ClosedForm(model, robot.frame_id(), None, robot.lower, robot.upper)
    still = closed_form(robot)
    for q in robot.sample(rng, 100):
        T = target(robot, q)
        there = moved.solve_all(np.ascontiguousarray(base.homogeneous @ T), robot.home)
        here = still.solve_all(T, robot.home)
        assert len(there) == len(here)
        assert all(contains(there, branch, 1e-5) for branch in here.q)


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


@settings(max_examples=60, deadline=None)
@given(turns=st.lists(st.integers(-3, 3), min_size=4, max_size=4), number=st.integers(0, 10_000))
def test_full_turns_of_the_seed_change_only_the_copies(turns: list[int], number: int) -> None:
    robot = jacokin.load_robot()
    form = closed_form(robot)
    rng = np.random.default_rng(number)
    q, seed = robot.sample(rng, 2)
    shift = np.zeros(6)
    shift[np.isinf(robot.upper)] = 2.0 * np.pi * np.array(turns)
    here, there = form.solve_all(target(robot, q), seed), form.solve_all(target(robot, q), seed + shift)
    np.testing.assert_allclose(there.q - here.q, np.broadcast_to(shift, here.q.shape), atol=1e-12)


def test_the_seed_s_own_pose_returns_the_seed(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    regular = [q for q in robot.sample(rng, 500) if robot.singular_values(q)[-1] > 1e-3]
    assert len(regular) > 400
    for q in regular:
        assert np.abs(form.solve_all(target(robot, q), q).q[0] - q).max() < 1e-9


def test_limits_are_exact_and_margins_say_by_how_much(robot: Robot, rng: np.random.Generator) -> None:
    form = closed_form(robot)
    for q in robot.sample(rng, 300):
        rows = form.solve_all(target(robot, q), q)
        inside = np.all((rows.q >= robot.lower) & (rows.q <= robot.upper), axis=1)
        np.testing.assert_array_equal(rows.within_limits, inside)
        np.testing.assert_array_equal(rows.margin, np.minimum(rows.q - robot.lower, robot.upper - rows.q))
        assert inside.any()


@pytest.mark.parametrize("joint", [1, 2])
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_joint_on_its_limit_counts_as_within_and_one_past_it_does_not(
    joint: int, side: str, robot: Robot, rng: np.random.Generator
) -> None:
    form = closed_form(robot)
    limit = getattr(robot, side)[joint]
    outward = -1.0 if side == "lower" else 1.0
    regular = 0
    for q in robot.sample(rng, 100):
        for past, within in ((0.0, True), (5e-10, True), (3e-9, False), (1e-3, False)):
            q[joint] = limit + outward * past
            nearest = form.solve_all(target(robot, q), q)
            index = int(np.argmin(circular(nearest.q, q)))
            assert circular(nearest.q[index], q) < 1e-6
            if robot.singular_values(q)[-1] < 1e-2:
                continue  # rounding of the target moves such a branch by more than the snap
            regular += 1
            assert nearest.within_limits[index] == within
            if within:
                assert nearest.q[index, joint] == pytest.approx(limit, abs=1e-12)
            else:
                assert nearest.margin[index, joint] == pytest.approx(-past, abs=1e-11)
    assert regular > 200  # of 400


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


@pytest.mark.parametrize("distance", [2.0, 1e3, 1e9, 1e200])
def test_far_targets_have_no_branches(distance: float, robot: Robot) -> None:
    T = np.eye(4)
    T[0, 3] = distance  # [m]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(closed_form(robot).solve_all(T, robot.home)) == 0


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


def _bent(robot: Robot, joint: int, move: pin.SE3) -> ClosedForm:
    model = robot.pin_model.copy()
    model.jointPlacements[joint] = model.jointPlacements[joint] * move
    return ClosedForm(model, robot.frame_id(), None, robot.lower, robot.upper)


@pytest.mark.parametrize(
    ("joint", "axis", "pair"),
    [(2, 0, ("joint_1", "joint_2")), (4, 0, ("joint_3", "joint_4")), (5, 0, ("joint_4", "joint_5"))],
)
def test_a_shifted_axis_is_refused_by_name(joint: int, axis: int, pair: tuple[str, str], robot: Robot) -> None:
    shift = pin.SE3(np.eye(3), 1e-3 * np.eye(3)[axis])
    with pytest.raises(StructureError, match="must meet") as caught:
        _bent(robot, joint, shift)
    assert caught.value.axes == pair
    assert caught.value.misfit == pytest.approx(1e-3, rel=1e-3)
    assert "method='qp'" in str(caught.value)


def test_a_tilted_axis_is_refused(robot: Robot) -> None:
    with pytest.raises(StructureError, match="parallel") as caught:
        _bent(robot, 3, pin.SE3(pin.exp3(np.array([0.01, 0.0, 0.0])), np.zeros(3)))
    assert caught.value.axes == ("joint_2", "joint_3")
    assert caught.value.misfit == pytest.approx(0.01, rel=1e-3)
    assert caught.value.unit == "rad"


def test_a_frame_off_the_last_link_is_refused(robot: Robot) -> None:
    with pytest.raises(StructureError, match="link_5"):
        closed_form(robot, "link_5")


@pytest.mark.parametrize("name", ["j2n6s300", "m1n6s300", "j2s6s300"])
def test_a_model_with_rounded_numbers_is_polished(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    model = robot.pin_model.copy()
    for i in range(1, 7):
        turn = pin.exp3(3e-7 * rng.normal(size=3))
        model.jointPlacements[i] = model.jointPlacements[i] * pin.SE3(turn, 1e-8 * rng.normal(size=3))
    form = ClosedForm(model, robot.frame_id(), None, robot.lower, robot.upper)
    assert 1e-8 < form.misfit < 1e-5
    data, regular = model.createData(), 0
    for q in robot.sample(rng, 500):
        pin.framesForwardKinematics(model, data, q)
        if np.linalg.svd(pin.computeFrameJacobian(model, data, q, robot.frame_id()))[1][-1] < 1e-3:
            continue
        regular += 1
        rows = form.solve_all(np.ascontiguousarray(data.oMf[robot.frame_id()].homogeneous), q)
        assert contains(rows, q)
        assert worst_error(rows) < 1e-10
    assert regular > 400


def test_results_are_read_only(robot: Robot) -> None:
    rows = closed_form(robot).solve_all(target(robot, robot.home), robot.home)
    for array in (rows.q, rows.margin, rows.distance, rows.position_error):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0.0


def test_two_threads_share_a_form(robot: Robot, rng: np.random.Generator) -> None:
    from concurrent.futures import ThreadPoolExecutor

    form = closed_form(robot)
    targets: list[Array] = [target(robot, q) for q in robot.sample(rng, 400)]
    alone = [form.solve_all(T, robot.home).rows for T in targets]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda T: form.solve_all(T, robot.home).rows, targets))
    assert all(np.array_equal(a, b) for a, b in zip(alone, together, strict=True))
