"""Every branch of arms of many structures, against Newton's method from thousands of random starts."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin.arrays import Array
from jacokin.ik.geometry import chain_of
from jacokin.kernels.branches import COLUMNS, MAX_BRANCHES, PoseQuery
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.closed_form.pose import make_work
from jacokin.kernels.six_joints.pose import branches_of_labelling
from tests.kernels.six_joints.arms import (
    ARMS,
    chain_of_arm,
    distance,
    form_of,
    lost,
    perturbed,
    pose_at,
    poses_and_jacobians,
    round_angles,
    smallest_singular_value,
)

HOME = np.zeros(6)


def jaco(name: str) -> Array:
    robot = jacokin.load_robot(name)
    return chain_of(robot.pin_model, robot.frame_id(robot.default_frame), None, 6)


def structured(rng: np.random.Generator, count: int) -> Array:
    """Configurations of whole eighths of a turn, exactly and nearly: poses that people give."""
    q = np.round(rng.uniform(-np.pi, np.pi, (count, 6)) / (np.pi / 4)) * (np.pi / 4)
    q[::2] += 1e-3 * rng.normal(size=q[::2].shape)
    return q


def check_own(chain: Array, q: Array) -> None:
    """Each configuration is among the branches of its pose, or one so near that the pose cannot tell them apart."""
    form = form_of(chain)
    for row in q:
        T = pose_at(chain, row)
        branches = form.solve_all(T, row)
        closures = np.abs(poses_and_jacobians(chain, branches.q)[0] - T).max(axis=(1, 2))
        regular = [smallest_singular_value(chain, branch) > 1e-3 for branch in branches.q]
        assert closures.max() < 2e-9
        assert closures[regular].max(initial=0.0) < 1e-12
        nearest = min(distance(row, other) for other in branches.q)
        assert nearest < 1e-6 or smallest_singular_value(chain, row) < 1e-3


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ARMS)
def test_the_configuration_a_pose_was_made_from_is_found(name: str, rng: np.random.Generator) -> None:
    chain = chain_of_arm(name)
    check_own(chain, np.concatenate([rng.uniform(-np.pi, np.pi, (40, 6)), structured(rng, 10)]))


@pytest.mark.one_quick
@pytest.mark.parametrize("sigma", [1e-9, 1e-6, 1e-4, 5e-3])
def test_a_jaco_that_is_not_quite_one(sigma: float, rng: np.random.Generator) -> None:
    chain = perturbed(jaco("j2n6s300"), sigma)
    check_own(chain, rng.uniform(-np.pi, np.pi, (30, 6)))


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["ur5", "xarm6"])
def test_no_branch_of_brute_force_is_missing(name: str, rng: np.random.Generator) -> None:
    chain = chain_of_arm(name)
    form = form_of(chain)
    T = pose_at(chain, rng.uniform(-np.pi, np.pi, 6))
    assert lost(chain, form.solve_all(T, HOME).q, T) == []


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.0, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("name", [*ARMS, "j2n6s300", "j2s6s300"])
def test_no_branch_of_brute_force_is_missing_from_any_arm(name: str, sigma: float, rng: np.random.Generator) -> None:
    chain = perturbed(chain_of_arm(name) if name in ARMS else jaco(name), sigma)
    form = form_of(chain)
    for number, q in enumerate(rng.uniform(-np.pi, np.pi, (3, 6))):
        T = pose_at(chain, q)
        assert lost(chain, form.solve_all(T, HOME).q, T, seed=number) == []


def check_honest(chain: Array, q: Array, starts: int) -> int:
    """No regular branch is missing where none is said to be; returns at how many poses (n, 6) nothing is."""
    form, sure = form_of(chain), 0
    for number, row in enumerate(q):
        T = pose_at(chain, row)
        branches = form.solve_all(T, HOME)
        if branches.complete:
            sure += 1
            assert lost(chain, branches.q, T, starts=starts, seed=number) == [], row
    return sure


#: Configurations with regular branches beside nearly singular ones, where neighbours hide several of them.
CROWDED = {
    "xarm6": [179.9994, 1e-4, -179.9997, -179.9999, 2e-4, 89.9998],  # [deg]
    "crx": [-89.999999625, -179.999999775, -1.169e-7, -3.515e-7, -2.38e-7, 2.2e-7],
    "industrial": [-90.0003, -89.9998, 1e-4, -180.0002, -1e-4, 179.9999],
}


@pytest.mark.one_quick
@pytest.mark.parametrize("name", CROWDED)
def test_complete_is_not_said_where_neighbours_hide_a_branch(name: str) -> None:
    check_honest(chain_of_arm(name), np.radians([CROWDED[name]]), 1000)


def test_complete_is_not_said_where_three_roots_are_one_to_rounding() -> None:
    """Branches 1e-6 rad from each other in the joint that is solved for, far apart in others."""
    check_honest(perturbed(chain_of_arm("puma"), 1e-7), np.radians([[-90.0, -90.0, 90.0, 180.0, -90.0, 30.0]]), 1000)


@pytest.mark.slow
def test_branches_of_two_degeneracies_that_share_a_joint_angle(rng: np.random.Generator) -> None:
    """Axis 4 of a Gen3 lite along axis 1 and axis 3 along axis 5: two pairs of branches have one q6."""
    chain = chain_of_arm("gen3 lite")
    form = form_of(chain)
    for number in range(12):
        q = rng.uniform(-np.pi, np.pi, 6)
        q[2], q[3] = q[1] + np.pi * (number % 2), np.pi * (number // 2 % 2)
        T = pose_at(chain, q)
        branches = form.solve_all(T, HOME)
        at_q6 = np.abs((branches.q[:, 5] - q[5] + np.pi) % (2.0 * np.pi) - np.pi) < 1e-6
        assert at_q6.sum() == 3  # of four, one stands for two degeneracies
        assert lost(chain, branches.q, T, starts=200, seed=number) == []


def test_complete_is_said_of_nearly_all_poses(rng: np.random.Generator) -> None:
    """Random ones: doubt that is always there would be honest, too, and of no use."""
    for name in ("crx", "ur5", "xarm6", "generic"):
        chain = chain_of_arm(name)
        form = form_of(chain)
        q = rng.uniform(-np.pi, np.pi, (100, 6))
        assert sum(form.solve_all(pose_at(chain, row), HOME).complete for row in q) >= 97


@pytest.mark.slow
@pytest.mark.parametrize("name", ["crx", "ur5", "puma", "gen3 lite", "xarm6", "industrial"])
def test_complete_is_never_wrong_at_round_angles(name: str, rng: np.random.Generator) -> None:
    assert check_honest(chain_of_arm(name), round_angles(rng, 40, -9.0), 200) > 20


@pytest.mark.parametrize("name", ["crx", "ur5", "puma", "xarm6", "gen3 lite"])
def test_a_singular_configuration_is_among_the_branches_or_these_are_in_doubt(
    name: str, rng: np.random.Generator
) -> None:
    """Branches that meet in one are apart of a neighbour, or of the one that is moved the opposite way."""
    chain, missed, sure = chain_of_arm(name), 0, 0
    form = form_of(chain)
    for q in rng.integers(-4, 5, (800, 6)) * (np.pi / 4):
        found = form.solve_all(pose_at(chain, q), HOME)
        sure += found.complete
        missed += found.complete and min((distance(q, row) for row in found.q), default=np.inf) > 1e-4
    assert missed == 0
    assert sure > 400


@pytest.mark.parametrize(
    "degrees",
    [
        [-180, -90, 90, 45, -180, 0],
        [-180, 45, 90, -45, -45, 0],
        [90, -180, 90, 45, 45, -180],
        [180, -30, 90, -30, -90, -150],
    ],
)
def test_a_continuum_that_no_neighbour_has_is_found(degrees: list[float]) -> None:
    """Along it joints 1, 2, 4 and 5 of a CRX turn; what remains of a neighbour's closure there has one sign."""
    chain, q = chain_of_arm("crx"), np.radians(degrees)
    found = form_of(chain).solve_all(pose_at(chain, q), HOME)
    assert found.singular.any()
    assert not found.complete
    assert len(found) <= 16
    np.testing.assert_allclose([pose_at(chain, row) for row in found.q], [pose_at(chain, q)] * len(found), atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [1e-9, 1e-7, 1e-5, 5e-3])
