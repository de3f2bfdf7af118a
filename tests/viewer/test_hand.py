"""A hand that leads the arm of the viewer: what pages report, and what they are shown."""

from __future__ import annotations

import urllib.error
import urllib.request
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest

import jacokin
from jacokin import Robot, Tracker
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.teleop import Controller, Teleop
from jacokin.viewer import Viewer, serve
from tests import gripper_arms
from tests.viewer.page import Page, opened, until

Led = tuple[Viewer, Controller]


@pytest.fixture(scope="module")
def led(robot: Robot) -> Iterator[Led]:
    with serve(robot, port=0) as viewer:
        yield viewer, viewer.add_controller()


def say(viewer: Viewer, query: str, token: str | None = None) -> int:
    """Status of the answer to a report."""
    page = urlsplit(viewer.url)
    given = page.query if token is None else token
    try:
        with urllib.request.urlopen(f"http://{page.netloc}/hand?{given}&{query}", timeout=60.0) as answer:
            return int(answer.status)
    except urllib.error.HTTPError as error:
        return error.code


def test_a_report_of_a_page_is_a_twist(led: Led) -> None:
    viewer, controller = led
    assert say(viewer, "keys=r+g&axes=&buttons=") == 200
    assert np.allclose(np.asarray(controller.read(0.0)), [0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    assert controller.fingers == 1.0
    assert say(viewer, "keys=&axes=0+-1.000+0+0&buttons=0+0") == 200
    assert np.allclose(np.asarray(controller.read(0.0)), [0.1, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.mark.parametrize("query", ["axes=left", "axes=nan", "axes=0+1e999", f"keys={'w+' * 2000}", "buttons=--1"])
def test_malformed_reports_are_refused(led: Led, query: str) -> None:
    viewer, controller = led
    assert say(viewer, query) == 400
    assert controller.read(0.0) is None


def test_who_has_no_token_leads_nothing(led: Led) -> None:
    viewer, controller = led
    assert say(viewer, "keys=r", token="token=guessed") == 403
    assert controller.read(0.0) is None


def drawn_hand(page: Page, link: str = "/arm/6/") -> Array:
    """The vertices of all pieces of the hand [m], one after the other."""
    pieces = [node.props["vertices"] for name, node in sorted(dict(page.screen.nodes).items()) if name.startswith(link)]
    return np.concatenate([np.empty(0), *(np.asarray(piece).reshape(-1) for piece in pieces)])


@pytest.mark.slow
def test_the_arm_is_shown_where_the_hand_brings_it_with_its_fingers(robot: Robot, led: Led) -> None:
    viewer, controller = led
    teleop = Teleop(Tracker(robot, acceleration_limit=4.0), clutch=True)
    with opened(viewer) as page:
        assert until(lambda: len(drawn_hand(page)) > 0)
        hand = drawn_hand(page)
        for _ in range(40):
            controller.report(keys=["r"])
            step = teleop.step(controller.read(0.0))
            viewer.follow(step, finger_angle=0.15)
        while np.abs(step.v).max() > 0.0:
            step = teleop.step(np.zeros(6))
            viewer.follow(step, finger_angle=1.2)
        assert np.abs(step.q - robot.home).max() > 0.02
        assert until(lambda: np.array_equal(viewer.view.q, step.q))
        assert "FOLLOWING" in viewer.view.note
        assert until(lambda: len(drawn_hand(page)) == len(hand) and not np.array_equal(drawn_hand(page), hand))
        teleop.clutch(False)
        viewer.follow(teleop.step())
        assert until(lambda: "HOLDING" in viewer.view.note)
        assert until(lambda: any("Holding" in str(text.props) for text in page.screen.controls.values()))


@pytest.mark.one_quick
@pytest.mark.parametrize(("name", "angle"), [("gen3_6dof", 0.0), ("gen3_lite", 0.05), ("so101", 0.8)])
def test_fingers_of_other_arms_are_drawn_where_they_have_some(name: str, angle: float, tmp_path: Path) -> None:
    robot = gripper_arms.load(name, tmp_path) if name in gripper_arms.TEXTS else jacokin.load_robot(name)
    hand_of = "/arm/5/" if robot.dof == 5 else "/arm/6/"
    with serve(robot, port=0) as viewer:
        teleop = Teleop(Tracker(robot))
        with opened(viewer) as page:
            assert until(lambda: len(drawn_hand(page, hand_of)) > 0)
            hand = drawn_hand(page, hand_of)
            viewer.follow(teleop.step(), finger_angle=angle)
            moves = name != "gen3_6dof"
            assert until(lambda: "HOLDING" in viewer.view.note)
            assert until(lambda: np.array_equal(drawn_hand(page, hand_of), hand) != moves)


@pytest.mark.slow
def test_an_arm_that_something_else_moves_is_shown(robot: Robot) -> None:
    with serve(robot, port=0) as viewer, opened(viewer) as page:
        assert until(lambda: len(drawn_hand(page)) > 0)
        hand = drawn_hand(page)
        q = robot.home + 0.1

        def stands() -> bool:
            viewer.stand(q, finger_angle=1.2, note="at 1.0 s")
            view = viewer.view
            return np.array_equal(view.q, q) and view.note == "at 1.0 s"

        assert until(stands)
        assert until(lambda: len(drawn_hand(page)) == len(hand) and not np.array_equal(drawn_hand(page), hand))
        with pytest.raises(InvalidInputError, match="q must"):
            viewer.stand(np.zeros(3))


def test_the_buttons_work_the_clutch_and_end(robot: Robot) -> None:
    with serve(robot, port=0) as viewer:
        first = viewer.add_controller()
        second = viewer.add_controller()  # takes the page over
        with opened(viewer) as page:
            page.click("Clutch")
            assert until(second.toggled)
            page.click("End")
            assert until(lambda: second.ended)
            assert say(viewer, "keys=w") == 200
            assert second.read(0.0) is not None
        assert (first.read(0.0), first.ended, first.toggled()) == (None, False, False)


def test_what_is_no_step_is_refused(led: Led, robot: Robot) -> None:
    viewer, _ = led
    with pytest.raises(InvalidInputError, match="step must be a TeleopStep"):
        viewer.follow(robot.home)  # type: ignore[arg-type]  # wrong on purpose
    step = Teleop(Tracker(robot)).step()
    with pytest.raises(InvalidInputError, match="finger_angle must be"):
        viewer.follow(step, finger_angle=np.nan)


def test_a_page_loads_the_script_that_reads_keys_and_gamepads_from_the_viewer_alone(led: Led) -> None:
    viewer, _ = led
    page = urlsplit(viewer.url)
    with urllib.request.urlopen(viewer.url, timeout=60.0) as answer:
        text = answer.read().decode()
    assert text.count('<script src="/hand.js"></script></body>') == 1
    with urllib.request.urlopen(f"http://{page.netloc}/hand.js?{page.query}", timeout=60.0) as answer:
        assert answer.headers["Content-Type"].startswith("text/javascript")
        assert "getGamepads" in answer.read().decode()
    with pytest.raises(urllib.error.HTTPError) as refused:
        urllib.request.urlopen(f"http://{page.netloc}/hand.js", timeout=60.0)
    refused.value.close()
    assert refused.value.code == 403
    with opened(viewer) as shown:
        assert until(lambda: any("data-jacokin-hand" in str(each.props) for each in shown.screen.controls.values()))
        assert not any("onerror" in str(each.props) for each in shown.screen.controls.values())
