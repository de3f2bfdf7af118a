"""The fuzzer: its own kinematics are right, and it notices what it is there to notice."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

sys.path.append(str(Path(__file__).resolve().parents[2]))  # last: the installed package is what gets tested

from fuzz import arguments, examples, files, targets, values
from fuzz.kinematics import bundled_chain, rotation_error, urdf_chain
from jacokin import IKSolver, Robot
from jacokin.ik import BatchResult
from jacokin.model import NAMES, urdf_folder


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("frame", ["end_effector", "wristsite", "gripsite"])
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


@pytest.mark.parametrize("kind", [targets.run, files.run])
def test_a_case_repeats(kind: Callable[[int, int, int], Iterator[object]], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(targets, "BATCH", 5)
    assert list(kind(5, 3, 4)) == list(kind(5, 3, 4))
