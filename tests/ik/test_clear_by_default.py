"""Contact is avoided unless something else is asked for, against all branches and all members."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import solve_file
from jacokin.ik.batches import batch
from jacokin.ik.c_library import solver_file
from jacokin.model import Floor, Scene, SelfContact, Sphere
from jacokin.model.own_shapes import kept_less
from tests.near_neighbours import CLEARANCE, NEIGHBOURS, near_neighbours, of_neighbours_and_others
from tests.robot_files import urdf_text


@pytest.fixture(scope="module")
def solver(robot: Robot) -> IKSolver:
    return IKSolver(robot)


@pytest.fixture(scope="module")
def contact(robot: Robot) -> SelfContact:
    return SelfContact(robot)


def clear_rows(robot: Robot, contact: SelfContact, seed: int, count: int) -> Array:
    rows = robot.sample(np.random.default_rng(seed), 2 * count)
    return rows[[not contact.touches(q) for q in rows]][:count]


def test_the_default_takes_the_nearest_branch_without_contact(
    robot: Robot, solver: IKSolver, contact: SelfContact
) -> None:
    rng = np.random.default_rng(5)
    passed_over = touching = 0
    bare = IKSolver(robot, collision="ignore")
    for q, seed in zip(robot.sample(rng, 400), robot.sample(rng, 400), strict=True):
        target = robot.forward_kinematics(q)
        rows = bare.solve_all(target, seed).q_within_limits
        clear = [row for row in rows if not contact.touching(row)]
        result = solver.solve(target, seed)
        assert result.success
        np.testing.assert_array_equal(result.q, (clear or rows)[0])
        assert bool(result.touching) == (not clear)
        passed_over += bool(clear) and not np.array_equal(clear[0], rows[0])
        if not clear:
            touching += 1
            assert list(result.touching) == contact.touching(result.q)
            a, b = result.touching[0]
            assert result.message.startswith("every branch within the limits is in contact; the best at ")
            assert f"{a} and {b}" in result.message
    assert passed_over >= 3
    assert touching > 5


def test_what_ignores_contact_answers_as_before(robot: Robot) -> None:
    bare = IKSolver(robot, collision="ignore")
    for q in robot.sample(np.random.default_rng(6), 100):
        target = robot.forward_kinematics(q)
        result, branches = bare.solve(target), bare.solve_all(target)
        np.testing.assert_array_equal(result.q, branches.nearest())
        assert result.touching == ()
        assert branches.touching is None


def test_a_scene_is_not_to_be_hit(robot: Robot) -> None:
    scene = Scene([Floor(0.1)])
    for made in (IKSolver(robot, scene=scene), IKSolver(robot).in_scene(scene)):
        assert made.verifier.options.collision == "reject"
        below = jacokin.pose([0.4, 0.0, 0.05], down=True)
        result = made.solve(below, closest=False)
        assert result.status is Status.IN_COLLISION
        assert "floor" in result.message
    lenient = IKSolver(robot, scene=scene, collision="prefer").solve(below)
    assert lenient.success
    assert any("floor" in pair for pair in lenient.touching)
    assert IKSolver(robot, clearance=0.01).verifier.options.collision == "reject"
    assert IKSolver(robot, collision="report").in_scene(scene).verifier.options.collision == "report"


@pytest.mark.parametrize("collision", ["prefer", "reject", "report", "ignore"])
def test_rows_of_a_batch_answer_as_solve_does(robot: Robot, collision: str) -> None:
    solver = IKSolver(robot, collision=collision)
    rng = np.random.default_rng(7)
    rows, seeds = robot.sample(rng, 200), robot.sample(rng, 200)
    targets = [robot.forward_kinematics(q) for q in rows]
    single_thread, threaded = (solver.solve_batch(targets, seeds, closest=False, workers=workers) for workers in (1, 2))
    assert single_thread.touching is not None
    for index, (target, seed) in enumerate(zip(targets, seeds, strict=True)):
        single = solver.solve(target, seed, closest=False)
        assert single_thread.status[index] is single.status
        np.testing.assert_array_equal(single_thread.q[index], single.q)
        np.testing.assert_array_equal(threaded.q[index], single.q)
        assert single_thread.touching[index] == bool(single.touching)
    assert single_thread.touching.any() == (collision != "ignore")


def test_rows_in_contact_start_no_processes(robot: Robot, solver: IKSolver, monkeypatch: pytest.MonkeyPatch) -> None:
    """They take microseconds, and processes a second to begin."""
    rows = robot.sample(np.random.default_rng(7), 200)

    def refuse(*_: object) -> None:
        raise AssertionError("processes were started")

    monkeypatch.setattr(batch, "worker_processes", refuse)
    found = solver.solve_batch([robot.forward_kinematics(q) for q in rows], workers=2)
    assert found.touching is not None
    assert found.touching.sum() > 4


def test_a_file_is_answered_as_a_batch_is(robot: Robot, solver: IKSolver, tmp_path: Path) -> None:
    targets = np.array([robot.forward_kinematics(q).homogeneous for q in robot.sample(np.random.default_rng(8), 200)])
    np.savez(tmp_path / "targets.npz", targets=targets)
    solve_file(solver, tmp_path / "targets.npz", tmp_path / "answers.npz")
    expected = solver.solve_batch(targets)
    with np.load(tmp_path / "answers.npz") as answers:
        np.testing.assert_array_equal(answers["q"], expected.q)
    bare = IKSolver(robot, collision="ignore").solve_batch(targets)
    assert 0 < (bare.q != expected.q).any(axis=1).sum() < 100


@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s300", "j2s7s300"])
def test_every_clear_configuration_is_its_own_answer(name: str) -> None:
    robot = jacokin.load_robot(name)
    solver, contact = IKSolver(robot), SelfContact(robot)
    for q in clear_rows(robot, contact, 9, 60):
        target = robot.forward_kinematics(q)
        result = solver.solve(target, seed=q)
        assert result.success
        assert not result.touching
        np.testing.assert_allclose(result.q, q, rtol=0.0, atol=1e-6)
        if robot.dof == 6:
            branches = solver.solve_all(target, q)
            assert branches.touching is not None
            assert branches.touching[0] == ()
            about = solver.solve(FreeAxis(target, axis=(1.0, 0.0, 0.0)), seed=q)
            assert about.success
            np.testing.assert_allclose(about.q, q, rtol=0.0, atol=1e-6)


def assert_nearest_clear_member(
    solver: IKSolver, target: FreeAxis | pin.SE3, seed: Array, contact: SelfContact
) -> bool:
    """Whether the nearest member of all touches: another one is taken, and no clear one is much nearer."""
    result = solver.solve(target, seed)
    assert result.success
    family = IKSolver(solver.robot, collision="ignore").solve_all(target, seed)
    rows = family.sample(2000)
    clear = rows[[not contact.touches(q) for q in rows]]
    if result.touching:
        assert not len(clear)
        assert "in contact" in result.message
        return True
    nearest = family.nearest(seed)
    assert nearest is not None
    far = float(np.linalg.norm(result.q - seed))
    assert far <= float(np.linalg.norm(clear - seed, axis=1).min()) + 0.05
    return contact.touches(nearest)


@pytest.mark.slow
def test_the_nearest_clear_member_of_families(robot: Robot, contact: SelfContact) -> None:
    seven = jacokin.load_robot("j2s7s300")
    for arm, count, look in ((robot, 8, contact), (seven, 8, SelfContact(seven))):
        found = 0
        rows = arm.sample(np.random.default_rng(10), 200 * count)
        for q in [q for q in rows if look.touches(q)][:count]:
            pose = arm.forward_kinematics(q)
            target = FreeAxis(pose, axis=(0.0, 1.0, 0.0)) if arm.dof == 6 else pose
            found += assert_nearest_clear_member(IKSolver(arm), target, q, look)
        assert found == count


def test_a_member_without_contact_is_taken(robot: Robot, solver: IKSolver, contact: SelfContact) -> None:
    rows = robot.sample(np.random.default_rng(11), 200)
    found = 0
    for q in [row for row in rows if contact.touches(row)][:8]:
        target = FreeAxis(robot.forward_kinematics(q), axis=(1.0, 0.0, 0.0))
        result = solver.solve(target, seed=q)
        assert result.success
        found += not result.touching
        assert contact.touches(result.q) == bool(result.touching)
    assert found >= 4


def test_an_arm_without_shapes_is_answered_and_told(tmp_path: Path) -> None:
    text = urdf_text()
    bare = tmp_path / "bare.urdf"
    while "<collision" in text:
        start, stop = text.index("<collision"), text.index("</collision>") + len("</collision>")
        text = text[:start] + text[stop:]
    bare.write_text(text)
    lost = tmp_path / "lost.urdf"
    box = '<collision><geometry><mesh filename="nowhere.stl"/></geometry></collision></link>'
    lost.write_text(text.replace("</link>", box, 1))
    for path, reason in ((bare, "the description has no collision shapes"), (lost, "nowhere.stl")):
        robot = jacokin.load_robot(path, tip="end_effector")
        solver = IKSolver(robot)
        target = robot.forward_kinematics(robot.home)
        result = solver.solve(target)
        assert result.success
        assert "contact was not checked: " in result.message
        assert reason in result.message
        both = solver.solve_batch([target, target], seeds=np.zeros(6))
        assert all("contact was not checked: " in each for each in both.message)
        assert solver.solve_all(target).touching is None
        assert "not checked" not in IKSolver(robot, collision="ignore").solve(target).message


def test_branches_keep_what_touches_when_they_are_pickled(robot: Robot, solver: IKSolver) -> None:
    branches = solver.solve_all(robot.forward_kinematics(robot.sample(np.random.default_rng(1))))
    assert branches.touching == pickle.loads(pickle.dumps(branches)).touching


def test_the_c_library_takes_the_default_and_nothing_that_asks_for_contact(robot: Robot, solver: IKSolver) -> None:
    assert solver_file(solver) == solver_file(IKSolver(robot, collision="ignore"))
    for other in (IKSolver(robot, collision="reject"), IKSolver(robot, scene=Scene([Floor()]), collision="prefer")):
        with pytest.raises(InvalidInputError, match="does not look for contact"):
            solver_file(other)


def test_a_position_is_reached_without_contact(robot: Robot, solver: IKSolver, contact: SelfContact) -> None:
    bare, touched, left = IKSolver(robot, collision="ignore"), 0, 0
    for q in robot.sample(np.random.default_rng(12), 60):
        position = robot.forward_kinematics(q).translation
        answer = bare.solve(position)
        if contact.touches(answer.q):
            touched += 1
            left += bool(solver.solve(position).touching)  # some positions are inside the arm's own column
    assert left <= touched // 2
    assert touched >= 2


@pytest.mark.parametrize(
    ("q", "ball"),
    [
        ((1.12611634, 2.70570983, 0.80931216, -2.18257924, np.pi, 2.36807194), (0.02299425, 0.0868969, 0.57355935)),
        ((0.60451997, 3.12501644, 5.32463678, 1.35399394, np.pi, -0.92245612), (0.21231388, -0.10052966, 0.57400907)),
    ],
)
def test_a_straight_wrist_turns_out_of_contact(q: tuple[float, ...], ball: tuple[float, float, float]) -> None:
    """Every branch that is listed touches the ball; others of the self-motion that it stands for do not."""
    robot = jacokin.load_robot("j2s6s300")
    solver, own = IKSolver(robot, scene=Scene([Sphere("ball", 0.03, ball)])), np.array(q)
    target = robot.forward_kinematics(own)
    branches = solver.solve_all(target, seed=own)
    assert all(solver.verifier.touches(each) for each in branches.q_within_limits)
    result = solver.solve(target, seed=own)
    assert result.success
    assert not solver.verifier.touches(result.q)
    batch_result = solver.solve_batch([target, target], seeds=own)
    assert batch_result.success.all()
    np.testing.assert_allclose(batch_result.q, np.tile(result.q, (2, 1)), rtol=0.0, atol=1e-12)


def test_neighbours_nearer_than_the_clearance_leave_answers_that_say_so(
    tmp_path: Path, rng: np.random.Generator
) -> None:
    robot = near_neighbours(tmp_path)
    solver = IKSolver(robot, clearance=CLEARANCE)
    kept = kept_less(robot, None, CLEARANCE)[NEIGHBOURS]
    rows = robot.sample(rng, 150)
    away, others = of_neighbours_and_others(robot, rows)
    there = (away > kept) & (others > CLEARANCE)
    assert there.mean() > 0.5
    targets = [robot.forward_kinematics(q) for q in rows]
    results = [solver.solve(target, seed=q, closest=False) for target, q in zip(targets, rows, strict=True)]
    assert all(result.success for result, clear in zip(results, there, strict=True) if clear)
    both = solver.solve_batch(targets, seeds=rows, closest=False)
    np.testing.assert_array_equal(both.success, [result.success for result in results])
    reached = np.array([result.q for result in results if result.success])
    for answers in (reached, both.q[both.success]):
        away, others = of_neighbours_and_others(robot, answers)
        assert away.min() > kept - 1e-6
        assert others.min() > CLEARANCE - 1e-6
    for message in (results[int(np.argmax(there))].message, both.message[int(np.argmax(there))]):
        assert f"kept less than 0.02 m apart, as nearly always nearer: l4#2 and l6#3 ({kept:.2g} m)" in message
    assert "apart" not in IKSolver(robot).solve(targets[0]).message