def test_complete_is_never_wrong_on_a_jaco_that_is_not_quite_one(sigma: float, rng: np.random.Generator) -> None:
    assert check_honest(perturbed(jaco("j2n6s300"), sigma), round_angles(rng, 40, -9.0), 200) > 18


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["xarm6", "offset wrist", "generic"])
def test_random_poses_need_no_neighbour(name: str, rng: np.random.Generator) -> None:
    """Which takes as long as the arm itself, or longer."""
    form, work = form_of(chain_of_arm(name)), make_work(np.empty((MAX_BRANCHES, COLUMNS)))
    arm, in_doubt = unpack_arm(form.arm).six, 0
    for q in rng.uniform(-np.pi, np.pi, (20, 6)):
        query = PoseQuery(form.chain, form.constants[2], pose_at(form.chain, q), HOME)
        work.branches.filled[0] = work.branches.fold.filled[0] = 0
        in_doubt += branches_of_labelling(arm.scale, arm.own, -1, query, work.six, work.branches)
        assert (
            distance(q, min(work.branches.rows[: work.branches.filled[0], :6], key=lambda row: distance(q, row))) < 1e-6
        )
    assert in_doubt <= 1


def test_more_branches_than_eight_where_the_structure_gives_them(rng: np.random.Generator) -> None:
    """A UR5 has eight at most, a CRX sixteen (Abbes and Poisson, 2024, count up to 16)."""
    counts = {}
    for name in ("ur5", "crx"):
        chain = chain_of_arm(name)
        form = form_of(chain)
        q = rng.uniform(-np.pi, np.pi, (60, 6))
        counts[name] = max(len(form.solve_all(pose_at(chain, row), HOME)) for row in q)
    assert counts["ur5"] == 8
    assert 8 < counts["crx"] <= 16


