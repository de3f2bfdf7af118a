"""Controls that change what is solved for and what is drawn, driven by the messages that pages send."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import viser
from websockets.exceptions import ConnectionClosed

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.ik import Box, Floor, Scene
from jacokin.motion import track_path
from jacokin.viewer import Inspector, Viewer, ViewerOptions, serve
from jacokin.viewer.drawing import load_parts
from tests.robot_files import ur5_text
from tests.viewer.page import Page, opened, repeat, until
from tests.viewer.test_viewer import NEAR, comes_to

LETTERS = ("a", "b", "c")


@pytest.fixture
def viewer(robot: Robot) -> Iterator[Viewer]:
    table = Scene([Box("table", (0.5, 0.5, 0.02), (0.3, -0.3, 0.25)), Floor(-0.3)])
    with serve(robot, scene=table, port=0) as running:
        yield running


def test_another_frame_is_where_the_arm_has_it(viewer: Viewer, page: Page, robot: Robot) -> None:
    before = viewer.view.q
    page.change("Frame", "gripsite")
    assert until(lambda: viewer.view.target.isApprox(robot.forward_kinematics(before, "gripsite"), 1e-9))
    assert until(lambda: viewer.view.selected is not None)
    assert np.allclose(viewer.view.q, before, atol=1e-9)
    assert until(lambda: np.allclose(page.node("/target").position, viewer.view.target.translation))


def test_a_target_is_typed_in_numbers(viewer: Viewer, page: Page) -> None:
    before = viewer.view.target
    x, _, z = page.value("x, y, z [m]")
    assert np.allclose(page.value("x, y, z [m]"), before.translation, atol=5.1e-5)
    page.change("x, y, z [m]", (x, -0.25, z))
    assert until(lambda: viewer.view.target.translation[1] == -0.25)
    # What was not touched stays exactly as it is.
    assert np.array_equal(viewer.view.target.translation[[0, 2]], before.translation[[0, 2]])
    assert np.allclose(viewer.view.target.rotation, before.rotation, atol=1e-15)
    page.change("Roll, pitch, yaw [deg]", (10.0, 90.0, 0.0))  # which other angles say, too
    wanted = pin.rpy.rpyToMatrix(*np.radians([10.0, 90.0, 0.0]))
    assert until(lambda: np.allclose(viewer.view.target.rotation, wanted, atol=1e-12))
    assert until(lambda: np.allclose(page.node("/target").position, viewer.view.target.translation))
    viewer.show(jacokin.pose(NEAR, rpy=(0.0, 0.0, 0.5)))
    assert until(lambda: np.allclose(page.value("Roll, pitch, yaw [deg]"), (0.0, 0.0, 28.65)))
    assert until(lambda: np.allclose(viewer.view.target.translation, NEAR) and not viewer.view.pending)  # at rest
    page.change("x, y, z [m]", (float("nan"), 0.0, 0.0))
    assert until(lambda: viewer.view.note.startswith("Ignored: target"))
    with opened(viewer) as other:
        assert until(lambda: np.allclose(other.value("x, y, z [m]"), NEAR))


def test_joints_are_in_degrees_on_demand(viewer: Viewer, page: Page, robot: Robot) -> None:
    q = viewer.view.q
    assert page.has("Joints [rad]")
    page.change("Degrees", True)
    assert until(lambda: page.has("Joints [deg]") and page.has("joint_6") and "[deg]" in page.text)
    slider = page.control("joint_2").props
    assert (slider["min"], slider["max"]) == (47.0, 313.0)
    assert until(lambda: page.value("joint_2") == round(float(np.degrees(q[1])), 1))
    assert np.array_equal(viewer.view.q, q)  # not rounded by being shown
    page.change("joint_2", 100.0)
    assert until(lambda: viewer.view.q[1] == np.radians(100.0))
    assert np.array_equal(np.delete(viewer.view.q, 1), np.delete(q, 1))
    page.change("joint_2", 313.0)
    assert until(lambda: abs(viewer.view.q[1] - robot.upper[1]) < 1e-12)
    page.change("Degrees", False)
    assert until(lambda: page.has("Joints [rad]") and page.value("joint_2") == round(float(robot.upper[1]), 3))


@pytest.mark.slow
def test_boxes_hold_numbers_of_six_characters(viewer: Viewer, page: Page, robot: Robot) -> None:
    for degrees in (False, True):
        page.change("Degrees", degrees)
        assert until(lambda degrees=degrees: page.has(f"Joints [{'deg' if degrees else 'rad'}]"))  # type: ignore[misc]  # bound here
        for name in robot.joint_names:
            assert until(lambda name=name: page.has(name))  # type: ignore[misc]  # bound here
            props = page.control(name).props
            assert props["precision"] == (1 if degrees else 3)
            scale = np.degrees(1.0) if degrees else 1.0
            joint = robot.joint_index(name)
            if not robot.unlimited[joint]:  # the ends are just outside the limits
                assert -props["step"] < props["min"] - scale * robot.lower[joint] < 1e-9
                assert -1e-9 < props["max"] - scale * robot.upper[joint] < props["step"]
            assert all(len(str(props[end])) <= 6 for end in ("min", "max"))
    assert page.control("Height [m]").props["precision"] <= 3


@pytest.mark.slow
def test_without_branches_there_is_no_slider_for_them(tmp_path: Path) -> None:
    path = tmp_path / "ur5.urdf"
    path.write_text(ur5_text().replace('name="q5" type="revolute"', 'name="q5" type="prismatic"'), encoding="utf-8")
    with serve(str(path), port=0) as viewer, opened(viewer) as page:
        assert len(viewer.view.branches) == 0
        assert not page.control("Branch").props["visible"]
    with serve(port=0) as viewer, opened(viewer) as page:
        assert page.control("Branch").props["visible"]
        assert page.control("Branch").props["max"] == len(viewer.view.branches)


def test_a_tool_is_taken_from_its_controls(viewer: Viewer, page: Page, robot: Robot) -> None:

    def in_force(tool: pin.SE3) -> bool:
        return until(lambda: viewer.view.target.isApprox(robot.forward_kinematics(viewer.view.q) * tool, 1e-9))

    place = np.array([0.0, 0.02, 0.1])
    page.change("Tool [m]", tuple(place.tolist()))
    assert in_force(pin.SE3(np.eye(3), place))  # all controls of a setup are set when one is answered
    page.change("Tool [deg]", (90.0, 0.0, 0.0))
    assert in_force(pin.SE3(pin.rpy.rpyToMatrix(np.pi / 2, 0.0, 0.0), place))


def test_a_tool_of_an_option_stays_exact_until_it_is_moved(robot: Robot) -> None:
    tool = pin.SE3(pin.rpy.rpyToMatrix(0.1, 0.2, 0.3), np.array([1e-5, 0.05, 0.1234567]))
    with serve(robot, ViewerOptions(tool=tool), port=0) as viewer, opened(viewer) as page:
        page.change("Contact", "report")
        assert until(lambda: viewer.view.touching is not None)
        page.click("As Python")
        assert until(lambda: page.value("Text"))
        made: dict[str, IKSolver] = {}
        exec("\n".join(page.value("Text").splitlines()[:3]), made)
        kept = made["solver"].tool
        assert kept is not None
        assert np.array_equal(kept.translation, tool.translation)
        assert np.allclose(kept.rotation, tool.rotation, atol=1e-15)  # by way of a quaternion


@pytest.mark.slow
def test_contact_obstacles_and_clearance_are_switched(viewer: Viewer, page: Page, robot: Robot) -> None:
    inside = robot.forward_kinematics(robot.home)
    inside.translation = np.array([0.3, -0.3, 0.25])  # in the table
    viewer.show(inside)
    assert until(lambda: np.allclose(viewer.view.target.translation, inside.translation))
    assert until(lambda: viewer.view.status is Status.IN_COLLISION)
    page.change("Contact", "ignore")
    assert until(lambda: viewer.view.status is Status.OK)
    page.change("Contact", "reject")
    assert until(lambda: viewer.view.status is Status.IN_COLLISION and not viewer.view.pending)
    page.change("Obstacles", False)
    assert until(lambda: viewer.view.status is Status.OK)
    assert until(lambda: "0" not in page.names("/scene/"))
    page.change("Clearance [m]", 0.5)  # the arm's own shapes are nearer than that
    assert until(lambda: viewer.view.status is Status.IN_COLLISION)
    page.change("Contact", "ignore")
    assert until(lambda: viewer.view.status is Status.OK)


@pytest.mark.one_quick
@pytest.mark.parametrize(
    ("control", "value"),
    [
        ("Frame", "../../etc/passwd"),
        ("Frame", 7),
        ("Contact", "yes"),
        ("Clearance [m]", -1.0),
        ("Clearance [m]", float("nan")),
        ("Tool [m]", (float("inf"), 0.0, 0.0)),
        ("Tool [m]", LETTERS),
        ("Tool [deg]", (float("nan"), 0.0, 0.0)),
    ],
)
def test_what_is_not_a_setup_is_ignored_and_the_control_goes_back(
    viewer: Viewer, page: Page, robot: Robot, control: str, value: object
) -> None:
    before = page.value(control)
    page.change(control, value)
    if value != LETTERS:  # which viser itself refuses
        assert until(lambda: viewer.view.note.startswith("Ignored: "))
    with opened(viewer) as other:
        assert until(lambda: other.value(control) == before)
        assert comes_to(viewer, other, NEAR)
    assert viewer.view.status is Status.OK
    # The frame is the same, and there is no tool.
    assert robot.forward_kinematics(viewer.view.q).isApprox(jacokin.pose(NEAR, (0.0, 1.0, 0.0, 0.0)), 1e-6)


def test_the_range_of_a_free_axis_holds(viewer: Viewer, page: Page) -> None:
    page.change("Free axis", "z")
    assert until(lambda: viewer.view.free is not None)
    page.change("Range [deg]", (20.0, 35.0))
    assert until(lambda: viewer.view.free is not None and viewer.view.free.lower == np.radians(20.0))
    shown = viewer.view.free
    assert shown is not None
    assert np.radians(20.0) <= shown.value <= np.radians(35.0)
    for start, stop in shown.intervals:
        assert np.radians(20.0) - 1e-9 <= start <= stop <= np.radians(35.0) + 1e-9
    page.change("Angle [deg]", 170.0)
    assert until(lambda: viewer.view.free is not None and viewer.view.free.value == np.radians(35.0))
    with opened(viewer) as other:
        for wrong in ((50.0, 10.0), (float("nan"), 1.0), (-500.0, 0.0), "x", ("a", "b"), (1.0,)):
            page.change("Range [deg]", wrong)
            assert until(lambda: tuple(other.value("Range [deg]")) == (20.0, 35.0))
    # Again and again: what was wrong may go back only now.
    assert repeat(
        lambda: page.change("Range [deg]", (-90.0, 90.0)),
        lambda: viewer.view.free is not None and viewer.view.free.upper == np.radians(90.0),
    )


def test_a_free_axis_of_an_option_is_shown_at_once(robot: Robot) -> None:
    with serve(robot, ViewerOptions(free_axis="y", free_range=(-0.3, 0.4)), target=NEAR, port=0) as viewer:
        free = viewer.view.free
        assert free is not None
        assert (free.axis, free.lower, free.upper) == (1, -0.3, 0.4)
        viewer.show(jacokin.pose((0.3, -0.25, 0.5), down=True))
        assert until(lambda: viewer.view.target.translation[1] == -0.25)
        assert viewer.view.free is not None
        assert viewer.view.free.lower == -0.3  # not rounded to the steps of the slider


@pytest.mark.slow
def test_joint_3_of_seven_moves_while_the_tool_stays(bundled: Callable[[str], Robot]) -> None:
    robot = bundled("j2s7s300")
    with serve(robot, port=0) as viewer, opened(viewer) as page:
        target = viewer.view.target
        seen = set()
        for degrees in (-150.0, -40.0, 20.0, 120.0):
            before = viewer.view
            page.change("joint_3, free [deg]", degrees)
            assert until(lambda before=before: not np.array_equal(viewer.view.q, before.q))  # type: ignore[misc]  # bound here
            view = viewer.view
            assert robot.within_limits(view.q)
            assert robot.forward_kinematics(view.q).isApprox(target, 1e-6)
            assert view.free is not None
            inside = any(
                start <= np.radians(degrees) + turn <= stop
                for start, stop in view.free.intervals
                for turn in (-2 * np.pi, 0.0, 2 * np.pi)
            )
            away = (view.q[2] - np.radians(degrees) + np.pi) % (2 * np.pi) - np.pi
            assert not inside or abs(away) < 1e-9
            seen.add(round(float(view.q[2]), 6))
        assert len(seen) > 1
        assert len(viewer.view.ghosts) > 5
        page.change("joint_3, free [deg]", float("nan"))
        assert until(lambda: viewer.view.note.startswith("Ignored"))


@pytest.mark.slow
def test_a_slice_of_the_map_is_drawn_at_its_height(viewer: Viewer, page: Page) -> None:
    node = page.node("/map")
    assert not node.visible
    page.change("Slice", True)
    assert until(lambda: node.visible)
    page.change("Height [m]", 0.3)
    assert until(lambda: abs(node.positions[0, 2] - 0.3) <= 0.025)
    assert (np.abs(node.positions[:, 2] - 0.3) <= 0.025 + 1e-6).all()
    count = len(node.positions)
    assert count > 100
    assert until(lambda: node.props["batched_colors"].size == 3 * count)
    assert until(lambda: node.props["batched_wxyzs"].size == 4 * count)
    for wrong in (float("nan"), 1e300, "high"):
        page.change("Height [m]", wrong)
    page.change("Slice", False)
    with opened(viewer) as other:
        assert comes_to(viewer, other, NEAR)


@pytest.mark.slow
def test_each_shape_that_touches_is_drawn_over_the_arm(robot: Robot) -> None:
    at_tool = robot.forward_kinematics(robot.home).translation
    scene = Scene([Box("crate", (0.1, 0.1, 0.1), at_tool)])
    owners = {name: index for index, part in enumerate(load_parts(robot)[0]) for name in part.shapes}
    with serve(robot, ViewerOptions(collision="report"), scene=scene, port=0) as viewer, opened(viewer) as page:
        touching = {name for pair in viewer.view.arm_touching for name in pair} - {"crate"}
        assert touching
        assert page.names("/touching/") == touching
        places = Inspector(IKSolver(robot)).places([viewer.view.q])
        for name in touching:
            assert np.allclose(page.node(f"/touching/{name}").position, places.positions[0, owners[name]])
        viewer.show(jacokin.pose([-0.3, 0.3, 0.6]))
        assert until(lambda: not viewer.view.arm_touching)
        assert until(lambda: not page.names("/touching/"))


@pytest.mark.slow
def test_trajectories_of_other_programs_are_played(robot: Robot, tmp_path: Path) -> None:
    end = np.array(robot.home)
    end[1] += 0.3
    start = robot.forward_kinematics(robot.home)
    path = track_path(robot, [start, robot.forward_kinematics(end)], start=robot.home)
    for name in ("path.json", "path.kinova.csv"):
        path.save(tmp_path / name)
        with serve(robot, trajectory=tmp_path / name, port=0) as viewer, opened(viewer) as page:
            page.change("Time [s]", 1e9)
            assert until(lambda viewer=viewer: np.allclose(viewer.view.q, path.q[-1], atol=1e-6))  # type: ignore[misc]  # bound here


@pytest.mark.slow
def test_no_page_makes_the_viewer_open_files(
    viewer: Viewer, page: Page, robot: Robot, tmp_path: Path, audited: list[tuple[str, str]]
) -> None:
    """While pages do whatever they can, nothing is written, and nothing read but the robot's own description."""
    controls = [each for each in page.screen.controls.values() if "label" in each.props and "Folder" not in each.kind]
    assert len(controls) > 20
    audited.clear()
    for control in controls:
        label = control.props["label"]
        wrong = ("../../etc/passwd", str(tmp_path / "x"), 1, True, control.value)
        # Viser drops a page that sends what is not a message: the next control has a page of its own.
        with contextlib.suppress(ConnectionClosed), opened(viewer) as other:
            for value in (True,) if "Button" in control.kind else wrong:
                other.change(label, value)
    for command in page.screen.commands:
        page.press(command)
    with opened(viewer) as other:
        assert comes_to(viewer, other, NEAR)
    opened_files = list(audited)
    known = (str(Path(viser.__file__).parent), str(Path(robot.source.path).parent))
    foreign = [(path, mode) for path, mode in opened_files if not path.startswith(known) or set(mode) & set("wax+")]
    assert foreign == []
    assert not list(tmp_path.iterdir())


_listening: list[list[tuple[str, str]]] = []


def _hook(event: str, arguments: tuple[object, ...]) -> None:
    if event == "open" and _listening and isinstance(arguments[0], str):
        for seen in _listening:
            seen.append((arguments[0], str(arguments[1] or "r")))


@pytest.fixture(scope="session")
def hooked() -> None:
    """An audit hook stays for as long as the process lives."""
    sys.addaudithook(_hook)


@pytest.fixture
def audited(hooked: None) -> Iterator[list[tuple[str, str]]]:
    """Files that the process opens, with their modes."""
    seen: list[tuple[str, str]] = []
    _listening.append(seen)
    yield seen
    _listening.remove(seen)
