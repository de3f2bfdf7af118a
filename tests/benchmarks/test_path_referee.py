"""The referee of planned paths finds what is wrong with a trajectory, and its distances are those of the library."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot, plan_path
from jacokin.ik import Box, Scene

sys.path.append(str(Path(__file__).resolve().parents[2]))  # last: the installed package is what gets tested

from benchmarks.path_referee import SHAPES_APART, Referee, Surveyor


@pytest.mark.parametrize("free", [False, True])
def test_what_is_wrong_is_found(robot: Robot, free: bool) -> None:
    corners = [jacokin.pose(place, down=True) for place in ([0.4, -0.4, 0.3], [0.4, -0.3, 0.3], [0.3, -0.3, 0.35])]
    targets = [FreeAxis(pose, axis=[1.0, 0.0, 0.0]) for pose in corners] if free else corners
    result, referee = plan_path(IKSolver(robot), targets, dt=0.05), Referee(robot)
    assert result.success
    assert referee.faults(result, targets) == []
    assert referee.faults(replace(result, q=result.q + 1e-5), targets) == ["off the lines"]
    assert "off the lines" in referee.faults(replace(result, q=result.q[::-1]), targets)
    assert "speed" in referee.faults(replace(result, t=0.1 * result.t), targets)
    q = result.q.copy()
    q[3, 1] = np.nextafter(robot.upper[1], np.inf)
    assert "limit" in referee.faults(replace(result, q=q), targets)
    elsewhere = [pin.SE3(pose.rotation, pose.translation + np.array([0.0, 0.0, 1e-5])) for pose in corners]
    assert "off the lines" in referee.faults(result, elsewhere)


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_distances_of_two_engines_agree(name: str, rng: np.random.Generator) -> None:
    robot = jacokin.load_robot(name)
    size, centre = np.array([0.3, 0.2, 0.1]), np.array([0.4, -0.3, 0.3])
    surveyor, scene = Surveyor(name, [(size, centre)]), Scene([Box("box", size, centre)])
    compared = 0
    for q in robot.sample(rng, 20):
        distance = robot.clearance(q, scene)
        if distance > 0.0:
            assert surveyor.least(q[None]) == pytest.approx(distance, abs=SHAPES_APART)
            compared += 1
        else:
            assert surveyor.least(q[None]) < SHAPES_APART
    assert compared > 5