def test_a_straight_wrist_is_a_continuum_with_its_member_at_the_seed(rng: np.random.Generator) -> None:
    chain = chain_of_arm("puma")
    form = form_of(chain)
    for q in rng.uniform(-2.0, 2.0, (5, 6)):
        q[4] = 0.0
        seed = q + np.array([0.0, 0.0, 0.0, 0.7, 0.0, -0.7])  # joints 4 and 6 turn the same axis
        branches = form.solve_all(pose_at(chain, q), seed)
        assert branches.singular.any()
        assert not branches.complete
        assert min(distance(seed, other) for other in branches.q) < 1e-6


@pytest.mark.parametrize("name", ["gen3_6dof", "puma"])
def test_complete_is_not_wrong_where_a_straight_wrist_nearly_is_a_continuum(
    name: str, rng: np.random.Generator
) -> None:
    """Axes 4 and 6 of a Gen3 miss each other by 0.35 mm: branches there are singular ones, which no neighbour has."""
    chain = jaco(name) if name not in ARMS else perturbed(chain_of_arm(name), 2e-4)
    form, sure = form_of(chain), 0
    for number in range(40):
        q = rng.uniform(-np.pi, np.pi, 6)
        q[4] = 0.0
        if number % 2:  # the tool vertical
            q[2] = q[1] + np.pi * (number % 4 > 1)
        branches = form.solve_all(pose_at(chain, q), HOME)
        closures = np.abs(poses_and_jacobians(chain, branches.q)[0] - pose_at(chain, q)).max(axis=(1, 2))
        assert closures.max() < 2e-9
        sure += branches.complete
        # Two of them may be so near to each other that the pose hardly tells them apart.
        assert not branches.complete or min(distance(q, other) for other in branches.q) < 5e-3
    assert sure > 20


def test_a_pose_out_of_reach_has_no_branch() -> None:
    T = np.eye(4)
    T[:3, 3] = 5.0, 0.0, 0.0  # [m]
    assert len(form_of(chain_of_arm("gen3 lite")).solve_all(T, HOME)) == 0


def test_answers_repeat_in_any_order(rng: np.random.Generator) -> None:
    chain = chain_of_arm("crx")
    form = form_of(chain)
    targets = [pose_at(chain, q) for q in rng.uniform(-np.pi, np.pi, (20, 6))]
    first = [form.solve_all(T, HOME).rows for T in targets]
    again = [form.solve_all(T, HOME).rows for T in reversed(targets)]
    assert all(np.array_equal(a, b) for a, b in zip(first, reversed(again), strict=True))
