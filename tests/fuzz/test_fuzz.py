"""The fuzzer: its own kinematics are right, and it notices what it is there to notice."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parents[2]))  # last: the installed package is what gets tested

from fuzz import arguments, calibrations, examples, files, motions, six_joints, targets, values
from fuzz.kinematics import bundled_chain, rotation_error, urdf_chain
from jacokin import IKSolver, Robot
from jacokin.calibration import Measurements, calibrate
from jacokin.ik import BatchResult
from jacokin.ik.solutions.points import Points
from jacokin.model import NAMES, Scene, Sphere, urdf_folder
from jacokin.model.descriptions.bundled import JACOS
from jacokin.motion import move_joints
from tests.robot_files import load_text


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("name", "frame"),
    [(name, frame) for name in NAMES for frame in ("end_effector", "wristsite")]
    + [(name, "gripsite") for name in JACOS],
)
def test_three_kinematics_agree(
    name: str, frame: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    q = robot.sample(rng, 20)
    own = np.array([robot.forward_kinematics(row, frame).homogeneous for row in q])
    from_table = bundled_chain(urdf_folder(), name, frame)
    from_text = urdf_chain((urdf_folder() / f"{name}.urdf").read_text(), robot.joint_names, frame, robot.base)
    assert from_text is not None
    for chain in (from_table, from_text):
        reached = chain.forward(q)
        np.testing.assert_allclose(reached[:, :3, 3], own[:, :3, 3], rtol=0.0, atol=1e-12)
        assert rotation_error(reached[:, :3, :3], own[:, :3, :3]).max() < 1e-7
    np.testing.assert_array_equal(from_table.lower, robot.lower)
    np.testing.assert_array_equal(from_table.upper, robot.upper)


def test_a_false_success_a_lost_target_and_a_false_status_are_noticed(
    robot: Robot, rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    what = targets.Case(IKSolver(robot), bundled_chain(urdf_folder(), robot.name, "end_effector"), np.eye(4))
    q = targets.within(robot, rng, 20)
    assert list(targets.check_configurations(what, "within", q, rng)) == []
    solve = IKSolver.solve_batch

    def spoiled(self: IKSolver, *arguments: object, **options: object) -> BatchResult:
        batch = solve(self, *arguments, **options)  # type: ignore[arg-type]  # passed on as they came
        moved = batch.q.copy()
        moved[0] += 1e-3
        success = batch.success.copy()
        success[1] = False
        return BatchResult(
            moved, batch.status, success, batch.position_error, batch.orientation_error, batch.method, batch.message
        )

    monkeypatch.setattr(IKSolver, "solve_batch", spoiled)
    found = [
        (finding.kind, finding.what.split(":")[0]) for finding in targets.check_configurations(what, "within", q, rng)
    ]
    assert ("wrong", "success off the target") in found
    assert any(kind == "lost" for kind, _ in found)


def test_a_raw_exception_is_noticed_and_an_error_of_jacokin_is_not(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = examples.build(tmp_path)
    every = arguments.callables(made)
    assert {"solve_ik", "IKSolver.solve", "Tracker.step", "track_path", "JacoArm.set_site_to_xpos"} <= every.keys()

    def raw(target: object) -> None:
        raise IndexError("tuple index out of range")

    monkeypatch.setattr(arguments, "callables", lambda _: {"raw": raw})
    (finding,) = arguments.call(made, np.random.default_rng(0))
    assert finding.kind == "raw"
    assert "IndexError" in finding.where
    monkeypatch.setattr(arguments, "callables", lambda _: {"solve_ik": every["solve_ik"]})
    monkeypatch.setattr(values, "value", lambda _: "nonsense")
    assert list(arguments.call(made, np.random.default_rng(0))) == []


def test_functions_of_public_modules_are_called() -> None:
    names = set(arguments.callables(examples.Examples({}, {})))
    assert {"load_robot", "track_path", "Physics", "tolerance", "make_arm", "add_target_site", "Uniform"} <= names
    assert not {"check_name", "shown", "ArrayLike"} & names  # imported by such modules, and not theirs


def test_a_file_that_is_read_wrongly_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    forward = Robot.forward_kinematics
    for name in ("j2n6s300.urdf", "j2n6s300.xml"):
        path = tmp_path / name
        path.write_bytes((urdf_folder() / name).read_bytes())
        assert list(files.check(name, path, np.random.default_rng(0))) == []
        with monkeypatch.context() as patch:
            patch.setattr(Robot, "forward_kinematics", lambda self, q: forward(self, np.add(q, 1e-3)))
            (finding,) = files.check(name, path, np.random.default_rng(0))
        assert finding.kind == "wrong"


def test_a_motion_that_touches_or_is_too_quick_is_noticed(robot: Robot) -> None:
    limits = {"velocity_limit": None, "acceleration_limit": 1.0, "jerk_limit": None, "torque_limit": None}
    motion = move_joints(robot, robot.home, robot.home + 0.3, acceleration_limit=1.0)
    assert list(motions.check_motion(robot, motion, robot.home, limits, "")) == []
    found = motions.check_motion(robot, motion, robot.home + 0.1, {**limits, "acceleration_limit": 0.9}, "")
    kinds = {finding.where for finding in found}
    assert {"a motion breaks the limits of acceleration", "a motion breaks its start"} <= kinds
    assert motions.Referee(robot, Scene()).distance(robot.home, 0.01) > 0.0
    ball = Sphere("ball", 0.05, robot.forward_kinematics(robot.home).translation)
    assert motions.Referee(robot, Scene([ball])).distance(robot.home, 0.01) < 0.0


def test_a_calibration_that_is_too_sure_is_noticed(robot: Robot, rng: np.random.Generator) -> None:
    arm, numbers = calibrations.hidden_arm(robot, rng)
    q = robot.sample(rng, 20)
    places = [arm.forward_kinematics(row).translation + rng.normal(0.0, 1e-3, 3) for row in q]
    found = calibrate(robot, Measurements(q, positions=places, sigma=1e-3))
    assert [*calibrations.check_covariance(found, ""), *calibrations.check_truth(found, numbers, "")] == []
    (finding,) = calibrations.check_truth(found, 10.0 * numbers, "")
    assert finding.where == "calibrate: too sure"


def test_a_branch_that_is_lost_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(1)
    robot = load_text(tmp_path / "arm.urdf", six_joints.random_arm(rng))
    solver, q = IKSolver(robot, collision="ignore"), robot.sample(rng)
    assert list(six_joints.check_branches(solver, q)) == []
    found = solver.solve_all(robot.forward_kinematics(q), q).q  # the nearest first, which is q
    monkeypatch.setattr(Points, "q", property(lambda branches: found[1:]))
    (finding,) = six_joints.check_branches(solver, q)
    assert finding.kind == "lost"


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", [files.run, targets.run])
def test_a_case_repeats(kind: Callable[[int, int, int], Iterator[object]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(targets, "BATCH", 5)
    assert list(kind(5, 3, 4)) == list(kind(5, 3, 4))
