"""The panel in a real browser: sliders, switches and folders by mouse and keys, and what they draw."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
import trimesh

import jacokin
from jacokin import IKSolver, Robot, reachability
from jacokin.ik import Box, Scene
from jacokin.model import urdf_folder
from jacokin.motion import Trajectory, track_path
from jacokin.viewer import Inspector, Viewer, ViewerOptions, serve
from jacokin.viewer.contents import MapSlices
from jacokin.viewer.drawing import ArmPart, ColouredMesh, load_parts, load_visuals
from tests.robot_files import load_text
from tests.viewer.chromium import (
    EYE,
    FOV,
    HEIGHT,
    IN_BROWSER,
    WIDTH,
    Mask,
    Tab,
    agreement,
    camera,
    hidden,
    image,
    picture,
    pixels,
    showing,
    silhouette,
)
from tests.viewer.page import opened, repeat, until

pytestmark = IN_BROWSER
ALIKE = 0.92  # of the pixels; the rest are edges, which the browser smooths


@pytest.fixture(scope="module")
def path(bundled: Callable[[str], Robot]) -> Trajectory:
    robot = bundled("j2n6s300")
    start = robot.forward_kinematics(robot.home)
    end = jacokin.pose(start.translation + np.array([0.0, 0.0, 0.02]), rotation=start.rotation)
    return track_path(robot, [start, end], start=robot.home)


@pytest.fixture(scope="module")
def viewer(bundled: Callable[[str], Robot], path: Trajectory) -> Iterator[Viewer]:
    """With a crate that the hand touches, and a trajectory."""
    robot = bundled("j2n6s300")
    crate = Scene([Box("crate", (0.06, 0.06, 0.06), robot.forward_kinematics(robot.home).translation)])
    with serve(robot, ViewerOptions(collision="report"), scene=crate, trajectory=path, port=0) as running:
        yield running


@pytest.fixture(scope="module")
def tab(viewer: Viewer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with showing(viewer, tmp_path_factory.mktemp("chromium")) as page:
        yield page


@pytest.fixture
def inspector(robot: Robot) -> Inspector:
    return Inspector(IKSolver(robot))


RIGHT, END = ("ArrowRight", 39), ("End", 35)


def press_on_slider(tab: Tab, label: str, key: tuple[str, int], there: Callable[[], object], times: int = 1) -> bool:
    """Press a key on a slider, several times and again and again, until something comes true."""

    def press() -> None:
        tab.focus_slider(label)
        tab.press_key(*key, times)

    return repeat(press, there, pause=2.0)


def test_a_joint_slider_moves_its_joint(viewer: Viewer, tab: Tab, robot: Robot) -> None:
    before = viewer.view.q
    assert press_on_slider(tab, "joint_2", RIGHT, lambda: viewer.view.q[1] > before[1] + 0.015, times=20)
    assert np.allclose(np.delete(viewer.view.q, 1), np.delete(before, 1))
    viewer.show(robot.forward_kinematics(before))
    assert until(lambda: np.allclose(viewer.view.q, before, atol=1e-6))


def test_a_click_shows_the_ellipsoid(viewer: Viewer, tab: Tab, inspector: Inspector) -> None:
    tab.click("Manipulability")
    with opened(viewer) as page:
        assert until(lambda: page.node("/ellipsoid").visible)
    tool = inspector.pose_of(viewer.view.q).translation
    column, row = pixels(tool[None], camera(), EYE, FOV, WIDTH, HEIGHT)[0].round().astype(int)

    def violet() -> bool:
        red, green, blue, seen = image(viewer)[row, column].astype(int)
        return bool(seen and blue > red > green)

    with hidden(viewer, "/grid", "/target", "/start", "/path", "/scene/0", *parts(viewer)):
        assert until(violet)
        assert until(lambda: 0 < picture(viewer).sum() < 0.5 * WIDTH * HEIGHT)
    tab.click("Manipulability")
    with opened(viewer) as page:
        assert until(lambda: not page.node("/ellipsoid").visible)


def parts(viewer: Viewer) -> list[str]:
    """The nodes of the arm, its ghosts, and what touches."""
    touching = [f"/touching/{name}" for pair in viewer.view.arm_touching for name in pair]
    return [*(f"/{kind}/{part}" for kind in ("arm", "ghosts", "wires") for part in range(7)), *touching]


def test_cells_of_the_map_are_drawn_where_they_are(viewer: Viewer, tab: Tab) -> None:
    tab.click("Reachability map")
    assert until(lambda: tab.value("document.body.innerText.includes('Height [m]')"))
    tab.click("Slice")
    with opened(viewer) as page:
        assert until(lambda: page.node("/map").visible)
        height = float(page.node("/map").positions[0, 2])
    reach = reachability.bundled()
    slices = MapSlices(reach)
    layer = slices.layer(height)
    fraction = reach.fraction[:, :, layer].ravel()
    x, y = np.meshgrid(reach.grid.axis(0), reach.grid.axis(1), indexing="ij")
    centres = np.column_stack((x.ravel(), y.ravel(), np.full(x.size, slices.heights[layer])))
    at = pixels(centres, camera(), EYE, FOV, WIDTH, HEIGHT).round().astype(int)
    seen = ((at >= 0) & (at < [WIDTH, HEIGHT])).all(axis=1) & (((centres - EYE) @ camera())[:, 2] > 0.3)
    assert (seen & (fraction > 0.0)).sum() > 200

    def drawn() -> bool:
        covered = picture(viewer)[at[seen][:, 1], at[seen][:, 0]]
        return bool((covered == (fraction[seen] > 0.0)).mean() > 0.97)

    with hidden(viewer, "/grid", "/target", "/start", "/path", "/scene/0", *parts(viewer)):
        assert until(drawn)
        inside = seen & (fraction > 0.0)
        colours = image(viewer)[at[inside][:, 1], at[inside][:, 0], :3].astype(int)
        assert np.corrcoef(fraction[inside], colours[:, 1])[0, 1] > 0.8  # greener where more is reached
        tab.click("Slice")
        assert until(lambda: not picture(viewer).any())


def test_what_touches_is_orange_and_nothing_else(viewer: Viewer, tab: Tab, robot: Robot, inspector: Inspector) -> None:
    view = viewer.view
    touching = {name for pair in view.arm_touching for name in pair} - {"crate"}
    assert touching
    places = inspector.places([view.q])
    shapes = load_parts(robot)[0]
    only = [
        ArmPart(part.name, tuple(ColouredMesh(mesh) for name, mesh in part.shapes.items() if name in touching))
        for part in shapes
    ]
    wanted, whole = silhouette(tuple(only), places, 0), silhouette(shapes, places, 0)
    assert 0 < wanted.sum() < 0.8 * whole.sum()

    def orange() -> Mask:
        red, green, blue = np.moveaxis(image(viewer)[:, :, :3].astype(int), 2, 0)
        return np.asarray((red > green + 20) & (green > blue + 40))

    with hidden(
        viewer,
        "/grid",
        "/target",
        "/start",
        "/scene/0",
        *(f"/{kind}/{part}" for kind in ("ghosts", "wires") for part in range(1, 7)),
    ):
        assert until(lambda: orange()[wanted].mean() > 0.5)  # the rest is behind the arm
        marked = orange()
        assert not marked[~wanted].sum() > 0.1 * marked.sum()


def test_the_plots_of_a_trajectory_are_drawn(viewer: Viewer, tab: Tab) -> None:
    tab.click("Joints over time")
    assert until(lambda: tab.value("document.querySelectorAll('.uplot canvas').length") == 6)


def test_a_trajectory_is_played_by_a_click(viewer: Viewer, tab: Tab, path: Trajectory) -> None:
    end = float(path.t[-1])
    tab.click("Play")
    assert until(lambda: viewer.view.note.startswith(f"Trajectory at {end:.2f} of {end:.2f} s"))
    tab.focus_slider("Time [s]")
    assert until(lambda: tab.value(f"Math.abs(document.activeElement.ariaValueNow - {end}) < 0.01"))  # the page, too
    assert press_on_slider(tab, "Time [s]", ("Home", 36), lambda: viewer.view.note.startswith("Trajectory at 0.00"))


def test_the_tracker_takes_the_arm_to_a_gizmo_that_was_dragged(viewer: Viewer, tab: Tab, inspector: Inspector) -> None:
    tab.click("Track")
    assert until(lambda: viewer.view.note.startswith("Tracking"))
    goal = viewer.view.target.translation + np.array([0.0, 0.0, 0.05])
    with opened(viewer) as other:
        other.move_gizmo(tuple(goal.tolist()), other.node("/target").wxyz)
        assert until(lambda: np.linalg.norm(inspector.pose_of(viewer.view.q).translation - goal) < 1e-3)
        tab.click("Track")
        assert until(lambda: other.value("Track") is False)
    assert until(lambda: not viewer.view.note)


def test_the_arm_goes_by_a_click_to_what_is_shown(tmp_path: Path, robot: Robot, inspector: Inspector) -> None:
    home = robot.forward_kinematics(robot.home)
    with (
        serve(robot, port=0) as viewer,
        showing(viewer, tmp_path) as tab,
        hidden(viewer, "/grid", "/target"),
    ):
        viewer.show(jacokin.pose(home.translation + np.array([0.0, 0.0, 0.15]), rotation=home.rotation))
        assert until(lambda: np.abs(viewer.view.q - robot.home).max() > 0.1)
        goal = viewer.view.q

        def green() -> int:
            red, green, blue = np.moveaxis(image(viewer)[:, :, :3].astype(int), 2, 0)
            return int(((green > red + 30) & (green > blue + 30)).sum())

        assert until(lambda: green() > 300)  # the sticks of the start
        tab.click("Go")
        assert until(lambda: tab.value("document.body.innerText.includes('Arrived: reached in')"))
        assert np.abs(viewer.view.q - goal).max() < 1e-9
        assert until(lambda: green() < 30)
        tab.click("Ghosts")
        wanted = silhouette(load_parts(robot)[0], inspector.places([goal]), 0)
        assert until(lambda: agreement(picture(viewer), wanted) > ALIKE)


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
    robot = load_text(tmp_path / "ringed.urdf", text.replace('<link name="link_3">', f'<link name="link_3">{ring}'))
    visuals = load_visuals(robot)
    assert visuals is not None
    with (
        serve(robot, port=0) as viewer,
        showing(viewer, tmp_path / "chromium") as tab,
        hidden(viewer, "/grid", "/target"),
    ):
        tab.click("Ghosts")
        places = Inspector(IKSolver(robot)).places([viewer.view.q])
        shapes, drawn = silhouette(load_parts(robot)[0], places, 0), silhouette(visuals, places, 0)
        assert agreement(shapes, drawn) < ALIKE  # they differ, so the comparison can fail
        assert until(lambda: agreement(picture(viewer), shapes) > ALIKE)
        tab.click("Visual meshes")
        assert until(lambda: agreement(picture(viewer), drawn) > ALIKE)


NARROW = {"width": 420, "height": 800, "deviceScaleFactor": 1, "mobile": False}
CUT = """[...document.querySelectorAll('.mantine-NumberInput-input')]
  .filter(e => e.clientWidth && e.scrollWidth > e.clientWidth).map(e => e.value)"""
HEIGHTS = """[document.querySelector('canvas').getBoundingClientRect().bottom,
  document.querySelector('.mantine-ScrollArea-viewport').getBoundingClientRect().top]"""


@pytest.mark.parametrize("width", [420, 1000])
def test_no_number_is_cut_and_on_a_narrow_window_the_arm_is_in_sight(tmp_path: Path, robot: Robot, width: int) -> None:
    target = jacokin.pose([-0.2345, -0.3456, 0.4567], rpy=np.radians([-123.45, -34.56, -123.45]))
    with serve(robot, target=target, port=0) as viewer, showing(viewer, tmp_path) as tab:
        tab.ask("Emulation.setDeviceMetricsOverride", **NARROW | {"width": width})
        tab.click("Degrees")
        assert until(lambda: tab.value("document.body.innerText.includes('Joints [deg]')"))
        boxes = "document.querySelectorAll('.mantine-NumberInput-input').length > 12"
        assert until(lambda: tab.value(boxes))
        assert until(lambda: tab.value(CUT) == []), tab.value(CUT)  # once the page is laid out anew
        label = "getComputedStyle([...document.querySelectorAll('label')].find(e => e.textContent == 'Prefer')).color"
        assert tab.value(label) == "rgb(73, 80, 87)"

        def apart() -> bool:
            heights = tab.value(HEIGHTS)
            assert isinstance(heights, list)
            canvas, panel = map(float, heights)
            return 400.0 < canvas <= panel

        assert width > 420 or until(apart)


def test_two_browsers_show_the_same(tmp_path: Path, robot: Robot, inspector: Inspector) -> None:
    with (
        serve(robot, port=0) as viewer,
        showing(viewer, tmp_path / "first") as first,
        showing(viewer, tmp_path / "second") as second,
        hidden(viewer, "/grid", "/target"),
    ):
        first.click("Ghosts")
        before = viewer.view.q
        assert press_on_slider(second, "joint_2", END, lambda: viewer.view.q[1] > before[1] + 0.08)
        parts = load_parts(robot)[0]
        for page in (0, 1):

            def alike(page: int = page) -> bool:
                wanted = silhouette(parts, inspector.places([viewer.view.q]), 0)
                return agreement(picture(viewer, page), wanted) > ALIKE

            assert until(alike)
