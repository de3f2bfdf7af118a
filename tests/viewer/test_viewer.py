"""The running viewer, driven by the messages that pages send."""

from __future__ import annotations

import contextlib
import gc
import re
import sys
import threading
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from websockets.exceptions import ConnectionClosed

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Floor, Scene
from jacokin.model import urdf_folder
from jacokin.viewer import Inspector, Viewer, ViewerOptions, serve
from jacokin.viewer.view import View
from tests.model.measured_arms import perturbed
from tests.robot_files import load_text
from tests.viewer.page import Page, opened, port_of, repeat, until
from tests.viewer.trajectories import recorded

TABS = 12  # that are open at once
NEAR, FAR = (0.3, -0.2, 0.5), (2.0, 0.0, 0.3)


def at(viewer: Viewer, position: tuple[float, float, float]) -> bool:
    """Whether the viewer comes to show a target, with nothing left to do."""
    return until(lambda: np.allclose(viewer.view.target.translation, position) and not viewer.view.pending)


def comes_to(viewer: Viewer, page: Page, position: tuple[float, float, float]) -> bool:
    """As `at`, for a gizmo moved again and again: messages of different pages are answered as they come."""
    return repeat(
        lambda: page.move_gizmo(position),
        lambda: np.allclose(viewer.view.target.translation, position) and not viewer.view.pending,
    )


def test_one_node_for_each_part_however_many_branches(viewer: Viewer, page: Page) -> None:
    assert {name for name in page.names("/arm/") if "/" not in name} == {str(part) for part in range(7)}
    assert page.names("/ghosts/") == {str(part) for part in range(1, 6)}  # the hand is where the arm's own is
    assert page.ghosts == len(viewer.view.branches) - 1 == 7


def test_branches_that_are_not_feasible_are_nets(robot: Robot) -> None:
    """Told apart by more than their colour."""
    target = jacokin.pose([-0.3, -0.35, 0.4], rpy=(1.9, 0.3, 0.4))
    found = IKSolver(robot, collision="ignore").solve_all(target)
    elbows = np.array([robot.forward_kinematics(q, "link_3").translation for q in found.q])
    scene = Scene([Box("crate", (0.08, 0.08, 0.08), elbows[elbows[:, 2].argmax()])])
    with serve(robot, scene=scene, target=target, port=0) as viewer, opened(viewer) as page:
        assert until(lambda: not viewer.view.pending)
        others = viewer.view.feasible[viewer.view.ghosts]
        assert 0 < others.sum() < len(others)
        for part in (4, 5):
            assert until(lambda part=part: len(page.node(f"/ghosts/{part}").positions) == others.sum())  # type: ignore[misc]  # bound here
            assert until(lambda part=part: len(page.node(f"/wires/{part}").positions) == (~others).sum())  # type: ignore[misc]  # as above
        assert page.node("/wires/5").props["wireframe"]
        assert not page.node("/ghosts/5").props["wireframe"]


def test_the_gizmo_moves_the_arm(viewer: Viewer, page: Page, robot: Robot) -> None:
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)
    view = viewer.view
    assert view.status is Status.OK
    reached = robot.forward_kinematics(view.q)
    assert reached.isApprox(jacokin.pose(NEAR, (0.0, 1.0, 0.0, 0.0)), 1e-6)
    assert until(lambda: page.ghosts == len(view.branches) - 1)
    places = Inspector(IKSolver(robot)).places([view.q])
    for part in range(7):
        assert until(lambda part=part: np.allclose(page.node(f"/arm/{part}").position, places.positions[0, part]))  # type: ignore[misc]  # bound here


def test_out_of_reach_there_is_the_closest_configuration(viewer: Viewer, page: Page, robot: Robot) -> None:
    page.move_gizmo(FAR)
    assert at(viewer, FAR)
    assert viewer.view.status is Status.UNREACHABLE
    assert robot.within_limits(viewer.view.q)
    assert until(lambda: "closest configuration found" in page.text)
    assert page.ghosts == 0
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)
    assert viewer.view.selected is not None


