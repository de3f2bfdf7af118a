"""Keys and a gamepad in a real browser, which lead the arm."""

from __future__ import annotations

import threading
import time
from pathlib import Path

import numpy as np

from jacokin import Robot, Tracker
from jacokin.teleop import Session, Teleop, TeleopStep, lead
from jacokin.viewer import serve
from tests.viewer.chromium import IN_BROWSER, showing
from tests.viewer.page import until

pytestmark = IN_BROWSER
PAD = "navigator.getGamepads = () => [{connected: true, axes: %s, buttons: Array(16).fill({value: 0})}]; 1"


def test_keys_and_a_gamepad_of_the_page_lead_the_arm(robot: Robot, tmp_path: Path) -> None:
    """The camera, which w, a, s and d move otherwise, stays; a page that lost the focus leads nothing."""
    with serve(robot, port=0) as viewer:
        controller = viewer.add_controller()
        teleop = Teleop(Tracker(robot, acceleration_limit=4.0), clutch=True)
        steps, sessions = list[TeleopStep](), list[Session]()

        def act(step: TeleopStep) -> bool:
            steps.append(step)
            viewer.follow(step)
            return True

        leader = threading.Thread(target=lambda: sessions.append(lead(teleop, controller, act=act)))
        leader.start()
        with showing(viewer, tmp_path) as tab:
            tab.ask("Emulation.setFocusEmulationEnabled", enabled=True)
            client = next(iter(viewer.server.get_clients().values()))
            eye, start = client.camera.position.copy(), teleop.tool.translation
            letter = {"key": "w", "code": "KeyW", "windowsVirtualKeyCode": ord("W")}
            tab.ask("Input.dispatchKeyEvent", type="keyDown", text="w", **letter)
            assert until(lambda: teleop.tool.translation[0] - start[0] > 0.03)
            tab.ask("Input.dispatchKeyEvent", type="keyUp", **letter)
            np.testing.assert_allclose(client.camera.position, eye, atol=1e-6)
            tab.value(PAD % "[0, 0, 0, -1]")
            assert until(lambda: steps[-1].status.name == "FOLLOWING" and abs(steps[-1].v).max() > 0.0)
            tab.value(PAD % "[0, 0, 0, 0]")
            tab.press("G")
            tab.ask("Emulation.setFocusEmulationEnabled", enabled=False)
            tab.value("document.hasFocus = () => false; 1")
            assert until(lambda: steps[-1].status.name == "NO_INPUT")
            time.sleep(0.1)
            tab.click("End")
        leader.join(timeout=60.0)
        (session,) = sessions
        assert session.within_limits
        assert abs(steps[-1].v).max() < 1e-4
