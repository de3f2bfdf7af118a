"""The law of own answers: a configuration is the answer to its own pose, and a member of its own family."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from fuzz import own_answers
from fuzz.findings import Finding
from jacokin import FreeAxis, IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.model.angles import wrap_to_pi

DEGREES = math.pi / 180.0


def distance(robot: Robot, rows: Array, seed: Array) -> Array:
    """From a seed (dof,), circular on unlimited joints [rad]."""
    apart = rows - seed
    return np.asarray(np.linalg.norm(np.where(robot.unlimited, wrap_to_pi(apart), apart), axis=-1))


def solver_of(name: str, **limits: tuple[float, float]) -> IKSolver:
    return IKSolver(jacokin.load_robot(name, limits=limits or None), collision="ignore")


@pytest.mark.parametrize("kind", own_answers.CLASSES)
@pytest.mark.parametrize("name", ["j2s7s300", "j2s6s300", "j2n6s300"])
def test_a_configuration_is_its_own_answer(name: str, kind: str, rng: np.random.Generator) -> None:
    solver = solver_of(name)
    robot = solver.robot
    findings: list[Finding] = []
    for _ in range(8 if kind == "multiples of 90 degrees" else 20):
        q = np.clip(own_answers.CLASSES[kind](robot, rng), robot.lower, robot.upper)
        findings.extend(own_answers.check(solver, kind, q, rng))
    assert [finding for finding in findings if finding.kind != "unsure"] == []


@pytest.mark.parametrize(
    "q",
    [
        (0.0, 90.0, 0.0, 180.0, 180.0, 180.0, 270.0),
        (0.0, 180.0, 0.0, 90.0, 0.0, 180.0, 0.0),
        (-90.0, 90.0, -90.0, 180.0, 90.0, 180.0, 180.0),
        (0.0, 90.0, -180.0, 180.0, -90.0, 180.0, -180.0),
    ],
)
@pytest.mark.parametrize("name", ["j2s7s200", "j2s7s300"])
def test_seven_joints_at_right_angles_have_a_complete_family(name: str, q: tuple[float, ...]) -> None:
    solver = solver_of(name)
    own = np.array(q) * DEGREES
    T = solver.robot.forward_kinematics(own)
    family = solver.solve_all(T, seed=own)
    assert family.complete
    assert np.abs(wrap_to_pi(solver.solve(T, seed=own).q - own)).max() < 1e-6
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-6


@pytest.mark.parametrize(
    ("name", "q", "axis", "tool"),
    [
        # Curves cross at the configuration,
        ("j2n6s300", (180.0, 90.0, 90.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0), True),
        ("j2n6s300", (-90.0, 270.0, 90.0, 0.0, 0.0, 90.0), (0.0, 1.0, 0.0), True),
        ("m1n6s200", (-180.0, 180.0, 270.0, 180.0, 0.0, 0.0), (0.0, 0.0, 1.0), True),
        ("m1n6s300", (0.0, 270.0, 90.0, 0.0, 0.0, -90.0), (0.0, 0.0, 1.0), True),
        # it is a single point,
        ("m1n6s200", (0.0, 90.0, 180.0, 0.0, 0.0, 0.0), (1.0, 0.0, 0.0), False),
        ("m1n6s300", (0.0, 180.0, 180.0, 90.0, -180.0, 0.0), (0.54, -0.17, -0.83), True),
        ("m1n6s200", (-90.0, 180.0, 180.0, 90.0, -90.0, -90.0), (-0.03, 0.69, -0.72), False),
        # its curve only touches a limit there,
        ("m1n6s200", (-90.0, 270.0, 35.0, 90.0, 0.0, 0.0), (1.0, 0.0, 0.0), False),
        # it is on a circle of straight wrists that short curves meet,
        ("j2s6s200", (90.0, 90.0, 180.0, -180.0, 180.0, 90.0), (1.0, 0.0, 0.0), True),
        # it is one at the edge of reach,
        (
            "j2s6s300",
            (-163.656, 179.905, 180.0, 77.957, 179.972, 116.926),
            (0.0, 1.0, 0.0),
            False,
        ),
        # or passes a limit just where it meets another one.
        ("j2s6s200", (180.0, 270.0, 341.0, -90.0, 180.0, -90.0), (0.0, 0.0, 1.0), True),
        ("j2s6s200", (0.0, 180.0, 19.0, 0.0, 180.0, 0.0), (0.0, 1.0, 0.0), False),
    ],
)
def test_singular_members_about_a_free_axis_are_members(
    name: str, q: tuple[float, ...], axis: tuple[float, float, float], *, tool: bool
) -> None:
    solver = IKSolver(
        jacokin.load_robot(name), tool=jacokin.pose((0.5, 0.0, 0.0)) if tool else None, collision="ignore"
    )
    own = np.clip(np.array(q) * DEGREES, solver.robot.lower, solver.robot.upper)
    target = FreeAxis(solver.verifier.tool_pose(own), axis=axis)
    assert np.abs(wrap_to_pi(solver.solve(target, seed=own).q - own)).max() < 1e-6
    family = solver.solve_all(target)  # without the configuration as a seed
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-4


@pytest.mark.parametrize(
    "q",
    [
        (-90.0, 270.0, 90.0, 180.0, -90.0, 180.0, 90.0),
        (-90.0, 90.0, 90.0, 180.0, 180.0, 180.0, 90.0),
        (-90.0, 180.0, -90.0, 180.0, 90.0, 180.0, 0.0),
        (-90.0, 90.0, -90.0, 330.0, -90.0, 180.0, 0.0),
        (-90.0, 270.0, 90.0, 30.0, 0.0, 180.0, 180.0),
        (180.0, 180.0, 90.0, 210.0, -90.0, 295.0, -60.0),
    ],
)
def test_singular_members_of_seven_joints_are_members(q: tuple[float, ...]) -> None:
    solver = solver_of("j2s7s300")
    own = np.clip(np.array(q) * DEGREES, solver.robot.lower, solver.robot.upper)
    T = solver.robot.forward_kinematics(own)
    assert np.abs(wrap_to_pi(solver.solve(T, seed=own).q - own)).max() < 1e-6
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in solver.solve_all(T)) < 1e-5


@pytest.mark.parametrize("tool", [None, jacokin.pose((0.5, 0.0, 0.0))])
@pytest.mark.parametrize(
    ("name", "q"),
    [
        ("j2s7s300", (0.61138378218, 0.83572912938, 0.04950544671, 5.65130986011, 1.47207155929, math.pi, 2.92796577)),
        ("j2s7s200", (-2.59700931871, 0.8919505976, 2.9535791234, 0.66637331003, 1.53472613400, math.pi, -0.55055194)),
        ("j2s7s300", (1.96378332200, 4.0029511772, -2.8281220082, 0.60363645992, -2.44428010421, math.pi, 0.47983119)),
    ],
)
def test_a_straight_wrist_is_found_where_no_node_of_a_curve_is_near_it(
    name: str, q: tuple[float, ...], tool: pin.SE3 | None
) -> None:
    solver = IKSolver(jacokin.load_robot(name), tool=tool)
    own, T = np.array(q), solver.verifier.tool_pose(np.array(q))
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in solver.solve_all(T)) < 1e-6


@pytest.mark.parametrize(
    ("name", "q", "axis", "tool"),
    [
        # A straight wrist on a stretched arm, beside curves that are a hundredth of a radian long,
        ("j2s6s300", (0.0, 270.0, 180.0, -180.0, 180.0, -90.0), (1.0, 0.0, 0.0), False),
        ("j2s6s200", (90.0, 90.0, 180.0, 90.0, 180.0, 0.0), (1.0, 0.0, 0.0), True),
        # curves of 2e-4 rad that end at a quarter turn,
        (
            "j2s6s300",
            (-2.394225567, 84.359298947, 180.0, -177.688657055, 180.994320757, 51.463503829),
            (1.0, 0.0, 0.0),
            False,
        ),
        # a closed curve of 2e-3 rad,
        ("m1n6s300", (-90.0, 90.0, 180.0, -180.0, 90.0, -90.0), (0.0, 1.0, 0.0), True),
        # and a curve all along which the arm is at the edge of reach.
        ("m1n6s200", (90.0, 180.0, 180.0, -180.0, 0.0, -90.0), (0.0, 0.0, 1.0), True),
    ],
)
def test_members_at_the_edge_of_reach_are_members(
    name: str, q: tuple[float, ...], axis: tuple[float, float, float], *, tool: bool
) -> None:
    solver = IKSolver(jacokin.load_robot(name), tool=jacokin.pose((0.5, 0.0, 0.0)) if tool else None)
    own = np.array(q) * DEGREES
    family = solver.solve_all(FreeAxis(solver.verifier.tool_pose(own), axis=axis))
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-6


@pytest.mark.parametrize("kind", ["multiples of 90 degrees", "stretched", "straight wrist"])
@pytest.mark.parametrize("name", ["j2s7s300", "m1n6s300"])
def test_a_complete_family_has_every_branch_at_many_parameters(name: str, kind: str, rng: np.random.Generator) -> None:
    solver = solver_of(name)
    for _ in range(4):
        q = np.clip(own_answers.CLASSES[kind](solver.robot, rng), solver.robot.lower, solver.robot.upper)
        T = solver.verifier.tool_pose(q)
        target = T if solver.robot.dof == 7 else FreeAxis(T, axis=np.eye(3)[int(rng.integers(2))])
        assert own_answers.find_missing(solver, solver.solve_all(target), target, q, rng) is None


@pytest.mark.parametrize("tool", [None, jacokin.pose((0.5, 0.0, 0.0))])
@pytest.mark.parametrize(
    ("name", "q", "axis"),
    [
        # Where a circle of straight wrists meets other curves, joint 4 passes its limit, too, or touches it,
        ("j2s7s200", (-180.0, 240.0, 0.0, 330.0, 120.0, 180.0, -150.0), None),
        ("j2s7s200", (-90.0, 90.0, -180.0, 330.0, -180.0, 180.0, 0.0), None),
        ("j2s7s200", (90.0, 270.0, 90.0, 330.0, 0.0, 180.0, -180.0), None),
        # the point in the middle of a curve is not found where others cross it,
        ("j2n6s300", (-90.0, 270.0, 180.0, 180.0, 180.0, 0.0), (1.0, 0.0, 0.0)),
        # curves all end next to a circle,
        ("j2s6s200", (153.8768, 192.6793, 179.4646, -45.5106, 180.0, -111.6135), (0.0, 1.0, 0.0)),
        # or are taken for others there,
        ("j2s6s300", (-30.0, 300.0, 180.0, 120.0, 180.0, 90.0), (0.0, 1.0, 0.0)),
        # and those of an arm that is nearly stretched are short, next to an edge of joint 3.
        ("j2s7s300", (80.48033, 179.77228, 165.57382, 180.0, 108.64824, 213.28231, -139.30024), None),
    ],
)
def test_a_complete_family_lacks_no_branch_next_to_singular_members(
    name: str,
    q: tuple[float, ...],
    axis: tuple[float, float, float] | None,
    tool: pin.SE3 | None,
    rng: np.random.Generator,
) -> None:
    solver = IKSolver(jacokin.load_robot(name), tool=tool, collision="ignore")
    own = np.clip(np.array(q) * DEGREES, solver.robot.lower, solver.robot.upper)
    T = solver.verifier.tool_pose(own)
    target = T if axis is None else FreeAxis(T, axis=axis)
    family = solver.solve_all(target)
    for _ in range(3):
        assert own_answers.find_missing(solver, family, target, own, rng) is None
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-5
    assert family.complete or name.startswith("j2s6s")  # curves of 2e-5 rad, and such that a circle hides


def test_a_closed_curve_beside_the_folds_of_others_is_found() -> None:
    """In one gap between slices with them, where roots of the polynomial are not told apart."""
    solver = IKSolver(jacokin.load_robot("j2n6s300"), tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore")
    own = np.array([-2.9045244743715575, 1.0518690959367183, 3.672064522043798, 1.98265586, -0.92327451, 2.16419309])
    axis = (-0.2291247435016545, 0.09322864979913463, -0.968922221218985)
    target = FreeAxis(solver.verifier.tool_pose(own), axis=axis)
    family = solver.solve_all(target)
    assert family.complete
    assert family.branches == 10
    there = solver.solve_all(target.at(-1.0264559))
    assert len(there) == sum(arc.contains(-1.0264559) for arc in family) + (~there.within_limits).sum()


def test_a_small_closed_curve_through_a_quarter_turn_is_found(rng: np.random.Generator) -> None:
    solver = IKSolver(jacokin.load_robot("m1n6s300"), tool=jacokin.pose((0.5, 0.0, 0.0)))
    own = np.array((-90.0, 90.0, 180.0, -180.0, 90.0, -90.0)) * DEGREES
    target = FreeAxis(solver.verifier.tool_pose(own), axis=(0.0, 1.0, 0.0))
    assert own_answers.find_missing(solver, solver.solve_all(target), target, own, rng) is None


def test_a_family_without_a_small_curve_through_a_singular_point_is_not_called_complete(
    rng: np.random.Generator,
) -> None:
    solver = solver_of("j2s6s300")
    own = np.array((90.0, 180.0, 180.0, 90.0, 270.0, 90.0)) * DEGREES
    axis = (0.10821628092449317, 0.8513962266934214, -0.5132384452816016)
    target = FreeAxis(solver.verifier.tool_pose(own), axis=axis)
    family = solver.solve_all(target)
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-6
    assert not family.complete or own_answers.find_missing(solver, family, target, own, rng) is None


def test_points_of_a_curve_at_the_edge_of_reach_are_not_called_complete() -> None:
    """The arm is stretched upwards: joints 1, 4 and 6 turn together, and nothing says where such a curve goes."""
    solver = IKSolver(jacokin.load_robot("m1n6s200"), tool=jacokin.pose((0.5, 0.0, 0.0)))
    own = np.array((90.0, 180.0, 180.0, -180.0, 0.0, -90.0)) * DEGREES
    assert not solver.solve_all(FreeAxis(solver.verifier.tool_pose(own), axis=(0.0, 0.0, 1.0))).complete


def test_a_joint_may_touch_its_limit_just_where_another_passes_its_own() -> None:
    solver = IKSolver(jacokin.load_robot("j2s7s200"), tool=jacokin.pose((0.5, 0.0, 0.0)))
    own = np.array((30.0, 180.0, -30.0, 30.0, 90.0, 0.0, 180.0)) * DEGREES
    own[5] = solver.robot.upper[5]
    family = solver.solve_all(solver.verifier.tool_pose(own))
    near = [each for each in family if np.abs(wrap_to_pi(each.nearest(own) - own)).max() < 1e-9]
    assert len(near) == 1


def test_a_joint_that_stays_on_its_limit_while_others_turn_is_within_it() -> None:
    solver = IKSolver(jacokin.load_robot("j2s7s200"), collision="ignore")
    own = np.array((-0.5, 0.5, 0.0, 1.0 / 6.0, -1.0, 1.0, -1.0)) * math.pi
    own[:3] += (-2.0287507e-07, 5.1548963e-08, -1.21843294e-07)
    own[4:] += (-2.9503957e-08, -4.2921536e-09, -1.33997666e-07)
    own[3] = solver.robot.lower[3]
    family = solver.solve_all(solver.robot.forward_kinematics(own))
    assert min(np.abs(wrap_to_pi(each.nearest(own) - own)).max() for each in family) < 1e-6


@pytest.mark.parametrize("limits", [(0.01, 1.0), (-2.0, -0.01)])
def test_a_straight_wrist_outside_the_range_is_no_member(limits: tuple[float, float], rng: np.random.Generator) -> None:
    solver = solver_of("j2s6s300")
    q = solver.robot.sample(rng)
    q[4] = math.pi
    target = FreeAxis(solver.robot.forward_kinematics(q), axis=(1.0, 0.0, 0.0), range=limits)
    for interval in solver.solve_all(target):
        assert limits[0] - 1e-9 <= interval.start <= interval.stop <= limits[1] + 1e-9


def test_a_configuration_on_a_limit_is_its_own_answer_where_rounding_puts_branches_past_it() -> None:
    """Wrist and arm are bent by 1e-6 rad: rounding moves branches along joints 4 and 6 by 1e-4 rad."""
    own = np.array([-1.5707937981667417, 1.5707981096920451, -3.1415974484233025, -1.3793406341518253, 0.0, 0.0])
    own[4:] = 1.4237138742437597e-06, 1.5650614879298345e-07
    way = np.array([9.17989e-05, 3.125824e-04, 2.527282e-04, 0.0, -1.14967e-05, -8.765564e-04])
    limits = {"joint_3": (-1.5 * math.pi, -140.0 * DEGREES), "joint_4": (float(own[3]), 1.957291462053893)}
    limits |= {"joint_5": (-0.6421231638150, 5.3219655373554), "joint_6": (-200.0 * DEGREES, 120.0 * DEGREES)}
    rotation = [
        [0.5977287432088384, 0.7988938043688476, -0.06700029017140206],
        [-0.8015659788430265, 0.5940202773266612, -0.06805800236693166],
        [-0.014571585480079027, 0.09438537739409691, 0.9954290880975755],
    ]
    tool = jacokin.pose((-0.1516035340053487, 0.29998116389451884, -0.06330209730991643), rotation=rotation)
    solver = IKSolver(jacokin.load_robot("j2s6s200", limits=limits), tool=tool, collision="ignore")
    T = solver.verifier.tool_pose(own)
    branches = solver.solve_all(T)
    within = branches.q[(branches.margin >= 0.0).all(axis=1)]
    assert np.abs(wrap_to_pi(within - own)).max(axis=1).min() < 1e-4
    result = solver.solve(T, seed=own + way).raise_for_status()
    assert np.linalg.norm(result.q - own - way) <= np.linalg.norm(way) + 1e-4


def test_a_nearly_straight_wrist_at_the_end_of_a_range_is_a_member_or_may_be_missing(
    rng: np.random.Generator,
) -> None:
    complete, held = 0, 0
    for number in range(60):
        solver = solver_of(("j2s6s300", "j2s6s200", "m1n6s200")[number % 3])
        q = solver.robot.sample(rng)
        q[4] = math.pi if number % 3 < 2 else q[4]
        q = np.clip(q + 1e-10 * rng.normal(size=6), solver.robot.lower, solver.robot.upper)
        axis = np.eye(3)[number % 3] if number % 2 else rng.normal(size=3)
        T = solver.robot.forward_kinematics(q)
        for limits in ((-math.pi, 0.0), (0.0, 2.0)):
            family = solver.solve_all(FreeAxis(T, axis=axis, range=limits))
            near = any(np.abs(wrap_to_pi(each.nearest(q) - q)).max() < 1e-4 for each in family)
            assert near or not family.complete, (number, limits)
            held, complete = held + near, complete + family.complete
    assert held >= 90
    assert complete >= 30


def members_around(solver: IKSolver, rng: np.random.Generator, number: int) -> int:
    """Ask for members all along the intervals of poses at right angles; returns how many there were."""
    robot, asked = solver.robot, 0
    while asked < number:
        q = np.clip(own_answers.CLASSES["multiples of 90 degrees"](robot, rng), robot.lower, robot.upper)
        T = robot.forward_kinematics(q)
        target = T if robot.dof == 7 else FreeAxis(T, axis=np.eye(3)[int(rng.integers(3))])
        for interval in solver.solve_all(target):
            for p in rng.uniform(interval.start, interval.stop, 5).tolist():
                member = interval.at(p)
                assert robot.within_limits(member)
                wanted = T if robot.dof == 7 else target.at(p)
                assert np.abs(robot.forward_kinematics(member).homogeneous - wanted.homogeneous).max() < 3e-9
                asked += 1
    return asked


@pytest.mark.parametrize("name", ["j2s7s300", "m1n6s200"])
def test_every_parameter_of_an_interval_has_a_member(name: str, rng: np.random.Generator) -> None:
    assert members_around(solver_of(name), rng, 100) >= 100


def test_an_end_on_a_limit_just_where_curves_meet_is_a_member() -> None:
    solver = IKSolver(jacokin.load_robot("j2s6s200"), "gripsite", collision="ignore")
    q = np.array([2.40986340497831, 2.6286024141394533, 0.0, 0.6695275796847806, math.pi, -0.7282898459694027])
    q[2] = solver.robot.lower[2]
    T = solver.robot.forward_kinematics(q, frame="gripsite")
    target = FreeAxis(T, axis=(1.0, 0.0, 0.0), range=(-0.349303, 1.33239))
    for interval in solver.solve_all(target):
        for p in (interval.start, interval.stop):
            reached = solver.robot.forward_kinematics(interval.at(p), frame="gripsite")
            assert np.abs(reached.homogeneous - target.at(p).homogeneous).max() < 3e-9


@pytest.mark.slow
@pytest.mark.parametrize("name", ["j2s7s200", "j2s7s300", "j2s6s200", "j2n6s300", "m1n6s200"])
def test_every_parameter_of_many_intervals_has_a_member(name: str, rng: np.random.Generator) -> None:
    assert members_around(solver_of(name), rng, 1120) >= 1120


@pytest.mark.parametrize("limits", [None, (-1.0, 2.0)])
def test_about_the_axis_of_the_last_joint_a_straight_wrist_has_two_free_turns(
    limits: tuple[float, float] | None, rng: np.random.Generator
) -> None:
    solver = solver_of("j2s6s300", **({} if limits is None else {"joint_6": limits}))
    robot = solver.robot
    for _ in range(5):
        q = robot.sample(rng)
        q[4] = math.pi
        target = FreeAxis(robot.forward_kinematics(q), axis=(0.0, 0.0, 1.0), range=(-0.5, 0.7))
        family = solver.solve_all(target)
        assert min(distance(robot, interval.nearest(q), q) for interval in family) < 1e-9
        assert distance(robot, solver.solve(target, seed=q).q, q) < 1e-9
        seed = robot.sample(rng)
        others = []
        for turn in rng.uniform(-math.pi, math.pi, 300):  # joints 4 and 6 turned by anything that the range allows
            for sign in (1.0, -1.0):
                other = q + np.array([0.0, 0.0, 0.0, turn, 0.0, sign * turn + rng.uniform(-0.5, 0.7)])
                reached = robot.forward_kinematics(other)
                p = target.parameter_of(reached.rotation)
                same = np.abs(reached.homogeneous - target.at(p).homogeneous).max() < 1e-9
                if same and -0.5 <= p <= 0.7 and robot.within_limits(other):
                    others.append(other)
        assert others
        nearest = family.nearest(seed)
        assert nearest is not None
        assert distance(robot, nearest, seed) <= distance(robot, np.array(others), seed).min() + 1e-9


def circle_through(family: jacokin.ik.Family, q: Array) -> jacokin.ik.Interval:
    """The interval along which the parameter stands still that a configuration is on."""
    (found,) = [
        interval
        for interval in family
        if interval.start == interval.stop and np.abs(wrap_to_pi(interval.nearest(q) - q)).max() < 1e-9
    ]
    return found


def test_all_members_around_a_straight_wrist_belong_to_one_interval(rng: np.random.Generator) -> None:
    solver = solver_of("j2s7s300")
    robot = solver.robot
    q = robot.sample(rng)
    q[5] = math.pi
    T = robot.forward_kinematics(q)
    circle = circle_through(solver.solve_all(T), q)
    for turn in rng.uniform(-math.pi, math.pi, 20):
        # Axes 5 and 7 are one line: what joint 7 turns forth, joint 5 turns back.
        for sign in (1.0, -1.0):
            moved = q + turn * np.array([0.0, 0.0, 0.0, 0.0, 1.0, 0.0, sign])
            if np.linalg.norm(robot.forward_kinematics(moved).homogeneous - T.homogeneous) < 1e-9:
                break
        else:
            pytest.fail("the tool moves with joints 5 and 7, whatever their signs")
        assert np.abs(wrap_to_pi(circle.nearest(moved) - moved)).max() < 1e-9
        assert np.abs(wrap_to_pi(solver.solve(T, seed=moved).q - moved)).max() < 1e-9


def test_the_nearest_member_of_a_circle_is_nearest(rng: np.random.Generator) -> None:
    solver = solver_of("j2s6s300")
    robot = solver.robot
    for _ in range(5):
        q = robot.sample(rng)
        q[4] = math.pi
        circle = circle_through(solver.solve_all(FreeAxis(robot.forward_kinematics(q), axis=(1.0, 0.0, 0.0)), q), q)
        seed = robot.sample(rng)
        dense = np.array([circle.nearest(q + turn * np.eye(6)[3]) for turn in np.linspace(0.0, 2.0 * math.pi, 2000)])
        assert distance(robot, circle.nearest(seed), seed) <= distance(robot, dense, seed).min() + 1e-12


def test_limits_cut_a_circle(rng: np.random.Generator) -> None:
    solver = solver_of("j2s6s300", joint_4=(-1.0, 1.0), joint_6=(-0.5, 2.0))
    robot = solver.robot
    for _ in range(5):
        q = robot.sample(rng)
        q[4] = math.pi
        T = robot.forward_kinematics(q)
        family = solver.solve_all(FreeAxis(T, axis=(0.0, 1.0, 0.0)), q)
        circle = circle_through(family, q)
        assert {end.joint for end in circle.ends} <= {"joint_4", "joint_6"}
        for turn in np.linspace(-math.pi, math.pi, 50):
            assert robot.within_limits(circle.nearest(q + turn * np.eye(6)[3]))
        result = solver.solve(T, seed=q)
        assert result.status is Status.OK
        assert np.abs(result.q - q).max() < 1e-9


def test_the_answer_to_a_plain_pose_is_the_nearest_of_the_continuum(rng: np.random.Generator) -> None:
    """Joints 4 and 6 of a spherical wrist share a turn where joint 5 is straight."""
    solver = solver_of("j2s6s300")
    robot: Robot = solver.robot
    for _ in range(10):
        q = robot.sample(rng)
        q[4] = math.pi
        T = robot.forward_kinematics(q)
        seed = robot.sample(rng)
        answer = solver.solve(T, seed=seed)
        assert answer.success
        turns = np.linspace(-math.pi, math.pi, 400)
        sign = next(
            s
            for s in (1.0, -1.0)
            if np.linalg.norm(robot.forward_kinematics(q + np.array([0, 0, 0, 1, 0, s])).homogeneous - T.homogeneous)
            < 1e-9
        )
        continuum = q + turns[:, np.newaxis] * np.array([0.0, 0.0, 0.0, 1.0, 0.0, sign])
        assert distance(robot, answer.q, seed) <= distance(robot, continuum, seed).min() + 1e-9


@pytest.mark.parametrize("name", ["j2s6s200", "j2n6s300"])
def test_a_batch_answers_as_solve_does_on_multiple_roots(name: str, rng: np.random.Generator) -> None:
    solver = IKSolver(jacokin.load_robot(name), tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore")
    robot = solver.robot
    own = [(-90.0, 180.0, 180.0, -90.0, 30.0, 0.0), (90.0, 90.0, 180.0, 30.0, 60.0, 0.0)]
    seeds = [np.clip(np.array(each) * DEGREES, robot.lower, robot.upper) for each in own]
    seeds += [np.clip(own_answers.CLASSES["stretched"](robot, rng), robot.lower, robot.upper) for _ in range(20)]
    poses = [solver.verifier.tool_pose(q) for q in seeds]
    batch = solver.solve_batch(poses, seeds)
    singles = [solver.solve(T, seed=q) for T, q in zip(poses, seeds, strict=True)]
    assert batch.status == tuple(each.status for each in singles)
    np.testing.assert_array_equal(batch.q, [each.q for each in singles])
    np.testing.assert_allclose(wrap_to_pi(batch.q - seeds), 0.0, atol=1e-4)


def test_a_branch_on_its_limit_is_found_of_a_stretched_arm() -> None:
    solver = IKSolver(jacokin.load_robot("j2s6s200"), tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore")
    own = np.clip(np.array((-90.0, 180.0, 180.0, -90.0, 30.0, 0.0)) * DEGREES, solver.robot.lower, solver.robot.upper)
    branches = solver.solve_all(solver.verifier.tool_pose(own), own)  # joint 5 is on its limit, and a double root
    assert np.abs(wrap_to_pi(branches.q_within_limits[0] - own)).max() < 1e-4
    seed = own + np.array((1.5e-4, 3.6e-4, 1.1e-4, 5.2e-4, 0.0, -2.8e-4))
    assert np.linalg.norm(solver.solve(solver.verifier.tool_pose(own), seed=seed).q - seed) < 1e-3


@pytest.mark.parametrize(
    ("tool", "q"),
    [
        (False, (-2.61799384, 1.57079631, 3.14159273, -1.04719755, 3.14159261, -2.09439509)),
        (True, (0.52359899, 0.82030475, 3.14159261, 2.09439528, 3.14159265, -1.04719755)),
        (True, (4e-8, 4.71238889, 3.14159278, 1.57079645, 3.14159265, 0.0)),
    ],
)
def test_a_seed_next_to_a_stretched_arm_with_a_straight_wrist_is_its_own_answer(
    tool: bool, q: tuple[float, ...]
) -> None:
    """Many configurations far apart close such a pose to rounding."""
    solver = IKSolver(jacokin.load_robot("j2s6s300"), tool=jacokin.pose((0.5, 0.0, 0.0)) if tool else None)
    own = np.array(q)
    T = solver.verifier.tool_pose(own)
    assert np.abs(solver.solve(T, seed=own).q - own).max() < 1e-6
    assert np.abs(solver.solve_batch([T], own).q[0] - own).max() < 1e-6
    seed = own + 1e-3 * np.array((0.5, -0.5, 0.5, 0.0, 0.5, 0.0))
    assert np.linalg.norm(solver.solve(T, seed=seed).q - seed) < 1e-3 + 1e-6


@pytest.mark.parametrize(
    ("name", "q", "axis"),
    [
        ("j2s7s300", (-1.5707963, 3.1415849, 3.1415915, 3.1415927, 1.5707963, 1.1344640137963142, 3.1415927), None),
        (
            "j2n6s300",
            (-3.141592653589793, 4.71239033, 3.141592653589793, 3.14159304, 3.14159098, 4.6e-7),
            (0.0, 0.0, 1.0),
        ),
    ],
)
def test_a_family_is_not_called_complete_where_the_tool_nearly_cannot_move_in_two_directions(
    name: str, q: tuple[float, ...], axis: tuple[float, float, float] | None
) -> None:
    solver = IKSolver(jacokin.load_robot(name), tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore")
    own = np.array(q)
    T = solver.verifier.tool_pose(own)
    target = T if axis is None else FreeAxis(T, axis=axis)
    assert np.abs(solver.solve(target, seed=own).q - own).max() < 1e-4
    assert not solver.solve_all(target).complete


@pytest.mark.parametrize("size", [1e-7, 1e-6, 1e-5, 1e-4])
def test_the_answer_beside_a_singularity_is_no_farther_from_the_seed_than_the_configuration(
    size: float, rng: np.random.Generator
) -> None:
    """Stretched arms with a straight wrist, but for little: many configurations far apart are answers there."""
    solver = IKSolver(jacokin.load_robot("j2s6s300"), tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore")
    robot = solver.robot
    for _ in range(40):
        q = robot.sample(rng)
        q[[2, 4]] = math.pi
        q = np.clip(q + size * rng.normal(size=6), robot.lower, robot.upper)
        T = solver.verifier.tool_pose(q)
        assert np.linalg.norm(solver.solve(T, seed=q).q - q) < 1e-4
        way = rng.normal(size=6)
        seed = np.clip(q + 1e-3 * way / np.linalg.norm(way), robot.lower, robot.upper)
        single, batch = solver.solve(T, seed=seed), solver.solve_batch([T], seed)
        assert single.success
        assert np.linalg.norm(single.q - seed) < np.linalg.norm(q - seed) + 1e-6
        np.testing.assert_array_equal(batch.q[0], single.q)


@pytest.mark.parametrize(
    ("name", "q", "seed"),
    [
        (
            "j2s6s300",
            (-3.14157070732, 4.71230073614, 3.14163359681, 2.98316656e-5, 3.14164075073, -3.14155453603),
            (-3.14236488968, 4.71211642605, 3.14180284816, 5.69580052e-4, 3.14172031958, -3.14164939714),
        ),
        (
            "j2n6s300",
            (1.57207864013, 1.57144152480, 3.14196178271, 5.327588e-4, 3.14191940462, 4.0201684e-4),
            (1.57202813600, 1.57095473993, 3.14192857297, 3.259894e-4, 3.14257941130, -1.2810061e-4),
        ),
    ],
)
def test_the_member_beside_a_singularity_is_no_farther_from_the_seed_than_the_configuration(
    name: str, q: tuple[float, ...], seed: tuple[float, ...]
) -> None:
    solver = IKSolver(jacokin.load_robot(name), tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore")
    own, start = np.array(q), np.array(seed)
    T = solver.verifier.tool_pose(own)
    for target in (T, FreeAxis(T, axis=(0.0, 0.0, 1.0))):
        answer = solver.solve(target, seed=start)
        assert np.linalg.norm(answer.q - start) < np.linalg.norm(own - start) + 1e-6


def test_a_member_on_a_limit_of_a_joint_with_more_than_a_turn_of_room_is_in_its_interval() -> None:
    """The joint's next copy is within the limits just beyond it: the distance jumps there."""
    solver = solver_of("j2s7s200", joint_5=(-5.8, 1.3), joint_7=(-2.3, 6.269))
    own = np.array((0.5 * math.pi, 0.5 * math.pi, 0.0, 0.5 * math.pi, 0.03, math.pi, 6.269))
    family = solver.solve_all(solver.robot.forward_kinematics(own))
    assert min(np.abs(interval.nearest(own) - own).max() for interval in family) < 1e-6  # not a turn away


