"""What can be told apart: ranks against robots with one number changed."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.calibration import Measurements, calibrate
from tests.calibration.simulated import PRIOR, brute_jacobian, poses_of, positions_of

SMALLEST = 1e-6  # of the largest singular value: differences leave 1e-9


def rank(jacobian: np.ndarray) -> int:
    values = np.linalg.svd(jacobian, compute_uv=False)
    return int(np.sum(values > SMALLEST * values[0]))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s200"])
@pytest.mark.parametrize("kind", ["positions", "poses"])
def test_rank_of_a_known_base_and_tool(name: str, kind: str, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(name)
    q = robot.sample(rng, 30)
    brute = brute_jacobian(robot, q)[:, : 3 if kind == "positions" else 6]
    wanted = rank(brute.reshape(-1, 36) * PRIOR)
    if kind == "positions":
        rows = Measurements(q, positions=positions_of(robot, q), sigma=3e-4)
    else:
        rows = Measurements(q, poses=poses_of(robot, q), sigma=(3e-4, 1e-3))
    found = calibrate(robot, rows)
    assert found.fit.identifiability.rank == wanted
    assert wanted == {"positions": 23, "poses": 26}[kind]
    assert len(found.unidentified) == 36 - wanted
    for estimate in found.parameters.values():  # nothing is claimed that the prior does not say
        assert estimate.sigma <= estimate.prior * (1.0 + 1e-9)


@pytest.mark.slow
def test_unknown_base_and_tool_cost_what_they_must(robot: Robot, rng: np.random.Generator) -> None:
    """Six numbers more for the base and six for the tool, of poses; thirty in all show, as for every such chain."""
    q = robot.sample(rng, 40)
    T = poses_of(robot, q)
    rows = Measurements(q, poses=T, sigma=(3e-4, 1e-3), base="unknown", tool="unknown")
    found = calibrate(robot, rows)
    assert found.fit.identifiability.rank == 30  # four a joint, six for the base or the tool
    assert len(found.parameters) == 48
    for frame, wanted in (("pinchsite", 27), ("end_effector", 25)):
        seen = positions_of(robot, q, frame)
        positions = Measurements(q, positions=seen, sigma=3e-4, frame=frame, base="unknown", tool="unknown")
        # A point's orientation never shows; of one on the last axis, neither does the tilt of that axis.
        assert calibrate(robot, positions).fit.identifiability.rank == wanted


@pytest.mark.slow
def test_few_rows_identify_few_numbers(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng, 4)
    found = calibrate(robot, Measurements(q, positions=positions_of(robot, q), sigma=3e-4))
    assert found.fit.identifiability.rank == 12
    lengths = np.linalg.norm(positions_of(robot, q), axis=1)
    distances = calibrate(robot, Measurements(q, distances=lengths, points=np.zeros(3), sigma=3e-4))
    assert distances.fit.identifiability.rank == 4


@pytest.mark.slow
def test_sentences_name_what_cannot_be_told_apart(robot: Robot, rng: np.random.Generator) -> None:
    q = robot.sample(rng, 40)
    T = poses_of(robot, q)
    known = calibrate(robot, Measurements(q, positions=T[:, :3, 3], sigma=3e-4)).unidentified
    assert "offset of joint_6 does not show in the measurements" in known  # the point is on its axis
    assert "z of joint_2 and y of joint_4 cannot be told apart" in known  # parallel axes
    others = robot.sample(rng, 60)  # say the same of the arm, in the same words
    again = calibrate(robot, Measurements(others, positions=positions_of(robot, others), sigma=3e-4)).unidentified
    assert again == known
    turned = calibrate(robot, Measurements(q, positions=T[:, :3, 3], sigma=3e-4, base="unknown"), ["offset"])
    assert any("offset of joint_1" in sentence and "the base's yaw" in sentence for sentence in turned.unidentified)


def test_what_is_not_identified_keeps_the_description(robot: Robot, rng: np.random.Generator) -> None:
    """Moving along an unidentified combination changes no prediction, and the estimate has none of it."""
    arm_q = robot.sample(rng, 30)
    seen = positions_of(robot, arm_q) + rng.normal(0, 1e-3, (30, 3))
    found = calibrate(robot, Measurements(arm_q, positions=seen, sigma=3e-4))
    prior = found.model.prior
    scaled = found.fit.x / prior
    known = found.fit.identifiability.known
    hidden = scaled - known.T @ (known @ scaled)
    assert np.linalg.norm(hidden) < 1e-2 * np.linalg.norm(scaled)
