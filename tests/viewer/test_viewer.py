"""The running viewer, driven by the messages that pages send."""

from __future__ import annotations

import contextlib
import gc
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import viser
from websockets.exceptions import ConnectionClosed

import jacokin
from jacokin import Robot, Status
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, JacokinError, MissingExtraError
from jacokin.ik import Box, Floor, Scene
from jacokin.viewer import Viewer, serve
from tests.viewer.page import Page, opened, until


@dataclass
class Recorded:
    """A trajectory as other programs may have it."""

    joint_names: tuple[str, ...]
    t: Array
    q: Array


NEAR, FAR = (0.3, -0.2, 0.5), (2.0, 0.0, 0.3)


@pytest.fixture
def viewer(robot: Robot) -> Iterator[Viewer]:
    with serve(robot, port=0) as running:
        yield running


@pytest.fixture
def page(viewer: Viewer) -> Iterator[Page]:
    with opened(viewer) as tab:
        assert until(viewer.server.get_clients)
        yield tab


def at(viewer: Viewer, position: tuple[float, float, float]) -> bool:
    """Whether the viewer comes to show a target, with nothing left to do."""
    return until(lambda: np.allclose(viewer.view.target.translation, position) and not viewer.view.pending)


def comes_to(viewer: Viewer, page: Page, position: tuple[float, float, float]) -> bool:
    """As `at`, for a gizmo moved again and again: messages of different pages are answered as they come."""

    def there() -> bool:
        page.move_gizmo(position)
        time.sleep(0.05)
        return np.allclose(viewer.view.target.translation, position) and not viewer.view.pending

    return until(there)


def ghosts(viewer: Viewer) -> int:
    """How many ghosts the scene draws, the same of every part."""
    nodes = viewer._stage.arm.ghosts.values()
    (count,) = {len(node.batched_positions) if node.visible else 0 for node in nodes}
    return count


def test_one_node_for_each_part_however_many_branches(viewer: Viewer) -> None:
    names = set(viewer.server.scene._handle_from_node_name)
    assert {f"/arm/{part}" for part in range(7)} | {f"/ghosts/{part}" for part in range(1, 7)} <= names
    assert ghosts(viewer) == len(viewer.view.branches) - 1 == 7


def test_the_gizmo_moves_the_arm(viewer: Viewer, page: Page) -> None:
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)
    view = viewer.view
    assert view.status is Status.OK
    reached = viewer._inspector.robot.forward_kinematics(view.q)
    assert reached.isApprox(jacokin.pose(NEAR, (0.0, 1.0, 0.0, 0.0)), 1e-6)
    assert ghosts(viewer) == len(view.branches) - 1
    places = viewer._inspector.places([view.q])
    for part, node in viewer._stage.arm.solid.items():
        assert np.allclose(node.position, places.positions[0, part])


def test_out_of_reach_there_is_the_closest_configuration(viewer: Viewer, page: Page) -> None:
    page.move_gizmo(FAR)
    assert at(viewer, FAR)
    assert viewer.view.status is Status.UNREACHABLE
    assert viewer._inspector.robot.within_limits(viewer.view.q)
    assert "closest configuration found" in viewer._panel._status.content
    assert ghosts(viewer) == 0
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)
    assert viewer.view.selected is not None


def test_slider_and_keys_go_through_the_branches(viewer: Viewer, page: Page) -> None:
    count = len(viewer.view.branches)
    page.set(viewer._panel._branch, 4)
    assert until(lambda: viewer.view.selected == 3)
    (following, previous) = [
        handle._impl.uuid
        for name in ("Next branch", "Previous branch")
        for handle in viewer.server.gui._command_handle_from_uuid.values()
        if handle._impl.props.label == name
    ]
    page.send("CommandTriggerMessage", uuid=following)
    assert until(lambda: viewer.view.selected == 4)
    for _ in range(5):
        page.send("CommandTriggerMessage", uuid=previous)
    assert until(lambda: viewer.view.selected == (4 - 5) % count)
    assert ghosts(viewer) == count - 1


def test_joint_sliders_move_the_arm_and_the_target_follows(viewer: Viewer, page: Page) -> None:
    before = viewer.view.q
    page.set(viewer._panel._joints[1], 2.5)
    assert until(lambda: viewer.view.q[1] == 2.5)
    view = viewer.view
    assert np.array_equal(np.delete(view.q, 1), np.delete(before, 1))  # not rounded to the sliders' steps
    target = viewer._inspector.robot.forward_kinematics(view.q)
    assert until(lambda: np.allclose(viewer._stage.gizmo.position, target.translation))
    assert view.status is Status.OK


