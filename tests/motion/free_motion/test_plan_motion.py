"""`plan_motion`: the end is at the goal, nothing touches on the way, limits hold between rows, and failures say why."""

from __future__ import annotations

import functools
import itertools
import pickle
import signal
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import trimesh
from numpy.typing import NDArray

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Floor, Scene, Sphere
from jacokin.ik.seeds import DEFAULT_RANDOM_SEED
from jacokin.kernels.free_motion.trees import Trees, make_trees
from jacokin.model import SelfContact
from jacokin.model.contact import Contact
from jacokin.model.own_shapes import kept_less
from jacokin.model.poses import rotation_angle
from jacokin.motion import Trajectory, plan_motion
from jacokin.motion.free_motion import search
from tests.compiled_twin import compile_twin
from tests.near_neighbours import CLEARANCE, FAR, NEIGHBOURS, near_neighbours, of_neighbours_and_others
from tests.robot_files import ur5_text

FINE = 1e-3  # [rad] between configurations that the referee looks at
WALL = Scene([Box("wall", [0.6, 0.02, 0.7], [0.45, -0.05, 0.35]), Floor(-0.02)])


@functools.lru_cache(maxsize=16)
def referee(robot: Robot, scene: Scene) -> tuple[mujoco.MjModel, mujoco.MjData, NDArray[np.intp], NDArray[np.float64]]:
    """The robot in the scene, the pairs (n, 2) of shapes that count, and how near they must be to touch [m]."""
    model, counted = compile_twin(robot, scene.surroundings)
    pairs = np.array(counted)
    radii = np.where(model.geom_rbound == 0.0, np.inf, model.geom_rbound)[pairs]  # of planes it is 0
    return model, mujoco.MjData(model), pairs, radii.sum(axis=1)


def touches(robot: Robot, scene: Scene, rows: NDArray[np.float64]) -> int:
    """How many configurations (n, dof) MuJoCo finds in contact."""
    model, data, pairs, far = referee(robot, scene)
    found = 0
    for q in rows:
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        apart = np.linalg.norm(data.geom_xpos[pairs[:, 0]] - data.geom_xpos[pairs[:, 1]], axis=1)
        found += any(
            mujoco.mj_geomDistance(model, data, a, b, 0.01, None) < -1e-6 for a, b in pairs[apart < far].tolist()
        )
    return found


def between(motion: Trajectory, step: float) -> NDArray[np.float64]:
    """Configurations along a motion, at most a step [rad] apart."""
    rows = [motion.q[:1]]
    for a, b in zip(motion.q[:-1], motion.q[1:], strict=True):
        count = max(1, int(np.ceil(np.abs(b - a).max() / step)))
        rows.append(a + np.arange(1, count + 1)[:, None] / count * (b - a))
    return np.concatenate(rows)


def check(robot: Robot, scene: Scene, motion: Trajectory, acceleration: float = 1.0, step: float = 0.02) -> None:
    """Limits of position, velocity and acceleration, agreement of the columns, and no contact."""
    assert motion.success, motion.message
    assert (motion.q >= robot.lower).all()
    assert (motion.q <= robot.upper).all()
    assert (np.abs(motion.v) <= robot.velocity_limit).all()
    assert (np.abs(motion.a) <= acceleration).all()
    assert not motion.v[[0, -1]].any()
    if len(motion) > 2:
        dt = np.diff(motion.t)[:, None]
        assert (np.abs(np.diff(motion.q, axis=0) / dt) <= robot.velocity_limit + 1e-9).all()
        assert (np.abs(np.diff(motion.v, axis=0) / dt) <= acceleration + 1e-6).all()
        np.testing.assert_allclose(np.diff(motion.q, axis=0), 0.5 * dt * (motion.v[1:] + motion.v[:-1]), atol=2e-4)
    assert touches(robot, scene, between(motion, step)) == 0
    assert (motion.clearance > 0.0).all()


def ways_through(robot: Robot, rng: np.random.Generator) -> tuple[NDArray[np.float64], pin.SE3]:
    """A configuration on one side of the wall, and a pose on the other."""
    solver = IKSolver(robot, collision="reject", scene=WALL)
    q = solver.solve(jacokin.pose([0.4, -0.35, 0.3], down=True)).q
    return q, jacokin.pose([0.4, 0.25, rng.uniform(0.25, 0.35)], down=True)


