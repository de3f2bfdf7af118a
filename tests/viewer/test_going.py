"""The button "Go": motions that are planned and played, driven by the messages that pages send."""

from __future__ import annotations

import threading
import time
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.ik import Box, Scene
from jacokin.model.angles import TURN
from jacokin.motion import Trajectory, plan_motion
from jacokin.viewer import Viewer, ViewerOptions, serve
from jacokin.viewer import viewer as running
from tests.motion.free_motion.test_plan_motion import WALL, between, parted, touches, ways_through
from tests.viewer.page import Page, opened, until
from tests.viewer.test_viewer import at


def raise_target(viewer: Viewer, robot: Robot, rise: float) -> None:
    """Move the gizmo from home straight up [m]."""
    home = robot.forward_kinematics(robot.home)
    place = jacokin.pose(home.translation + np.array([0.0, 0.0, rise]), rotation=home.rotation)
    viewer.show(place)
    assert at(viewer, place.translation)


def says(viewer: Viewer, beginning: str) -> bool:
    return until(lambda: viewer.view.note.startswith(beginning))


def go(page: Page) -> None:
    assert until(lambda: page.has("Go"))
    page.click("Go")


@pytest.mark.slow
def test_the_arm_goes_to_what_is_shown_and_the_next_motion_begins_there(
    viewer: Viewer, page: Page, robot: Robot
) -> None:
    assert viewer.motion is None
    assert not page.names("/start")
    raise_target(viewer, robot, 0.05)
    shown = viewer.view
    assert until(lambda: page.names("/start"))  # which is home
    began = time.monotonic()
    go(page)
    assert says(viewer, "Moving")
    assert until(lambda: page.has("Stop"))
    under_way = viewer.view
    assert under_way.target.isApprox(shown.target)
    assert np.array_equal(under_way.branches, shown.branches)  # the goal among them
    assert says(viewer, "Arrived: reached in")
    motion = viewer.motion
    assert motion is not None
    assert motion.success
    assert motion.duration <= time.monotonic() - began
    assert np.array_equal(motion.q[0], robot.home)
    assert np.array_equal(viewer.view.q, motion.q[-1])
    assert np.allclose(viewer.view.q, shown.q, atol=1e-12)
    assert (viewer.view.selected, viewer.view.status) == (shown.selected, shown.status)
    assert until(lambda: page.has("Go") and not page.names("/start"))
    raise_target(viewer, robot, 0.08)
    go(page)
    assert until(lambda: viewer.motion is not motion)
    assert viewer.motion is not None
    assert np.array_equal(viewer.motion.q[0], motion.q[-1])
    assert says(viewer, "Arrived")


def test_the_arm_stands_where_it_is_stopped(viewer: Viewer, page: Page, robot: Robot) -> None:
    raise_target(viewer, robot, 0.15)
    goal = viewer.view.q
    go(page)
    assert until(lambda: viewer.view.note.startswith("Moving") and np.abs(viewer.view.q - robot.home).max() > 0.02)
    page.click("Stop")
    assert says(viewer, "Stopped at ")
    stood = viewer.view.q
    motion = viewer.motion
    assert motion is not None
    assert np.abs(motion.q - stood).max(axis=1).min() < 0.01  # [rad] between two rows
    assert np.abs(goal - stood).max() > 0.01
    page.press("Next branch")
    assert until(lambda: viewer.view.selected == 0)
    go(page)
    assert says(viewer, "Arrived")
    assert viewer.motion is not None
    assert np.array_equal(viewer.motion.q[0], stood)
    assert np.allclose(viewer.view.q, goal, atol=1e-9)


@pytest.mark.slow
def test_a_gizmo_that_is_moved_stops_the_arm_there(viewer: Viewer, page: Page, robot: Robot) -> None:
    raise_target(viewer, robot, 0.15)
    go(page)
    assert until(lambda: viewer.view.note.startswith("Moving") and np.abs(viewer.view.q - robot.home).max() > 0.02)
    raise_target(viewer, robot, 0.1)
    assert until(lambda: page.has("Go"))
    first = viewer.motion
    go(page)
    assert says(viewer, "Arrived")
    assert first is not None
    assert viewer.motion is not None
    assert viewer.motion is not first
    assert not np.array_equal(viewer.motion.q[0], robot.home)
    assert np.abs(first.q - viewer.motion.q[0]).max(axis=1).min() < 0.01  # [rad] between two rows


def test_motions_begin_where_the_page_says(viewer: Viewer, page: Page, robot: Robot) -> None:
    page.change("joint_2", 2.5)
    assert until(lambda: viewer.view.q[1] == 2.5)
    assert until(lambda: page.names("/start"))
    page.change("Ghosts", False)
    assert until(lambda: not page.names("/start"))
    page.change("Ghosts", True)
    assert until(lambda: page.names("/start"))
    page.click("Start here")
    assert until(lambda: not page.names("/start"))
    page.change("joint_2", 2.55)
    go(page)
    assert says(viewer, "Arrived")
    assert viewer.motion is not None
    assert viewer.motion.q[0, 1] == 2.5
    assert viewer.motion.q[-1, 1] == 2.55


