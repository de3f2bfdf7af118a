"""The streams and the measures of smoothness see what they are to see, and nothing where nothing is."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from jacokin import Robot

sys.path.append(str(Path(__file__).resolve().parents[2]))  # last: the installed package is what gets tested

from benchmarks import streams
from benchmarks.smooth import measure, reversals, stands_after, table, target_reversals


def test_a_reversal_is_a_turn_within_three_ticks_above_a_twentieth_of_the_limit() -> None:
    limit = np.array([1.0, 2.0])
    v = np.zeros((20, 2))
    assert reversals(v, limit).tolist() == [0, 0]
    v[3], v[4] = [0.06, 0.06], [-0.06, -0.06]
    assert reversals(v, limit).tolist() == [1, 0]  # 3 % of the second limit
    v[4, 0], v[6, 0] = 0.0, -0.06
    assert reversals(v, limit).tolist() == [1, 0]
    v[6, 0], v[7, 0] = 0.0, -0.06
    assert reversals(v, limit).tolist() == [0, 0]  # four ticks
    v[:, 1] = 0.2 * (-1.0) ** np.arange(20)
    assert reversals(v, limit).tolist() == [0, 19]


def test_the_time_to_stand_counts_from_where_the_target_does() -> None:
    v, limit = np.zeros((100, 1)), np.ones(1)
    assert stands_after(v, limit, 0.01) == 0.0
    v[:40] = 0.5
    assert stands_after(v, limit, 0.01, 10) == pytest.approx(0.3)
    v[-1] = 0.002
    assert math.isinf(stands_after(v, limit, 0.01, 10))


@pytest.mark.one_quick
@pytest.mark.parametrize("kind", list(streams.KINDS))
def test_streams_are_whole_start_at_the_tool_and_come_to_rest(robot: Robot, kind: str) -> None:
    stream = streams.make(robot, kind, np.random.default_rng(3))
    again = streams.make(robot, kind, np.random.default_rng(3))
    assert len(stream) == len(stream.meant) == len(stream.targets) == round(streams.SECONDS / streams.DT)
    assert all(
        a is b is None or (a is not None and b is not None and a == b)
        for a, b in zip(stream.heard, again.heard, strict=True)
    )
    if stream.stands:
        assert stream.targets[0].isApprox(robot.forward_kinematics(robot.home), 1e-9)
    settled = stream.targets[stream.stands + 20 :]  # the last packet is still on its way
    assert all(target.isApprox(settled[-1], 1e-9) for target in settled)
    assert stream.meant[-1].isApprox(stream.targets[-1], 1e-6)
    turns = kind == "circling"  # so fast that a coordinate turns round within three ticks
    assert (target_reversals(stream.meant, stream.dt) > 0) == turns
    assert (target_reversals(stream.targets, stream.dt) > 0) == (turns or kind == "turned")


def test_bursts_are_as_rare_as_packets_and_turned_frames_stand_out(robot: Robot) -> None:
    bursts = streams.make(robot, "bursts", np.random.default_rng(0))
    gaps = np.diff([tick for tick, pose in enumerate(bursts.heard) if pose is not None])
    assert set(gaps[1:].tolist()) <= {6, 7, 8}  # 69 ms
    turned = streams.make(robot, "turned", np.random.default_rng(0))
    angles = [pin.log3(a.rotation.T @ b.rotation) for a, b in zip(turned.targets, turned.meant, strict=True)]
    far = np.linalg.norm(angles, axis=1) > 1.0
    assert 0 < far.sum() < 0.1 * len(turned)


def test_a_motion_is_measured(robot: Robot) -> None:
    stream = streams.make(robot, "standing", np.random.default_rng(0), seconds=4.0)
    still = np.tile(robot.home, (len(stream), 1))
    found = measure(robot, stream, still)
    away = stream.meant[0].translation - robot.forward_kinematics(robot.home).translation
    assert found.error == found.last_error == pytest.approx(float(np.linalg.norm(away)))
    assert (found.reversals, found.stands, found.acceleration, found.too_fast) == (0, 0.0, 0.0, 0)
    still[::2, 2] += 1e-3
    shaken = measure(robot, stream, still)
    assert shaken.reversals == shaken.worst > 300
    assert math.isinf(shaken.stands)
    assert "never" in table({("standing", "mine"): [shaken]})