def test_ghosts_can_be_hidden(viewer: Viewer, page: Page) -> None:
    page.set(viewer._panel._ghosts, False)
    assert until(lambda: ghosts(viewer) == 0)
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)
    assert ghosts(viewer) == 0
    page.set(viewer._panel._ghosts, True)
    assert until(lambda: ghosts(viewer) == len(viewer.view.branches) - 1)


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
        page.set(viewer._panel._joints[0], float("nan"))
        page.set(viewer._panel._branch, 10**6)
        page.move_gizmo(position, wxyz)
    with opened(viewer) as other:
        assert comes_to(viewer, other, NEAR)
        assert viewer.view.status is Status.OK


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
    page.set(viewer._panel.free._axis, "z")
    assert until(lambda: viewer.view.free is not None)
    assert not viewer._panel.free._value.disabled
    page.set(viewer._panel.free._value, 40.0)
    assert until(lambda: viewer.view.free is not None and abs(viewer.view.free.value - np.radians(40.0)) < 1e-9)
    free = viewer.view.free
    assert free is not None
    assert free.pose is not None
    assert np.allclose(viewer._stage.gizmo.position, free.pose.translation)
    assert "within the limits [deg]" in viewer._panel._status.content
    page.set(viewer._panel.free._axis, "none")
    assert until(lambda: viewer.view.free is None and viewer._panel.free._value.disabled)
    page.set(viewer._panel.free._axis, "../../etc/passwd")
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)
    assert viewer.view.free is None


def test_the_tracker_follows_the_gizmo_within_the_velocity_limits(viewer: Viewer, page: Page) -> None:
    robot = viewer._inspector.robot
    start = viewer.view.target
    page.set(viewer._panel._track, True)
    assert until(lambda: viewer.view.note.startswith("Tracking"))
    goal = start.translation + np.array([0.0, 0.0, 0.08])
    wxyz = tuple(float(value) for value in jacokin.model.quat_wxyz(start.rotation))
    began, before = time.monotonic(), viewer.view.q
    page.move_gizmo(tuple(goal.tolist()), wxyz)
    assert until(lambda: np.linalg.norm(viewer._inspector.pose_of(viewer.view.q).translation - goal) < 1e-3)
    spent = time.monotonic() - began + 0.1
    assert (np.abs(viewer.view.q - before) <= robot.velocity_limit * spent).all()
    assert until(lambda: viewer.view.note.startswith("Tracking, ok"))
    page.set(viewer._panel._track, False)
    page.move_gizmo(NEAR)
    assert at(viewer, NEAR)
    assert until(lambda: viewer.view.note == "")


def test_a_trajectory_is_played_paused_scrubbed_and_slowed(robot: Robot) -> None:
    end = np.array(robot.home)
    end[1] += 0.5
    t = np.linspace(0.0, 0.6, 61)
    trajectory = Recorded(robot.joint_names, t, robot.home + np.outer(t / t[-1], end - robot.home))
    with serve(robot, trajectory=trajectory, port=0) as viewer, opened(viewer) as page:
        assert until(viewer.server.get_clients)
        player = viewer._panel.player
        assert player is not None
        assert np.allclose(viewer.view.q, robot.home)
        page.set(player._time, 0.3)
        assert until(lambda: np.allclose(viewer.view.q[1], robot.home[1] + 0.25, atol=1e-3))
        page.set(player._speed, 0.5)
        assert until(lambda: player.speed == 0.5)
        page.set(player._play, True)
        began = time.monotonic()
        assert until(lambda: player._play.label == "Pause")
        assert until(lambda: np.allclose(viewer.view.q, end, atol=1e-9))
        assert time.monotonic() - began > 0.4  # 0.3 s at half the speed
        assert until(lambda: player._play.label == "Play")
        assert "Trajectory at 0.60 of 0.60 s" in viewer._panel._status.content
        page.move_gizmo(NEAR)
        assert at(viewer, NEAR)


def test_a_trajectory_outside_the_limits_says_so(robot: Robot) -> None:
    beyond = np.array(robot.home)
    beyond[1] = robot.upper[1] + 0.2
    with serve(robot, trajectory=Recorded(robot.joint_names, np.zeros(1), beyond[None]), port=0) as viewer:
        with opened(viewer) as page:
            assert until(viewer.server.get_clients)
            assert viewer._panel.player is not None
            page.set(viewer._panel.player._play, True)
            assert until(lambda: "outside the limits: joint_2" in viewer.view.note)
        assert np.array_equal(viewer.view.q, beyond)


def test_obstacles_are_drawn_and_count_as_contact(robot: Robot) -> None:
    at_tool = robot.forward_kinematics(robot.home).translation
    scene = Scene([Box("crate", (0.3, 0.3, 0.3), at_tool), Floor(-0.2)])
    with serve(robot, scene=scene, collision="reject", port=0) as viewer:
        assert set(viewer._stage._obstacles) == {"crate", "floor"}
        assert viewer.view.status is Status.IN_COLLISION
        assert any("crate" in pair for pair in viewer.view.arm_touching)
        assert viewer._stage._obstacles["crate"].color != viewer._stage._obstacles["floor"].color
        assert "crate" in viewer._panel._status.content
    with serve(robot, scene=scene, port=0) as viewer:  # only drawn
        assert set(viewer._stage._obstacles) == {"crate", "floor"}
        assert viewer.view.selected is not None


