"""The panel beside the scene: status, branches, joints, and text to paste."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np
import viser

from jacokin.arrays import Array
from jacokin.viewer import texts
from jacokin.viewer.view import Inspector, View

Post = Callable[[str], None]


class FromClient(Protocol):
    """What viser tells a callback."""

    @property
    def client(self) -> object:
        """Who moved the control; None when the viewer did."""


Value = TypeVar("Value")

STEP = 0.001  # [rad] or [m] of a joint's slider
ONE_SIDED = 2.0 * math.pi  # how far a slider goes where a joint has no limit


class Panel:
    """Controls that every page shares. What a client does is posted as the name of a control; values are read later."""

    def __init__(self, server: viser.ViserServer, inspector: Inspector, post: Post) -> None:
        """Add the controls.

        Args:
            server: viser's.
            inspector: of the robot.
            post: called from any thread with "branch", "joints", "next", "previous", "ghosts", "python" or "command".
        """
        self._inspector = inspector
        self._post = post
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        self._status = gui.add_html("")
        self._branch = gui.add_slider("Branch", 1, 2, 1, 1, hint="N and P: the next and the previous one")
        self._branch.on_update(self._from_client("branch"))
        gui.add_command("Next branch", hotkey="N").on_trigger(lambda _: post("next"))
        gui.add_command("Previous branch", hotkey="P").on_trigger(lambda _: post("previous"))
        self._ghosts = gui.add_checkbox("Ghosts", True, hint="Draw the other branches")
        self._ghosts.on_update(self._from_client("ghosts"))
        self._shown = np.zeros(inspector.robot.dof)  # values the sliders were last set to
        with gui.add_folder("Joints"):
            self._joints = [self._add_joint(gui, joint) for joint in range(inspector.robot.dof)]
        with gui.add_folder("Copy", expand_by_default=False):
            gui.add_button("As Python").on_click(lambda _: post("python"))
            gui.add_button("As command line").on_click(lambda _: post("command"))
            self._text = gui.add_text("Text", "", multiline=True)

    def show(self, view: View) -> None:
        """Bring every control to a view."""
        self._status.content = texts.status_html(self._inspector, view)
        count = len(view.branches)
        self._branch.disabled = count < 2
        self._branch.max = max(count, 2)
        if view.selected is not None:
            _set(self._branch, view.selected + 1)
        for joint, slider in enumerate(self._joints):
            value = float(view.q[joint])
            if self._inspector.robot.unlimited[joint] and not self._inspector.robot.sliding[joint]:
                value = texts.wrapped(value)
            value = min(max(value, slider.min), slider.max)
            _set(slider, value)
            self._shown[joint] = value

    def say(self, text: str) -> None:
        """Text to paste."""
        _set(self._text, text)

    @property
    def branch(self) -> int:
        """Number of the branch that the slider is at, from 0; as a client sent it."""
        return int(self._branch.value) - 1

    @property
    def ghosts(self) -> bool:
        """Whether ghosts are to be drawn."""
        return bool(self._ghosts.value)

    def joints(self, q: Array) -> Array:
        """(dof,) what the sliders say; a joint whose slider was not moved stays exactly where `q` has it."""
        wanted = np.array(q)
        robot = self._inspector.robot
        for joint, slider in enumerate(self._joints):
            value = float(slider.value)
            if value == self._shown[joint]:
                continue
            turns = robot.unlimited[joint] and not robot.sliding[joint]
            wanted[joint] = q[joint] + texts.wrapped(value - q[joint]) if turns and math.isfinite(value) else value
        return wanted

    def _add_joint(self, gui: viser.GuiApi, joint: int) -> viser.GuiSliderHandle[float]:
        robot = self._inspector.robot
        low, high = float(robot.lower[joint]), float(robot.upper[joint])
        if robot.unlimited[joint]:
            low, high = (-1.0, 1.0) if robot.sliding[joint] else (-math.pi, math.pi)
        low = high - ONE_SIDED if math.isinf(low) else low
        high = low + ONE_SIDED if math.isinf(high) else high
        slider = gui.add_slider(robot.joint_names[joint], low, high, STEP, low, disabled=not low < high)
        slider.on_update(self._from_client("joints"))
        self._shown[joint] = low
        return slider

    def _from_client(self, name: str) -> Callable[[FromClient], None]:
        """A callback that posts what clients do, and not what the viewer sets itself."""

        def updated(event: FromClient) -> None:
            if event.client is not None:
                self._post(name)

        return updated


def _set(control: viser.GuiInputHandle[Value], value: Value) -> None:
    """Bring a control to a value on every page."""
    control.value = value  # type: ignore[misc]  # viser's setter stands behind another method, where mypy misses it
