"""The viewer in a real browser: what is drawn is what forward kinematics says, and mouse and keys work."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pinocchio as pin
import pytest
import viser

import jacokin
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.viewer import Inspector, Viewer, serve
from jacokin.viewer.drawing import ArmPart, load_parts
from tests.viewer.chromium import IN_BROWSER, Mask, Tab, agreement, hidden, picture, pixels, showing, silhouette
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
def arm_only(viewer: Viewer, tab: Tab, robot: Robot) -> Iterator[tuple[ArmPart, ...]]:
    """A scene without grid and gizmo, which would be in the pictures."""
    with hidden(viewer, "/grid", "/target"):
        yield load_parts(robot)[0]


@pytest.fixture
def no_ghosts(viewer: Viewer) -> Iterator[None]:
    """A scene without the other branches."""
    with opened(viewer) as page:
        page.change("Ghosts", False)
        assert until(lambda: page.ghosts == 0)
    yield
    with opened(viewer) as page:
        page.change("Ghosts", True)
        assert until(lambda: page.ghosts == len(viewer.view.ghosts))


def silhouettes(robot: Robot, arm: tuple[ArmPart, ...], rows: Array, first: int = 0) -> list[Mask]:
    """The pixels that the arm covers at configurations (k, dof), from a part on."""
    places = Inspector(IKSolver(robot)).places(rows)
    return [silhouette(arm, places, index, first) for index in range(len(rows))]


def shown(viewer: Viewer, position: Array) -> bool:
    return until(lambda: np.allclose(viewer.view.target.translation, position) and not viewer.view.pending)


def drawn(viewer: Viewer, wanted: Mask) -> bool:
    """Whether the browser comes to draw these pixels."""
    return until(lambda: agreement(picture(viewer), wanted) > ALIKE)


def test_the_arm_is_drawn_where_forward_kinematics_has_it(
    viewer: Viewer, robot: Robot, arm_only: tuple[ArmPart, ...], no_ghosts: None
) -> None:
    seen = []
    for target in (TARGET, jacokin.pose([-0.3, -0.4, 0.6], down=True)):
        viewer.show(target)
        assert shown(viewer, target.translation)
        seen += silhouettes(robot, arm_only, viewer.view.q[None])
        assert drawn(viewer, seen[-1])
    assert agreement(*seen) < 0.7  # the two postures differ, so the comparison can fail


def test_every_other_branch_is_a_ghost(viewer: Viewer, robot: Robot, arm_only: tuple[ArmPart, ...]) -> None:
    viewer.show(jacokin.pose([0.31, -0.3, 0.45], down=True))
    assert shown(viewer, np.array([0.31, -0.3, 0.45]))
    view = viewer.view
    assert len(view.ghosts) >= 3
    masks = silhouettes(robot, arm_only, view.branches[view.ghosts], first=1)
    with hidden(viewer, "/start", *(f"/arm/{part}" for part in range(6))):  # the hand is one for all branches
        assert drawn(viewer, np.logical_or.reduce(masks))
        image = picture(viewer)
        assert min(float(image[mask].mean()) for mask in masks) > ALIKE


def test_the_mouse_drags_the_gizmo(viewer: Viewer, tab: Tab) -> None:
    viewer.show(TARGET)
    assert shown(viewer, TARGET.translation)
    client = next(iter(viewer.server.get_clients().values()))
    centre = TARGET.translation
    grip, aim_at = centre + 0.12 * TARGET.rotation[:, 2], centre + 0.22 * TARGET.rotation[:, 2]

    def aim() -> Array:
        """(2, 2) the pixels of grip and aim, where the camera is."""
        camera = client.camera
        w, x, y, z = (float(value) for value in camera.wxyz)
        axes = pin.Quaternion(w, x, y, z).toRotationMatrix()
        size = camera.image_width, camera.image_height
        return pixels(np.stack((grip, aim_at)), axes, camera.position, camera.fov, *size)

    def is_dragged() -> bool:
        """A drag that misses, because the browser has not drawn the gizmo yet, turns the camera."""
        ends = aim()
        tab.draw()
        while not np.array_equal(ends, now := aim()):  # the camera still turns
            ends = now
            tab.draw()
        tab.drag(ends[0], ends[1])
        return until(lambda: np.linalg.norm(viewer.view.target.translation - centre) > 0.05, patience=2.0)

    assert until(is_dragged)
    # How far depends on which frames the browser had time for; what it sent is where the gizmo is.
    gizmo = viewer.server.scene.get_handle_by_name("/target")
    assert gizmo is not None
    assert until(lambda: np.allclose(viewer.view.target.translation, gizmo.position) and not viewer.view.pending)


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


def test_a_second_tab_moves_what_the_first_one_draws(
    viewer: Viewer, robot: Robot, arm_only: tuple[ArmPart, ...], no_ghosts: None
) -> None:
    with opened(viewer) as other:
        other.move_gizmo((0.35, -0.25, 0.5))
        assert shown(viewer, np.array([0.35, -0.25, 0.5]))
    assert drawn(viewer, silhouettes(robot, arm_only, viewer.view.q[None])[0])


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
