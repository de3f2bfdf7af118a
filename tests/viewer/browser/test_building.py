"""Obstacles that pages add: placed by a click, typed, moved, removed; the arm is judged with them at once."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin import Robot, Status
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Cylinder, IKSolver, Scene, Sphere
from jacokin.viewer import Viewer, serve
from jacokin.viewer.browser import panel
from jacokin.viewer.browser.panel import ADD, MOST, WAITING
from tests.viewer.page import Page, opened, until

EYE = (1.0, -1.0, 1.0)


@pytest.fixture
def viewer(robot: Robot) -> Iterator[Viewer]:
    with serve(robot, scene=Scene([Box("table", (0.2, 0.2, 0.02), (0.6, 0.6, 0.1))]), port=0) as running:
        yield running


def click(page: Page, at: tuple[float, float, float]) -> None:
    """Click where a point of the scene is seen from EYE."""
    direction = np.array(at) - EYE
    page.send(
        "ScenePointerMessage",
        event_type="click",
        ray_origin=EYE,
        ray_direction=tuple((direction / np.linalg.norm(direction)).tolist()),
        screen_pos=((0.5, 0.5),),
        modifier=None,
    )


def names(viewer: Viewer) -> tuple[str, ...]:
    return () if viewer.scene is None else viewer.scene.names


def added(viewer: Viewer) -> Any:  # Any: one of several shapes
    """The obstacle after the table."""
    assert viewer.scene is not None
    return viewer.scene.obstacles[1]


def test_a_click_on_the_floor_places_a_box_that_counts_as_contact(viewer: Viewer, page: Page, robot: Robot) -> None:
    assert viewer.view.status is Status.OK
    tool = robot.forward_kinematics(viewer.view.q).translation
    click(page, (0.3, -0.2, 0.0))  # nobody asked for a place
    page.change("Size [m]", (0.2, 0.2, 1.4))
    page.click(ADD)
    assert until(lambda: page.has(WAITING))
    assert names(viewer) == ("table",)
    click(page, (tool[0], tool[1], 0.0))
    assert until(lambda: names(viewer) == ("table", "added_1"))
    assert until(lambda: page.has(ADD))
    assert viewer.scene is not None
    assert isinstance(added(viewer), Box)
    assert np.allclose(added(viewer).pose.translation, [tool[0], tool[1], 0.7])
    assert until(lambda: viewer.view.status is Status.IN_COLLISION and not viewer.view.pending)
    again = IKSolver(robot, scene=viewer.scene).solve(viewer.view.target, viewer.view.seed)
    assert again.status is viewer.view.status
    page.click("As Python")
    assert until(lambda: "added_1" in page.value("Text"))
    page.click("Remove")
    assert until(lambda: names(viewer) == ("table",))
    assert until(lambda: viewer.view.status is Status.OK)
    assert until(lambda: not page.node("/obstacle").visible)


def test_it_is_moved_by_its_gizmo_and_typed(viewer: Viewer, page: Page) -> None:
    page.click("Add in front")
    assert until(lambda: names(viewer) == ("table", "added_1"))
    where = (0.1, 0.55, 0.2)
    page.send("TransformControlsUpdateMessage", name="/obstacle", wxyz=(1.0, 0.0, 0.0, 0.0), position=where, owner="")
    assert until(lambda: np.allclose(added(viewer).pose.translation, where))
    assert until(lambda: np.allclose(page.value("Place [m]"), where))
    page.change("Kind", "cylinder")
    assert until(lambda: isinstance(added(viewer), Cylinder))
    page.change("Size [m]", (0.3, 0.1, 0.5))
    assert until(lambda: added(viewer).length == 0.5)
    assert added(viewer).radius == 0.15
    page.change("Kind", "sphere")
    assert until(lambda: isinstance(added(viewer), Sphere))
    assert until(lambda: len(page.names("/scene/")) == 2)  # no drawing is left of what it was before
    page.click("Add in front")
    assert until(lambda: names(viewer) == ("table", "added_1", "added_2"))
    page.change("Obstacle", "added_1")
    assert until(lambda: np.allclose(page.node("/obstacle").position, where))
    page.click("Remove")
    assert until(lambda: names(viewer) == ("table", "added_2"))


@pytest.mark.one_quick
@pytest.mark.parametrize("size", [(0.0, 0.1, 0.1), (-1.0, 0.1, 0.1), (float("nan"), 0.1, 0.1)])
def test_a_wrong_size_changes_nothing(viewer: Viewer, page: Page, size: tuple[float, float, float]) -> None:
    page.click("Add in front")
    assert until(lambda: names(viewer) == ("table", "added_1"))
    before = viewer.scene
    page.change("Size [m]", size)
    assert until(lambda: viewer.view.note.startswith("Ignored: size"))
    assert viewer.scene is before
    with opened(viewer) as other:
        assert until(lambda: np.allclose(other.value("Size [m]"), panel.SIZE))


def test_a_click_beside_the_floor_is_refused(viewer: Viewer, page: Page) -> None:
    page.click(ADD)
    assert until(lambda: page.has(WAITING))
    click(page, (0.0, 0.0, 5.0))
    assert until(lambda: "click on the floor" in viewer.view.note)
    assert names(viewer) == ("table",)
    for origin, direction in (((0, 0, 1), (0, 0, float("nan"))), ((0, 0, 1), (1, 0, -0.01)), ((0, 0, 1), (0, 0, 1))):
        with pytest.raises(InvalidInputError):
            panel.on_floor(np.array(origin, dtype=float), np.array(direction, dtype=float))
    assert np.array_equal(panel.on_floor(np.array([0.0, 0.5, 1.0]), np.array([0.5, 0.0, -1.0])), [0.5, 0.5, 0.0])


@pytest.mark.slow
def test_a_page_cannot_add_without_end(viewer: Viewer, page: Page) -> None:
    for count in range(MOST + 1):
        page.click("Add in front")
        assert until(lambda count=count: len(names(viewer)) == 1 + min(count + 1, MOST))  # type: ignore[misc]  # bound here
    assert until(lambda: "remove one first" in viewer.view.note)
    assert len(names(viewer)) == 1 + MOST


def test_without_a_scene_the_first_obstacle_makes_one(robot: Robot) -> None:
    with serve(robot, port=0) as viewer, opened(viewer) as page:
        assert viewer.scene is None
        assert page.control("Obstacles").props["disabled"]
        page.click("Add in front")
        assert until(lambda: names(viewer) == ("added_1",))
        assert until(lambda: not page.control("Obstacles").props["disabled"])
        page.change("Obstacles", False)
        assert until(lambda: not page.names("/scene/"))
        viewer.show(jacokin.pose(panel.PLACE, down=True))
        assert until(lambda: viewer.view.target.translation[1] == -0.3)
        assert until(lambda: viewer.view.status is Status.OK)  # what is unticked is not there
        page.click("Remove")
        assert until(lambda: viewer.scene is None)