def test_a_straight_motion_where_nothing_is_in_the_way(robot: Robot) -> None:
    """The least time of a straight motion from rest to rest is known."""
    goal = robot.home + np.array([0.5, 0.1, -0.1, 0.2, 0.0, 0.3])
    motion = plan_motion(IKSolver(robot), robot.home, goal)
    check(robot, Scene(), motion)
    speed = (robot.velocity_limit / np.maximum(np.abs(goal - robot.home), 1e-12)).min()  # of the whole way
    pull = (1.0 / np.maximum(np.abs(goal - robot.home), 1e-12)).min()
    least = 1.0 / speed + speed / pull
    assert least < motion.duration < 1.02 * least + 0.03
    away = motion.q - robot.home
    share = away[:, :1] / away[-1, :1]
    np.testing.assert_allclose(away, share * away[-1], atol=1e-9)
    assert motion.goal is not None
    assert motion.goal.number == 0
    np.testing.assert_array_equal(motion.q[-1], goal)
    assert "straight" in motion.message
    assert motion.time is motion.t


def test_around_a_wall(robot: Robot, rng: np.random.Generator, tmp_path: Path) -> None:
    start, pose = ways_through(robot, rng)
    solver = IKSolver(robot, collision="reject", scene=WALL)
    motion = plan_motion(solver, start, pose, time_limit=30.0)
    check(robot, WALL, motion)
    np.testing.assert_array_equal(motion.q[0], start)
    end = robot.forward_kinematics(motion.q[-1])
    np.testing.assert_allclose(end.translation, pose.translation, atol=1e-6)
    assert rotation_angle(end.rotation.T @ pose.rotation) < 1e-6
    again = plan_motion(solver, start, pose, time_limit=60.0)
    np.testing.assert_array_equal(again.q, motion.q)
    for name in ("motion.csv", "motion.npz"):
        motion.save(tmp_path / name)
        read = Trajectory.load(tmp_path / name)
        assert isinstance(read, Trajectory)
        np.testing.assert_array_equal(read.clearance, motion.clearance)
        assert (read.message, read.outcome) == (motion.message, "OK")


