"""Arms with axes that meet or are parallel: the same branches as the general way and brute force find."""

from __future__ import annotations

import pickle

import numpy as np
import pinocchio as pin
import pytest

from jacokin.arrays import Array
from jacokin.ik import closed_form as closed_form_module
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.structures import quick_form, size_of
from jacokin.kernels.branches import COLUMNS, MAX_BRANCHES, PoseQuery
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.closed_form.pose import make_work
from jacokin.kernels.six_joints.elbow_offset import branches_of_elbow_offset
from jacokin.kernels.six_joints.loop import Form, joint_of
from jacokin.kernels.six_joints.planar_arm import branches_of_planar_arm
from tests.kernels.plain import PlainCall
from tests.kernels.six_joints.arms import (
    ARMS,
    H,
    chain_of_arm,
    chain_of_numbers,
    distance,
    form_of,
    lost,
    missing,
    perturbed,
    pose_at,
    round_angles,
    smallest_singular_value,
)

HOME = np.zeros(6)
#: a [m], d [m], alpha [rad] of each joint.
MADE_UP: dict[str, tuple[list[float], list[float], list[float]]] = {
    "any three, wrist": ([0.3, 0.25, 0.2, 0, 0, 0.05], [0.2, 0.15, 0.3, 0.35, 0, 0.1], [0.9, 1.7, 1.1, 1.2, -1.9, 0.3]),
    "shoulder 123": ([0, 0, 0.1, 0.4, 0.02, 0.1], [0.3, 0, 0.4, 0, 0.1, 0.1], [H, -H, H, 0, H, 0]),
    "skew shoulder 123": ([0, 0, 0.3, 0.2, 0.1, 0.1], [0.3, 0, 0.2, 0.1, 0.3, 0.2], [1.2, 1.0, 0.7, 2.1, 1.4, 0.5]),
    "meeting 345": ([0.2, 0.3, 0, 0, 0.2, 0.2], [0.2, 0.1, 0.3, 0, 0.3, 0.1], [1.9, 0.8, 1.1, 1.3, 0.7, 1.2]),
    "axes 1 and 2 parallel": ([0.3, 0.25, 0, 0, 0, 0], [0.2, 0.1, 0.05, 0.3, 0, 0.1], [0, -H, H, H, -H, 0]),
    "any others, 234": ([0.1, 0.4, 0.35, 0, 0, 0.1], [0.2, 0.05, 0.07, 0.1, 0.2, 0.1], [1.1, np.pi, 0, 1.2, -0.9, 0.6]),
    "parallel 345": ([0, 0.1, 0.35, 0.4, 0.1, 0.1], [0.2, 0.05, 0.07, 0.1, 0.2, 0.1], [1.1, -1, 0, np.pi, -0.9, 0.6]),
    "parallel 123": ([0.3, 0.4, 0.05, 0, 0.1, 0.1], [0.2, 0.05, 0.07, 0.1, 0.2, 0.1], [0, 0, 1.1, 1.4, -0.9, 0.6]),
    "planar 1234": ([0, 0.7, 0, 0, 0.03, 0], [0.275, 0.1, 0.1, 0.5, 0.16, 0.17], [-H, np.pi, -H, 1.1, -0.7, 0.4]),
    "planar 2345": ([0.1, 0, 0.7, 0, 0, 0], [0.2, 0.16, 0, 0, 0.5, 0.17], [0.8, H, np.pi, -H, H, 0.3]),
    "planar 5432": ([0, 0, 0.4, 0, 0.05, 0.1], [0.2, 0.35, 0, 0, 0.3, 0.1], [0.9, H, np.pi, H, 0.7, 0.4]),
    "offset 1234": ([0, 0.7, 0.08, 0, 0.03, 0], [0.275, 0.1, 0.1, 0.5, 0.16, 0.17], [-H, np.pi, -H, 1.1, -0.7, 0.4]),
    "offset 2345": ([0.1, 0, 0.7, 0.09, 0, 0], [0.2, 0.16, 0, 0, 0.5, 0.17], [0.8, H, np.pi, -H, H, 0.3]),
    "offset 5432": ([0, 0.07, 0.4, 0, 0.05, 0.1], [0.2, 0.35, 0, 0, 0.3, 0.1], [0.9, H, np.pi, H, 0.7, 0.4]),
}
#: The kind of form, and the joints whose axes meet or are parallel; of a planar arm, these and the two beside them.
EXPECTED = {
    "puma": (Form.SPHERICAL_WRIST, (4, 5, 6)),
    "industrial": (Form.SPHERICAL_WRIST, (4, 5, 6)),
    "any three, wrist": (Form.SPHERICAL_WRIST, (4, 5, 6)),
    "shoulder 123": (Form.SPHERICAL_WRIST, (1, 2, 3)),
    "skew shoulder 123": (Form.SPHERICAL_WRIST, (1, 2, 3)),
    "meeting 345": (Form.SPHERICAL_WRIST, (3, 4, 5)),
    "axes 1 and 2 parallel": (Form.SPHERICAL_WRIST, (4, 5, 6)),
    "ur5": (Form.PARALLEL_AXES, (2, 3, 4)),
    "any others, 234": (Form.PARALLEL_AXES, (2, 3, 4)),
    "parallel 345": (Form.PARALLEL_AXES, (3, 4, 5)),
    "parallel 123": (Form.PARALLEL_AXES, (1, 2, 3)),
    "crx": (Form.PLANAR_ARM, (2, 3, 1, 4)),
    "planar 1234": (Form.PLANAR_ARM, (2, 3, 1, 4)),
    "planar 2345": (Form.PLANAR_ARM, (3, 4, 2, 5)),
    "planar 5432": (Form.PLANAR_ARM, (3, 4, 2, 5)),
    "xarm6": (Form.ELBOW_OFFSET, (2, 3, 1, 4)),
    "offset 1234": (Form.ELBOW_OFFSET, (2, 3, 1, 4)),
    "offset 2345": (Form.ELBOW_OFFSET, (3, 4, 2, 5)),
    "offset 5432": (Form.ELBOW_OFFSET, (3, 4, 2, 5)),
}