def test_a_branch_outside_the_limits_is_not_gone_to(viewer: Viewer, page: Page) -> None:
    page.move_gizmo((0.6, 0.0, -0.2))
    assert at(viewer, (0.6, 0.0, -0.2))
    view = viewer.view
    outside = int(np.flatnonzero(~view.within)[0])
    page.change("Branch", outside + 1)
    assert until(lambda: viewer.view.selected == outside)
    go(page)
    assert says(viewer, "Ignored: goal")
    assert until(lambda: page.has("Go"))
    assert viewer.view.selected == outside


@pytest.mark.slow  # the motion takes its time
def test_out_of_reach_the_arm_goes_to_the_closest_configuration(viewer: Viewer, page: Page, robot: Robot) -> None:
    reach = robot.forward_kinematics(robot.home)
    page.move_gizmo((0.3, -0.8, 0.5))
    go(page)
    assert says(viewer, "Arrived")
    assert "mm and" in viewer.view.note
    assert viewer.view.errors[0] == pytest.approx(
        float(np.linalg.norm(robot.forward_kinematics(viewer.view.q).translation - [0.3, -0.8, 0.5])), abs=1e-9
    )
    assert not robot.forward_kinematics(viewer.view.q).isApprox(reach, 1e-3)


@pytest.mark.one_quick
@pytest.mark.parametrize("collision", ["report", "ignore"])
def test_without_a_way_a_sentence_says_why(robot: Robot, collision: str) -> None:
    home = robot.forward_kinematics(robot.home).translation
    crate = Scene([Box("crate", (0.2, 0.2, 0.2), home)])
    with serve(robot, ViewerOptions(collision=collision), scene=crate, port=0) as viewer, opened(viewer) as page:
        raise_target(viewer, robot, 0.3)
        go(page)
        assert until(lambda: "touches crate at the start" in viewer.view.note or "crate touches" in viewer.view.note)
        assert "No motion: " in viewer.view.note
        assert "move it out by hand" in viewer.view.note
        assert until(lambda: page.has("Go") and "No motion" in page.text)
        page.click("Start here")
        assert until(lambda: not page.names("/start"))
        raise_target(viewer, robot, 0.0)
        before = viewer.view.q
        go(page)
        assert until(lambda: "configurations that reach the goal touch something" in viewer.view.note)
        assert np.array_equal(viewer.view.q, before)
        page.change("Obstacles", False)
        go(page)
        assert says(viewer, "Moving")


@pytest.mark.slow
def test_a_search_that_was_stopped_does_not_begin_again(robot: Robot) -> None:
    with serve(robot, scene=parted(robot), port=0) as viewer, opened(viewer) as page:
        page.change("joint_1", float(np.remainder(robot.home[0] + TURN, TURN) - np.pi))
        assert until(lambda: abs(viewer.view.q[0] - robot.home[0]) > 1.0)
        goal = viewer.view.q
        go(page)
        assert until(lambda: page.has("Stop"))
        page.click("Stop")
        assert says(viewer, "Stopped before a way was found")
        assert until(lambda: page.has("Go"))
        assert np.array_equal(viewer.view.q, goal)
        page.press("Next branch")  # answered, and nothing else waits
        assert until(lambda: not viewer.view.note)


@pytest.mark.slow
def test_pages_are_served_while_a_way_is_looked_for(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    served = threading.Event()

    def look(*arguments: Any, **options: Any) -> Trajectory:
        """As long as it takes to open a page, however slow the machine is."""
        while (motion := plan_motion(*arguments, **options)) and not served.is_set():
            pass
        return motion

    monkeypatch.setattr(running, "plan_motion", look)
    with serve(robot, scene=parted(robot), port=0) as viewer, opened(viewer) as page:
        page.change("joint_1", float(np.remainder(robot.home[0] + TURN, TURN) - np.pi))
        assert until(lambda: abs(viewer.view.q[0] - robot.home[0]) > 1.0)
        go(page)
        assert says(viewer, "Looking for a way")
        with opened(viewer) as other:
            assert until(lambda: "Looking for a way" in other.text)
            served.set()
            assert says(viewer, "No motion: no way was found")
        assert "allow more time" in viewer.view.note


@pytest.mark.slow  # the motion takes its time
def test_the_arm_goes_around_what_is_in_the_way(robot: Robot, rng: np.random.Generator) -> None:
    start, pose = ways_through(robot, rng)
    with (
        serve(robot, ViewerOptions(collision="reject"), scene=WALL, seed=start, port=0) as viewer,
        opened(viewer) as page,
    ):
        viewer.show(pose)
        assert at(viewer, pose.translation)
        go(page)
        assert says(viewer, "Moving")
        seen = []
        while (view := viewer.view).note.startswith("Moving"):
            seen.append(view.q)
            time.sleep(0.01)
        assert view.note.startswith("Arrived: reached in")
        motion = viewer.motion
    assert motion is not None
    assert "around what is in the way" in motion.message
    assert np.array_equal(motion.q[0], start)
    assert robot.forward_kinematics(motion.q[-1]).isApprox(pose, 1e-5)
    assert touches(robot, WALL, between(motion, 0.02)) == 0
    assert len(seen) > 50
    assert touches(robot, WALL, np.array(seen)) == 0
