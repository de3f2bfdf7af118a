"""What a runner follows: all files of trajectories, their checks, and a hand."""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin.errors import InvalidInputError
from jacokin.model import Robot
from jacokin.motion import Tracker, Trajectory, move_joints
from jacokin.runner import LiveMotion, Measured, PlannedMotion, ProcessLink, Runner, RunnerStatus, TwinLink, run
from jacokin.teleop import Teleop
from jacokin.twin import KinovaDriver, SimulatedArm
from tests.robot_files import CRANE

TICK = 0.01


@pytest.fixture(scope="module")
def trajectory(robot: Robot) -> Trajectory:
    return move_joints(robot, robot.home, robot.home + np.array([0.4, 0.1, -0.2, 0.5, 0.1, 0.6]), dt=0.01)


@pytest.mark.parametrize("name", ["m.csv", "m.npz", "m.json", "m.kinova.csv", "m.kinova.json"])
def test_all_files_that_save_writes(robot: Robot, trajectory: Trajectory, tmp_path: Path, name: str) -> None:
    is_message = name.endswith("json")
    prefix = {"joint_prefix": "j2n6s300_", "first_time": 0.1} if is_message else {}
    trajectory.save(tmp_path / name, **prefix)  # type: ignore[arg-type]
    motion = PlannedMotion.load(tmp_path / name, robot)
    assert motion.time[0] == 0.0
    assert motion.duration == pytest.approx(trajectory.duration, abs=TICK)
    np.testing.assert_allclose(motion.q[[0, -1]], trajectory.q[[0, -1]], atol=1e-12)
    # The velocities of the ticks lead through it, and are within the limits.
    q = motion.q[0].copy()
    motion.begin(q)
    while not motion.is_over:
        before = motion.now
        wanted = motion.step(TICK)
        assert (np.abs(wanted.v) <= robot.velocity_limit + 1e-9).all()
        q += wanted.v * TICK
        assert motion.now > before
        np.testing.assert_allclose(q, wanted.q, atol=1e-9)
    np.testing.assert_allclose(q, trajectory.q[-1], atol=1e-9)


def test_a_slide_is_told_in_millimetres(tmp_path: Path) -> None:
    file = tmp_path / "crane.urdf"
    file.write_text(CRANE, encoding="utf-8")
    crane = jacokin.load_robot(file)
    with pytest.raises(InvalidInputError, match=r"slide is 100 mm past its limit in row 1"):
        PlannedMotion(crane, [0.0, 9.0], [[0.0, 1.0, 0.0], [0.0, 1.6, 0.0]])
    with pytest.raises(InvalidInputError, match=r"slide is 500 mm/s faster than its limit from row 0"):
        PlannedMotion(crane, [0.0, 0.1], [[0.0, 1.0, 0.0], [0.0, 1.15, 0.0]])
    motion = PlannedMotion(crane, [0.0, 1.0], [[0.0, 1.0, 0.0], [0.0, 1.1, 0.0]])
    with pytest.raises(InvalidInputError, match=r"slide is 50.0 mm from where the motion begins \(34.9 mm allowed\)"):
        motion.begin(np.array([0.0, 0.95, 0.0]))
    runner = Runner(crane, motion)
    runner.step(0.0, Measured(np.array([0.0, 1.0, 0.0])))
    step = runner.step(0.01, Measured(np.array([0.0, 1.2, 0.0])))
    assert "slide is 200.0 mm off the motion (87.3 mm allowed)" in step.message


def test_rows_that_break_a_limit_are_refused(robot: Robot) -> None:
    q = np.array([robot.home, robot.home])
    with pytest.raises(InvalidInputError, match="joint_2 is 5.73 deg past its limit in row 1"):
        PlannedMotion(robot, [0.0, 9.0], np.where(np.eye(6)[1] * [[0.0], [1.0]] > 0.0, robot.upper[1] + 0.1, q))
    with pytest.raises(InvalidInputError, match="joint_1 is .* deg/s faster than its limit from row 0"):
        PlannedMotion(robot, [0.0, 1.0], q + np.outer([0.0, 1.0], np.eye(6)[0]))
    for time, rows in (([0.0, 0.0], q), ([0.0, 1.0], q[:, :5]), ([], q[:0]), ([0.0, 1.0], q * np.nan), ("x", q)):
        with pytest.raises(InvalidInputError):
            PlannedMotion(robot, time, rows)


def live(robot: Robot) -> LiveMotion:
    return LiveMotion(Teleop(Tracker(robot, dt=TICK, q=robot.home, acceleration_limit=2.0)))