def test_slider_and_keys_go_through_the_branches(viewer: Viewer, page: Page) -> None:
    count = len(viewer.view.branches)
    page.change("Branch", 4)
    assert until(lambda: viewer.view.selected == 3)
    page.press("Next branch")
    assert until(lambda: viewer.view.selected == 4)
    for _ in range(5):
        page.press("Previous branch")
    assert until(lambda: viewer.view.selected == (4 - 5) % count)
    assert until(lambda: page.value("Branch") == (4 - 5) % count + 1)
    assert page.ghosts == count - 1


def test_joint_sliders_move_the_arm_and_the_target_follows(viewer: Viewer, page: Page, robot: Robot) -> None:
    before = viewer.view.q
    page.change("joint_2", 2.5)
    assert until(lambda: viewer.view.q[1] == 2.5)
    view = viewer.view
    assert np.array_equal(np.delete(view.q, 1), np.delete(before, 1))  # not rounded to the sliders' steps
    target = robot.forward_kinematics(view.q)
    assert until(lambda: np.allclose(page.node("/target").position, target.translation))
    assert view.status is Status.OK


def test_ghosts_can_be_hidden(viewer: Viewer, page: Page) -> None:
    page.change("Ghosts", False)
    assert until(lambda: page.ghosts == 0)
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)
    assert until(lambda: page.node("/arm/6").visible and "Reached" in page.text)
    assert page.ghosts == 0
    page.change("Ghosts", True)
    assert until(lambda: page.ghosts == len(viewer.view.branches) - 1)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("position", "wxyz"),
    [
        ((float("nan"), 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
        ((float("inf"), 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
        ((0.3, 0.0, 0.4), (0.0, 0.0, 0.0, 0.0)),
        ((0.3, 0.0), (1.0, 0.0, 0.0, 0.0)),
        ("left", "right"),
        (None, None),
        ((1e308, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0)),
    ],
)
def test_what_is_not_a_pose_changes_nothing_and_the_next_one_works(
    viewer: Viewer, page: Page, position: object, wxyz: object
) -> None:
    with contextlib.suppress(ConnectionClosed):  # viser drops a page that sends what is not a message
        page.change("joint_1", float("nan"))
        page.change("Branch", 10**6)
        page.move_gizmo(position, wxyz)
    with opened(viewer) as other:
        assert comes_to(viewer, other, NEAR)
        assert viewer.view.status is Status.OK


@pytest.mark.slow
def test_two_tabs_show_and_move_the_same(viewer: Viewer, page: Page) -> None:
    with opened(viewer) as other:
        assert until(lambda: len(viewer.server.get_clients()) == 2)
        other.move_gizmo(NEAR)
        assert at(viewer, NEAR)
        page.move_gizmo(FAR)
        assert at(viewer, FAR)
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)


def test_a_free_axis_leaves_an_angle_to_choose(viewer: Viewer, page: Page) -> None:
    page.change("Free axis", "z")
    assert until(lambda: viewer.view.free is not None)
    assert until(lambda: not page.control("Angle [deg]").props["disabled"])
    page.change("Angle [deg]", 40.0)
    assert until(lambda: viewer.view.free is not None and abs(viewer.view.free.value - np.radians(40.0)) < 1e-9)
    free = viewer.view.free
    assert free is not None
    assert free.pose is not None
    assert until(lambda: free.pose is not None and np.allclose(page.node("/target").position, free.pose.translation))
    assert until(lambda: "within the limits [deg]" in page.text)
    page.change("Free axis", "none")
    assert until(lambda: viewer.view.free is None and page.control("Angle [deg]").props["disabled"])
    page.change("Free axis", "../../etc/passwd")
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)
    assert viewer.view.free is None


@pytest.mark.slow
def test_the_tracker_follows_the_gizmo_within_the_velocity_limits(viewer: Viewer, page: Page, robot: Robot) -> None:
    start = viewer.view.target
    page.change("Track", True)
    assert until(lambda: viewer.view.note.startswith("Tracking"))
    goal = start.translation + np.array([0.0, 0.0, 0.08])
    wxyz = tuple(float(value) for value in jacokin.model.quat_wxyz(start.rotation))
    began, before = time.monotonic(), viewer.view.q
    page.move_gizmo(tuple(goal.tolist()), wxyz)
    assert until(lambda: np.linalg.norm(robot.forward_kinematics(viewer.view.q).translation - goal) < 1e-3)
    spent = time.monotonic() - began + 0.1
    assert (np.abs(viewer.view.q - before) <= robot.velocity_limit * spent).all()
    assert until(lambda: viewer.view.note.startswith("Tracking, ok"))
    page.change("Track", False)
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)
    assert until(lambda: viewer.view.note == "")