def test_a_curve_that_hardly_moves_the_tool_is_no_point() -> None:
    """Its parameter changes by 4e-9 rad, its joints by 6e-4 rad."""
    solver = IKSolver(jacokin.load_robot("j2s6s200"), tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore")
    own = np.array((1.5707930118, 3.1416003616, 3.1415913169, -1.5708040645, 4.7124078680, 1.3813341522e-5))
    family = solver.solve_all(FreeAxis(solver.verifier.tool_pose(own), axis=(0.0, 1.0, 0.0)))
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-6


def test_the_member_beside_a_seed_is_found_on_limits_that_are_nearly_a_turn_apart() -> None:
    """What is beyond one limit may be nearer to the other one, in another copy."""
    solver = solver_of("j2s7s300", joint_6=(-3.53, 2.34))
    robot, rng = solver.robot, np.random.default_rng(1)
    for _ in range(30):
        q = robot.sample(rng)
        q[5] = 2.34
        way = rng.normal(size=7)
        seed = np.clip(q + 1e-3 * way / np.linalg.norm(way), robot.lower, robot.upper)
        answer = solver.solve(robot.forward_kinematics(q), seed=seed)
        assert np.linalg.norm(answer.q - seed) < 1e-3 + 1e-6


def test_a_seed_beside_a_singular_member_on_a_limit_is_not_left() -> None:
    limits = {"joint_1": (-1.5 * math.pi, -1.9198621771937625), "joint_5": (-5.27, -0.33)}
    tool = jacokin.pose([-0.160438, -0.141815, -0.125791], rpy=[-1.6642, 0.0392, -3.0640])
    q = np.array([-1.9198621771937625, math.pi, -math.pi / 2, math.pi, -math.pi / 2, 1.5 * math.pi, math.pi])
    moved = np.array([0.0, -2.4086e-4, -6.0825e-4, -1.6551e-4, 1.3507e-4, -2.2597e-4, 6.8195e-4])
    solver = IKSolver(jacokin.load_robot("j2s7s200", limits=limits), tool=tool, collision="ignore")
    result = solver.solve(solver.verifier.tool_pose(q), seed=q + moved)
    assert result.success
    assert np.linalg.norm(result.q - q - moved) <= np.linalg.norm(moved) + 1e-6


@pytest.mark.parametrize(
    ("name", "limits", "q", "tool"),
    [
        # A joint touches its limit from outside and turns back;
        ("j2s7s200", {}, (-120.0, 180.0, -150.0, 90.0, 90.0, 65.0, 120.0), False),
        ("j2s7s300", {}, (180.0, 180.0, -150.0, 330.0, 90.0, 65.0, 60.0), False),
        # it has more than a turn of room, and is within its limits in that copy between two guesses only;
        (
            "j2s7s300",
            {4: (-140.0, 480.0), 7: (-140.0, 540.0)},
            (-30.0, 180.0, -150.0, -120.0, 30.0, 240.0, 540.0),
            False,
        ),
        ("j2s7s200", {2: (-123.0, 221.0), 4: (-255.0, 110.0)}, (141.0, 106.0, 92.0, 110.0, -250.0, 68.5, 210.0), False),
        # two joints of a straight wrist are on their limits at once;
        (
            "j2s7s300",
            {4: (-304.0, -98.8), 5: (-86.0, 15.0), 7: (-159.0, -22.5)},
            (90.0, 90.0, 90.0, -270.0, -86.0, 180.0, -159.0),
            True,
        ),
        # one joint comes to its limit just as another leaves its own, and the tool can hardly move in some direction.
        (
            "j2s7s200",
            {1: (-80.0, 0.0), 3: (-292.0, -193.039463234)},
            (0.0, 180.000051484, -193.039463234, 90.0001073, 540.000026727, 180.000087984, -5.6748e-05),
            False,
        ),
        (
            "j2s7s200",
            {1: (-80.0, 0.0), 7: (-120.0, 160.0)},
            (0.0, 180.002781774, -269.998097578, 179.971376663, 269.996371723, 180.013639208, 160.0),
            True,
        ),
        (
            "j2s7s200",
            {2: (-250.0, -110.0), 4: (-310.0, -180.0), 6: (-187.0, -113.0)},
            (90.000495243, -110.0, -0.082288805, -180.0, -89.980857897, -180.021354133, 0.06048715),
            False,
        ),
    ],
)
def test_a_member_at_one_point_within_the_limits_alone_is_its_own_answer(
    name: str, limits: dict[int, tuple[float, float]], q: tuple[float, ...], tool: bool
) -> None:
    robot = jacokin.load_robot(
        name, limits={f"joint_{j}": (low * DEGREES, high * DEGREES) for j, (low, high) in limits.items()} or None
    )
    placed = jacokin.pose((0.1, -0.2, 0.15), rpy=(0.3, -0.5, 1.0)) if tool else None
    solver, own = (
        IKSolver(robot, tool=placed, collision="ignore"),
        np.clip(np.array(q) * DEGREES, robot.lower, robot.upper),
    )
    for seed in range(6):
        findings = own_answers.check(solver, "on limits", own, np.random.default_rng(seed))
        assert [finding for finding in findings if finding.kind != "unsure"] == []


@pytest.mark.parametrize(
    ("name", "q", "axis"),
    [
        # A straight wrist that reaches the target but for 1e-12, or two of them that are nearly one,
        (
            "j2s7s200",
            (
                -3.141592655557089,
                1.5707963263177107,
                -1.129821450283641e-11,
                3.1415926498525018,
                1.5707963265333935,
                3.141592653852006,
                -1.5707963267580982,
            ),
            None,
        ),
        # and two free motions, but for 1e-5, beside the turn about the last axis.
        (
            "j2n6s300",
            (
                8.53005582027811e-05,
                3.141644433263592,
                3.141589696573811,
                3.1416369564296076,
                -6.37703309499424e-05,
                -3.141606319376479,
            ),
            (0, 0, 1),
        ),
    ],
)
def test_a_family_with_members_that_nearly_form_a_surface_is_not_called_complete(
    name: str, q: tuple[float, ...], axis: tuple[int, int, int] | None
) -> None:
    own = np.array(q)
    for tool in (None, jacokin.pose((0.5, 0.0, 0.0))):
        solver = IKSolver(jacokin.load_robot(name), tool=tool, collision="ignore")
        T = solver.verifier.tool_pose(own)
        family = solver.solve_all(T if axis is None else FreeAxis(T, axis=axis))
        assert not family.complete


def test_least_squares_where_curves_meet_stay_near() -> None:
    """A point on a limit led ten turns away, and a piece of a curve had no nodes: none but these numbers show it."""
    limits = {
        "joint_2": (-4.292096036745463, -3.215074959557145),
        "joint_3": (-5.934119456780721, 5.061454830783556),
        "joint_4": (-4.4630870547359445, 0.8200020781821378),
        "joint_7": (-2.872243201257263, 1.8468997836327348),
    }
    tool = np.array(
        [
            [0.9808870547888071, 0.0788295574058149, 0.1778945941476106, 0.03565931536502981],
            [-0.1931294351819364, 0.505779733087338, 0.8407662474578813, 0.197137333791711],
            [-0.0236982491768062, -0.8590534107244464, 0.5113371006573351, -0.2105719690853758],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    own = np.array(
        (
            1.9256030604300314,
            -3.3706299051213984,
            -5.251363632347237,
            -4.083637115078659,
            1.1202368801474378,
            math.pi,
            -0.02484680955797458,
        )
    )
    solver = IKSolver(jacokin.load_robot("j2s7s200", limits=limits), tool=pin.SE3(tool), collision="ignore")
    result = solver.solve(solver.verifier.tool_pose(own), seed=own)
    assert result.success
    assert np.linalg.norm(result.q - own) < 1e-6


@pytest.mark.parametrize(
    ("name", "limits", "q"),
    [
        (
            "j2s7s300",
            {4: (-5.422306039970768, 6.844000610033633), 5: (-2.0943951023931953, 9.773843811168245)},
            (2.682115, 1.410773, 2.540799, -5.422306039970768, 9.773843811168245, 1.279748, -1.812396),
        ),
        (
            "j2s7s300",
            {1: (-0.598629691157246, 6.249246792336187), 3: (-1.5905290789462665, 6.571047543039205)},
            (-0.598629691157246, 2.920466, -1.5905290789462665, 3.353790, 1.814578, 1.941845, 3.063297),
        ),
        (
            "j2s6s300",
            {1: (-1.2, 5.3), 4: (-3.0, 4.0), 5: (-2.0, 6.0)},
            (-1.2, 2.9, 1.4, 4.0, 6.0, 0.4),
        ),
        # Or as another one touches its own.
        (
            "j2s7s200",
            {
                1: (-4.71238898038469, -1.5707963267948966),
                2: (-0.32222475218229896, 10.972113019595843),
                6: (-4.155094893763243, 5.46793850334962),
            },
            (
                -2.6892207698747366,
                10.972113019595843,
                -1.6351419049710987,
                math.pi,
                -0.16727474381773044,
                5.46793850334962,
                -2.742402267860289,
            ),
        ),
        # Or 0.01 rad before it.
        (
            "j2s7s300",
            {
                2: (-0.17453292519943295, 7.67944870877505),
                5: (-1.0471975511965976, 8.377580409572781),
                6: (-2.443460952792061, 1.0471975511965976),
            },
            (1.053328, -0.17453292519943295, -1.080414, 1.975824, 8.364124, -0.948034, -0.125073),
        ),
        # Both limits of joint 7 are one angle.
        (
            "j2s7s300",
            {
                1: (-5.9311239711004875, 2.3570469149015816),
                2: (-2.0 * math.pi, 2.0 * math.pi),
                3: (-1.0352100821823722, 5.762943828516763),
                5: (-1.7442389488135106, 8.462469561039754),
                6: (-7.0, 7.0),
                7: (-2.0 * math.pi, 2.0 * math.pi),
            },
            (-1.47817, -2.208119, -1.0352100821823722, 1.179334, 4.913026, 2.050284, -2.0 * math.pi),
        ),
        # Joint 6 is past its limit until 1e-9 rad before joint 2 is.
        (
            "j2s7s200",
            {
                1: (-7.0, 7.0),
                2: (-2.0 * math.pi, 2.0 * math.pi),
                3: (-7.0, 7.0),
                4: (-2.391009232898522, 4.889453306765528),
                5: (-2.8037503390869043, 4.548875464674434),
                6: (-2.052953940684508, 6.261629363576686),
                7: (-7.0, 7.0),
            },
            (
                -2.4862705244030145,
                -2.0 * math.pi,
                -0.2938241182069792,
                2.51830675859976,
                -1.7414962566788286,
                6.261629363576686,
                -0.4404231059456025,
            ),
        ),
    ],
)
def test_a_member_with_several_joints_of_more_than_a_turn_on_limits_is_its_own_answer(
    name: str, limits: dict[int, tuple[float, float]], q: tuple[float, ...]
) -> None:
    """One joint comes in just as another leaves: in these copies, only one point of the curve is within the limits."""
    robot = jacokin.load_robot(name, limits={f"joint_{joint}": pair for joint, pair in limits.items()})
    solver, own = IKSolver(robot, collision="ignore"), np.array(q)
    T = robot.forward_kinematics(own)
    family = solver.solve_all(T if robot.dof == 7 else FreeAxis(T, axis=(0.0, 0.0, 1.0)))
    assert min(np.abs(interval.nearest(own) - own).max() for interval in family) < 1e-6


@pytest.mark.parametrize("tool", [None, jacokin.pose((0.5, 0.0, 0.0))])
@pytest.mark.parametrize(
    "q",
    [
        (-1.2118686565871135, 0.0, -1.8470310561498215, math.pi, -1.3409945252104594, 1.2883433803055213, 0.053277199),
        (1.6937101376542207, 0.0, 1.526320735332635, math.pi, -2.782009516775983, 4.906909096306035, 2.627312661),
    ],
)
def test_a_stretched_arm_with_joint_2_on_its_limit_is_a_member(q: tuple[float, ...], tool: pin.SE3 | None) -> None:
    solver = IKSolver(jacokin.load_robot("j2s7s300"), tool=tool, collision="ignore")
    own = np.maximum(np.array(q), solver.robot.lower)
    family = solver.solve_all(solver.verifier.tool_pose(own))
    assert min(np.abs(interval.nearest(own) - own).max() for interval in family) < 1e-6


def test_three_joints_on_limits_at_a_fold_are_their_own_answer() -> None:
    """Joint 1 only touches its limit there, and joints 3 and 6 pass theirs: one node of the curve is within them."""
    limits = {
        "joint_1": (-math.pi, 1.0471975511965976),
        "joint_2": (0.8726646259971648, 5.410520681182422),
        "joint_3": (-2.6179938779914944, 0.6981317007977318),
        "joint_6": (-2.6179938779914944, 2.0943951023931953),
    }
    tool = np.array(
        [
            [0.05273025958062838, 0.9205038764794213, -0.3871590540216225, 0.040449274135015756],
            [0.8588985351601837, 0.15597222922476595, 0.48781755812019295, 0.159616485629817],
            [0.5094240139846671, -0.35825309084083995, -0.7823949749830543, 0.1400119525938185],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    own = np.array(
        (
            1.0471975511965976,
            3.1415904861343344,
            0.6981317007977318,
            -1.9525731286734417e-06,
            2.6496369570388468e-06,
            -2.6179938779914944,
        )
    )
    solver = IKSolver(jacokin.load_robot("m1n6s300", limits=limits), tool=pin.SE3(tool), collision="ignore")
    T = solver.verifier.tool_pose(own)
    target = FreeAxis(T, axis=(0.656033200628699, -0.7243498938583456, -0.21198507244678522))
    result = solver.solve(target, seed=own)
    assert result.success
    assert np.linalg.norm(wrap_to_pi(result.q - own)) < 1e-4


def test_a_straight_wrist_with_three_joints_on_limits_has_members_that_are_nearest() -> None:
    """A point that the limits cut out of a curve misses the target by 1e-9 m: `nearest` raised an error."""
    limits = {
        "joint_1": (-3.5959082218516176, -1.838331078543257),
        "joint_3": (-0.030503994267768064, 1.2649994263117912),
        "joint_4": (-0.3490658503988659, math.pi),
        "joint_5": (-1.3962634015954636, 2.443460952792061),
    }
    tool = np.array(
        [
            [0.4317814703556667, 0.28535115325873184, 0.8556514951727778, 0.030738823441611607],
            [-0.9019782418119546, 0.13671964407020154, 0.40956439081435353, -0.2941115107221278],
            [-0.00011469661557228505, -0.9486213460908568, 0.3164135404584596, 0.19532497113859448],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    own = np.array((-1.838331078543257, math.pi, 1.2649994263117912, 0.5 * math.pi, 0.0, 0.0))
    solver = IKSolver(jacokin.load_robot("j2s6s200", limits=limits), tool=pin.SE3(tool), collision="ignore")
    family = solver.solve_all(FreeAxis(solver.verifier.tool_pose(own), axis=(1.0, 0.0, 0.0)))
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-4


@pytest.mark.parametrize("tool", [None, jacokin.pose((0.5, 0.0, 0.0))])
def test_a_curve_as_short_as_another_beside_it_is_no_less_a_curve(tool: pin.SE3 | None) -> None:
    """Next to two singularities: one from -0.006 to 0.001, another from 0.0005 to 0.026 rad of the parameter."""
    own = (
        0.0016622089111947664,
        1.569267626623348,
        3.138581052883136,
        0.00017961155487508917,
        3.1397644987501976,
        -6.812621267204873e-05,
    )
    other = np.array(
        (
            0.001660028139703229,
            1.5731581605787244,
            3.1435997234746544,
            0.004683099236325816,
            3.1390979026102404,
            0.0034939044781281403,
        )
    )
    solver = IKSolver(jacokin.load_robot("m1n6s300"), tool=tool, collision="ignore")
    family = solver.solve_all(FreeAxis(solver.verifier.tool_pose(np.array(own)), axis=(1.0, 0.0, 0.0)))
    assert min(np.abs(interval.nearest(other) - other).max() for interval in family) < 1e-6


def test_the_member_beside_a_seed_is_found_next_to_three_singularities() -> None:
    own = np.array(
        (
            0.00011459947446109122,
            3.1417249170006243,
            3.141662848697171,
            -3.141629427065557,
            3.141559467336457,
            -3.8599123366389974e-05,
        )
    )
    seed = np.array(
        (
            -0.0003509705658231811,
            3.1413902162102922,
            3.1410940206463747,
            -3.1413304603780188,
            3.1412008148203245,
            -0.00039865725698178146,
        )
    )
    solver = IKSolver(jacokin.load_robot("m1n6s200"), collision="ignore")
    result = solver.solve(FreeAxis(solver.verifier.tool_pose(own), axis=(1.0, 0.0, 0.0)), seed=seed)
    assert result.success
    assert np.linalg.norm(result.q - seed) < np.linalg.norm(own - seed) + 1e-4


def test_the_branch_beside_a_seed_is_found_though_two_joints_come_to_their_limits_on_the_way() -> None:
    """One of them leaves its limit again: with both held there, the nearest point misses the pose by 1.5e-9 m."""
    limits = {
        "joint_1": (-2.0434415671624038, 9.753598085064171),
        "joint_2": (-math.pi, -1.3962634015954636),
        "joint_3": (0.33161255787892263, 5.951572749300664),
        "joint_4": (-2.9670597283903604, -1.2217304763960306),
    }
    tool = np.array(
        [
            [-0.26463057317650884, 0.7378412724430669, -0.6209355171190231, -0.21043570136552536],
            [-0.6118625539502686, -0.626152903512575, -0.4832771011502891, 0.030538027648068677],
            [-0.7453823681934845, 0.2520372950623935, 0.6171566471195986, 0.21740171456258034],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    own = np.array(
        (
            3.6696613566908436,
            -3.1415672921829674,
            3.1416261820600675,
            -2.651212185920564,
            5.759551005503238,
            1.125283235740444,
        )
    )
    seed = np.array(
        (
            3.6691825273084984,
            -3.141171868509289,
            3.140939617021604,
            -2.650862190036186,
            5.759586531581287,
            1.1251964413511406,
        )
    )
    solver = IKSolver(jacokin.load_robot("j2s6s300", limits=limits), tool=pin.SE3(tool), collision="ignore")
    result = solver.solve(solver.verifier.tool_pose(own), seed=seed)
    assert result.success
    assert np.linalg.norm(result.q - seed) < np.linalg.norm(own - seed) + 1e-6


def test_the_nearest_member_just_before_the_end_of_an_interval_is_found() -> None:
    """Between two guesses, one of them nearer to the end than guesses are exact."""
    limits = {
        "joint_1": (-1.8514226660400306, 1.5588631592954594),
        "joint_2": (-2.2689280275926285, 2.6179938779914944),
        "joint_3": (-4.021813083987388, 0.9234636851330231),
        "joint_4": (-1.027971658869542, 5.902414922828304),
        "joint_7": (-4.014257279586958, 1.0471975511965976),
    }
    tool = np.array(
        [
            [-0.3097775728673706, 0.53672849959932, 0.7848314297135814, -0.1330177214708575],
            [0.2808940407222505, 0.840253228469207, -0.4637596898543481, 0.2539360403153819],
            [-0.9083701851311106, 0.07679212046126435, -0.4110554427324069, -0.12130471493097467],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    own = np.array(
        (
            -1.6092325309082203,
            -1.2484846994787528,
            0.8262345555138515,
            0.8239992878160416,
            -1.5371995143526338,
            5.148692187360998,
            0.8435343215877767,
        )
    )
    solver = IKSolver(jacokin.load_robot("j2s7s200", limits=limits), tool=pin.SE3(tool), collision="ignore")
    family = solver.solve_all(solver.verifier.tool_pose(own))
    assert min(np.abs(interval.nearest(own) - own).max() for interval in family) < 1e-6


def test_curves_that_come_within_the_limits_just_before_they_meet_are_members() -> None:
    """For 5e-5 rad of the parameter joint 6 is within its limit: only the node where the curves meet is."""
    limits = {
        "joint_1": (-4.545743923475949, -0.9154804098388749),
        "joint_2": (-1.7453292519943295, 1.3962634015954636),
        "joint_3": (-0.23112458138122974, 9.545668689255672),
        "joint_6": (-2.2407393374292974, 0.005414864572249378),
    }
    tool = np.array(
        [
            [-0.2815281226095405, 0.7634123302325191, -0.5813291066417564, 0.2589448285000517],
            [-0.13024840337637827, 0.5698231482491667, 0.8113796479683925, 0.017146148992494115],
            [0.9506720094742728, 0.30414337699243654, -0.060988004015419595, 0.27114375881429714],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    meeting = np.array((-4.545743923475949, -0.5 * math.pi, math.pi, 0.5 * math.pi, math.pi, -0.5 * math.pi))
    member = np.array(
        (
            -4.545742412657071,
            -1.5699079222103767,
            3.143668241489028,
            -0.0026548388034672854,
            3.1427834084197146,
            0.0026427906742565455,
        )
    )
    solver = IKSolver(jacokin.load_robot("j2s6s200", limits=limits), tool=pin.SE3(tool), collision="ignore")
    family = solver.solve_all(FreeAxis(solver.verifier.tool_pose(meeting), axis=(1.0, 0.0, 0.0)))
    assert min(np.abs(interval.nearest(member) - member).max() for interval in family) < 1e-6


def test_a_joint_that_touches_its_limit_at_a_node_is_its_own_answer() -> None:
    """The share of a touch between two nodes is rounded to less than none: a piece of a curve had no nodes."""
    limits = {"joint_5": (-2.6179938779914944, 2.443460952792061), "joint_7": (-4.71238898038469, -1.2217304763960306)}
    tool = np.array(
        [
            [-0.0937886179045464, 0.7719895656783411, 0.6286778234002858, 0.2217308494542916],
            [-0.11470985656397276, -0.6356349933654579, 0.763419808504054, -0.24678601289051694],
            [0.9889617505033385, -0.0005154542266485596, 0.14817013986735827, -0.06565151031054958],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    own = np.array((0.0, math.pi, math.pi, math.pi, 0.5 * math.pi, 1.5 * math.pi, -1.5 * math.pi))
    solver = IKSolver(jacokin.load_robot("j2s7s300", limits=limits), tool=pin.SE3(tool), collision="ignore")
    result = solver.solve(solver.verifier.tool_pose(own), seed=own)
    assert result.success
    assert np.linalg.norm(result.q - own) < 1e-6


def test_the_nearest_member_is_found_where_its_curve_reaches_right_up_to_the_seed() -> None:
    own = np.array(
        (
            -0.00016509552159824103,
            3.141807365355563,
            -3.1415492050061613,
            3.1411315876960595,
            0.0006933148820752567,
            1.5710371076001037,
            3.1411368940172832,
        )
    )
    seed = np.array(
        (
            -0.0005816437595464634,
            3.142612948805533,
            -3.1417170004628288,
            3.1413421842911777,
            0.0007901610159867197,
            1.5711302457863767,
            3.1414317884628855,
        )
    )
    solver = IKSolver(jacokin.load_robot("j2s7s300"), tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore")
    result = solver.solve(solver.verifier.tool_pose(own), seed=seed)
    assert result.success
    assert np.linalg.norm(wrap_to_pi(result.q - seed)) < np.linalg.norm(own - seed) + 1e-6


def test_a_folded_arm_is_found_though_a_move_runs_along_the_edge_of_reach() -> None:
    limits = {"joint_2": (-3.532, 1.608), "joint_4": (0.0, 4.014), "joint_6": (-1.5551476115283194, -0.397)}
    tool = jacokin.pose((0.076, 0.015, -0.181), rpy=(2.58, -0.355, 2.316))
    solver = IKSolver(jacokin.load_robot("j2s7s200", limits=limits), tool=tool, collision="ignore")
    own = np.array((0.5 * math.pi, 0.0, 0.0, 0.0, 0.5 * math.pi, -1.5551476115283194, -math.pi))
    family = solver.solve_all(solver.verifier.tool_pose(own))
    assert not family.complete or any(np.abs(interval.nearest(own) - own).max() < 1e-6 for interval in family)


@pytest.mark.parametrize(
    ("name", "own"),
    [
        (
            "j2s6s200",
            (
                -1.0108666656069204e-05,
                3.1415846114233132,
                3.1415998723501377,
                -1.5708179808491258,
                4.712395133908651,
                1.5707916528869783,
            ),
        ),
        (
            "m1n6s200",
            (
                -1.966041469885605e-05,
                3.1415535762514595,
                3.1415735590043186,
                3.141566606315403,
                3.1415702268774046,
                3.141592561218088,
            ),
        ),
    ],
)
def test_the_member_beside_a_seed_is_found_where_members_nearly_form_a_surface(
    name: str, own: tuple[float, ...], rng: np.random.Generator
) -> None:
    solver, q = (
        IKSolver(jacokin.load_robot(name), tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore"),
        np.array(own),
    )
    target = FreeAxis(solver.verifier.tool_pose(q), axis=(0.0, 0.0, 1.0))
    for _ in range(10):
        way = rng.normal(size=6)
        seed = q + 1e-3 * way / np.linalg.norm(way)
        result = solver.solve(target, seed=seed)
        assert result.success
        assert np.linalg.norm(result.q - seed) < 1e-3 + 1e-4


def test_a_piece_past_a_limit_all_along_is_no_interval() -> None:
    """Joint 6 is 4e-8 rad past its limit and more, from one touch of joint 7 at its own to the next."""
    solver = solver_of(
        "j2s7s200",
        joint_2=(math.radians(-240.0), math.radians(-120.0)),
        joint_3=(-4.557307001930109, -3.2769251948700596),
        joint_5=(-3.5612092449232165, -0.054990871346361825),
        joint_7=(math.radians(-70.0), math.radians(30.0)),
    )
    own = np.array(
        (
            0.5 * math.pi,
            -math.pi,
            -4.557307001930109,
            1.5 * math.pi,
            -0.054990871346361825,
            math.radians(295.0),
            math.radians(-70.0),
        )
    )
    solver = IKSolver(solver.robot, tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore")
    family = solver.solve_all(solver.verifier.tool_pose(own))
    members = np.array([interval.nearest(own) for interval in family])
    assert np.abs(members - own).max(axis=1).min() < 1e-9


@pytest.mark.parametrize("range_", [(-math.pi, 0.0), (-0.5, 0.0), (-0.1, 0.1), (0.0, math.pi)])
def test_a_curve_that_is_a_point_but_for_rounding_is_a_member_at_the_end_of_a_range(
    range_: tuple[float, float],
) -> None:
    solver, own = solver_of("j2s6s300"), np.array((-90.0, 180.0, 180.0, 0.0, 270.0, -90.0)) * DEGREES
    family = solver.solve_all(FreeAxis(solver.verifier.tool_pose(own), axis=(1.0, 0.0, 0.0), range=range_))
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-5


def test_members_are_found_where_a_joint_with_several_copies_bends_sharply() -> None:
    """Next to two singularities at once, of an arm whose joint 4 has more than a turn of room."""
    solver = solver_of("j2s7s300", joint_4=(-0.984, 11.23))
    own = np.array((90.0, 180.0, 0.0, 270.0, 0.0, 180.0, 90.0)) * DEGREES
    own += np.array((-103.0, 71.0, -92.0, 16.0, -110.0, -168.0, 157.0)) * 1e-6
    family = solver.solve_all(solver.verifier.tool_pose(own))
    assert family.branches == 8
    assert all(interval.length > 1.0 for interval in family)
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-9


def test_the_nearest_member_is_found_on_a_short_curve_beside_one_as_short() -> None:
    """Slices see two closed curves here, one of them 0.01 rad long, and none of a third one, half as long."""
    solver = solver_of("m1n6s300")
    own = np.array((1.57231605424, 3.14152732231, 3.14344283667, -3.14357389195, -3.14154271949, 1.5722623961588))
    target = FreeAxis(solver.verifier.tool_pose(own), axis=(0.0, 1.0, 0.0))
    way = np.array((-1.6, 4.2, -4.5, 1.7, -5.0, 5.7)) * 1e-4
    for seed in (own, own + way):
        result = solver.solve(target, seed=seed)
        assert result.success
        assert np.linalg.norm(result.q - seed) <= np.linalg.norm(seed - own) + 1e-6


def test_turns_about_the_last_axis_of_a_nearly_straight_wrist_are_not_said_to_be_all() -> None:
    """The wrist is bent by 1e-6 rad: joint 4 is known to 2e-4 rad there, and two branches are taken for one."""
    solver = solver_of("j2s6s300")
    own = np.array((-math.pi, 1.5 * math.pi, math.pi, -0.5 * math.pi, math.pi, math.pi))
    own += np.array((-4.0422, -0.8172, 0.8151, 1.4714, -1.0385, 4.9791)) * 1e-6
    target = FreeAxis(solver.verifier.tool_pose(own), axis=(0.0, 0.0, 1.0))
    assert not solver.family(target).complete
    np.testing.assert_allclose(solver.solve(target, seed=own).q, own, atol=1e-9)


@pytest.mark.parametrize(
    ("tool", "degrees", "off", "axis", "complete"),
    [
        # the curve is found,
        ((-80, -50, -30), (-90, 180, 180, 90, 270, -90), (2.2182, 1.3804, 1.2708, 0.0631, 7.0153, -0.7657), 3, True),
        # is not solved for where others meet beside it,
        ((-80, -50, -30), (-90, 180, 180, 90, 270, -90), (1.7129, 0.4147, -0.0137, 0.6133, 1.0022, -0.9847), 3, False),
        # or the parameter stands still along it: two points are known of each.
        ((-90, 90, -80), (0, 180, 180, 0, 90, 180), (10.4454, 10.9558, 0.058, -9.1823, -23.6863, -12.7412), 1, False),
    ],
)
def test_members_of_small_curves_are_found(
    tool: tuple[float, ...], degrees: tuple[float, ...], off: tuple[float, ...], axis: int, complete: bool
) -> None:
    """Next to a straight wrist of a stretched arm, curves are 3e-5 to 2e-3 rad long."""
    solver = IKSolver(solver_of("j2s6s300").robot, tool=jacokin.pose(np.array(tool) * 1e-3), collision="ignore")
    own = np.array(degrees) * DEGREES + np.array(off) * 1e-6
    axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0), (0.187, 0.387, 0.903))
    target = FreeAxis(solver.verifier.tool_pose(own), axis=axes[axis])
    family = solver.family(target)
    assert family.complete == complete
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-6
    np.testing.assert_allclose(wrap_to_pi(solver.solve(target, seed=own).q - own), 0.0, atol=1e-6)


def test_single_points_beside_a_nearly_straight_wrist_leave_a_family_in_doubt() -> None:
    """The wrist is bent by 4e-9 rad on the edge of reach; joint 5 of the points that are found is 1.6 rad away."""
    solver = IKSolver(solver_of("j2s7s200").robot, tool=jacokin.pose((0.5, 0.0, 0.0)), collision="ignore")
    own = np.array((180.0, 90.0, -180.0, 180.0, 90.0, 180.0, -180.0)) * DEGREES
    own += np.array((26.4, -15.8, 11.1, 3.0, 7.6, 4.2, 49.3)) * 1e-9
    pose = solver.verifier.tool_pose(own)
    assert not solver.family(pose).complete
    np.testing.assert_allclose(wrap_to_pi(solver.solve(pose, seed=own).q - own), 0.0, atol=1e-9)


def test_the_member_beside_a_seed_is_found_where_one_joint_touches_its_limit_as_another_leaves_its_own() -> None:
    """Joint 2 touches just where joint 5 comes in: halves of the chord stay in doubt until they are too short."""
    lower_5, upper_5, lower_6, upper_6 = -2.792526803190927, -1.2217304763960306, -2.30310985616651, 2.1610731664701013
    solver = solver_of("j2s7s200", joint_5=(lower_5, upper_5), joint_6=(lower_6, upper_6))
    tool = jacokin.pose((0.01752, 0.186436, 0.294286))
    solver = IKSolver(solver.robot, tool=tool, collision="ignore")
    own = np.array((0.132015793, solver.robot.lower[1], -0.493793429, math.pi, upper_5, 0.658884877, -2.558367184))
    away = np.array((5.94182, 0.0, -4.58386, 3.54390, 0.0, 3.03341, 0.25500)) * 1e-4
    result = solver.solve(solver.verifier.tool_pose(own), seed=own + away)
    assert result.success
    assert np.linalg.norm(result.q - own - away) <= np.linalg.norm(away) + 1e-6


@pytest.mark.parametrize(
    ("tool", "axis"),
    [
        ((-0.173, 0.079, 0.016), (0.63, 0.743, -0.299)),
        ((-0.179, 0.091, 0.028), (0.638, 0.673, -0.35)),
        ((-0.153, 0.099, 0.007), (0.594, 0.661, -0.359)),
    ],
)
def test_a_member_on_limits_at_a_fold_that_is_the_end_of_the_range_is_found(
    tool: tuple[float, float, float], axis: tuple[float, float, float]
) -> None:
    """Joint 2 and joint 5 on limits; the curves are known to 2e-6 rad there, the root of how well they close."""
    limits = {
        "joint_2": (-3.316125579, math.radians(490.0)),
        "joint_3": (math.radians(-230.0), math.radians(-150.0)),
        "joint_5": (-6.145053321681674, -3.548166356),
    }
    solver = IKSolver(solver_of("j2n6s200", **limits).robot, tool=jacokin.pose(tool), collision="ignore")
    own = np.array((math.pi, math.radians(490.0), -math.pi, 0.0, -6.145053321681674, -0.5 * math.pi))
    family = solver.solve_all(FreeAxis(solver.verifier.tool_pose(own), axis=axis, range=(0.0, 2.0)))
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-6


def test_turns_about_the_last_axis_of_a_stretched_arm_with_a_nearly_straight_wrist_are_not_said_to_be_all() -> None:
    """Ten branches of the pose are within 2e-3 rad: some of nearly a continuum."""
    solver = solver_of("j2s6s300")
    own = np.array((3.061252972, 1.508941758, math.pi, 1.235948287, math.pi + 1.06814e-4, 0.403912713))
    target = FreeAxis(solver.verifier.tool_pose(own), axis=(0.0, 0.0, 1.0))
    assert not solver.family(target).complete


def test_a_straight_wrist_on_two_limits_that_is_known_to_1e_6_rad_is_found() -> None:
    """Joints 1, 4 and 6 are on limits; the circle is found where another motion is free, to the root of rounding."""
    limits = {
        "joint_1": (math.radians(-280.0), math.radians(-20.0)),
        "joint_2": (math.radians(-190.0), math.radians(40.0)),
        "joint_3": (math.radians(-230.0), math.radians(-110.0)),
        "joint_4": (math.radians(-330.0), math.radians(-240.0)),
        "joint_6": (-5.93876796600899, -2.300370215),
    }
    tool = jacokin.pose((0.181, -0.112, -0.099))
    solver = IKSolver(solver_of("j2s6s200", **limits).robot, tool=tool, collision="ignore")
    own = np.array((math.radians(-20.0), 0.0, -math.pi, math.radians(-330.0), math.pi, -5.93876796600899))
    family = solver.solve_all(FreeAxis(solver.verifier.tool_pose(own), axis=(-0.523, -0.665, 0.564)))
    assert min(np.abs(wrap_to_pi(interval.nearest(own) - own)).max() for interval in family) < 1e-9


def test_a_point_amid_a_small_curve_leaves_a_family_in_doubt() -> None:
    """The point misses the target by more than rounding; members are up to 9e-5 rad away, all round."""
    solver = solver_of("j2s6s300")
    own = np.array((-90.0, 180.0, 180.0, -180.0, 180.0, 0.0)) * DEGREES
    own += np.array((1.3224, -1.6982, -0.0359, -0.1289, -1.7517, 0.0588)) * 1e-6
    target = FreeAxis(solver.verifier.tool_pose(own), axis=(0.0, 1.0, 0.0))
    assert not solver.family(target).complete
    np.testing.assert_allclose(wrap_to_pi(solver.solve(target, seed=own).q - own), 0.0, atol=1e-6)
