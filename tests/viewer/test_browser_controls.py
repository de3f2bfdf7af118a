"""The panel in a real browser: sliders, switches and folders by mouse and keys, and what they draw."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh

import jacokin
from jacokin import Robot
from jacokin.ik import Box, Scene
from jacokin.model import urdf_folder
from jacokin.motion import track_path
from jacokin.viewer import Viewer, serve
from jacokin.viewer.drawing.meshes import merged
from jacokin.viewer.drawing.robot import Part, visuals_of
from tests.viewer.browser import (
    EYE,
    FOV,
    HEIGHT,
    IN_BROWSER,
    WIDTH,
    Tab,
    agreement,
    camera,
    image,
    picture,
    pixels,
    showing,
    silhouette,
)
from tests.viewer.page import opened, until

pytestmark = IN_BROWSER
ALIKE = 0.92  # of the pixels; the rest are edges, which the browser smooths


@pytest.fixture(scope="module")
def viewer(bundled: Callable[[str], Robot]) -> Iterator[Viewer]:
    """With a crate that the hand touches, and a trajectory."""
    robot = bundled("j2n6s300")
    start = robot.forward_kinematics(robot.home)
    end = jacokin.pose(start.translation + np.array([0.0, 0.0, 0.02]), rotation=start.rotation)
    crate = Scene([Box("crate", (0.06, 0.06, 0.06), start.translation)])
    path = track_path(robot, [start, end], start=robot.home)
    with serve(robot, scene=crate, collision="report", trajectory=path, port=0) as running:
        yield running


@pytest.fixture(scope="module")
def tab(viewer: Viewer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with showing(viewer, tmp_path_factory.mktemp("chromium")) as page:
        assert until(lambda: page.value("document.querySelectorAll('[role=slider]').length") != 0)
        yield page


@pytest.fixture
def hidden(viewer: Viewer) -> Iterator[Callable[..., None]]:
    """Hides nodes of the scene for as long as a test lasts."""
    gone = []

    def hide(*names: str) -> None:
        for name, node in viewer.server.scene._handle_from_node_name.items():
            if name.startswith(names) and node.visible:
                node.visible = False
                gone.append(node)

    yield hide
    for node in gone:
        node.visible = True


def test_a_joint_slider_moves_its_joint(viewer: Viewer, tab: Tab) -> None:
    before = viewer.view.q
    tab.focus_slider("joint_2")
    tab.press_arrow(20)
    assert until(lambda: viewer.view.q[1] > before[1] + 0.015)
    assert np.allclose(np.delete(viewer.view.q, 1), np.delete(before, 1))
    viewer.show(viewer._inspector.robot.forward_kinematics(before))
    assert until(lambda: np.allclose(viewer.view.q, before, atol=1e-6))


def test_a_click_shows_the_ellipsoid(viewer: Viewer, tab: Tab, hidden: Callable[..., None]) -> None:
    hidden("/grid", "/target", "/arm", "/ghosts", "/scene", "/touching")
    assert until(lambda: not picture(viewer).any())
    tab.click("Manipulability")
    assert until(lambda: viewer._stage._ellipsoid.visible)
    hidden("/arm", "/ghosts", "/scene", "/touching")  # the switch showed the view again
    node = viewer._stage._ellipsoid
    tool = viewer._inspector.pose_of(viewer.view.q).translation
    column, row = pixels(tool[None], camera(), EYE, FOV, WIDTH, HEIGHT)[0].round().astype(int)
    assert until(lambda: picture(viewer)[row, column])
    red, green, blue, _ = image(viewer)[row, column].astype(int)
    assert blue > red > green  # violet
    assert 0 < picture(viewer).sum() < 0.5 * WIDTH * HEIGHT
    tab.click("Manipulability")
    assert until(lambda: not node.visible)


def test_cells_of_the_map_are_drawn_where_they_are(viewer: Viewer, tab: Tab, hidden: Callable[..., None]) -> None:
    slicing = viewer._panel.slicing
    assert slicing is not None
    tab.click("Reachability map")
    assert until(lambda: tab.value("document.body.innerText.includes('Height [m]')"))
    tab.click("Slice")
    assert until(lambda: slicing._node.visible)
    hidden("/grid", "/target", "/arm", "/ghosts", "/scene", "/touching")
    height = float(slicing._node.batched_positions[0][2])
    x, y = np.meshgrid(slicing._slices._x[:, 0], slicing._slices._y[0], indexing="ij")
    centres = np.column_stack((x.ravel(), y.ravel(), np.full(x.size, height)))
    reached = (slicing._slices._fraction[:, :, slicing._slices.layer(height)] > 0.0).ravel()
    at = pixels(centres, camera(), EYE, FOV, WIDTH, HEIGHT).round().astype(int)
    seen = ((at >= 0) & (at < [WIDTH, HEIGHT])).all(axis=1) & (((centres - EYE) @ camera())[:, 2] > 0.3)
    assert (seen & reached).sum() > 200

    def drawn() -> bool:
        mask = picture(viewer)
        covered = mask[at[seen][:, 1], at[seen][:, 0]]
        return bool((covered == reached[seen]).mean() > 0.97)

    assert until(drawn)
    colours = image(viewer)[at[seen & reached][:, 1], at[seen & reached][:, 0], :3].astype(int)
    fractions = slicing._slices._fraction[:, :, slicing._slices.layer(height)].ravel()[seen & reached]
    assert np.corrcoef(fractions, colours[:, 1])[0, 1] > 0.8  # greener where more is reached
    tab.click("Slice")
    assert until(lambda: not slicing._node.visible)


def test_what_touches_is_orange_and_nothing_else(viewer: Viewer, tab: Tab, hidden: Callable[..., None]) -> None:
    view = viewer.view
    touching = {name for pair in view.arm_touching for name in pair} - {"crate"}
    assert touching
    hidden("/grid", "/target", "/ghosts", "/scene", "/ellipsoid")
    arm = viewer._stage.arm
    places = viewer._inspector.places([view.q])
    parts = tuple(viewer._look.shapes)
    only = []
    for part in parts:
        kept = [mesh for name, mesh in part.shapes.items() if name in touching]
        only.append(Part(part.name, merged(kept)))
    wanted = silhouette(tuple(only), places, 0)
    whole = silhouette(parts, places, 0)
    assert 0 < wanted.sum() < 0.8 * whole.sum()

    def orange() -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
        red, green, blue = np.moveaxis(image(viewer)[:, :, :3].astype(int), 2, 0)
        return np.asarray((red > green + 20) & (green > blue + 40))

    assert until(lambda: orange().any())
    marked = orange()
    assert marked[wanted].mean() > 0.5  # the rest is behind the arm
    assert not marked[~wanted].sum() > 0.1 * marked.sum()
    assert {name for name, node in arm._touching.items() if node.visible} == touching


def test_the_plots_of_a_trajectory_are_drawn(viewer: Viewer, tab: Tab) -> None:
    tab.click("Joints over time")
    assert until(lambda: tab.value("document.querySelectorAll('.uplot canvas').length") == 6)


def test_a_trajectory_is_played_by_a_click(viewer: Viewer, tab: Tab) -> None:
    player = viewer._panel.player
    assert player is not None
    tab.click("Play")
    assert until(lambda: "Trajectory at" in viewer.view.note)
    assert viewer._playback is not None
    assert until(lambda: viewer._playback is not None and viewer._playback.time == viewer._playback.duration)
    tab.focus_slider("Time [s]")
    end = f"Math.abs(document.activeElement.ariaValueNow - {viewer._playback.duration}) < 0.01"
    assert until(lambda: tab.value(end))  # the page has come to the end, too
    tab.ask("Input.dispatchKeyEvent", type="keyDown", key="Home", code="Home", windowsVirtualKeyCode=36)
    assert until(lambda: viewer._playback is not None and viewer._playback.time == 0.0)


def test_the_tracker_takes_the_arm_to_a_gizmo_that_was_dragged(viewer: Viewer, tab: Tab) -> None:
    tab.click("Track")
    assert until(lambda: viewer.view.note.startswith("Tracking"))
    goal = viewer.view.target.translation + np.array([0.0, 0.0, 0.05])
    wxyz = tuple(float(value) for value in viewer._stage.gizmo.wxyz)
    with opened(viewer) as other:
        other.move_gizmo(tuple(goal.tolist()), wxyz)
        assert until(lambda: np.linalg.norm(viewer._inspector.pose_of(viewer.view.q).translation - goal) < 1e-3)
    tab.click("Track")
    assert until(lambda: not viewer._panel.track)


def test_copied_text_stands_in_the_page(viewer: Viewer, tab: Tab) -> None:
    tab.click("Copy")
    assert until(lambda: tab.value("document.body.innerText.includes('As Python')"))
    tab.click("As Python")
    assert until(
        lambda: tab.value("[...document.querySelectorAll('textarea')].some(e => e.value.includes('IKSolver'))")
    )


def test_visual_meshes_are_drawn_where_forward_kinematics_has_them(tmp_path: Path) -> None:
    trimesh.creation.torus(0.15, 0.04).export(tmp_path / "ring.stl")
    text = (urdf_folder() / "j2n6s300.urdf").read_text(encoding="utf-8")
    ring = '<visual><origin xyz="0 0.1 0"/><geometry><mesh filename="ring.stl"/></geometry></visual>'
    path = tmp_path / "ringed.urdf"
    path.write_text(text.replace('<link name="link_3">', f'<link name="link_3">{ring}'), encoding="utf-8")
    robot = jacokin.load_robot(path)
    visuals = visuals_of(robot)
    assert visuals is not None
    with serve(robot, port=0) as viewer, showing(viewer, tmp_path / "chromium") as tab:
        for name in ("/grid", "/target"):
            viewer.server.scene._handle_from_node_name[name].visible = False
        assert until(lambda: tab.value("document.querySelectorAll('[role=slider]').length") != 0)
        tab.click("Ghosts")
        places = viewer._inspector.places([viewer.view.q])
        shapes, drawn = silhouette(viewer._look.shapes, places, 0), silhouette(visuals, places, 0)
        assert agreement(shapes, drawn) < ALIKE  # they differ, so the comparison can fail
        assert until(lambda: agreement(picture(viewer), shapes) > ALIKE)
        tab.click("Visual meshes")
        assert until(lambda: agreement(picture(viewer), drawn) > ALIKE)


def test_two_browsers_show_the_same(tmp_path: Path, robot: Robot) -> None:
    with (
        serve(robot, port=0) as viewer,
        showing(viewer, tmp_path / "first") as first,
        showing(viewer, tmp_path / "second") as second,
    ):
        for name in ("/grid", "/target"):
            viewer.server.scene._handle_from_node_name[name].visible = False
        for tab in (first, second):
            assert until(lambda tab=tab: tab.value("document.querySelectorAll('[role=slider]').length") != 0)  # type: ignore[misc]  # bound here
        first.click("Ghosts")
        before = viewer.view.q
        second.focus_slider("joint_2")
        second.press_arrow(100)
        assert until(lambda: viewer.view.q[1] > before[1] + 0.08)
        wanted = silhouette(viewer._look.shapes, viewer._inspector.places([viewer.view.q]), 0)
        for page in (0, 1):
            assert until(lambda page=page: agreement(picture(viewer, page), wanted) > ALIKE)  # type: ignore[misc]  # bound here