def test_the_ellipsoid_is_shown_on_demand(viewer: Viewer, page: Page) -> None:
    assert not viewer._stage._ellipsoid.visible
    page.set(viewer._panel._ellipsoid, True)
    assert until(lambda: viewer._stage._ellipsoid.visible)
    tool = viewer._inspector.pose_of(viewer.view.q).translation
    assert np.allclose(viewer._stage._ellipsoid.position, tool)


def test_text_to_paste_comes_when_asked_for(viewer: Viewer, page: Page) -> None:
    buttons = {
        str(getattr(handle._impl.props, "label", "")): handle
        for handle in viewer.server.gui._gui_input_handle_from_uuid.values()
        if isinstance(handle, viser.GuiButtonHandle)
    }
    page.set(buttons["As command line"], True)
    assert until(lambda: viewer._panel._text.value.startswith("jacokin ik --robot j2n6s300"))
    page.set(buttons["As Python"], True)
    assert until(lambda: viewer._panel._text.value.startswith("import jacokin"))


def test_show_moves_the_gizmo(viewer: Viewer) -> None:
    viewer.show(jacokin.pose(NEAR, down=True))
    assert at(viewer, NEAR)
    with pytest.raises(InvalidInputError, match="target"):
        viewer.show(np.ones((4, 4)))
    assert at(viewer, NEAR)


def test_messages_do_not_pile_up_and_tabs_leave_nothing_behind(viewer: Viewer) -> None:
    def messages() -> int:
        return len(viewer.server._websock_server._broadcast_buffer.message_from_id)

    def settled(page: Page) -> bool:
        page.move_gizmo(FAR)
        time.sleep(0.05)
        return np.allclose(viewer.view.target.translation, FAR)

    def round_of_tabs() -> None:
        with ExitStack() as tabs:
            pages = [tabs.enter_context(opened(viewer)) for _ in range(20)]
            assert until(lambda: len(viewer.server.get_clients()) == 20)
            for index in range(60):
                pages[index % 20].move_gizmo((0.3, -0.2, 0.4 + 0.002 * index))
            # Messages of one page are answered in order, those of different pages as they come.
            assert until(lambda: settled(pages[0]))
        assert until(lambda: not viewer.server.get_clients())
        gc.collect()

    round_of_tabs()
    # Blocks are counted instead of traced: tracemalloc crashes Python 3.11 where threads without the GIL allocate.
    before, threads, held = messages(), threading.active_count(), sys.getallocatedblocks()
    round_of_tabs()
    assert sys.getallocatedblocks() < held + 2_000  # a hundred a tab
    assert messages() <= before + 5
    assert threading.active_count() <= threads + 2
    assert not viewer.server._websock_server._client_state_from_id


def test_closing_ends_threads_and_frees_the_port(robot: Robot) -> None:
    before = set(threading.enumerate())
    viewer = serve(robot, port=0)
    port = int(viewer.url.rsplit(":", 1)[1])
    with opened(viewer) as page:
        page.move_gizmo(NEAR)
        assert at(viewer, NEAR)
        viewer.close()
    viewer.close()
    assert viewer.wait(0.0)
    assert until(lambda: not [t for t in set(threading.enumerate()) - before if t.is_alive()])
    with serve(robot, port=port):
        pass


def test_a_position_keeps_the_orientation_of_the_tool(robot: Robot) -> None:
    with serve(robot, target=NEAR, port=0) as viewer:
        assert np.allclose(viewer.view.target.translation, NEAR)
        assert np.allclose(viewer.view.target.rotation, robot.forward_kinematics(robot.home).rotation)


def test_without_viser_the_extra_is_named(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingExtraError, match=r"pip install 'jacokin\[viewer\]'"):
        serve(robot)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"visuals": "yes"}, "visuals"),
        ({"free_axis": ["z"]}, "free_axis"),
        ({"free_axis": "z", "free_range": "ab"}, "range"),
        ({"reachability": 5}, "folder"),
        ({"trajectory": 5}, "trajectory"),
        ({"tool": [1.0, 2.0]}, "tool"),
        ({"scene": [1]}, "scene"),
        ({"clearance": 0.1}, "clearance has no effect"),
    ],
)
def test_a_wrong_option_is_named(robot: Robot, options: dict[str, Any], message: str) -> None:  # Any: as users may
    with pytest.raises(JacokinError, match=message):
        serve(robot, port=0, **options)


def test_every_bundled_robot_is_served() -> None:
    for name in jacokin.model.NAMES:
        with serve(name, port=0) as viewer:
            assert viewer.view.status is Status.OK
            assert ghosts(viewer) == len(viewer.view.branches) - 1 > 0