def test_distances_are_measured_when_they_are_asked_for(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    asked = 0
    measure = Contact.distances

    def counted(*given: Any, **options: Any) -> Any:
        nonlocal asked
        asked += 1
        return measure(*given, **options)

    monkeypatch.setattr(Contact, "distances", counted)
    motion = plan_motion(IKSolver(robot, scene=WALL), robot.home, robot.home + 0.1)
    assert asked == 0
    copy = pickle.loads(pickle.dumps(motion))
    np.testing.assert_array_equal(motion.clearance, copy.clearance)
    assert asked == 1
    np.testing.assert_array_equal(copy.clearance, robot.clearance(motion.q, WALL, self_collision=True))
    assert not motion.clearance.flags.writeable
    with pytest.raises(AttributeError, match="'Trajectory' object has no attribute 'clearence'"):
        motion.clearence  # type: ignore[attr-defined]  # noqa: B018 - a name that is not there


def test_more_ways_are_never_slower(robot: Robot, rng: np.random.Generator) -> None:
    solver, quicker = IKSolver(robot, collision="reject", scene=WALL), 0
    for _ in range(4):
        start, pose = ways_through(robot, rng)
        durations = [plan_motion(solver, start, pose, time_limit=30.0, ways=ways).duration for ways in (1, 2, 4, 8)]
        assert durations == sorted(durations, reverse=True)
        quicker += durations[-1] < durations[0]
    assert quicker


def test_trees_ways_and_rows_grow_beyond_their_first_room(
    robot: Robot, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    start, pose = ways_through(robot, rng)
    made = list[int]()

    def make(dof: int, room: int) -> Trees:
        made.append(room)
        return make_trees(dof, room)

    monkeypatch.setattr(search, "FIRST_ROOM", 3)
    monkeypatch.setattr(search, "CORNERS", 2)
    monkeypatch.setattr(search, "ROWS", 4)
    monkeypatch.setattr(search, "make_trees", make)
    solver = IKSolver(robot, collision="reject", scene=WALL)
    with ThreadPoolExecutor(1) as pool:  # a thread that has no work arrays yet
        motion = pool.submit(plan_motion, solver, start, pose, time_limit=30.0).result()
    check(robot, WALL, motion)
    assert made[:2] == [6, 12]
    np.testing.assert_array_equal(plan_motion(solver, start, pose, time_limit=30.0).q, motion.q)


def test_threads_share_a_solver(robot: Robot, rng: np.random.Generator) -> None:
    start, pose = ways_through(robot, rng)
    solver = IKSolver(robot, collision="reject", scene=WALL)
    expected = plan_motion(solver, start, pose, time_limit=30.0)
    with ThreadPoolExecutor(4) as pool:
        for motion in pool.map(lambda _: plan_motion(solver, start, pose, time_limit=30.0), range(8)):
            np.testing.assert_array_equal(motion.q, expected.q)


def test_no_generator_is_one_with_the_fixed_seed(robot: Robot, rng: np.random.Generator) -> None:
    start, pose = ways_through(robot, rng)
    arm = jacokin.load_robot(limits={"joint_1": (start[0] - 1.5, start[0] + 1.5)})  # no straight motion
    solver = IKSolver(arm, scene=WALL)
    expected, *others = (
        plan_motion(solver, start, pose, rng=np.random.default_rng(DEFAULT_RANDOM_SEED + k)).q for k in range(4)
    )
    for _ in range(2):
        np.testing.assert_array_equal(plan_motion(solver, start, pose).q, expected)
    assert any(other.tobytes() != expected.tobytes() for other in others)


def test_plans_do_not_depend_on_those_before(robot: Robot, rng: np.random.Generator) -> None:
    """Nor on other scenes, clearances and limits of the same arm: what a thread keeps of a scene says nothing of it."""
    start, goal = ways_through(robot, rng)
    narrow = jacokin.load_robot(limits={"joint_1": (start[0] - 1.5, start[0] + 1.5)})
    others = WALL.adding(*(Sphere(f"ball {k}", 0.02, [0.6, 0.1 * k, 0.7]) for k in range(-5, 6)))
    solvers = [
        IKSolver(robot, scene=WALL),
        IKSolver(narrow, scene=WALL),
        IKSolver(robot, scene=others),
        IKSolver(robot, scene=WALL, clearance=0.05),
        IKSolver(robot),
    ]
    alone = []
    for solver in solvers:
        with ThreadPoolExecutor(1) as pool:  # a thread that has planned nothing
            alone.append(pool.submit(plan_motion, solver, start, goal).result())
    for _ in range(2):
        for solver, expected in zip(solvers, alone, strict=True):
            np.testing.assert_array_equal(plan_motion(solver, start, goal).q, expected.q)
    lengths = {len(each.t) for each in alone}
    assert len(lengths) > 2, "all scenes are alike"


def parted(robot: Robot) -> Scene:
    """Two halves of a wall that leave room for the column of the base alone: no way leads to the other side."""
    tool = robot.forward_kinematics(robot.home).translation
    along = float(np.arctan2(tool[1], tool[0])) + 0.5 * np.pi - 0.6
    across = np.array([np.cos(along), np.sin(along), 0.0])
    halves = [
        Box(f"half_{k}", [2.0, 0.01, 4.0], jacokin.pose(sign * 1.06 * across, rpy=[0.0, 0.0, along]))
        for k, sign in enumerate((1.0, -1.0))
    ]
    return Scene([*halves, Box("lid", [4.0, 0.01, 2.0], jacokin.pose([0.0, 0.0, 2.25], rpy=[0.0, 0.0, along]))])


def test_an_interrupt_ends_a_search_that_leads_nowhere(robot: Robot) -> None:
    solver, goal = IKSolver(robot, collision="reject", scene=parted(robot)), robot.home.copy()
    goal[0] += np.pi
    failed = plan_motion(solver, robot.home, goal, time_limit=0.05)
    assert (failed.outcome, len(failed)) == ("NO_WAY", 1)
    assert "half_" in failed.message
    timer = threading.Timer(0.1, signal.raise_signal, [signal.SIGINT])
    begin = time.monotonic()
    timer.start()
    with pytest.raises(KeyboardInterrupt):
        plan_motion(solver, robot.home, goal, time_limit=300.0)
    assert time.monotonic() - begin < 100.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_fine_referee_finds_no_contact(robot: Robot, seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, pose = ways_through(robot, rng)
    motion = plan_motion(IKSolver(robot, collision="reject", scene=WALL), start, pose, time_limit=30.0, rng=rng)
    check(robot, WALL, motion, step=FINE)


def test_jerk_is_limited_through_corners(robot: Robot, rng: np.random.Generator) -> None:
    start, pose = ways_through(robot, rng)
    solver = IKSolver(robot, collision="reject", scene=WALL)
    pose = plan_motion(solver, start, pose, time_limit=30.0, ways=1).q[-1]  # with stops, another one may be nearer
    plain = plan_motion(solver, start, pose, time_limit=30.0, ways=1)
    motion = plan_motion(solver, start, pose, time_limit=30.0, ways=1, jerk_limit=4.0)
    check(robot, WALL, motion)
    np.testing.assert_array_equal(motion.q[[0, -1]], plain.q[[0, -1]])
    assert plain.duration < motion.duration < 1.25 * plain.duration
    jerk = np.diff(motion.a, axis=0) / np.diff(motion.t)[:, None]
    assert np.abs(jerk).max() <= 4.0 * (1.0 + 1e-6)
    assert np.abs(motion.a[[0, -1]]).max() < 1e-9


def test_any_of_several_goals_will_do(robot: Robot) -> None:
    solver = IKSolver(robot)
    far = jacokin.pose([2.0, 0.0, 0.5])
    pose = robot.forward_kinematics(robot.home + 0.2)
    motion = plan_motion(solver, robot.home, [far, FreeAxis(pose, axis=[0, 0, 1]), robot.home + 1.0])
    check(robot, Scene(), motion)
    assert motion.goal is not None
    assert motion.goal.number == 1
    assert motion.goal.parameter is not None
    assert isinstance(motion.goal.target, FreeAxis)
    reached = robot.forward_kinematics(motion.q[-1])
    np.testing.assert_allclose(reached.translation, pose.translation, atol=1e-6)
    np.testing.assert_allclose(reached.rotation[:, 2], pose.rotation[:, 2], atol=1e-6)
    position = plan_motion(solver, robot.home, pose.translation)
    np.testing.assert_allclose(robot.forward_kinematics(position.q[-1]).translation, pose.translation, atol=1e-6)


def test_unlimited_joints_take_the_short_way(robot: Robot) -> None:
    goal = robot.home.copy()
    goal[0] += 2.0 * np.pi - 0.5
    motion = plan_motion(IKSolver(robot), robot.home, goal)
    np.testing.assert_allclose(motion.q[-1, 0], robot.home[0] - 0.5, atol=1e-12)


def test_copies_within_wide_limits_are_all_tried() -> None:
    """A wall stands where the short way leads: the copy of the goal a turn away is reached the other way round."""
    robot = jacokin.load_robot(limits={"joint_1": (-6.0, 6.0)})
    start, goal = robot.home.copy(), robot.home.copy()
    start[0], goal[0] = 3.0, -3.0
    motion = plan_motion(IKSolver(robot), start, robot.forward_kinematics(goal))
    assert motion.q[-1, 0] == pytest.approx(2.0 * np.pi - 3.0, abs=1e-6)
    # A configuration is what it says: cables know the turns of a limited joint.
    np.testing.assert_array_equal(plan_motion(IKSolver(robot), start, goal).q[-1], goal)


def test_the_nearest_copy_is_among_those_that_are_tried() -> None:
    """Of six copies of each joint, 46,656 in all, some are looked at: those around the start."""
    robot = jacokin.load_robot(limits={f"joint_{number}": (-20.0, 20.0) for number in range(1, 7)})
    goal = robot.home + 0.05
    motion = plan_motion(IKSolver(robot), robot.home, robot.forward_kinematics(goal))
    np.testing.assert_allclose(motion.q[-1], goal, atol=1e-9)


def test_a_joint_with_one_limit_has_copies_around_the_start() -> None:
    robot = jacokin.load_robot(limits={"joint_1": (-3.0, np.inf)})
    start = robot.home + 100.0 * np.pi * np.eye(6)[0]
    motion = plan_motion(IKSolver(robot), start, robot.forward_kinematics(start + 0.05))
    np.testing.assert_allclose(motion.q[-1], start + 0.05, atol=1e-9)


def test_seven_joints_choose_their_elbow() -> None:
    robot = jacokin.load_robot("j2s7s300")
    pose = robot.forward_kinematics(robot.home + 0.3)
    motion = plan_motion(IKSolver(robot), robot.home, pose)
    check(robot, Scene(), motion)
    np.testing.assert_allclose(robot.forward_kinematics(motion.q[-1]).translation, pose.translation, atol=1e-6)
    assert motion.goal is not None
    assert motion.goal.parameter == pytest.approx(motion.q[-1, 2], abs=1e-9)


def test_what_is_held_stays_clear(robot: Robot, rng: np.random.Generator) -> None:
    start, pose = ways_through(robot, rng)
    held = WALL.attach(Box("rod", [0.02, 0.02, 0.2], [0.0, 0.0, 0.05]), to="end_effector")
    motion = plan_motion(IKSolver(robot, collision="reject", scene=held), start, pose, time_limit=30.0)
    if motion.success:
        check(robot, held, motion)
    else:
        assert motion.outcome in ("GOAL_IN_CONTACT", "START_IN_CONTACT", "NO_WAY")


def test_failures_say_what_to_do(robot: Robot) -> None:
    there = robot.forward_kinematics(robot.home).translation
    inside = IKSolver(robot, collision="reject", scene=Scene([Sphere("ball", 0.05, there)]))
    motion = plan_motion(inside, robot.home, robot.home + 0.5)
    assert (motion.success, motion.outcome, len(motion)) == (False, "START_IN_CONTACT", 1)
    assert "ball" in motion.message
    assert "allow" in str(motion)
    motion = plan_motion(IKSolver(robot), robot.home, jacokin.pose([2.0, 0.0, 0.0]))
    assert motion.outcome == "UNREACHABLE"
    assert "farther away than the arm is long" in motion.message
    pose = robot.forward_kinematics(robot.home + 0.4)
    blocked = IKSolver(robot, collision="reject", scene=Scene([Sphere("ball", 0.08, pose.translation)]))
    motion = plan_motion(blocked, robot.home, pose)
    assert motion.outcome == "GOAL_IN_CONTACT"
    assert "ball" in motion.message


def test_no_way_names_what_is_in_the_way(robot: Robot) -> None:
    """A wall through the column of the base: on its other side there is no way."""
    solver = IKSolver(robot, collision="reject", scene=Scene([Box("wall", [3.0, 0.01, 3.0], [0.0, 0.14, 0.0])]))
    goal = robot.home.copy()
    goal[0] += np.pi
    motion = plan_motion(solver, robot.home, goal, time_limit=0.3)
    assert motion.outcome in ("NO_WAY", "START_IN_CONTACT", "GOAL_IN_CONTACT")
    assert "wall" in motion.message


def test_mistakes(robot: Robot) -> None:
    solver = IKSolver(robot)
    outside = robot.home.copy()
    outside[1] = 0.1
    with pytest.raises(InvalidInputError, match="goal puts joint_2 at 0.1"):
        plan_motion(solver, robot.home, outside)
    empty: Any
    for empty in ([], (), np.zeros((0, 6)), np.zeros(0), np.zeros((0, 4, 4))):
        with pytest.raises(InvalidInputError, match="goal is empty"):
            plan_motion(solver, robot.home, empty)
    with pytest.raises(InvalidInputError, match="time_limit must be"):
        plan_motion(solver, robot.home, robot.home, time_limit=0.0)
    with pytest.raises(InvalidInputError, match="ways must be"):
        plan_motion(solver, robot.home, robot.home, ways=0)
    with pytest.raises(InvalidInputError, match="goal must have shape"):
        plan_motion(solver, robot.home, [1.0, 2.0])
    with pytest.raises(InvalidInputError, match="goal 1"):
        plan_motion(solver, robot.home, [robot.home, "cup"])


def test_links_that_are_near_everywhere_are_no_hindrance() -> None:
    robot = jacokin.load_robot("gen3_lite")  # its fingers are 23 mm from the link before the wrist
    solver = IKSolver(robot, scene=Scene([Floor(-0.02)]), clearance=0.03)
    there = robot.forward_kinematics(robot.home)
    goal = pin.SE3(there.rotation, there.translation + np.array([0.0, 0.1, 0.0]))
    assert solver.solve(goal).success
    motion = plan_motion(solver, robot.home, goal, time_limit=10.0)
    check(robot, Scene([Floor(-0.02)]), motion)


def test_neighbours_nearer_than_the_clearance_are_passed_at_what_they_keep(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    robot = near_neighbours(tmp_path)
    solver = IKSolver(robot, clearance=CLEARANCE)
    kept = kept_less(robot, None, CLEARANCE)[NEIGHBOURS]
    rows = robot.sample(rng, 60)
    away, others = of_neighbours_and_others(robot, rows)
    ends, planned = rows[(away > kept + 1e-3) & (others > CLEARANCE + 1e-3)], 0
    for start, goal in itertools.pairwise(ends):
        if of_neighbours_and_others(robot, np.linspace(start, goal, 200))[0].min() < kept + 1e-3:
            continue  # where these two touch, they divide what the fifth joint can do
        motion = plan_motion(solver, start, goal, time_limit=5.0)
        assert motion.success, motion.message
        planned += 1
        assert "l4#2 and l6#3" in motion.message
        away, others = of_neighbours_and_others(robot, between(motion, 0.01))
        assert away.min() > kept
        assert others.min() > CLEARANCE
        least = np.min(of_neighbours_and_others(robot, motion.q), axis=0)
        np.testing.assert_allclose(np.minimum(motion.clearance, FAR), least, atol=1e-5)
    assert planned >= 5


def test_neighbours_that_are_nearer_than_they_keep_come_apart_first(tmp_path: Path, rng: np.random.Generator) -> None:
    robot = near_neighbours(tmp_path)
    solver = IKSolver(robot, clearance=CLEARANCE)
    kept = kept_less(robot, None, CLEARANCE)[NEIGHBOURS]
    rows = robot.sample(rng, 2000)
    away, others = of_neighbours_and_others(robot, rows)
    clear = others > CLEARANCE + 5e-3
    start = rows[clear & (away > 0.1 * kept) & (away < 0.9 * kept)][0]
    goal = next(
        q
        for q in rows[clear & (away > kept + 1e-3)]
        if (np.diff(of_neighbours_and_others(robot, np.linspace(start, q, 30))[0]) > 0.0).all()
    )
    motion = plan_motion(solver, start, goal, time_limit=5.0)
    assert motion.success, motion.message
    assert "l4#2 and l6#3 are" in motion.message
    away, others = of_neighbours_and_others(robot, motion.q)
    assert away.min() > away[0] - 1e-6
    apart = int(np.argmax(away > kept))
    assert (away[apart:] > kept - 1e-6).all()
    assert others.min() > CLEARANCE


def test_hulls_of_meshes_in_the_way_are_said_to_be_hulls(tmp_path: Path) -> None:
    parts = [((0.12, 0.03, 0.03), 0.0, 0.0), ((0.03, 0.03, 0.1), 0.045, 0.06), ((0.03, 0.03, 0.1), -0.045, 0.06)]
    boxes = [trimesh.creation.box(size).apply_translation((x, 0.0, z)) for size, x, z in parts]
    horseshoe: Any = trimesh.util.concatenate(boxes)
    horseshoe.export(tmp_path / "horseshoe.stl")
    path = tmp_path / "arm.urdf"
    path.write_text(ur5_text('<collision><geometry><mesh filename="horseshoe.stl"/></geometry></collision>'))
    for decompose in (False, True):
        robot = jacokin.load_robot(path, decompose=decompose)
        contact = SelfContact(robot)
        rows = robot.sample(np.random.default_rng(0), 200)
        goal = next(q for q in rows if contact.touching(q))
        start = next(q for q in rows if not contact.touching(q))
        motion = plan_motion(IKSolver(robot), start, goal)
        assert motion.outcome == "GOAL_IN_CONTACT"
        assert ("decompose=True" in motion.message) == (not decompose)
