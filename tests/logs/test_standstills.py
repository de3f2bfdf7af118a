"""Where an arm stands still: rows for a calibration, from recordings of an arm that nobody knows."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.calibration import Measurements, calibrate
from jacokin.errors import InvalidInputError
from jacokin.logs import Log, StandstillRule
from tests.calibration.simulated import hidden_arm, mean_error
from tests.logs.recordings import Array, Said, joint_state, measured_hand, names_of, pose, visits, write

NOISE = 3e-4  # [m]


def stops(robot: Robot, count: int) -> Array:
    return robot.sample(np.random.default_rng(4), count)


def reported(robot: Robot, times: Array, q: Array, noise: float = 0.0) -> list[Said]:
    rng = np.random.default_rng(8)
    rows = q + rng.normal(0.0, noise, q.shape)
    return [
        joint_state("/joint_states", float(t), names_of(robot).arm, row) for t, row in zip(times, rows, strict=True)
    ]


@pytest.mark.slow
@pytest.mark.parametrize(
    "ending", [".mcap", *(pytest.param(kind, marks=pytest.mark.slow) for kind in (".bag", ".db3"))]
)
def test_an_arm_nobody_knows_is_found_from_a_recording(ending: str, robot: Robot, tmp_path: Path) -> None:
    hidden = hidden_arm(robot, 3)
    times, q = visits(stops(robot, 20), stand=2.2, rate=20.0)
    said = [*reported(robot, times, q, 1e-5), *measured_hand(hidden, times, q, 20.0, NOISE, 1)]
    measured = Measurements.from_log(Log(write(tmp_path, ending, said), robot), sigma=(1e-4, 4e-4))
    assert (measured.kind, len(measured)) == ("poses", 20)
    assert measured.source is not None
    assert measured.source.suffix == ending
    found = calibrate(robot, measured)
    assert not found.rejected
    arm = jacokin.load_robot(robot.name, calibration=found.measured_arm)
    assert mean_error(robot, hidden) > 3e-3
    assert mean_error(arm, hidden) < 2e-4


def test_standstills_are_where_and_when_the_arm_stood(robot: Robot, tmp_path: Path) -> None:
    places = stops(robot, 4)
    times, q = visits(places, stand=2.0, move=1.0)
    said = [*reported(robot, times, q, 1e-4), *measured_hand(robot, times, q, 50.0, NOISE, 2)]
    found = Log(write(tmp_path, ".mcap", said), robot).standstills()
    np.testing.assert_allclose(found.q, places, atol=1e-4)
    # Speeds are measured over 0.2 s, the arm settles for 0.3 s.
    np.testing.assert_allclose(found.start[1:], 3.0 * np.arange(1, 4) + 0.3, atol=0.15)
    np.testing.assert_allclose(found.stop[:-1], 3.0 * np.arange(3) + 1.7, atol=0.15)
    np.testing.assert_allclose(found.noise, NOISE, rtol=0.5)
    assert (found.q_spread < 3e-4).all()
    assert (found.counts > 50).all()
    assert (found.drifting, found.unseen) == (0, 0)
    for row, T in zip(found.q, found.poses, strict=True):
        np.testing.assert_allclose(T, robot.forward_kinematics(row).homogeneous, atol=1e-3)


def test_a_few_wild_measurements_do_not_move_the_median(robot: Robot, tmp_path: Path) -> None:
    times, q = visits(stops(robot, 3))
    hand = measured_hand(robot, times, q, 20.0, NOISE, 2)
    wild = [pose("/tracker/hand", each.time + 0.01, np.diag([-1.0, -1.0, 1.0, 1.0])) for each in hand[::5]]
    found = Log(write(tmp_path, ".mcap", [*reported(robot, times, q), *hand, *wild]), robot).standstills()
    for row, T in zip(found.q, found.poses, strict=True):
        np.testing.assert_allclose(T, robot.forward_kinematics(row).homogeneous, atol=3e-3)


@pytest.mark.slow
def test_slow_drift_is_no_standstill(robot: Robot, tmp_path: Path) -> None:
    times, q = visits(stops(robot, 3), stand=3.0)
    q[:, 0] += np.where(times < 3.0, 0.008 * times, 0.024)  # below the speed, 14 mrad in the first standstill
    said = [*reported(robot, times, q), *measured_hand(robot, times, q, 20.0, NOISE, 2)]
    log = Log(write(tmp_path, ".mcap", said), robot)
    found = log.standstills()
    assert (len(found), found.drifting) == (2, 1)
    assert len(log.standstills(StandstillRule(spread=0.02))) == 3
    noisy = Log(write(tmp_path / "n", ".mcap", [*reported(robot, times, q, 1e-4), *said[len(times) :]]), robot)
    with pytest.raises(InvalidInputError, match="a joint goes farther than 1e-12 rad"):
        noisy.standstills(StandstillRule(spread=1e-12))


def test_standstills_without_measurements_are_counted(robot: Robot, tmp_path: Path) -> None:
    times, q = visits(stops(robot, 3))
    hand = [each for each in measured_hand(robot, times, q, 20.0, NOISE, 2) if each.time > 2.5]
    log = Log(write(tmp_path, ".mcap", [*reported(robot, times, q), *hand]), robot)
    found = log.standstills()
    assert (len(found), found.unseen) == (2, 1)


def test_why_there_is_no_standstill_is_said(robot: Robot, tmp_path: Path) -> None:
    times, q = visits(stops(robot, 3))
    said = [*reported(robot, times, q), *measured_hand(robot, times, q, 20.0, NOISE, 2)]
    log = Log(write(tmp_path, ".mcap", said), robot)
    with pytest.raises(InvalidInputError, match="never stands still for 5 s with no joint above 0.01 rad/s"):
        log.standstills(StandstillRule(duration=5.0))
    late = [pose("/hand", float(times[-1]) + 9.0, np.eye(4))]
    away = Log(write(tmp_path / "late", ".mcap", [*reported(robot, times, q), *late]), robot)
    with pytest.raises(InvalidInputError, match="nothing is measured of the hand .*from 0.0 to 8.0 s.* from 17.0"):
        away.standstills()


def test_what_the_arm_did_while_messages_were_missing_is_not_known(robot: Robot, tmp_path: Path) -> None:
    times, q = visits(stops(robot, 2), stand=2.0)
    keep = (times < 0.7) | (times > 1.5)
    said = [*reported(robot, times[keep], q[keep]), *measured_hand(robot, times, q, 20.0, NOISE, 2)]
    found = Log(write(tmp_path, ".mcap", said), robot).standstills()
    np.testing.assert_allclose(found.q, [q[-1]], atol=1e-12)


def test_one_error_takes_positions_only(robot: Robot, tmp_path: Path) -> None:
    times, q = visits(stops(robot, 3))
    said = [*reported(robot, times, q), *measured_hand(robot, times, q, 20.0, 0.0, 2)]
    log = Log(write(tmp_path, ".mcap", said), robot)
    measured = Measurements.from_log(log, sigma=1e-3, base="unknown", tool="unknown")
    assert measured.kind == "positions"
    assert measured.base is None
    assert measured.tool is None
    expected = [robot.forward_kinematics(row).translation for row in measured.q]
    np.testing.assert_allclose(measured.values, expected, atol=1e-9)
    assert measured.name_row(1).startswith("row 1 (from 0), at 3.")
    assert measured.select([2]).name_row(0).startswith("row 0 (from 0), at 6.")
    with pytest.raises(InvalidInputError, match="log must be a Log"):
        Measurements.from_log("run.mcap", sigma=1e-3)  # type: ignore[arg-type]


@pytest.mark.parametrize("wrong", [{"speed": 0.0}, {"duration": -1.0}, {"settle": -0.1}, {"spread": float("nan")}])
def test_wrong_rules_are_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(InvalidInputError, match=next(iter(wrong))):
        StandstillRule(**wrong)
