"""Whether two calibrations found the same arm."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.calibration import Calibration, Measurements, Prior, calibrate, compare
from jacokin.errors import InvalidInputError
from tests.calibration.simulated import NOISE, hidden_arm, positions_of
from tests.model.measured_arms import drawn_joint, measured_arm


def calibrated(robot: Robot, arm: Robot, seed: int, count: int = 30) -> Calibration:
    rng = np.random.default_rng(seed)
    q = arm.sample(rng, count)
    seen = positions_of(arm, q) + rng.normal(0.0, NOISE, (count, 3))
    return calibrate(robot, Measurements(q, positions=seen, sigma=NOISE))


def test_halves_of_one_arms_data_agree_and_those_of_two_arms_do_not(robot: Robot) -> None:
    first, second = (calibrated(robot, hidden_arm(robot, 1), seed) for seed in (1, 2))
    same = compare(first, second)
    assert same.agree
    assert same.distance == pytest.approx(same.expected, rel=0.5)
    assert str(same).startswith("they agree")
    other = compare(first, calibrated(robot, hidden_arm(robot, 2), 3))
    assert not other.agree
    assert other.p_value < 1e-6
    assert other.distance > 5.0 * other.expected


@pytest.mark.slow
def test_one_arm_is_taken_for_two_as_often_as_stated(robot: Robot) -> None:
    """Arms as the prior has them: p-values are those of chance."""
    values = []
    for seed in range(24):
        rng = np.random.default_rng(seed)
        joints = [drawn_joint(rng, offset=np.radians(1.0)) for _ in robot.joint_names]
        arm = jacokin.load_robot(calibration=measured_arm(robot, joints))
        values.append(compare(*(calibrated(robot, arm, 100 * seed + half, 25) for half in range(2))).p_value)
    assert 0.3 < np.mean(values) < 0.7
    assert np.mean(np.array(values) < 0.05) <= 0.17


def test_a_fault_of_a_joint_is_named(robot: Robot) -> None:
    """An arm before and after a knock that turned one zero by 3 mrad."""
    arm = hidden_arm(robot, 4)
    assert arm.calibration is not None
    rng = np.random.default_rng(4)
    q = arm.sample(rng, 40)
    turned = q + np.array([0.0, 0.0, 0.003, 0.0, 0.0, 0.0])
    found = [
        calibrate(robot, Measurements(q, positions=positions_of(arm, at) + rng.normal(0, NOISE, (40, 3)), sigma=NOISE))
        for at in (q, turned)
    ]
    result = compare(*found)
    assert not result.agree
    assert result.largest[0] in ("joint_3.offset", "joint_2.offset", "joint_3.x")  # told apart by the prior alone


@pytest.mark.slow
def test_what_is_refused(robot: Robot) -> None:
    first = calibrated(robot, hidden_arm(robot, 1), 1)
    q = robot.sample(np.random.default_rng(0), 10)
    rows = Measurements(q, positions=positions_of(robot, q), sigma=NOISE)
    with pytest.raises(InvalidInputError, match="must have the same prior"):
        compare(first, calibrate(robot, rows, prior=Prior(position=2e-3)))
    with pytest.raises(InvalidInputError, match="of the same numbers"):
        compare(first, calibrate(robot, rows, ["offset"]))
    with pytest.raises(InvalidInputError, match="second must be a Calibration"):
        compare(first, robot)  # type: ignore[arg-type]  # a user's mistake
