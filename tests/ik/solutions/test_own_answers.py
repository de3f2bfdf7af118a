"""Laws of sets with one parameter, on arms of every structure: own answers, completeness, solutions all along."""

from __future__ import annotations

import functools
import math
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from fuzz import own_answers, six_joints
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.ik import SolutionSet
from jacokin.model.angles import wrap_to_pi
from tests.seven_joint_arms import ARMS, load_arm

JACOS = ("j2s7s300", "j2n6s300", "j2s6s300")
REGULAR = 1e-3  # smallest singular value of a regular configuration, the tool in metres
SAME = 1e-6  # [rad]
FEW = 3
MANY = pytest.param(25, marks=pytest.mark.slow)


@functools.cache
def solver_of(name: str, folder: Path) -> IKSolver:
    return IKSolver(load_arm(name, folder) if name in ARMS else jacokin.load_robot(name), collision="ignore")


def target_of(robot: Robot, q: Array, rng: np.random.Generator, number: int = 0) -> pin.SE3 | FreeAxis:
    """The pose of a configuration; on six joints it may turn about any axis, or by a number x or that of joint 6."""
    T = robot.forward_kinematics(q)
    axis = (rng.normal(size=3), (1.0, 0.0, 0.0), (0.0, 0.0, -1.0))[number % 3]
    return FreeAxis(T, axis=axis) if robot.dof == 6 else T


def regular(robot: Robot, rng: np.random.Generator) -> Array:
    while True:
        q = robot.sample(rng)
        if robot.singular_values(q).min() > REGULAR:
            return q


def apart(a: Array, b: Array) -> float:
    return float(np.abs(wrap_to_pi(a - b)).max())


def holds(found: SolutionSet, q: Array) -> bool:
    """Whether a configuration is in a set, up to whole turns."""
    return any(apart(interval.nearest(q), q) < SAME for interval in found.intervals)


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [FEW, MANY])
@pytest.mark.parametrize("name", [*JACOS, *ARMS])
def test_a_regular_configuration_is_its_own_answer_and_in_its_set(
    name: str, count: int, folder: Path, rng: np.random.Generator
) -> None:
    solver = solver_of(name, folder)
    for number in range(count):
        q = regular(solver.robot, rng)
        target = target_of(solver.robot, q, rng, number)
        result, found = solver.solve(target, seed=q).raise_for_status(), solver.solve_all(target)
        np.testing.assert_allclose(result.q, q, atol=SAME)
        assert result.parameter is not None
        assert abs(wrap_to_pi(result.parameter - found.parameter_of(q))) < SAME
        assert holds(found, q)  # which is not told where to look


@pytest.mark.parametrize("number", [113, 143, 207, 1114, 1217])
def test_a_round_configuration_of_any_six_joints_is_there_or_others_are_in_doubt(number: int, folder: Path) -> None:
    """Also where digits are lost: rows of equations are nearly alike, roots are near each other."""
    path, rng = folder / f"round_{number}.urdf", np.random.default_rng(number)
    path.write_text(six_joints.random_arm(np.random.default_rng([77, number])))
    solver = IKSolver(jacokin.load_robot(path), collision="ignore")
    robot, sure = solver.robot, 0
    for i in range(60):
        q = np.clip(round_configuration(rng, i), robot.lower, robot.upper)
        found = solver.solve_all(robot.forward_kinematics(q))
        sure += found.complete
        assert not found.complete or min((apart(row, q) for row in found.q), default=math.inf) < 1e-4, q
    assert sure > 30


