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
from jacokin.ik.closed_form import ClosedForm
from tests.kernels.closed_form.tools import (
    brute_force,
    circular,
    closed_form,
    closest_pair,
    contains,
    sizes,
    target,
    worst_error,
)

FAMILY = ("j2n6s300", "j2n6s200", "j2s6s300", "j2s6s200", "m1n6s300", "m1n6s200")


@pytest.mark.parametrize("name", FAMILY)
@pytest.mark.parametrize("number", sizes(200, 1500))
def test_every_branch_closes_and_the_generating_one_is_among_them(
    number: int, name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    form = closed_form(robot)
    assert form.spherical == name.startswith("j2s")
    assert form.misfit < 1e-12
    for q in robot.sample(rng, number):
        rows = form.solve_all(target(robot, q), robot.home)
        assert contains(rows, q)
        assert worst_error(rows) < 1e-12
        assert closest_pair(rows) > 1e-6
        assert len(rows) <= 16
        assert not rows.singular.any()


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


@pytest.mark.slow
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
    assert len(regular) > 450
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
        assert rows.complete
        np.testing.assert_array_equal(rows.q_within_limits, rows.q[inside])


@pytest.mark.parametrize("joint", [1, 2])
@pytest.mark.parametrize("side", ["lower", "upper"])
def test_a_joint_on_its_limit_counts_as_within_and_one_past_it_does_not(
    joint: int, side: str, robot: Robot, rng: np.random.Generator
) -> None:
    form = closed_form(robot)
    limit = getattr(robot, side)[joint]
    outward = -1.0 if side == "lower" else 1.0
    checked = 0
    for q in robot.sample(rng, 100):
        for past, within in ((0.0, True), (5e-10, True), (3e-9, False), (1e-3, False)):
            q[joint] = limit + outward * past
            nearest = form.solve_all(target(robot, q), q)
            index = int(np.argmin(circular(nearest.q, q)))
            assert circular(nearest.q[index], q) < 1e-6
            if robot.singular_values(q)[-1] < 1e-2:
                continue  # rounding of the target moves such a branch by more than the snap
            checked += 1
            assert nearest.within_limits[index] == within
            if within:
                assert nearest.q[index, joint] == pytest.approx(limit, abs=1e-12)
            else:
                assert nearest.margin[index, joint] == pytest.approx(-past, abs=1e-11)
    assert checked > 200


@pytest.mark.parametrize("distance", [2.0, 1e3, 1e9, 1e200])
def test_far_targets_have_no_branches(distance: float, robot: Robot) -> None:
    T = np.eye(4)
    T[0, 3] = distance  # [m]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(closed_form(robot).solve_all(T, robot.home)) == 0


@pytest.mark.parametrize("name", ["j2n6s300", "m1n6s300", "j2s6s300"])
@pytest.mark.parametrize("number", sizes(100, 500))
def test_a_model_with_rounded_numbers_is_polished(
    number: int, name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    model = robot.pin_model.copy()
    for i in range(1, 7):
        turn = pin.exp3(3e-7 * rng.normal(size=3))
        model.jointPlacements[i] = model.jointPlacements[i] * pin.SE3(turn, 1e-8 * rng.normal(size=3))
    form = ClosedForm(model, robot.frame_id(), None, robot.lower, robot.upper)
    assert 1e-8 < form.misfit < 1e-5
    data = model.createData()
    checked = 0
    for q in robot.sample(rng, number):
        pin.framesForwardKinematics(model, data, q)
        if np.linalg.svd(pin.computeFrameJacobian(model, data, q, robot.frame_id()))[1][-1] < 1e-3:
            continue
        checked += 1
        rows = form.solve_all(np.ascontiguousarray(data.oMf[robot.frame_id()].homogeneous), q)
        assert contains(rows, q)
        assert worst_error(rows) < 1e-10