@pytest.mark.slow
def test_an_arm_without_velocity_limits_opens_and_tracks_with_given_ones(tmp_path: Path) -> None:
    text = (urdf_folder() / "j2n6s300.urdf").read_text(encoding="utf-8")
    arm = load_text(tmp_path / "slow.urdf", re.sub(r'velocity="[^"]*"', 'velocity="0"', text))
    with serve(arm, port=0) as viewer, opened(viewer) as page:
        page.move_gizmo(NEAR)
        assert at(viewer, NEAR)
        page.change("Track", True)
        assert until(lambda: "velocity" in viewer.view.note)
        assert until(lambda: page.value("Track") is False)
    with serve(arm, ViewerOptions(velocity_limit=0.5), port=0) as viewer, opened(viewer) as page:
        start = viewer.view.q
        page.change("Track", True)
        assert until(lambda: viewer.view.note.startswith("Tracking"))
        page.change("Track", False)
        page.move_gizmo(NEAR)
        assert at(viewer, NEAR)
        page.click("Go")
        assert until(lambda: viewer.motion is not None and viewer.motion.success)
        assert viewer.motion is not None
        assert (np.abs(viewer.motion.v) <= 0.5 + 1e-9).all()
        assert np.allclose(viewer.motion.q[0], start)
    for wrong in (0.0, -1.0, [1.0, 2.0], np.nan, "fast"):
        with pytest.raises(InvalidInputError, match="velocity_limit"):
            serve(arm, ViewerOptions(velocity_limit=wrong), port=0)


@pytest.mark.slow
def test_a_trajectory_is_played_paused_scrubbed_and_slowed(robot: Robot) -> None:
    end = np.array(robot.home)
    end[1] += 0.5
    t = np.linspace(0.0, 0.6, 61)
    trajectory = recorded(robot, t, robot.home + np.outer(t / t[-1], end - robot.home))
    with serve(robot, trajectory=trajectory, port=0) as viewer, opened(viewer) as page:
        assert np.allclose(viewer.view.q, robot.home)
        page.change("Time [s]", 0.3)
        assert until(lambda: np.allclose(viewer.view.q[1], robot.home[1] + 0.25, atol=1e-3))
        page.change("Speed", 0.5)
        began = time.monotonic()
        page.click("Play")
        assert until(lambda: page.has("Pause"))
        assert until(lambda: np.allclose(viewer.view.q, end, atol=1e-9))
        assert time.monotonic() - began > 0.4  # 0.3 s at half the speed
        assert until(lambda: page.has("Play"))
        assert until(lambda: "Trajectory at 0.60 of 0.60 s" in page.text)
        page.move_gizmo(NEAR)
        assert at(viewer, NEAR)


