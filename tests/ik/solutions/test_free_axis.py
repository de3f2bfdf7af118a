"""A tool that may turn about one axis: intervals against a scan of the closed form, members, statuses, mistakes."""

from __future__ import annotations

import math
import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

import jacokin
from jacokin import FreeAxis, IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, StructureError
from jacokin.ik import SolutionSet
from jacokin.model.angles import wrap_to_pi
from tests.seven_joint_arms import HALF, Placement, load_placed

AXES = {"tool x": (1.0, 0.0, 0.0), "last joint": (0.0, 0.0, -1.0), "skew": (0.3, -0.5, 0.4)}
RANGES = {"circle": (-math.pi, math.pi), "part": (-0.7, 1.1), "past pi": (2.5, 4.0)}


@pytest.fixture(scope="module")
def solver() -> IKSolver:
    return IKSolver(jacokin.load_robot(), collision="ignore")


def scan(solver: IKSolver, target: FreeAxis, parameters: Array) -> NDArray[np.int64]:
    """How many branches are within the limits at each parameter, pose by pose."""
    poses = np.array([target.at(p).homogeneous for p in parameters])
    rows = solver.closed_form().solve_batch(poses, np.tile(solver.robot.home, (len(poses), 1)))
    return rows.branches_within_limits


def counted(family: SolutionSet, parameters: Array) -> NDArray[np.int64]:
    """How many intervals hold each parameter."""
    return np.array([sum(interval.contains(p) for interval in family.intervals) for p in parameters])


@pytest.mark.one_quick
@pytest.mark.parametrize("limits", RANGES)
@pytest.mark.parametrize("axis", AXES)
def test_intervals_are_those_of_a_scan(solver: IKSolver, rng: np.random.Generator, axis: str, limits: str) -> None:
    for q in solver.robot.sample(rng, 3):
        target = FreeAxis(solver.robot.forward_kinematics(q), axis=AXES[axis], range=RANGES[limits])
        family = solver.solve_all(target)
        assert family.complete
        low, high = RANGES[limits]
        parameters = rng.uniform(low, high, 400)
        ends = [p for interval in family.intervals for p in (interval.start, interval.stop)]
        apart = [min(np.abs(wrap_to_pi(p - np.array([*ends, p + 1.0])))) > 1e-8 for p in parameters]
        parameters = parameters[apart]
        np.testing.assert_array_equal(counted(family, parameters), scan(solver, target, parameters))


#: Axes 2 and 3 are parallel, 1 and 4 in one plane across them, and 4 and 5 meet, as of a Fanuc CRX.
PLANAR: list[Placement] = [
    ((0.0, 0.0, 0.2), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, -0.54, 0.0), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.54), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.15), (HALF, 0.0, 0.0)),
    ((0.0, 0.05, 0.1), (0.0, 0.0, 0.0)),
]