def chain_of_name(name: str) -> Array:
    if name in ARMS:
        return chain_of_arm(name)
    chain = chain_of_numbers(*MADE_UP[name])
    chain[0] = pin.SE3(pin.exp3(np.array([0.3, -0.2, 0.5])), np.array([0.1, -0.2, 0.3])).homogeneous[:3]
    return chain


def in_the_general_way(form: ClosedForm) -> ClosedForm:
    """The same arm, solved as one without structure."""
    other = ClosedForm.__new__(ClosedForm)
    chain, arm, *rest = form.__getstate__()
    general = np.array(arm)
    general[42] = Form.GENERAL
    other.__setstate__((chain, general, *rest))
    return other


@pytest.mark.parametrize("name", [*ARMS, *MADE_UP])
def test_the_structure_is_found_wherever_it_is(name: str) -> None:
    chain = chain_of_name(name)
    form = quick_form(chain, 1.0 / size_of(chain))
    assert (form.kind, form.joints) == EXPECTED.get(name, (Form.GENERAL, ()))
    moved = perturbed(chain, 1e-7)
    assert quick_form(moved, 1.0 / size_of(moved)).kind == Form.GENERAL


@pytest.mark.one_quick
@pytest.mark.parametrize("name", EXPECTED)
def test_random_poses_have_their_configuration_and_those_of_brute_force(name: str, rng: np.random.Generator) -> None:
    chain = chain_of_name(name)
    form = form_of(chain)
    for number, q in enumerate(rng.uniform(-np.pi, np.pi, (30, 6))):
        T = pose_at(chain, q)
        branches = form.solve_all(T, HOME)
        assert min(distance(q, other) for other in branches.q) < 1e-6
        assert max(branches.position_error.max(), branches.orientation_error.max()) < 1e-12
        if number == 0:
            assert lost(chain, branches.q, T, starts=500) == []


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPECTED)
def test_no_branch_of_brute_force_is_missing(name: str, rng: np.random.Generator) -> None:
    chain = chain_of_name(name)
    form = form_of(chain)
    for number, q in enumerate(np.concatenate([rng.uniform(-np.pi, np.pi, (4, 6)), round_angles(rng, 4, -12.0)])):
        T = pose_at(chain, q)
        branches = form.solve_all(T, HOME)
        assert not branches.complete or lost(chain, branches.q, T, starts=1000, seed=number) == []


