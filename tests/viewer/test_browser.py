"""The viewer in a real browser: what is drawn is what forward kinematics says, and mouse and keys work."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np
import pinocchio as pin
import pytest
import viser

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.viewer import Viewer, serve
from jacokin.viewer.drawing.robot import Part, parts_of
from tests.viewer.browser import IN_BROWSER, Mask, Tab, agreement, picture, pixels, showing, silhouette
from tests.viewer.page import opened, until

pytestmark = IN_BROWSER
ALIKE = 0.92  # of the pixels; the rest are edges, which the browser smooths
TARGET = jacokin.pose([0.3, -0.3, 0.45], down=True)


@pytest.fixture(scope="module")
def viewer() -> Iterator[Viewer]:
    with serve(port=0) as running:
        yield running


@pytest.fixture(scope="module")
def tab(viewer: Viewer, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Tab]:
    with showing(viewer, tmp_path_factory.mktemp("chromium")) as page:
        yield page


@pytest.fixture
def arm_only(viewer: Viewer, tab: Tab) -> Iterator[tuple[Part, ...]]:
    """A scene without grid and gizmo, which would be in the pictures."""
    scene = viewer.server.scene
    hidden = [scene._handle_from_node_name[name] for name in ("/grid", "/target")]
    for node in hidden:
        node.visible = False
    yield parts_of(viewer._inspector.robot)[0]
    for node in hidden:
        node.visible = True


def shown(viewer: Viewer, position: Array) -> bool:
    return until(lambda: np.allclose(viewer.view.target.translation, position) and not viewer.view.pending)


def drawn(viewer: Viewer, wanted: Mask) -> bool:
    """Whether the browser comes to draw these pixels."""
    return until(lambda: agreement(picture(viewer), wanted) > ALIKE)


def test_the_arm_is_drawn_where_forward_kinematics_has_it(viewer: Viewer, arm_only: tuple[Part, ...]) -> None:
    viewer._stage.show_ghosts(False)
    seen = []
    for target in (TARGET, jacokin.pose([-0.3, -0.4, 0.6], down=True)):
        viewer.show(target)
        assert shown(viewer, target.translation)
        seen.append(silhouette(arm_only, viewer._inspector.places([viewer.view.q]), 0))
        assert drawn(viewer, seen[-1])
    assert agreement(*seen) < 0.7  # the two postures differ, so the comparison can fail
    viewer._stage.show_ghosts(True)


def test_every_other_branch_is_a_ghost(viewer: Viewer, arm_only: tuple[Part, ...]) -> None:
    viewer.show(jacokin.pose([0.31, -0.3, 0.45], down=True))
    assert shown(viewer, np.array([0.31, -0.3, 0.45]))
    view = viewer.view
    assert len(view.ghosts) >= 3
    places = viewer._inspector.places(view.branches[view.ghosts])
    masks = [silhouette(arm_only, places, index, first=1) for index in range(len(view.ghosts))]
    for node in viewer._stage.arm.solid.values():
        node.visible = False
    try:
        assert drawn(viewer, np.logical_or.reduce(masks))
        image = picture(viewer)
        covered = [float(image[mask].mean()) for mask in masks]
        assert min(covered) > ALIKE
    finally:
        for node in viewer._stage.arm.solid.values():
            node.visible = True


def test_the_mouse_drags_the_gizmo(viewer: Viewer, tab: Tab) -> None:
    viewer.show(TARGET)
    assert shown(viewer, TARGET.translation)
    client = next(iter(viewer.server.get_clients().values()))
    centre = TARGET.translation
    grip, aim = centre + 0.12 * TARGET.rotation[:, 2], centre + 0.22 * TARGET.rotation[:, 2]

    def is_dragged() -> bool:
        """A drag that misses, because the browser has not drawn the gizmo yet, turns the camera."""
        time.sleep(0.5)  # for the camera's last place
        camera = client.camera
        w, x, y, z = (float(value) for value in camera.wxyz)
        axes = pin.Quaternion(w, x, y, z).toRotationMatrix()
        size = camera.image_width, camera.image_height
        ends = pixels(np.stack((grip, aim)), axes, camera.position, camera.fov, *size)
        tab.drag(ends[0], ends[1])
        return until(lambda: np.linalg.norm(viewer.view.target.translation - centre) > 0.05, patience=5.0)

    assert any(is_dragged() for _ in range(6))
    # How far depends on which frames the browser had time for; what it sent is where the gizmo is.
    assert shown(viewer, viewer._stage.gizmo.position)


def test_keys_go_through_the_branches(viewer: Viewer, tab: Tab) -> None:
    viewer.show(TARGET)
    assert shown(viewer, TARGET.translation)
    assert until(lambda: viewer.view.selected is not None)
    before = viewer.view.selected
    assert before is not None
    tab.press("N")
    assert until(lambda: viewer.view.selected == (before + 1) % len(viewer.view.branches))
    tab.press("P")
    assert until(lambda: viewer.view.selected == before)


def test_a_second_tab_moves_what_the_first_one_draws(viewer: Viewer, arm_only: tuple[Part, ...]) -> None:
    viewer._stage.show_ghosts(False)
    with opened(viewer) as other:
        other.move_gizmo((0.35, -0.25, 0.5))
        assert shown(viewer, np.array([0.35, -0.25, 0.5]))
    assert drawn(viewer, silhouette(arm_only, viewer._inspector.places([viewer.view.q]), 0))
    viewer._stage.show_ghosts(True)


def test_a_page_of_another_address_cannot_connect(viewer: Viewer, robot: Robot, tab: Tab) -> None:
    """A page that another server serves opens a websocket to the viewer: the browser itself sends its Origin."""
    address = viewer.url.replace("http", "ws")
    kind = f"viser-v{viser.__version__}"
    script = (
        f"new Promise(done => {{ const s = new WebSocket({address!r}, {kind!r});"
        " s.onopen = () => done('open'); s.onerror = () => done('refused'); })"
    )
    assert tab.value(script) == "open"
    with serve(robot, port=0) as other:
        tab.ask("Page.navigate", url=other.url)
        assert until(other.server.get_clients)
        assert tab.value(script) == "refused"