@pytest.mark.slow
def test_the_arm_stays_where_tracking_ends_and_does_not_go_to_a_trajectory(robot: Robot) -> None:
    elsewhere = np.array(robot.home)
    elsewhere[1] += 0.5
    with serve(robot, trajectory=recorded(robot, [0.0], elsewhere[None]), port=0) as viewer, opened(viewer) as page:
        page.move_gizmo(NEAR)
        assert at(viewer, NEAR)
        for _ in range(5):
            page.change("Track", True)
            assert until(lambda: viewer.view.note.startswith("Tracking"))
            page.change("Track", False)
            assert until(lambda: not viewer.view.note.startswith("Tracking"))
            assert viewer.view.note == ""
            assert np.allclose(viewer.view.target.translation, NEAR)


def test_the_arm_and_the_panel_change_together(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    """A move is sent as one, however long the rest of it takes."""
    with serve(robot, port=0) as viewer, opened(viewer) as page:

        def places() -> object:
            return {name: (node.position, node.wxyz) for name, node in list(page.screen.nodes.items())}

        before, seen, show = places(), list[object](), viewer._panel.show

        def show_late(view: View) -> None:
            time.sleep(0.3)
            seen.append(places())
            show(view)

        monkeypatch.setattr(viewer._panel, "show", show_late)
        page.move_gizmo(NEAR)
        assert at(viewer, NEAR)
        assert seen[0] == before
        assert until(lambda: places() != before)


def test_tracking_that_is_ended_and_begun_again_at_once_goes_on(robot: Robot) -> None:
    """Both clicks may have come before the first is answered: what is answered then is that it tracks."""
    with serve(robot, port=0) as viewer, opened(viewer) as page:
        page.change("Track", True)
        assert until(lambda: viewer.view.note.startswith("Tracking"))
        viewer._inbox.post("track")
        assert until(lambda: not viewer._inbox.waits("track"))
        page.move_gizmo(NEAR)
        assert until(lambda: np.allclose(viewer.view.target.translation, NEAR))
        assert page.value("Track") is True
        page.change("Track", False)
        assert until(lambda: not viewer.view.note.startswith("Tracking"))


def test_a_trajectory_outside_the_limits_says_so(robot: Robot) -> None:
    beyond = np.array(robot.home)
    beyond[1] = robot.upper[1] + 0.2
    with serve(robot, trajectory=recorded(robot, [0.0], beyond[None]), port=0) as viewer:
        with opened(viewer) as page:
            page.click("Play")
            assert until(lambda: "outside the limits: joint_2" in viewer.view.note)
        assert np.array_equal(viewer.view.q, beyond)


@pytest.mark.slow
def test_obstacles_are_drawn_and_count_as_contact(robot: Robot) -> None:
    at_tool = robot.forward_kinematics(robot.home).translation
    scene = Scene([Box("crate", (0.3, 0.3, 0.3), at_tool), Floor(-0.2)])
    with serve(robot, ViewerOptions(collision="reject"), scene=scene, port=0) as viewer, opened(viewer) as page:
        assert page.names("/scene/") == {"0", "1"}
        assert viewer.view.status is Status.IN_COLLISION
        assert any("crate" in pair for pair in viewer.view.arm_touching)
        assert page.node("/scene/0").props["color"] != page.node("/scene/1").props["color"]
        assert "crate" in page.text
    with serve(robot, scene=scene, port=0) as viewer, opened(viewer) as page:  # only drawn
        assert page.names("/scene/") == {"0", "1"}
        assert viewer.view.selected is not None


@pytest.mark.slow
def test_the_ellipsoid_is_shown_on_demand(viewer: Viewer, page: Page, robot: Robot) -> None:
    assert not page.node("/ellipsoid").visible
    page.change("Manipulability", True)
    assert until(lambda: page.node("/ellipsoid").visible)
    tool = robot.forward_kinematics(viewer.view.q).translation
    assert until(lambda: np.allclose(page.node("/ellipsoid").position, tool))


@pytest.mark.slow
def test_text_to_paste_comes_when_asked_for(viewer: Viewer, page: Page) -> None:
    page.click("As command line")
    assert until(lambda: page.value("Text").startswith("jacokin ik --robot j2n6s300"))
    page.click("As Python")
    assert until(lambda: page.value("Text").startswith("import jacokin"))


def test_show_moves_the_gizmo(viewer: Viewer) -> None:
    viewer.show(jacokin.pose(NEAR, down=True))
    assert at(viewer, NEAR)
    with pytest.raises(InvalidInputError, match="target"):
        viewer.show(np.ones((4, 4)))
    assert at(viewer, NEAR)


@pytest.mark.slow
def test_messages_do_not_pile_up_and_tabs_leave_nothing_behind(viewer: Viewer) -> None:
    def round_of_tabs() -> int:
        """The messages that a page is sent when it opens after many others came and went."""
        with ExitStack() as tabs:
            pages = [tabs.enter_context(opened(viewer)) for _ in range(TABS)]
            assert until(lambda: len(viewer.server.get_clients()) == TABS)
            for index in range(3 * TABS):
                pages[index % TABS].move_gizmo((0.3, -0.2, 0.4 + 0.002 * index))
            # Messages of one page are answered in order, those of different pages as they come.
            assert comes_to(viewer, pages[0], FAR)
        assert until(lambda: not viewer.server.get_clients())
        with opened(viewer) as last:
            backlog = last.screen.backlog
        assert until(lambda: not viewer.server.get_clients())
        return backlog

    def settled() -> int:
        gc.collect()
        return threading.active_count()

    backlog, threads, held = round_of_tabs(), settled(), sys.getallocatedblocks()
    # Blocks are counted instead of traced: tracemalloc crashes Python 3.11 where threads without the GIL allocate.
    assert round_of_tabs() <= backlog + 5
    assert until(lambda: settled() <= threads + 2)
    assert until(lambda: settled() and sys.getallocatedblocks() < held + 100 * TABS)


@pytest.mark.slow
def test_closing_ends_threads_and_frees_the_port(robot: Robot) -> None:
    before = set(threading.enumerate())
    viewer = serve(robot, port=0)
    port = port_of(viewer)
    with opened(viewer) as page:
        page.move_gizmo(NEAR)
        assert at(viewer, NEAR)
        viewer.close()
    viewer.close()
    assert viewer.wait(0.0)
    assert until(lambda: not [t for t in set(threading.enumerate()) - before if t.is_alive()])
    with serve(robot, port=port):
        pass


@pytest.mark.slow
def test_the_datasheet_is_a_ghost_beside_a_calibrated_arm(robot: Robot) -> None:
    arm = perturbed(robot, np.random.default_rng(1))
    data = robot.pin_model.createData()
    with serve(arm, port=0) as viewer, opened(viewer) as page:
        viewer.show(jacokin.pose(NEAR, down=True))
        assert at(viewer, NEAR)
        others = len(viewer.view.ghosts)
        assert until(lambda: page.ghosts == others + 1)
        pin.forwardKinematics(robot.pin_model, data, viewer.view.q.copy())
        for joint in range(1, 7):
            drawn = page.screen.nodes[f"/ghosts/{joint}"].positions[-1]
            np.testing.assert_allclose(drawn, data.oMi[joint].translation, atol=1e-6)
            assert tuple(page.screen.nodes[f"/arm/{joint}"].position) != tuple(drawn)
        frames = [each.forward_kinematics(viewer.view.q).translation for each in (arm, robot)]
        away = f"The datasheet has the tool {1e3 * np.linalg.norm(frames[1] - frames[0]):.1f} mm"
        assert until(lambda: any(away in each.props.get("content", "") for each in page.screen.controls.values()))
        page.change("Ghosts", False)
        assert until(lambda: page.ghosts == 1)
        page.change("Datasheet", False)
        assert until(lambda: page.ghosts == 0)
        page.change("Ghosts", True)
        assert until(lambda: page.ghosts == others)


@pytest.mark.slow
def test_an_arm_as_described_has_no_such_switch(page: Page) -> None:
    assert not page.has("Datasheet")
