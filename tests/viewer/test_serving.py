"""What `serve` takes: robots, targets and options, and what it refuses."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin import Robot, Status
from jacokin.errors import JacokinError, MissingExtraError
from jacokin.viewer import ViewerOptions, serve
from tests.viewer.page import opened

NEAR = (0.3, -0.2, 0.5)


def test_a_position_keeps_the_orientation_of_the_tool(robot: Robot) -> None:
    with serve(robot, target=NEAR, port=0) as viewer:
        assert np.allclose(viewer.view.target.translation, NEAR)
        assert np.allclose(viewer.view.target.rotation, robot.forward_kinematics(robot.home).rotation)


def test_without_viser_the_extra_is_named(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"pip install '\.\[viewer\]'"):
        serve(robot)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"visuals": "yes"}, "visuals"),
        ({"free_axis": ["z"]}, "free_axis"),
        ({"free_axis": "z", "free_range": "ab"}, "range"),
        ({"tool": [1.0, 2.0]}, "tool"),
        ({"clearance": 0.1, "collision": "ignore"}, "clearance has no effect"),
    ],
)
def test_a_wrong_option_is_named(robot: Robot, options: dict[str, Any], message: str) -> None:  # Any: as users may
    with pytest.raises(JacokinError, match=message):
        serve(robot, ViewerOptions(**options), port=0)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"reachability": 5}, "folder"),
        ({"trajectory": 5}, "trajectory"),
        ({"scene": [1]}, "scene"),
        ({"options": {"visuals": True}}, "options must be ViewerOptions"),
    ],
)
def test_a_wrong_argument_is_named(robot: Robot, arguments: dict[str, Any], message: str) -> None:  # Any: as users may
    with pytest.raises(JacokinError, match=message):
        serve(robot, port=0, **arguments)


@pytest.mark.slow
@pytest.mark.parametrize("names", [("m1n6s200", "gen3"), pytest.param(jacokin.model.NAMES, marks=pytest.mark.slow)])
def test_bundled_robots_are_served(names: tuple[str, ...]) -> None:
    for name in names:
        with serve(name, port=0) as viewer, opened(viewer) as page:
            assert viewer.view.status is Status.OK
            assert page.ghosts == len(viewer.view.branches) - 1 > 0
