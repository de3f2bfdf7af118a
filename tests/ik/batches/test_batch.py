"""Batches: arguments, worker processes, interruption."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.motion import AxisTarget, PositionTarget

INTERRUPTED = """
    import os, signal, sys
    import jacokin

    def report(count):
        print(count, flush=True)

    if __name__ == "__main__":
        solver = jacokin.IKSolver(jacokin.load_robot(), method="qp")
        targets = [[0.3, 0.2, 0.3 + 1e-5 * index] for index in range(2_000)]
        solver.solve_batch(targets, workers=2, progress=report, closest=False)
"""


def is_left(group: int) -> bool:
    """Whether a group has a process."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "everyone"),
    [(signal.SIGINT, True), (signal.SIGINT, False), (signal.SIGKILL, False)],
    ids=["Ctrl-C", "kill -INT", "kill -KILL"],
)
def test_an_interrupted_batch_ends_and_leaves_no_process(tmp_path: Path, number: int, everyone: bool) -> None:
    script = tmp_path / "batch.py"
    script.write_text(textwrap.dedent(INTERRUPTED))
    process = subprocess.Popen(
        [sys.executable, script], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == "1"
        (os.killpg if everyone else os.kill)(process.pid, number)
        _, errors = process.communicate(timeout=60)
        assert process.returncode != 0
        if number == signal.SIGINT:
            assert errors.count("Traceback") == 1, errors
            assert errors.rstrip().endswith("KeyboardInterrupt")
        deadline = time.monotonic() + 60.0  # [s]
        while is_left(process.pid):
            assert time.monotonic() < deadline, "a worker process is still there"
            time.sleep(0.02)
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)


def test_masked_arrays_are_refused(robot: Robot) -> None:
    solver = IKSolver(robot)
    target = robot.forward_kinematics(robot.home)
    masked_pose = np.ma.masked_array(target.homogeneous, mask=np.eye(4, dtype=np.bool_))
    masked_seed = np.ma.masked_array(robot.home, mask=[True] + [False] * 5)
    for call in (
        lambda: solver.solve(masked_pose),
        lambda: solver.solve_all(masked_pose),
        lambda: solver.solve_batch(masked_pose[None]),
        lambda: solver.solve_batch([masked_pose]),
        lambda: solver.solve(target, masked_seed),
        lambda: solver.solve_batch([target], masked_seed),
        lambda: solver.solve_batch([target], masked_seed[None]),
        lambda: IKSolver(robot, tool=masked_pose),
    ):
        with pytest.raises(InvalidInputError, match="target|seed|tool"):
            call()


@pytest.mark.parametrize("seeds", [[[0.1] * 6, [0.1] * 5], "home", [["a"] * 6], [[True] * 6], [[10**400] * 6], {}, 1j])
def test_seeds_that_are_not_numbers_are_refused(robot: Robot, seeds: object) -> None:
    with pytest.raises(InvalidInputError, match="seeds"):
        IKSolver(robot).solve_batch([robot.forward_kinematics(robot.home)], seeds)  # type: ignore[arg-type]  # on purpose


@pytest.mark.parametrize("closest", ["no", 0, None, np.ones(2)])
def test_closest_is_true_or_false(robot: Robot, closest: object) -> None:
    solver = IKSolver(robot)
    target = robot.forward_kinematics(robot.home)
    for call in (solver.solve, lambda target, closest: solver.solve_batch([target], closest=closest)):
        with pytest.raises(InvalidInputError, match="closest must be True or False"):
            call(target, closest=closest)  # type: ignore[arg-type]  # on purpose


def test_options_of_any_type_are_named(robot: Robot) -> None:
    for option, value, error in (
        ("method", np.array(["qp", "auto"]), UnknownNameError),
        ("collision", 10**5000, UnknownNameError),
        ("qp_solver", ["daqp"], UnknownNameError),
        ("qp_solver", np.array(["daqp", "osqp"]), UnknownNameError),
        ("position_tolerance", 10**400, InvalidInputError),
        ("limit_snap", np.datetime64("2020-01-01"), InvalidInputError),
        ("max_restarts", np.timedelta64(3, "s"), InvalidInputError),
    ):
        with pytest.raises(error, match=option):
            IKSolver(robot, **{option: value})  # type: ignore[arg-type]  # wrong on purpose


def test_a_refused_structure_does_not_collect_tracebacks(robot: Robot) -> None:
    solver = IKSolver(robot, "link_4")
    depths = []
    for _ in range(3):
        with pytest.raises(jacokin.JacokinError) as caught:
            solver.closed_form()
        depths.append(len(caught.traceback))
    assert depths[1] == depths[2]


def test_targets_of_the_tracker_are_solved_as_one_by_one(robot: Robot) -> None:
    solver = IKSolver(robot)
    position, down = PositionTarget([0.3, -0.2, 0.4]), AxisTarget([0.0, 0.0, 1.0], [0.0, 0.0, -1.0])
    targets = [[position, down], position, robot.forward_kinematics(robot.home)]
    found = solver.solve_batch(targets)
    assert found.success.all()
    for q, target in zip(found.q, targets, strict=True):
        np.testing.assert_array_equal(q, solver.solve(target).q)
    with pytest.raises(InvalidInputError, match="the solver is for 'end_effector'"):
        solver.solve_batch([PositionTarget([0.3, -0.2, 0.4], frame="link_4")])


def test_messages_are_those_of_single_solves_but_for_the_branch(robot: Robot, rng: np.random.Generator) -> None:
    solver = IKSolver(robot)
    targets = np.array([robot.forward_kinematics(q).homogeneous for q in robot.sample(rng, 12)])
    targets[6:, :3, 3] *= 1.5
    seeds = robot.sample(rng, 12) + 9.0 * (np.arange(12) % 2)[:, None]
    batch = solver.solve_batch(targets, seeds)
    for target, seed, success, message in zip(targets, seeds, batch.success, batch.message, strict=True):
        single = solver.solve(target, seed).message
        said = "; ".join(part for part in single.split("; ") if not (success and part.startswith("branch ")))
        assert message == said