#: The same with axis 4 beside joint 3, as of an xArm6.
OFFSET: list[Placement] = [
    ((0.0, 0.0, 0.267), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-HALF, 0.0, 0.0)),
    ((0.053, -0.2845, 0.0), (0.0, 0.0, 0.0)),
    ((0.0775, 0.3425, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((0.076, 0.097, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, 0.05, 0.1), (0.0, 0.0, 0.0)),
]


def looked_at_own_set(solver: IKSolver, q: Array, rng: np.random.Generator) -> tuple[bool, bool]:
    """Whether the set about a random axis at a configuration, which is in it, says that it is complete, and is."""
    target = FreeAxis(solver.robot.forward_kinematics(q), axis=rng.normal(size=3))
    found = solver.solve_all(target)
    own = found.nearest(q)
    assert own is not None
    np.testing.assert_allclose(own, q, atol=1e-6)
    parameters = rng.uniform(-math.pi, math.pi, 40)
    return found.complete, bool((counted(found, parameters) == scan(solver, target, parameters)).all())


@pytest.mark.parametrize("count", [15, pytest.param(150, marks=pytest.mark.slow)])
@pytest.mark.parametrize("placements", [PLANAR, OFFSET], ids=["planar", "offset"])
def test_sets_of_planar_arms_are_whole(
    placements: list[Placement], count: int, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Where both equations for joint 5 become one, and it is complex, no curve begins."""
    robot = load_placed("planar", placements, [3.0] * 6, tmp_path)
    solver, complete = IKSolver(robot, collision="ignore"), 0
    for q in robot.sample(rng, count):
        is_complete, is_whole = looked_at_own_set(solver, q, rng)
        complete += is_complete
        assert is_whole
    assert complete > 0.97 * count


@pytest.mark.parametrize("count", [15, pytest.param(150, marks=pytest.mark.slow)])
def test_sets_of_a_gen3_of_six_joints_are_whole(count: int, rng: np.random.Generator) -> None:
    """It is built like a Jaco whose shoulder has an offset of 1 mm; joint 5 tells where no curve begins."""
    robot = jacokin.load_robot("gen3_6dof")
    solver, complete = IKSolver(robot, collision="ignore"), 0
    for q in robot.sample(rng, count):
        is_complete, is_whole = looked_at_own_set(solver, q, rng)
        complete += is_complete
        assert is_whole or not is_complete
    assert complete > 0.95 * count


def test_an_arm_whose_rounded_axes_are_all_but_parallel_has_sets(tmp_path: Path, rng: np.random.Generator) -> None:
    """The cosine between them may be above 1."""
    rounded = [(xyz, (round(roll, 4), 0.0, 0.0)) for xyz, (roll, _, _) in PLANAR]
    robot = load_placed("rounded", rounded, [3.0] * 6, tmp_path)
    for q in robot.sample(rng, 3):
        found = IKSolver(robot, collision="ignore").solve_all(FreeAxis(robot.forward_kinematics(q), axis=(0.3, 1, 0.2)))
        own = found.nearest(q)
        assert own is not None
        np.testing.assert_allclose(own, q, atol=1e-6)


#: Axes 2, 3, 5 and 6 are parallel where joint 4 is at zero: they turn against each other while the tool stands.
FOUR_PARALLEL: list[Placement] = [
    ((-0.1, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((-0.03, 0.0, 0.0), (0.67, 0.0, 0.0)),
    ((0.48, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((-0.06, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((-0.11, 0.0, 0.0), (-HALF, 0.0, 0.0)),
    ((0.09, 0.0, 0.01), (0.0, 0.0, 0.0)),
    ((-0.09, 0.08, 0.16), (0.0, 0.0, 0.0)),
]


@pytest.mark.parametrize("moved", [0.0, 1e-7, 1e-6, 1e-5, 1e-4])
def test_a_curve_along_which_the_angle_hardly_moves_is_found_or_in_doubt(
    moved: float, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Of an arm that is moved a little, the angle moves as little along such a curve, and F all but vanishes there."""
    placed = [
        ((x + moved * noise[0], y + moved * noise[1], z + moved * noise[2]), (roll + moved * noise[3], pitch, yaw))
        for ((x, y, z), (roll, pitch, yaw)), noise in zip(FOUR_PARALLEL, rng.normal(size=(7, 4)).tolist(), strict=True)
    ]
    robot = load_placed("parallel", placed, [3.0] * 6, tmp_path)
    solver, held = IKSolver(robot, collision="ignore"), 0
    for q in robot.sample(rng, 8):
        q[3] = 0.0
        found = solver.solve_all(FreeAxis(robot.forward_kinematics(q), axis=rng.normal(size=3)))
        own = found.nearest(q)
        has_own = own is not None and bool(np.abs(wrap_to_pi(own - q)).max() < 1e-4)
        held += has_own
        assert has_own or not found.complete
    assert held >= 6


@pytest.mark.parametrize("name", ["j2s6s300", "j2n6s300", "gen3_6dof", "gen3_lite"])
def test_special_postures_have_sets_about_the_last_axis(name: str, rng: np.random.Generator) -> None:
    """Joint 6 and the angle turn against each other: what reaches the pose tells, also of a stretched arm."""
    robot = jacokin.load_robot(name)
    solver = IKSolver(robot, collision="ignore")
    for q in robot.sample(rng, 10):
        q[2] = np.clip(math.pi if name.startswith("j2") else 0.0, robot.lower[2], robot.upper[2])
        target = FreeAxis(robot.forward_kinematics(q), axis=(0.0, 0.0, 1.0))
        found, seed = solver.solve_all(target), robot.sample(rng)
        assert found.complete
        assert len(found) <= 16
        own, nearest = found.nearest(q), found.nearest(seed)
        assert own is not None
        assert nearest is not None
        np.testing.assert_allclose(wrap_to_pi(own - q), np.zeros(6), atol=1e-6)
        away = np.linalg.norm(solver.solve(target, seed).q - seed)
        assert away == pytest.approx(np.linalg.norm(nearest - seed), abs=1e-7)


def test_an_interval_ends_where_its_joint_is_on_its_limit(solver: IKSolver, rng: np.random.Generator) -> None:
    robot, seen = solver.robot, 0
    for q in robot.sample(rng, 20):
        for interval in solver.solve_all(FreeAxis(robot.forward_kinematics(q), axis=(1.0, 0.2, 0.0))).intervals:
            for p, end in zip((interval.start, interval.stop), interval.ends, strict=True):
                if end.kind == "limit":
                    assert end.joint is not None
                    assert interval.at(p)[robot.joint_index(end.joint)] == end.limit
                    seen += 1
    assert seen > 10


def test_members_beside_a_straight_wrist_are_within_the_range() -> None:
    """The place where the range ends was not found on some curves, and members were up to 0.04 rad outside."""
    solver = IKSolver(jacokin.load_robot("j2s6s200"), frame="wristsite", collision="ignore")
    q = [
        -2.8277932242009722,
        2.947447248653068,
        2.94744724865223,
        2.827477420481195,
        3.141592653590955,
        0.45304166168096064,
    ]
    low, high = -0.3517185202051594, 2.0089764650944697
    T = solver.robot.forward_kinematics(q, "wristsite")
    found = solver.solve_all(FreeAxis(T, axis=(0.0, 0.0, 1.0), range=(low, high)))
    assert found.intervals
    for interval in found.intervals:
        assert low - 1e-9 <= interval.start <= interval.stop <= high + 1e-9
        for row in (interval.at(interval.start), interval.at(interval.stop), interval.nearest(q)):
            turned = pin.log3(T.rotation.T @ solver.robot.forward_kinematics(row, "wristsite").rotation)
            assert low - 1e-7 <= turned[2] <= high + 1e-7


@pytest.mark.slow
def test_the_end_of_an_interval_is_the_nearest_member_to_itself() -> None:
    """Of intervals of nearly a turn, rounding may put it before the start, which is past the stop."""
    robot, rng = jacokin.load_robot("j2s6s300"), np.random.default_rng(3)
    solver = IKSolver(robot, collision="ignore")
    for q in robot.sample(rng, 100):
        q[2] = math.pi  # stretched: a fold
        family = solver.solve_all(FreeAxis(robot.forward_kinematics(q), axis=rng.normal(size=3)))
        nearest = family.nearest(q)
        assert nearest is not None
        np.testing.assert_allclose(wrap_to_pi(nearest - q), np.zeros(6), atol=1e-5)


def test_an_arc_longer_than_a_turn_is_two_intervals(solver: IKSolver) -> None:
    """Two branches of this target go 0.01 rad further round than to where they began, from fold to fold."""
    pose = np.eye(4)
    pose[:3] = [
        [0.4171275738012258, 0.4383493303452778, 0.7961497671673021, 0.45],
        [-0.8241422962874475, -0.18685381015410885, 0.5346729178674989, -0.15],
        [0.38313713294949103, -0.879167514309269, 0.28332034720172383, 0.75],
    ]
    target = FreeAxis(pose, axis=[0.557372938490554, -0.19634697177694954, 0.806711394559682])
    family = solver.solve_all(target)
    assert max(interval.length for interval in family.intervals) <= 2.0 * np.pi + 1e-8
    inside = np.linspace(2.136, 2.138, 20)
    np.testing.assert_array_equal(counted(family, inside), scan(solver, target, inside))
    for interval in family.intervals:
        for p in (interval.start, interval.stop):
            q = interval.at(p)
            assert solver.robot.within_limits(q)
            np.testing.assert_allclose(
                solver.robot.forward_kinematics(q).homogeneous, target.at(p).homogeneous, atol=1e-9
            )


def test_members_are_spread_over_all_intervals(solver: IKSolver) -> None:
    family = solver.solve_all(FreeAxis(solver.robot.forward_kinematics(solver.robot.home), axis=(0.0, 1.0, 0.0)))
    assert len(family.sample(50)) == 50
    assert len(family.sample(1)) == len(family) > 1
    assert [family.parameter_of(q) for q in family.sample(len(family))] == pytest.approx(
        [float(wrap_to_pi(0.5 * (interval.start + interval.stop))) for interval in family.intervals]
    )


def test_a_turn_about_the_last_axis_is_a_turn_of_joint_6(solver: IKSolver) -> None:
    robot = solver.robot
    target = FreeAxis(robot.forward_kinematics(robot.home), axis=(0.0, 0.0, 1.0))
    family = solver.solve_all(target)
    branches = solver.solve_all(target.pose)
    assert len(family) == branches.within_limits.sum()
    rows = family.sample(40)
    assert len(np.unique(rows[:, :5].round(9), axis=0)) == len(family)


def test_own_limits_of_joint_6_cut_the_circle(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(limits={"joint_6": (-1.0, 2.0)})
    for q in robot.sample(rng, 5):
        for axis in ((0.0, 0.0, 1.0), (0.0, 0.0, -1.0), (1.0, 0.0, 0.0)):
            target = FreeAxis(robot.forward_kinematics(q), axis=axis)
            family = IKSolver(robot, collision="ignore").solve_all(target)
            parameters = rng.uniform(-math.pi, math.pi, 200)
            np.testing.assert_array_equal(
                counted(family, parameters), scan(IKSolver(robot, collision="ignore"), target, parameters)
            )


def test_statuses_name_the_reason(solver: IKSolver) -> None:
    far = solver.solve(FreeAxis(jacokin.pose((2.0, 0.0, 0.0)), axis=(1.0, 0.0, 0.0)), closest=False)
    assert far.status is Status.UNREACHABLE
    tight = solver.solve(FreeAxis(jacokin.pose((0.05, 0.05, 0.2), down=True), axis=(0.0, 0.0, 1.0)), closest=False)
    assert tight.status is Status.OUTSIDE_LIMITS
    assert "joint_3 by 0.07663" in tight.message


def test_a_failure_comes_with_the_closest_configuration(solver: IKSolver) -> None:
    target = FreeAxis(jacokin.pose((0.05, 0.05, 0.2), down=True), axis=(0.0, 0.0, 1.0))
    result = solver.solve(target)
    assert result.status is Status.OUTSIDE_LIMITS
    assert solver.robot.within_limits(result.q)
    assert result.position_error + 0.1 * result.orientation_error < 0.01
    assert result.parameter is not None


def test_contact_is_avoided_among_the_members(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot()
    solver = IKSolver(robot, collision="reject")
    for q in robot.sample(rng, 3):
        result = solver.solve(FreeAxis(robot.forward_kinematics(q), axis=(1.0, 0.0, 0.0)), seed=q)
        assert result.status in (Status.OK, Status.IN_COLLISION)
        assert bool(result.touching) == (result.status is Status.IN_COLLISION)


@pytest.mark.parametrize(
    ("axis", "limits", "message"),
    [
        ((0.0, 0.0, 0.0), (-1.0, 1.0), "axis must have a direction"),
        ((1.5e308, 1.5e308, 1.5e308), (-1.0, 1.0), "axis must have a direction"),
        ((1.0, 0.0), (-1.0, 1.0), "axis must have shape"),
        ((1.0, 0.0, math.nan), (-1.0, 1.0), "axis must be finite"),
        ((1.0, 0.0, 0.0), (1.0, -1.0), "least < largest"),
        ((1.0, 0.0, 0.0), (1.0, 1.0), "least < largest"),
        ((1.0, 0.0, 0.0), (-1.0, math.nan), "range must be finite"),
        ((1.0, 0.0, 0.0), (-4.0, 4.0), "at most one turn"),
    ],
)
def test_malformed_targets_are_refused(axis: tuple[float, ...], limits: tuple[float, float], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        FreeAxis(jacokin.pose((0.3, 0.0, 0.3)), axis=axis, range=limits)


def test_a_target_is_immutable_and_survives_pickling() -> None:
    target = FreeAxis(jacokin.pose((0.3, 0.0, 0.3)), axis=(0.0, 3.0, 0.0), range=(0.0, 1.0))
    with pytest.raises(ValueError, match="read-only"):
        target.matrix[0, 3] = 1.0
    again = pickle.loads(pickle.dumps(target))
    assert again.range == (0.0, 1.0)
    np.testing.assert_array_equal(again.axis, (0.0, 1.0, 0.0))
    np.testing.assert_array_equal(again.at(0.4).homogeneous, target.at(0.4).homogeneous)


def test_all_about_a_free_axis_need_the_closed_form(robot: Robot) -> None:
    target = FreeAxis(robot.forward_kinematics(robot.home), axis=(1.0, 0.0, 0.0))
    with pytest.raises((InvalidInputError, StructureError), match="closed form"):
        IKSolver(robot, method="qp", collision="ignore").solve_all(target)


def test_parameters_outside_are_refused(solver: IKSolver) -> None:
    target = FreeAxis(solver.robot.forward_kinematics(solver.robot.home), axis=(1.0, 0.0, 0.0), range=(-0.1, 0.1))
    interval = solver.solve_all(target).intervals[0]
    with pytest.raises(InvalidInputError, match="n must be a whole number >= 1, got 0"):
        interval.sample(0)
    with pytest.raises(InvalidInputError, match="step must be a positive number"):
        interval.walk(math.nan)
    with pytest.raises(InvalidInputError, match="parameter must be from"):
        interval.at(1.0)
    np.testing.assert_allclose(interval.at(interval.start + 2.0 * math.pi), interval.at(interval.start), atol=1e-12)


@pytest.mark.slow
def test_two_joints_on_their_limits_are_a_member(solver: IKSolver, rng: np.random.Generator) -> None:
    """Where one joint comes to its limit just as another leaves its own, an interval is a single point."""
    robot, points = solver.robot, 0
    for q in robot.sample(rng, 30):
        q[[1, 2]] = [rng.choice([robot.lower[joint], robot.upper[joint]]) for joint in (1, 2)]
        target = FreeAxis(robot.forward_kinematics(q), axis=(1.0, 0.2, 0.3))
        family = solver.solve_all(target)
        own = [interval for interval in family.intervals if np.abs(wrap_to_pi(interval.nearest(q) - q)).max() < 1e-7]
        assert own
        points += any(interval.length < 1e-8 for interval in own)
        np.testing.assert_allclose(solver.solve(target, seed=q).q, q, atol=1e-7)
        assert all(robot.within_limits(interval.at(interval.start)) for interval in family.intervals)
    assert points > 3