def test_a_hand_leads_the_arm_and_its_silence_stops_it(robot: Robot) -> None:
    """A twist for a second; then nothing, and the watchdog of `Teleop` brakes; then the end."""
    motion, arm = live(robot), SimulatedArm()
    runner = Runner(robot, motion)
    link = TwinLink(KinovaDriver(arm), period=0.02)
    moved: list[float] = []

    def watch() -> None:
        now = round(link.now() / TICK)
        if now == 10:
            motion.take('{"clutch": true}')
        if 20 <= now < 120:
            motion.take(json.dumps({"hand": [0.0, 0.0, 0.05, 0.0, 0.0, 0.0]}))
        if now == 260:
            assert motion.said.startswith("NO_INPUT")
            moved.append(arm.moved)
            motion.take('{"end": true}')

    run(runner, link, watch=watch)
    assert runner.status is RunnerStatus.ARRIVED
    start, end = (robot.forward_kinematics(q).translation for q in (robot.home, arm.state.q))
    np.testing.assert_allclose(end - start, [0.0, 0.0, 0.05], atol=0.02)
    assert end[2] - start[2] > 0.04
    assert 1.2 < moved[0] < 2.2


@pytest.mark.parametrize("line", ["", "{", "[]", "{}", '{"hands": []}', '{"clutch": 1}', '{"end": null}'])
def test_lines_that_are_none(robot: Robot, line: str) -> None:
    motion = live(robot)
    with pytest.raises(InvalidInputError):
        motion.take(line)
    assert not motion.is_over
    assert not motion.teleop.engaged


def test_the_end_of_a_hand_brakes_the_arm(robot: Robot) -> None:
    motion = live(robot)
    motion.begin(robot.home)
    motion.take('{"clutch": true}')
    for _ in range(50):
        motion.take('{"hand": [0.0, 0.0, 0.1, 0.0, 0.0, 0.0]}')
        before = motion.step(TICK).v
    assert np.abs(before).max() > 0.1
    motion.take('{"end": true}')
    assert not motion.is_over
    while not motion.is_over:
        v = motion.step(TICK).v
        assert np.abs(v - before).max() <= 2.0 * TICK + 1e-9  # the acceleration limit
        before = v


def test_what_is_no_motion_no_arm_and_no_hand_is_refused(robot: Robot) -> None:
    motion: Any = PlannedMotion(robot, [0.0], [robot.home])
    driver, wrong = KinovaDriver(SimulatedArm()), object()
    made: list[Callable[[], object]] = [
        lambda: PlannedMotion.of(wrong, robot),  # type: ignore[arg-type]  # the mistakes
        lambda: LiveMotion(wrong),  # type: ignore[arg-type]
        lambda: live(robot).take("[" * 100_000),
        lambda: Runner(robot, wrong),  # type: ignore[arg-type]
        lambda: Runner(robot, motion, {"gain": 1.0}),  # type: ignore[arg-type]
        lambda: TwinLink(wrong),  # type: ignore[arg-type]
        lambda: TwinLink(driver, period=math.nan),
        lambda: run(motion, TwinLink(driver)),
        lambda: ProcessLink(["true"], "joint_1"),
    ]
    for call in made:
        with pytest.raises(InvalidInputError):
            call()


def test_a_malformed_hand_brakes_and_says_why(robot: Robot) -> None:
    motion = live(robot)
    motion.begin(robot.home)
    motion.take('{"clutch": true, "hand": [1, 2]}')
    wanted = motion.step(TICK)
    assert motion.said.startswith("BAD_INPUT")
    np.testing.assert_array_equal(wanted.q, robot.home)


@pytest.mark.parametrize(("tick", "dt"), [(0.05, TICK), (0.013, TICK), (0.004, TICK), (TICK, 0.3 * TICK)])
def test_a_tracker_of_another_rate_moves_the_arm_as_steadily(robot: Robot, tick: float, dt: float) -> None:
    motion = LiveMotion(Teleop(Tracker(robot, dt=tick, q=robot.home, acceleration_limit=2.0)))
    motion.begin(robot.home)
    motion.take('{"clutch": true}')
    before, ends = motion.step(0.0), list[float]()
    for _ in range(round(1.0 / dt)):
        motion.take('{"hand": [0.0, 0.0, 0.1, 0.0, 0.0, 0.0]}')
        wanted = motion.step(dt)
        np.testing.assert_allclose(wanted.q - before.q, dt * wanted.v, atol=1e-12)
        assert np.abs(wanted.v - before.v).max() <= 2.0 * (tick + dt)  # the acceleration limit, in two ticks at most
        before = wanted
        ends.append(robot.forward_kinematics(wanted.q).translation[2])
    assert ends[-1] - ends[-round(0.2 / dt) - 1] == pytest.approx(0.02, rel=0.05)