@pytest.mark.one_quick
@pytest.mark.parametrize("name", EXPECTED)
def test_round_angles_are_answered_as_in_the_general_way(name: str, rng: np.random.Generator) -> None:
    chain = chain_of_name(name)
    form = form_of(chain)
    general = in_the_general_way(form)
    for q in round_angles(rng, 120, -12.0):
        T = pose_at(chain, q)
        branches, others = form.solve_all(T, q), general.solve_all(T, q)
        assert min(distance(q, other) for other in branches.q) < 1e-6 or smallest_singular_value(chain, q) < 1e-3
        assert missing(chain, others.q, branches.q) == []
        assert max(branches.position_error.max(), branches.orientation_error.max()) < 1e-9


@pytest.mark.one_quick
@pytest.mark.parametrize("sigma", [1e-12, 1e-10, 1e-9, 1e-8, 1e-6])
@pytest.mark.parametrize("name", ["puma", "ur5", "any three, wrist", "crx"])
def test_answers_do_not_jump_where_the_structure_ends(name: str, sigma: float, rng: np.random.Generator) -> None:
    """A structure within 1e-9 gives starts only: branches are those of the file's numbers."""
    chain = perturbed(chain_of_name(name), sigma)
    form = form_of(chain)
    general = in_the_general_way(form)
    for q in rng.uniform(-np.pi, np.pi, (40, 6)):
        T = pose_at(chain, q)
        branches, others = form.solve_all(T, HOME), general.solve_all(T, HOME)
        assert missing(chain, others.q, branches.q) == []
        assert missing(chain, branches.q, others.q) == []
        assert max(branches.position_error.max(), branches.orientation_error.max()) < 1e-9


@pytest.mark.parametrize(("name", "joint", "turning"), [("puma", 4, (3, 5)), ("ur5", 4, (1, 2, 3, 5))])
def test_a_straight_wrist_is_a_continuum(
    name: str, joint: int, turning: tuple[int, ...], rng: np.random.Generator
) -> None:
    """The member at the seed's angle of the last joint is returned, and said to stand for others."""
    chain = chain_of_name(name)
    form = form_of(chain)
    for q in rng.uniform(-1.5, 1.5, (10, 6)):
        q[joint] = 0.0
        branches = form.solve_all(pose_at(chain, q), q)
        assert branches.singular.any()
        assert not branches.complete
        member = branches.q[np.argmin([distance(q, row) for row in branches.q])]
        assert distance(q, member) < 1e-6
        seed = q.copy()
        seed[5] += 0.01  # the same continuum, elsewhere
        moved = form.solve_all(pose_at(chain, q), seed)
        others = [row for row in moved.q[moved.singular] if abs(row[5] - seed[5]) < 1e-9]
        rest = [i for i in range(6) if i not in turning]
        assert min(np.abs((row - q)[rest]).max() for row in others) < 1e-6


def test_a_straight_wrist_is_a_continuum_where_the_elbow_does_not_close_at_the_angle_of_the_seed(
    rng: np.random.Generator,
) -> None:
    """Joint 6 is then where it does: with it left at the seed, a UR5 had other branches alone, said to be all."""
    chain = chain_of_name("ur5")
    form, far = form_of(chain), 0
    for q in np.vstack([rng.integers(-4, 5, (150, 6)) * (np.pi / 4), rng.uniform(-np.pi, np.pi, (50, 6))]):
        q[4] = rng.choice([0.0, np.pi])
        T, seed = pose_at(chain, q), rng.uniform(-np.pi, np.pi, 6)
        branches = form.solve_all(T, seed)
        assert not branches.complete
        assert max(branches.position_error.max(), branches.orientation_error.max()) < 1e-9
        far += bool(np.abs(np.sin(0.5 * (branches.q[branches.singular][:, 5] - seed[5]))).min(initial=1.0) > 1e-3)
    assert far > 20


