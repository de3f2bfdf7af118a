"""The member nearest to a seed, found without the family: against dense scans by other code, and the family's own."""

from __future__ import annotations

import copy
import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from benchmarks import scan_seven
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import forms
from jacokin.ik.solutions.curve_arm import CurveArm
from jacokin.ik.solutions.members import Members
from jacokin.ik.solutions.search import SetSearch
from jacokin.ik.targets import interpret
from jacokin.model.angles import TURN
from tests.seven_joint_arms import ARMS, load_arm, load_placed

SCANNED = 4000
#: [rad] the nearest point of such a scan is this near to the nearest of all, or nearer, unless it is at an end.
COARSE = 0.02


@pytest.fixture(scope="module")
def six() -> IKSolver:
    return IKSolver(jacokin.load_robot(), collision="ignore")


@pytest.fixture(scope="module")
def seven() -> IKSolver:
    return IKSolver(jacokin.load_robot("j2s7s300"), collision="ignore")


def structured(robot: Robot, rng: np.random.Generator, number: int) -> Array:
    """A configuration of seven joints: any, stretched, on a limit, or with the wrist near the axis of joint 1."""
    q = robot.sample(rng)
    if number % 4 == 1:
        q[3] = math.pi + rng.uniform(-0.02, 0.02)
    elif number % 4 == 2:
        joint = (1, 3, 5)[number // 4 % 3]
        q[joint] = (robot.lower, robot.upper)[number // 12 % 2][joint]
    elif number % 4 == 3:
        q[2] = rng.choice([0.0, math.pi]) + rng.uniform(-0.002, 0.002)
        q[1], q[3] = math.pi + rng.uniform(-0.01, 0.01, 2)
    return q


@pytest.mark.parametrize("count", [12, pytest.param(25, marks=pytest.mark.slow)])
def test_no_member_of_seven_joints_is_nearer(seven: IKSolver, rng: np.random.Generator, count: int) -> None:
    robot = seven.robot
    scan, gaps = scan_seven.Scan(robot), []
    for number in range(count):
        target = robot.forward_kinematics(structured(robot, rng, number))
        seed = robot.sample(rng) if number % 5 else robot.home
        result = seven.solve(target, seed=seed).raise_for_status()
        distance = float(np.linalg.norm(result.q - seed))
        rows = scan.configurations(target.homogeneous, seed[2] + TURN * np.arange(SCANNED) / SCANNED)
        rows = rows[np.isfinite(rows[..., 0])]
        rows = rows[scan_seven.within_limits(robot, rows)]
        gaps.append(float(scan_seven.distances(robot, rows, seed).min(initial=math.inf)) - distance)
        assert gaps[-1] >= -1e-9
        family = seven.solve_all(target)
        own = family.nearest(seed)
        assert own is not None
        assert np.linalg.norm(own - seed) == pytest.approx(distance, abs=1e-9)
        np.testing.assert_allclose(own, result.q, atol=1e-6)
    assert np.median(gaps) < COARSE


@pytest.mark.parametrize("count", [24, pytest.param(150, marks=pytest.mark.slow)])
def test_no_solution_of_any_structure_is_farther_than_the_one_beside_the_seed(
    rng: np.random.Generator, count: int
) -> None:
    """Also with a straight wrist, on curves along which two joints turn against each other."""
    solver = IKSolver(jacokin.load_robot("gen3"), collision="ignore")
    robot = solver.robot
    for number in range(count):
        q = robot.sample(rng)
        if number % 4 == 0:
            q[5] = 0.0
        seed = np.clip(q + (0.01, 0.05, 0.3)[number % 3] * rng.standard_normal(7), robot.lower, robot.upper)
        found = solver.solve(robot.forward_kinematics(q), seed=seed).raise_for_status()
        assert np.linalg.norm(found.q - seed) <= np.linalg.norm(q - seed) + 1e-6


@pytest.mark.one_quick
@pytest.mark.parametrize("count", [12, pytest.param(100, marks=pytest.mark.slow)])
@pytest.mark.parametrize("turns", [False, True], ids=["own limits", "joints of two turns"])
@pytest.mark.parametrize("name", ["j2n6s300", "gen3_lite", "gen3", "panda", "xarm7"])
def test_the_answer_near_a_seed_is_the_nearest_of_the_whole_set(
    name: str, turns: bool, count: int, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Only parts of the curves are looked at for it: how large they are depends on how near the seed is."""
    robot = load_arm(name, tmp_path) if name in ARMS else jacokin.load_robot(name)
    if turns:
        limits = dict.fromkeys(robot.joint_names[::2], (-7.0, 6.0))
        robot = jacokin.load_robot(robot.source.path or name, limits=limits)
    solver = IKSolver(robot, collision="ignore")
    for number in range(count):
        q = robot.sample(rng)
        target = T = robot.forward_kinematics(q)
        if robot.dof == 6:
            free = ((-math.pi, math.pi), (-0.2, 0.3))[number % 2]
            target = FreeAxis(T, axis=rng.normal(size=3), range=free)
        moved = (1e-3, 0.03, 0.3, 1.0)[number % 4] * rng.standard_normal(robot.dof)
        seed = np.clip(q + moved, robot.lower, robot.upper)
        result = solver.solve(target, seed=seed).raise_for_status()
        found = solver.solve_all(target)
        nearest = found.nearest(seed)
        assert nearest is not None
        farther = np.linalg.norm(result.q - seed) - np.linalg.norm(nearest - seed)
        assert farther < 1e-8
        assert farther > -1e-8 or not found.complete


@pytest.mark.parametrize("count", [150, pytest.param(1000, marks=pytest.mark.slow)])
def test_the_answer_is_the_nearest_of_the_curves_where_there_are_solutions_all_around(
    count: int, rng: np.random.Generator
) -> None:
    """Where joints 4 and 6 turn about the axis about which the tool is free, two numbers are: Newton's steps slide."""
    solver = IKSolver(jacokin.load_robot("j2s6s200"), collision="ignore")
    robot = solver.robot
    for number in range(count):
        q = robot.sample(rng)
        q[2], q[4] = q[1] + math.pi * (number % 2), math.pi
        q = q + (0.0, 1e-12, 1e-9)[number % 3] * rng.standard_normal(6)
        target = FreeAxis(robot.forward_kinematics(q), axis=(0.0, 0.0, 1.0))
        if not robot.within_limits(q):
            continue
        seed = robot.sample(rng) + TURN * rng.integers(-3, 4, 6) * robot.unlimited
        result, found = solver.solve(target, seed=seed).raise_for_status(), solver.solve_all(target, seed)
        nearest = found.nearest(seed)
        assert nearest is not None
        assert np.linalg.norm(result.q - seed) < np.linalg.norm(nearest - seed) + 1e-8


@pytest.mark.parametrize("count", [30, pytest.param(400, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["gen3", "gen3_6dof", "two digits"])
def test_an_arm_that_nearly_has_a_wrist_gets_the_same_answers_as_in_general(
    name: str, count: int, tmp_path: Path, rng: np.random.Generator
) -> None:
    """Axes 5 and 7 of a Gen3, and 4 and 6 of the one with six joints, miss each other by a third of a millimetre.

    And right angles may be written with two digits. Next to places where configurations of the wrist meet whole curves
    are followed: that is enough but for a few targets.
    """
    if name == "two digits":
        placements = [(xyz, (round(roll, 2), 0.0, 0.0)) for xyz, (roll, _, _) in ARMS["rm75"][0]]
        robot = load_placed(name, placements, ARMS["rm75"][1], tmp_path)
    else:
        robot = jacokin.load_robot(name)
    solver = IKSolver(robot, collision="ignore")
    arm = forms.about_axis(solver.verifier) if robot.dof == 6 else forms.at_poses(solver.verifier)
    assert isinstance(arm, CurveArm)
    assert arm.nearly is not None
    given = 0
    for number in range(count):
        target: FreeAxis | pin.SE3 = robot.forward_kinematics(q := robot.sample(rng))
        if robot.dof == 6:
            target = FreeAxis(target, axis=rng.normal(size=3))
        seed = (robot.home, robot.sample(rng), q.clip(robot.lower + 0.1, robot.upper - 0.1))[number % 3]
        problem = arm.problem(interpret(target, robot.default_frame))
        none = np.empty((0, 7))
        nearly = problem._replace(arm=arm.nearly).nearest(none, seed, 0.0)
        answer = problem._replace(arm=in_general(arm)).nearest(none, seed, 0.0)
        assert isinstance(answer, np.ndarray)
        if isinstance(nearly, np.ndarray):
            given += 1
            away, least = (np.linalg.norm(x[: robot.dof] - seed) for x in (nearly, answer))
            assert away == pytest.approx(least, abs=1e-9)
    assert given > 0.94 * count


def in_general(arm: CurveArm) -> CurveArm:
    """The same arm, without what it nearly is."""
    found = copy.copy(arm)
    found.nearly = None
    return found


def test_only_an_arm_that_is_near_enough_counts_as_one_with_a_wrist(tmp_path: Path) -> None:
    placements, limits = ARMS["gen3"]
    for aside, near in ((0.0, True), (5e-4, True), (0.01, False)):
        moved = list(placements)
        (x, y, z), rpy = placements[6]
        moved[6] = (x + aside, y, z), rpy
        arm = forms.at_poses(IKSolver(load_placed("moved", moved, limits, tmp_path)).verifier)
        assert isinstance(arm, CurveArm)
        assert (arm.nearly is not None) == near
    panda = forms.at_poses(IKSolver(load_arm("panda", tmp_path)).verifier)
    assert isinstance(panda, CurveArm)
    assert panda.nearly is None  # its wrist is none but for rounding


@pytest.mark.one_quick
@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, 0.0, -1.0), (0.3, -0.5, 0.4)])
def test_no_member_about_a_free_axis_is_nearer(
    six: IKSolver, rng: np.random.Generator, axis: tuple[float, float, float]
) -> None:
    robot = six.robot
    for number in range(8):
        limits = ((-math.pi, math.pi), (-0.7, 1.1))[number % 2]
        target = FreeAxis(robot.forward_kinematics(robot.sample(rng)), axis=axis, range=limits)
        seed = robot.sample(rng)
        result = six.solve(target, seed=seed).raise_for_status()
        distance = float(np.linalg.norm(result.q - seed))
        poses = np.array([target.matrix_at(p) for p in np.linspace(*limits, SCANNED)])
        rows = six.closed_form().solve_batch(poses, np.tile(seed, (SCANNED, 1)))
        apart = np.linalg.norm(rows.q[rows.within_limits] - seed, axis=1)
        assert -1e-9 <= apart.min(initial=math.inf) - distance < COARSE
        own = six.solve_all(target).nearest(seed)
        assert own is not None
        assert np.linalg.norm(own - seed) == pytest.approx(distance, abs=1e-9)
        np.testing.assert_allclose(own, result.q, atol=1e-6)
        assert result.parameter is not None
        assert limits[0] <= result.parameter <= limits[1]
        error = target.at(result.parameter).actInv(robot.forward_kinematics(result.q))
        assert np.abs(error.homogeneous - np.eye(4)).max() < 1e-9


def test_a_member_is_nearest_to_itself(seven: IKSolver, rng: np.random.Generator) -> None:
    for number in range(40):
        q = structured(seven.robot, rng, number)
        result = seven.solve(seven.robot.forward_kinematics(q), seed=q).raise_for_status()
        np.testing.assert_allclose(result.q, q, atol=2e-7)


def test_limits_of_more_than_a_turn_leave_a_choice_of_copies(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("j2s7s300", limits={"joint_1": (-1.0, 6.0), "joint_5": (-2.0, 1.0)})
    solver = IKSolver(robot, collision="ignore")
    for q, seed in zip(robot.sample(rng, 5), robot.sample(rng, 5), strict=True):
        target = robot.forward_kinematics(q)
        result = solver.solve(target, seed=seed).raise_for_status()
        assert robot.within_limits(result.q)
        best = min(np.linalg.norm(row - seed) for row in solver.solve_all(target, seed=seed).sample(500))
        assert np.linalg.norm(result.q - seed) <= best + 1e-9


@pytest.mark.one_quick
@pytest.mark.parametrize("limits", [None, (-2.0, 1.5), (-7.0, 6.0)], ids=["unlimited", "less than a turn", "two turns"])
@pytest.mark.parametrize("free", [(-math.pi, math.pi), (-0.5, 0.7), (1.0, 4.0)], ids=["full turn", "narrow", "wide"])
@pytest.mark.parametrize("count", [4, pytest.param(8, marks=pytest.mark.slow)])
def test_about_the_axis_of_the_last_joint_the_others_stay(
    limits: tuple[float, float] | None,
    free: tuple[float, float],
    count: int,
    rng: np.random.Generator,
) -> None:
    """Held against every branch at 2,000 angles about the axis, each solved as a pose of its own."""
    robot = jacokin.load_robot(limits=None if limits is None else {"joint_6": limits})
    solver = IKSolver(robot, collision="ignore")
    solved = 0
    for number in range(count):
        sign = 1.0 if number % 2 else -1.0
        target = FreeAxis(robot.forward_kinematics(robot.sample(rng)), axis=(0.0, 0.0, sign), range=free)
        seed = robot.sample(rng)
        angles = np.linspace(*free, 2000)
        poses = [target.matrix_at(angle) for angle in angles.tolist()]
        rows = solver.solve_batch(np.array(poses), seeds=seed, closest=False)
        reached = [row for row, success in zip(rows.q, rows.success, strict=True) if success]
        if not reached:
            continue
        solved += 1
        result = solver.solve(target, seed=seed).raise_for_status()
        assert result.parameter is not None
        assert free[0] <= result.parameter <= free[1] or free[1] - free[0] >= TURN
        best = min(float(np.linalg.norm(row - seed)) for row in reached)
        assert float(np.linalg.norm(result.q - seed)) <= best + 1e-9
    assert solved >= count // 2


def test_seeds_far_outside_the_limits(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot()
    target = FreeAxis(robot.forward_kinematics(robot.home), axis=(1.0, 0.0, 0.0))
    family = IKSolver(robot, collision="ignore").solve_all(target)
    far = rng.uniform(-1e6, 1e6, robot.dof)
    nearest = family.nearest(far)
    assert nearest is not None
    assert robot.within_limits(nearest)
    assert (np.abs(nearest - far)[[0, 3, 4, 5]] < math.pi + 0.1).any()  # the copies there
    for call in (family.nearest, family.intervals[0].nearest):
        with pytest.raises(InvalidInputError, match="joint_1 = 1e\\+07 rad is too far from zero"):
            call([1e7] * 6)


#: Limits of joints 2 and 6 of a j2s7s300 [rad].
LOWER_2, LOWER_6, UPPER_6 = math.radians(47.0), math.radians(65.0), math.radians(295.0)


@pytest.mark.parametrize(
    ("own", "way"),
    [
        (
            (-2.2545966205740147, LOWER_2, -0.07686896226313067, math.pi, 0.4471113528288475, UPPER_6, -0.148673705741),
            (
                3.6516785987e-4,
                0.0,
                -2.7984763943e-4,
                2.6609735746e-4,
                -3.2901009524e-4,
                -1.3889230732e-4,
                5.8806420276e-4,
            ),
        ),
        (
            (
                -1.4472959465492676,
                LOWER_2,
                -1.9688515463705814,
                3.141592423175998,
                -1.4613186114159336,
                LOWER_6,
                -1.9085600954664903,
            ),
            (-1.47543655e-4, 4.22522899e-4, -2.25456162e-4, 4.08337940e-4, 6.66036160e-4, 0.0, 6.56261364e-6),
        ),
    ],
)
def test_the_nearest_member_is_where_a_joint_touches_its_limit_and_another_leaves_its_own(
    own: Sequence[float], way: Sequence[float]
) -> None:
    """Joint 2 touches its limit but for 1e-12 rad where joint 6 leaves its own; at the seed, both are within."""
    robot = jacokin.load_robot("j2s7s300")
    solver = IKSolver(robot, collision="ignore")
    q = np.array(own)
    seed = q + way
    result = solver.solve(solver.verifier.tool_pose(q), seed=seed).raise_for_status()
    assert np.linalg.norm(result.q - seed) <= np.linalg.norm(way) + 1e-6


def test_a_member_is_nearest_where_two_joints_touch_their_limits_at_once() -> None:
    """Joints 2 and 6 are within by 1e-13 rad along 1e-5 rad of the curve, and nowhere else near by."""
    limits = {
        "joint_1": (-3.9438066006297547, 0.9932977770513172),
        "joint_2": (math.radians(-210.0), math.radians(-100.0)),
    }
    limits |= {"joint_3": (math.radians(-140.0), math.radians(-50.0)), "joint_7": (0.0, 0.5 * math.pi)}
    robot = jacokin.load_robot("j2s7s300", limits=limits)
    rotation = [
        [-0.8017705603274574, -0.48690365015112425, 0.3465383154309305],
        [0.4726846773960961, -0.871466685514908, -0.13082435473798296],
        [0.365695453003102, 0.05891223563210534, 0.9288682275466652],
    ]
    position = -0.22686592623758506, -0.18985313974168583, -0.16190718708915855
    tool = jacokin.pose(position, rotation=rotation)
    solver = IKSolver(robot, tool=tool, collision="ignore")
    own = np.array([robot.upper[0], robot.upper[1], -0.5 * math.pi, math.pi, math.pi / 6, robot.lower[5], math.pi / 6])
    way = np.array([0.0, 0.0, -0.714195191651168, -2.703632261842337, 8.641592339660997, 0.0, 3.013563656887319]) * 1e-4
    result = solver.solve(solver.verifier.tool_pose(own), seed=own + way).raise_for_status()
    assert np.linalg.norm(result.q - own - way) <= np.linalg.norm(way) + 1e-6


@pytest.mark.parametrize(
    ("frame", "own", "seed"),
    [
        (
            "gripsite",
            (
                2.954200985045018,
                1.9949533416138925,
                4.7123893732963005,
                0.5235987755982988,
                math.pi,
                4.692877008375193,
                -1.5047683424122549,
            ),
            (
                3.3744655885833126,
                2.1222939030507986,
                5.202810257460731,
                1.525822196265659,
                -2.3497055627582895,
                4.017856998964151,
                12.850890167503144,
            ),
        ),
        (
            "end_effector",
            (
                -1.541688490989617,
                0.9471728459055728,
                1.5707894815583943,
                5.759586531581287,
                -8.206431761219671e-08,
                2.61372125534725,
                -1.4777108023111827,
            ),
            (
                -14.241245529927781,
                3.377528934099191,
                -7.958239447457532,
                2.1300350894382944,
                3.793734922992655,
                3.7026379800144684,
                -16.09499245774625,
            ),
        ),
    ],
)
def test_a_joint_that_passes_its_limit_slowly_does_so_at_one_place(
    frame: str, own: Sequence[float], seed: Sequence[float]
) -> None:
    """Joint 4 moves by 1e-4 of joint 3: 1e-5 rad beyond the nearest member it is past its limit by a snap."""
    solver = IKSolver(jacokin.load_robot("j2s7s300"), frame, collision="ignore")
    target = solver.verifier.tool_pose(np.array(own))
    found, result = solver.solve_all(target, seed=seed), solver.solve(target, seed=seed).raise_for_status()
    nearest = found.nearest(seed)
    assert nearest is not None
    np.testing.assert_allclose(result.q, nearest, rtol=0.0, atol=1e-8)


def test_in_an_incomplete_set_nothing_is_nearer_than_the_answer() -> None:
    """Along most curves the wrist is straight but for 1e-12 rad, and tables are full before all are followed."""
    solver = IKSolver(jacokin.load_robot("j2s6s200"), "gripsite", collision="ignore")
    own = (
        1.4331354973696557,
        3.1384031884178167,
        6.279995842005411,
        0.1443800426698106,
        3.1415926535890786,
        -2.644206756523204,
    )
    seed = (
        20.164951016960664,
        3.6261589358123585,
        3.423311810231038,
        2.4643028078113387,
        0.6117388502841017,
        -4.936362276739521,
    )
    target = FreeAxis(solver.verifier.tool_pose(np.array(own)), axis=(1.0, 0.0, 0.0))
    found, result = solver.solve_all(target, seed=seed), solver.solve(target, seed=seed).raise_for_status()
    nearest = found.nearest(seed)
    assert nearest is not None
    assert np.linalg.norm(result.q - seed) <= np.linalg.norm(nearest - seed) + 1e-8


@pytest.mark.parametrize("axis", [(0.0, 0.0, 1.0), (0.6, 0.0, 0.8)])
def test_beside_a_seed_steps_end_where_nothing_nearer_is_left(
    axis: tuple[float, ...], rng: np.random.Generator
) -> None:
    """With nearly the distance of the nearest member there is none, with twice that there is that member."""
    robot = jacokin.load_robot("j2n6s300")
    solver = IKSolver(robot, collision="ignore")
    for own in robot.sample(rng, 20):
        target = interpret(FreeAxis(robot.forward_kinematics(own), axis=axis), solver.frame)
        seed = own + 1e-3 * rng.normal(size=6)
        nearest = SetSearch(solver.verifier, forms.about_axis(solver.verifier)).nearest(target, seed)
        assert nearest is not None
        members = Members(solver.verifier, None, target, seed)
        p, way = target.nearest_angle(members.parameter(seed)), float(np.linalg.norm(nearest[0] - seed))
        assert members.beside(seed, p, 1.01 * way) is None
        found = members.beside(seed, p, 2.0 * way)
        assert found is not None
        np.testing.assert_allclose(found[0], nearest[0], rtol=0.0, atol=1e-6)


@pytest.mark.parametrize(
    ("name", "frame", "own", "axis", "seed"),
    [
        (
            "j2s6s200",
            "end_effector",
            (-1.86042, 1.98762, 8.601119e-12, 0.32403, -4.852164e-09, -2.35372),
            (-0.51667497, -0.69016183, 0.50667902),
            (19.2802, 1.2417, 1.0847, -10.9202, 2.9492, 21.3597),
        ),
        (
            "j2s6s300",
            "gripsite",
            (1.383999, 1.722131, 4.863724, -0.676, 3.141592653591617, -0.207442),
            (-0.43596202, 0.20993961, 0.87513569),
            (18.8226, 2.0031, 4.5935, -13.082, 2.5056, 11.343),
        ),
        (  # where the elbow is stretched the wrist is straight but for 1e-10 rad, and turns all round
            "j2s6s200",
            "gripsite",
            (-2.48388316, 3.855714545, math.pi, -1.759543374, math.pi, 0.32843175),
            (0.0, 0.0, 1.0),
            (9.0832, 1.431, 4.8715, -5.6698, 5.5143, 4.2681),
        ),
    ],
)
def test_near_circles_of_a_straight_wrist_the_answer_is_as_near_as_the_set_tells(
    name: str, frame: str, own: Sequence[float], axis: Sequence[float], seed: Sequence[float]
) -> None:
    solver = IKSolver(jacokin.load_robot(name), frame, collision="ignore")
    target = FreeAxis(solver.verifier.tool_pose(np.array(own)), axis=axis)
    found, result = solver.solve_all(target, seed=seed), solver.solve(target, seed=seed).raise_for_status()
    nearest = found.nearest(seed)
    assert nearest is not None
    assert np.linalg.norm(np.subtract(result.q, seed)) <= np.linalg.norm(nearest - seed) + 1e-8


def test_beside_a_seed_there_is_a_member_as_near_as_any() -> None:
    """All axes but one are parallel or meet, but for 1e-4 rad: least steps to the target lead farther away."""
    solver = IKSolver(jacokin.load_robot("j2s7s200"), collision="ignore")
    own = np.array([5.58e-5, math.pi - 3.1e-6, 7.07e-5, math.pi - 3.31e-5, -6.15e-5, math.pi + 3.13e-5, 1.57086587])
    way = np.array([6.1789839e-4, -1.83006e-4, 7.060903e-5, 1.6293752e-4, 2.150068e-4, -4.951749e-4, -5.116131e-4])
    seed = own + way
    result = solver.solve(solver.verifier.tool_pose(own), seed=seed).raise_for_status()
    assert np.linalg.norm(result.q - seed) <= np.linalg.norm(way) + 1e-4
