"""Results open the viewer with what they found, and go on at once."""

from __future__ import annotations

import importlib.util
import webbrowser
from collections.abc import Callable

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.errors import InvalidInputError, MissingExtraError
from jacokin.ik import Box, Scene
from jacokin.viewer import Viewer
from tests.programs import python
from tests.viewer.page import opened, until

TARGET = jacokin.pose([0.3, -0.3, 0.4], down=True)


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The pages that would be opened, on a machine with a screen."""
    found: list[str] = []
    monkeypatch.setattr(webbrowser, "open", found.append)
    monkeypatch.setenv("DISPLAY", ":0")
    return found


def test_an_answer_is_shown_as_its_solver_has_it(robot: Robot, pages: list[str]) -> None:
    scene = Scene([Box("table", (0.5, 0.5, 0.02), (0.3, -0.3, 0.1))])
    solver = IKSolver(robot, "gripsite", scene=scene, clearance=0.01)
    result = solver.solve(TARGET)
    assert result.success
    with result.show(solver) as running:
        assert isinstance(running, Viewer)
        assert pages == [running.url]
        assert repr(running) == f"Viewer({running.url})"
        assert np.allclose(running.view.q, result.q, atol=1e-9)
        assert running.view.target.isApprox(TARGET, 1e-6)
        assert running.view.status is Status.OK
        assert running.scene is scene
        with opened(running) as page:
            assert until(lambda: page.value("Frame") == "gripsite" and page.value("Clearance [m]") == 0.01)


def test_what_does_not_reach_is_shown_where_it_ended(robot: Robot, pages: list[str]) -> None:
    result = jacokin.solve_ik(jacokin.pose([2.0, 0.0, 0.4], down=True), robot)
    assert result.status is Status.UNREACHABLE
    with result.show(robot, browse=False) as running:
        assert isinstance(running, Viewer)
        assert np.allclose(running.view.q, result.q, atol=1e-9)
    assert pages == []


def test_every_branch_is_shown(robot: Robot) -> None:
    solver = IKSolver(robot, tool=jacokin.pose([0.0, 0.0, 0.05]), collision="report")
    branches = solver.solve_all(TARGET)
    with branches.show(solver, browse=False) as running:
        assert isinstance(running, Viewer)
        assert running.view.target.isApprox(TARGET, 1e-6)
        assert len(running.view.branches) == len(branches)
        shown = np.abs(running.view.branches[:, None, 1:3] - branches.q[None, :, 1:3]).max(axis=2).min(axis=0)
        assert shown.max() < 1e-6
        nearest = branches.nearest()
        assert nearest is not None
        assert np.allclose(running.view.q, nearest, atol=1e-6)


def test_a_motion_is_played(robot: Robot) -> None:
    scene = Scene([Box("crate", (0.1, 0.1, 0.1), (0.6, 0.4, 0.1))])
    goal = jacokin.solve_ik(TARGET, robot).q
    motion = jacokin.plan_motion(IKSolver(robot, scene=scene), robot.home, goal)
    with motion.show(robot, scene=scene, browse=False) as running, opened(running) as page:  # type: ignore[arg-type]  # a Viewer
        assert page.has("Trajectory")
        page.change("Time [s]", 1e9)
        assert isinstance(running, Viewer)
        assert until(lambda: np.allclose(running.view.q, motion.q[-1], atol=1e-9))
        assert running.scene is scene


def test_a_motion_opens_where_it_begins_with_its_path_and_play_in_sight(robot: Robot) -> None:
    motion = jacokin.plan_motion(IKSolver(robot), robot.home, jacokin.solve_ik(TARGET, robot).q)
    tool = [robot.forward_kinematics(q).translation for q in (motion.q[0], motion.q[-1])]
    with motion.show(robot, browse=False) as running, opened(running) as page:  # type: ignore[arg-type]  # a Viewer
        assert isinstance(running, Viewer)
        assert np.array_equal(running.view.q, motion.q[0])
        assert page.text.count("Trajectory at 0.00 of") == 1
        lines = page.node("/path").props["points"].reshape(-1, 2, 3)
        np.testing.assert_allclose([lines[0, 0], lines[-1, 1]], tool, atol=1e-6)
        assert np.array_equal(lines[1:, 0], lines[:-1, 1])
        assert page.ghosts == 0
        orders = {each.props.get("label"): each.props["order"] for each in page.screen.controls.values()}
        assert orders["Trajectory"] == min(
            order for label, order in orders.items() if label in ("Trajectory", "Branch")
        )
        page.change("Frame", "link_4")
        start = robot.forward_kinematics(motion.q[0], "link_4").translation
        assert until(lambda: np.allclose(page.node("/path").props["points"].reshape(-1, 2, 3)[0, 0], start, atol=1e-6))


def test_curves_are_shown_from_the_member_nearest_to_their_seed(robot: Robot) -> None:
    solver = IKSolver(robot)
    found = solver.solve_all(jacokin.FreeAxis(TARGET, axis=(0.0, 0.0, 1.0)))
    assert found.dimension == 1
    nearest = found.nearest()
    assert nearest is not None
    with found.show(solver, browse=False) as running:
        assert isinstance(running, Viewer)
        reached = running.view.target.translation
        assert np.allclose(reached, TARGET.translation, atol=1e-6)
        assert np.abs(found.q - running.view.q).max(axis=1).min() < 1e-6


def test_the_wrong_robot_and_no_branches_are_said(robot: Robot, bundled: Callable[[str], Robot]) -> None:
    solver = IKSolver(robot)
    result, branches = solver.solve(TARGET), solver.solve_all(TARGET)
    seven = bundled("j2s7s300")
    for shown in (result, branches):
        with pytest.raises(InvalidInputError, match=r"\(7,\)|7 values|shape"):
            shown.show(seven, browse=False)
        with pytest.raises(InvalidInputError, match="of must be a Robot, or the IKSolver"):
            shown.show("j2n6s300", browse=False)
        with pytest.raises(InvalidInputError, match="browse must be"):
            shown.show(robot, browse="yes")
    with pytest.raises(InvalidInputError, match="no configuration to show"):
        solver.solve_all(jacokin.pose([2.0, 0.0, 0.0])).show(robot, browse=False)


def test_without_the_extra_the_command_is_named(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    found = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *rest: None if name == "viser" else found(name, *rest)
    )
    with pytest.raises(MissingExtraError, match=r"viser.*pip install"):
        jacokin.solve_ik(TARGET, robot).show(robot, browse=False)


@pytest.mark.slow
def test_a_result_knows_of_the_viewer_only_when_asked() -> None:
    program = (
        "import sys, jacokin; robot = jacokin.load_robot();"
        "jacokin.solve_ik(robot.forward_kinematics(robot.home), robot);"
        "assert not [name for name in sys.modules if name.startswith(('jacokin.viewer', 'webbrowser', 'viser'))]"
    )
    python("-c", program)