@pytest.mark.parametrize("forearm", [0.35, 0.4318])
def test_a_wrist_on_axis_1_leaves_joint_1_free(forearm: float, rng: np.random.Generator) -> None:
    """A Puma without lateral offsets: wherever joint 1 is, the wrist's joints make up for it.

    With a forearm as long as the upper arm the wrist may be at the shoulder, where joint 2 is free as well.
    """
    chain = chain_of_name("puma")
    chain[3, :, 3] = 0.0
    chain[4, 2, 3] = forearm
    form = form_of(chain)
    assert form.arm[42] == Form.SPHERICAL_WRIST
    for q in rng.uniform(0.7, 1.2, (10, 6)):
        # The wrist's x at q1 = 0 is a cos(q3) + b sin(q3) + c: q3 so that it vanishes.
        at = {}
        for q3 in (0.0, H, np.pi):
            wrist = np.eye(4)
            for placement, angle in zip(chain[:4], (0.0, q[1], q3, 0.0), strict=True):
                wrist = wrist @ pin.SE3(placement[:, :3], placement[:, 3]).homogeneous
                wrist = wrist @ pin.SE3(pin.exp3(np.array([0.0, 0.0, angle])), np.zeros(3)).homogeneous
            at[q3] = (wrist @ np.append(chain[4, :, 3], 1.0))[0]
        c = 0.5 * (at[0.0] + at[np.pi])
        a, b = at[0.0] - c, at[H] - c
        q[2] = np.arctan2(b, a) + np.arccos(-c / np.hypot(a, b))
        branches = form.solve_all(pose_at(chain, q), q)
        nearest = np.argmin([distance(q, row) for row in branches.q])
        assert distance(q, branches.q[nearest]) < 1e-6
        assert branches.singular[nearest]


def test_out_of_reach_there_is_no_branch() -> None:
    T = np.eye(4)
    T[:3, 3] = 5.0, 0.0, 0.0  # [m]
    for name in EXPECTED:
        assert len(form_of(chain_of_name(name)).solve_all(T, HOME)) == 0


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["crx", "planar 1234", "planar 2345", "planar 5432"])
def test_a_polynomial_settles_random_poses_of_planar_arms(name: str, rng: np.random.Generator) -> None:
    """Each root has two branches, half a turn apart in the joint before the parallel axes."""
    form = form_of(chain_of_name(name))
    arm, work = unpack_arm(form.arm).six, make_work(np.empty((MAX_BRANCHES, COLUMNS)))
    before = joint_of(arm.form_labelling, 0)
    for q in rng.uniform(-np.pi, np.pi, (10, 6)):
        query = PoseQuery(form.chain, form.constants[2], pose_at(form.chain, q), HOME)
        work.branches.filled[0] = 0
        assert branches_of_planar_arm(arm, query, work.six.candidates, work.roots, work.branches)
        rows = work.branches.rows[: work.branches.filled[0], :6]
        assert min(distance(q, row) for row in rows) < 1e-6
        for row in rows:
            turned = row.copy()
            turned[before] += np.pi
            assert min(np.abs(np.sin(0.5 * (other - turned)[[before]])).max() for other in rows) < 1e-6


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["xarm6", "offset 1234", "offset 2345", "offset 5432"])
def test_a_polynomial_settles_most_poses_of_arms_with_an_offset_at_the_elbow(
    name: str, rng: np.random.Generator
) -> None:
    """Each root has one branch; where roots are too near to each other the general way goes on."""
    form, settled = form_of(chain_of_name(name)), 0
    arm, work = unpack_arm(form.arm).six, make_work(np.empty((MAX_BRANCHES, COLUMNS)))
    for q in rng.uniform(-np.pi, np.pi, (30, 6)):
        query = PoseQuery(form.chain, form.constants[2], pose_at(form.chain, q), HOME)
        work.branches.filled[0] = 0
        if branches_of_elbow_offset(arm, query, work.six.candidates, work.roots, work.branches):
            settled += 1
            assert min(distance(q, row) for row in work.branches.rows[: work.branches.filled[0], :6]) < 1e-6
    assert settled > 24


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["puma", "any three, wrist", "ur5", "crx", "xarm6"])
def test_compiled_bits_are_those_of_plain_python(
    name: str, monkeypatch: pytest.MonkeyPatch, rng: np.random.Generator
) -> None:
    form = form_of(chain_of_name(name))
    monkeypatch.setattr(closed_form_module, "Call", PlainCall)
    plain = pickle.loads(pickle.dumps(form))
    for q in np.concatenate([rng.uniform(-np.pi, np.pi, (3, 6)), round_angles(rng, 2, -12.0)]):
        T = pose_at(form.chain, q)
        np.testing.assert_array_equal(plain.solve_all(T, HOME).rows, form.solve_all(T, HOME).rows)
