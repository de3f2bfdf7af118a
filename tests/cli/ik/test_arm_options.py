"""Options of `jacokin ik` that change the arm: tool, limits, fingers."""

from __future__ import annotations

import json
import math

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from tests.cli.run import leave

TARGET = ("--position", "0.3", "-0.2", "0.4", "--down")


def solved(capsys: pytest.CaptureFixture[str], *words: str) -> list[float]:
    assert leave("ik", *TARGET, *words, "--json") == 0
    q: list[float] = json.loads(capsys.readouterr().out)["q"]
    return q


def test_the_tool_reaches_the_target(capsys: pytest.CaptureFixture[str]) -> None:
    robot = jacokin.load_robot()
    half = math.sqrt(0.5)
    for words, turn in (
        (("0.01", "0.02", "0.05"), 0.0),
        (("0.01", "0.02", "0.05", f"{half}", f"{half}", "0", "0"), 90.0),
    ):
        q = solved(capsys, "--tool", *words)
        tool = pin.SE3(pin.rpy.rpyToMatrix(math.radians(turn), 0.0, 0.0), np.array([0.01, 0.02, 0.05]))
        reached = robot.forward_kinematics(q) * tool
        assert reached.isApprox(jacokin.pose([0.3, -0.2, 0.4], down=True), 1e-6)


def test_own_limits_hold(capsys: pytest.CaptureFixture[str]) -> None:
    free = solved(capsys)
    high = math.floor(free[1] * 10.0) / 10.0
    held = solved(capsys, "--limit", f"joint_2=1.0,{high}", "--limit", "joint_6=-inf,3", "--degrees")
    assert math.radians(held[1]) <= high < free[1]


def test_fingers_stand_where_they_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert len(solved(capsys, "--finger-angle", "1.2", "--collision", "reject")) == 6
    assert leave("ik", *TARGET, "--finger-angle", "9") == 2
    assert "the fingers move from" in capsys.readouterr().err