def round_configuration(rng: np.random.Generator, number: int) -> Array:
    """A configuration of multiples of 45 or of 30 degrees."""
    parts = 4 if number % 3 else 6
    return np.asarray(rng.integers(-parts, parts + 1, 6) * (np.pi / parts), float)


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [FEW, pytest.param(9, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", [*JACOS, *ARMS])
def test_solutions_all_along_reach_the_target_within_the_limits(
    name: str, count: int, folder: Path, rng: np.random.Generator
) -> None:
    solver = solver_of(name, folder)
    robot = solver.robot
    for number in range(count):
        target = target_of(robot, robot.sample(rng), rng, number)
        found = solver.solve_all(target)
        assert found.dimension == 1
        for interval in found.intervals:
            assert -math.pi <= interval.start < math.pi or name not in JACOS
            assert interval.start <= interval.stop <= interval.start + 2.0 * math.pi
            for p in (interval.start, *rng.uniform(interval.start, interval.stop, 5), interval.stop):
                q = interval.at(p)
                goal = target.at(p) if isinstance(target, FreeAxis) else target
                assert np.abs(goal.actInv(robot.forward_kinematics(q)).homogeneous - np.eye(4)).max() < 1e-9
                assert robot.within_limits(q)
                assert abs(wrap_to_pi(found.parameter_of(q) - p)) < (1e-7 if robot.dof == 6 else 1e-12)


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [2, pytest.param(8, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", [*JACOS, *ARMS, "gen3_6dof"])
def test_a_complete_set_lacks_no_solution_of_a_scan(
    name: str, count: int, folder: Path, rng: np.random.Generator
) -> None:
    """Held against all solutions at values of the parameter, each a pose of six joints."""
    solver = solver_of(name, folder)
    robot = solver.robot
    for _ in range(count):
        target = target_of(robot, robot.sample(rng), rng)
        found = solver.solve_all(target)
        if not found.complete:
            continue
        for p in rng.uniform(-math.pi, math.pi, 12).tolist():
            if isinstance(target, FreeAxis):
                rows = solver.solve_all(target.at(p)).q_within_limits
            else:
                assert solver.parameter is not None
                joint = robot.joint_index(solver.parameter)
                if not robot.lower[joint] <= p <= robot.upper[joint]:
                    continue
                rows = solver.solve_all(target, fixed={solver.parameter: p}).q_within_limits
            for row in rows:
                assert holds(found, row)


@pytest.mark.one_quick("name")
@pytest.mark.parametrize("kind", own_answers.CLASSES)
@pytest.mark.parametrize("name", JACOS)
def test_a_natural_posture_is_its_own_answer(name: str, kind: str, folder: Path, rng: np.random.Generator) -> None:
    """Straight wrists, stretched arms, right angles, limits; where curves meet, too."""
    solver = solver_of(name, folder)
    robot = solver.robot
    for _ in range(6):
        q = np.clip(own_answers.CLASSES[kind](robot, rng), robot.lower, robot.upper)
        result = solver.solve(target_of(robot, q, rng), seed=q).raise_for_status()
        assert np.linalg.norm(result.q - q) < 1e-4


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [5, pytest.param(40, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["j2s6s200", "m1n6s200", "j2n6s300"])
def test_a_set_with_single_points_is_complete_only_with_all_of_them(
    name: str, count: int, rng: np.random.Generator
) -> None:
    """Arms stretched straight up with the other joints at right angles: points where solutions are lost in two ways.

    The tool is beside axis 6, without which every turn about that axis would be a solution.
    """
    solver = IKSolver(jacokin.load_robot(name), tool=jacokin.pose([0.5, 0.0, 0.0]), collision="ignore")
    robot = solver.robot
    for _ in range(count):
        q = own_answers.CLASSES["multiples of 90 degrees"](robot, rng)
        q[1:3] = math.pi
        q = np.clip(q, robot.lower, robot.upper)
        axis = np.eye(3)[rng.integers(3)] if rng.random() < 0.5 else rng.normal(size=3)
        target = FreeAxis(solver.verifier.tool_pose(q), axis=axis)
        found = solver.solve_all(target)
        assert not found.complete or any(apart(interval.nearest(q), q) < 1e-4 for interval in found.intervals)
        for seed in (q, np.clip(q + 3e-4 * rng.normal(size=6), robot.lower, robot.upper)):
            result = solver.solve(target, seed=seed).raise_for_status()
            assert np.linalg.norm(result.q - seed) <= np.linalg.norm(q - seed) + 1e-4


@pytest.mark.one_quick
@pytest.mark.parametrize("name", [*JACOS, *ARMS])
def test_nothing_in_a_set_is_nearer_than_the_nearest(name: str, folder: Path, rng: np.random.Generator) -> None:
    solver = solver_of(name, folder)
    robot = solver.robot
    for seed in robot.sample(rng, 3):
        target = target_of(robot, robot.sample(rng), rng)
        found = solver.solve_all(target, seed=seed)
        nearest, result = found.nearest(seed), solver.solve(target, seed=seed).raise_for_status()
        assert nearest is not None
        best = float(np.linalg.norm(nearest - seed))
        assert np.linalg.norm(result.q - seed) == pytest.approx(best, abs=1e-6)
        assert best <= min(np.linalg.norm(row - seed) for row in found.sample(400)) + 1e-6


#: Curves along which one joint goes all the way round and the parameter, the last joint, hardly changes.
NARROW = [
    ("xarm7", (-1.192565, -1.753836, 4.499250, 3.221823, -4.526541, 0.855359, -3.039284)),
    ("panda", (0.600692, -0.849295, 2.335510, -0.074847, -0.910238, 1.826370, -2.530596)),
]


@pytest.mark.parametrize(("name", "q"), NARROW)
def test_a_curve_along_which_the_parameter_hardly_changes_is_found(
    name: str, q: tuple[float, ...], folder: Path
) -> None:
    solver = solver_of(name, folder)
    assert holds(solver.solve_all(solver.robot.forward_kinematics(q)), np.array(q))


@pytest.mark.parametrize("count", [30, pytest.param(200, marks=pytest.mark.slow)])
def test_a_seed_beside_a_multiply_singular_configuration_gets_it_back(
    count: int, folder: Path, rng: np.random.Generator
) -> None:
    """Joints 2, 5 and 6 at zero: what is missing falls with the square of two distances, and no curve passes."""
    solver = solver_of("gen3", folder)
    robot, far = solver.robot, 0
    for q in robot.sample(rng, count):
        q[[1, 4, 5]] = 0.0
        way = rng.normal(size=robot.dof)
        seed = np.clip(q + 0.04 * way / np.linalg.norm(way), robot.lower, robot.upper)
        result = solver.solve(robot.forward_kinematics(q), seed=seed).raise_for_status()
        far += bool(np.linalg.norm(result.q - seed) > 1.1 * np.linalg.norm(q - seed))
    assert far <= 0.02 * count


def test_circles_of_a_straight_wrist_are_in_the_set(folder: Path, rng: np.random.Generator) -> None:
    """The two joints beside the middle one turn against each other, at one value of the parameter."""
    for name in ("j2s7s300", "j2s6s300"):
        solver = solver_of(name, folder)
        q = solver.robot.sample(rng)
        q[-2] = math.pi
        found = solver.solve_all(target_of(solver.robot, q, rng), seed=q)
        circles = [interval for interval in found.intervals if interval.start == interval.stop]
        assert any(interval.ends[0].kind == "circle" for interval in circles)
        turned = q + 0.4 * np.eye(len(q))[-1] - 0.4 * np.eye(len(q))[-3]
        assert min(apart(interval.nearest(turned), turned) for interval in circles) < 0.41


@pytest.mark.parametrize("count", [20, pytest.param(150, marks=pytest.mark.slow)])
def test_circles_beside_a_straight_elbow_are_in_a_complete_set(
    count: int, folder: Path, rng: np.random.Generator
) -> None:
    """With a straight wrist and a nearly straight elbow the arm is nearly singular all along the circle."""
    solver = solver_of("j2s7s300", folder)
    robot = solver.robot
    complete = 0
    for q in robot.sample(rng, count):
        q[3], q[5] = math.pi + rng.choice([-1, 1]) * 10 ** rng.uniform(-4, -2), math.pi
        found = solver.solve_all(robot.forward_kinematics(q))
        complete += found.complete
        assert not found.complete or any(apart(interval.nearest(q), q) < 1e-4 for interval in found.intervals)
    assert complete > 0.2 * count


@pytest.mark.parametrize("count", [10, pytest.param(150, marks=pytest.mark.slow)])
def test_a_single_configuration_at_the_edge_of_reach_is_in_the_set_or_in_doubt(
    count: int, folder: Path, rng: np.random.Generator
) -> None:
    """Right angles but for 1e-9 to 1e-7 rad, the elbow straight: rounding decides whether the pose is within reach."""
    solver = solver_of("j2s7s300", folder)
    robot = solver.robot
    for _ in range(count):
        q = own_answers.CLASSES["multiples of 90 degrees"](robot, rng)
        q[3] = math.pi
        q = np.clip(q + 10 ** rng.uniform(-9, -7) * rng.normal(size=7), robot.lower, robot.upper)
        found = solver.solve_all(robot.forward_kinematics(q))
        assert not found.complete or any(apart(interval.nearest(q), q) < 1e-4 for interval in found.intervals)


@pytest.mark.parametrize(
    ("name", "degrees", "axis"),
    [
        ("gen3_lite", (-90, 0, 0, 90, -90, 0), (-0.31753552779219985, -0.6229657906404145, -0.7149019599088342)),
        ("gen3_6dof", (-90, 0, 0, 90, -90, 90), (0.3527448220831334, -0.4798610246695798, 0.8033084634787558)),
        ("gen3_6dof", (-180, 0, 0, 90, -90, 0), (0.1507252540250891, 0.12699146798846123, 0.9803851614835916)),
    ],
)
def test_a_curve_that_shrinks_to_a_point_is_in_the_set_or_in_doubt(
    name: str, degrees: tuple[int, ...], axis: tuple[float, ...], folder: Path
) -> None:
    """Solutions are real at one value of the angle only, or along 5e-6 rad of it, right beside where others vanish."""
    solver, q = solver_of(name, folder), np.radians(degrees)
    found = solver.solve_all(FreeAxis(solver.verifier.tool_pose(q), axis=axis))
    assert not found.complete or holds(found, q)


def test_the_circle_of_a_straight_wrist_is_at_the_pose_itself() -> None:
    """The wrist is straight, which joint 5 may not be. One more curve of the tool's turns ends in a piece of 1e-4 rad.

    Along that the tool hardly turns, but it is turned by 2.2 rad.
    """
    q = [-1.2524879634072932, 2.0492090934445364, 5.19080174703628, -1.1989331241792778, 0.0, -0.11866710651615521]
    tool = jacokin.pose([-0.1252, 0.0682, 0.2862], rpy=[-1.7067, 0.384, 2.8008])
    solver = IKSolver(jacokin.load_robot("j2s6s300"), "gripsite", tool=tool, collision="ignore")
    robot, T = solver.robot, solver.verifier.tool_pose(np.array(q))
    assert solver.solve(T, q).status is jacokin.Status.OUTSIDE_LIMITS
    free = jacokin.load_robot("j2s6s300", limits={robot.joint_names[4]: (-4.0, 4.0)})
    result = IKSolver(free, "gripsite", tool=tool, collision="ignore").solve(T, q)
    assert result.success
    assert apart(result.q, np.array(q)) < 1e-6


def test_ranges_anywhere_on_the_circle(folder: Path, rng: np.random.Generator) -> None:
    solver = solver_of("j2s6s300", folder)
    robot = solver.robot
    for low, high in ((5.0, 8.0), (-9.0, -7.0), (2.5, 4.0)):
        T = robot.forward_kinematics(robot.sample(rng))
        for interval in solver.solve_all(FreeAxis(T, axis=(1.0, 0.3, 0.0), range=(low, high))).intervals:
            assert low - 1e-9 <= interval.start <= interval.stop <= high + 1e-9


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("seed", "case"),
    [
        (58001, 52),  # a pair of roots is foretold from one side only
        (58001, 114),  # a joint of more than a turn just comes to its limit
        (58001, 149),  # a single point, next to which two pairs of roots meet
        (58001, 250),  # a wrist that is not square
        (71001, 11),  # no joint has limits
        (71001, 225),  # others
        (71001, 228),
        (79, 53),  # a curve within 3e-5 rad of the angle, beside which four roots all but meet
        (95, 399),  # one within 3e-4, beside which complex solutions meet
        (91, 28),  # a joint touches its limit, and is 2e-7 rad past it on both sides
        (91, 672),  # two joints stand on their limits all round, near a singularity
        (96, 50),  # one does, nearer to one
        (52711, 60),  # one does, and is off by noise
        (90, 275),  # next to where curves meet, the nearest member is on a limit
        (96, 578),  # the seed has more margin than what is found of an incomplete set
        (401, 107),  # a curve along which the angle hardly moves, beside which F is small and not zero
        (3301, 150),
        (90401, 437),
        (90401, 819),  # and one beside which F all but vanishes
        (90401, 1965),  # an arm misses a spherical wrist by rounding, and is stretched
        (90401, 2234),  # one misses parallel axes
        (90501, 451),  # nothing determines joint 1, and the elbow does not reach at the angle of the seed
        (7703, 225),  # a pair all but comes to the axis beside an even value, and comes there between that and a fold
    ],
)
def test_sets_of_arms_with_special_structures_hold_what_they_are_made_from(
    seed: int, case: int, tmp_path: Path
) -> None:
    rng, path = np.random.default_rng([seed, case]), tmp_path / "arm.urdf"
    path.write_text(six_joints.random_arm(rng), encoding="utf-8")
    assert [finding for finding in six_joints.check(path, rng) if finding.kind != "unsure"] == []
