"""Pictures of sets of solutions: what is drawn is what the set says."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.errors import InvalidInputError
from jacokin.ik.solutions import picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

pytest.importorskip("matplotlib")


def test_curves_are_drawn_within_the_shaded_limits_with_their_folds(
    robot: Robot, monkeypatch: pytest.MonkeyPatch
) -> None:
    figures: list[Figure] = []
    target = jacokin.FreeAxis(robot.forward_kinematics(robot.home), axis=(1.0, 0.0, 0.0))
    found = IKSolver(robot, collision="ignore").solve_all(target)
    monkeypatch.setattr(picture, "write", lambda path, draw: figures.append(draw()))
    found.plot("")
    (figure,) = figures
    assert [axes.get_title() for axes in figure.axes] == list(robot.joint_names)
    folds = sum(end.kind == "fold" for interval in found.intervals for end in interval.ends)
    assert folds > 0
    for joint, axes in enumerate(figure.axes):
        assert sum(line.get_label() == "fold" for line in axes.lines) == folds
        assert axes.get_xlabel() == "angle [deg]"
        bounded = np.isfinite(robot.lower[joint])
        assert len(axes.patches) == (2 if bounded else 0)
        curves = [line for line in axes.lines if line.get_label() != "fold"]
        assert len(curves) == len(found)
        for interval, line in zip(found.intervals, curves, strict=True):
            x, y = np.asarray(line.get_xdata(), dtype=float), np.asarray(line.get_ydata(), dtype=float)
            assert np.degrees(interval.start) == pytest.approx(np.nanmin(x))
            assert np.degrees(interval.stop) == pytest.approx(np.nanmax(x))
            middle = len(x) // 2
            turned = y[middle] - np.degrees(interval.at(float(np.radians(x[middle])))[joint])
            assert abs((turned + 180.0) % 360.0 - 180.0) < 0.2
            assert np.nanmin(y) >= np.degrees(robot.lower[joint]) - 0.1
            assert np.nanmax(y) <= np.degrees(robot.upper[joint]) + 0.1


def test_points_are_drawn_hollow_outside_the_limits(rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch) -> None:
    figures: list[Figure] = []
    narrow = jacokin.load_robot(limits={"joint_3": (0.5, 3.0)})
    found = IKSolver(narrow, collision="ignore").solve_all(narrow.forward_kinematics(narrow.sample(rng)))
    assert 0 < found.within_limits.sum() < len(found)
    monkeypatch.setattr(picture, "write", lambda path, draw: figures.append(draw()))
    found.plot("")
    for joint, axes in enumerate(figures[0].axes):
        drawn = [float(np.asarray(line.get_ydata())[0]) for line in axes.lines]
        np.testing.assert_allclose(drawn, np.degrees(found.q[:, joint]), atol=1e-9)
        assert [line.get_fillstyle() == "full" for line in axes.lines] == found.within_limits.tolist()


def test_a_picture_is_written_by_its_ending(robot: Robot, tmp_path: Path) -> None:
    found = IKSolver(robot).solve_all(robot.forward_kinematics(robot.home))
    found.plot(tmp_path / "points.png")
    assert (tmp_path / "points.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(InvalidInputError, match=r"\.png, \.svg, \.pdf"):
        found.plot(tmp_path / "points.txt")
