"""Limits of jerk: rows of the table, and the time of both ways from rest to rest."""

from __future__ import annotations

import pytest

from jacokin import Robot

pytest.importorskip("ruckig")


def test_corners_are_passed_and_nothing_is_wrong(robot: Robot) -> None:
    from benchmarks.jerk import around

    cells = [cell.strip() for cell in around(robot, "table under pick", 2, 7.0, 0.05).strip("|").split("|")]
    assert cells[:3] == ["j2n6s300", "table under pick", "2"]
    mean, worst = map(float, cells[3].split(" / "))
    assert 1.0 < mean <= worst + 0.005
    assert worst < 1.3
    assert cells[-1] == "0"


def test_rest_to_rest_is_timed_beside_ruckig(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    from benchmarks.jerk import timing

    monkeypatch.setattr("benchmarks.jerk.ROUNDS", 1)
    monkeypatch.setattr("benchmarks.jerk.MOTIONS", 2)
    assert "Ruckig" in timing(robot, 7.0)
