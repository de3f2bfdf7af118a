"""The panel beside the scene: status, branches, joints, and text to paste."""

from __future__ import annotations

import html
import math

import numpy as np
import viser

from jacokin.arrays import Array
from jacokin.ik.preferences import PREFERENCES
from jacokin.viewer import texts
from jacokin.viewer.browser.controls import (
    FreeControls,
    PlayerControls,
    Post,
    SliceControls,
    SolverControls,
    set_value,
    watch,
)
from jacokin.viewer.contents import Contents
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.view import View

STEP = 0.001  # [rad] or [m] of a joint's slider
ONE_SIDED = 2.0 * math.pi  # how far a slider goes where a joint has no limit


class Panel:
    """Controls that all pages share. What a client does is posted as the name of a control; its value is read later."""

    def __init__(self, server: viser.ViserServer, inspector: Inspector, post: Post, contents: Contents) -> None:
        """Add the controls.

        Args:
            server: viser's.
            inspector: of the robot.
            post: called from any thread with the name of what was moved: "branch", "next", "previous", "ghosts",
                "ellipsoid", "visuals", "track", "prefer", "axis", "range", "angle", "setup", "slice", "joints",
                "python", "command", or a name of the player.
            contents: what there is to show beside the arm.
        """
        self._inspector = inspector
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        self._status = gui.add_html("")
        self._branch = gui.add_slider("Branch", 1, 2, 1, 1, hint="N and P: the next and the previous one")
        watch(post, "branch", self._branch)
        gui.add_command("Next branch", hotkey="N").on_trigger(lambda _: post("next"))
        gui.add_command("Previous branch", hotkey="P").on_trigger(lambda _: post("previous"))
        self._ghosts = gui.add_checkbox("Ghosts", True, hint="Draw the other branches")
        watch(post, "ghosts", self._ghosts)
        self._ellipsoid = gui.add_checkbox("Manipulability", False, hint="Draw how fast the tool can move each way")
        watch(post, "ellipsoid", self._ellipsoid)
        self._visuals = gui.add_checkbox(
            "Visual meshes",
            contents.dressed and contents.visuals is not None,
            disabled=contents.visuals is None,
            hint="Draw what the file shows instead of the shapes that collide",
        )
        watch(post, "visuals", self._visuals)
        if contents.note:
            gui.add_html(f'<div style="font-size:0.8em;padding:0 0.75em">{html.escape(contents.note)}</div>')
        self._track = gui.add_checkbox("Track", False, hint="Follow the gizmo at 100 Hz within the velocity limits")
        watch(post, "track", self._track)
        self._prefer = gui.add_dropdown("Prefer", PREFERENCES, initial_value=inspector.prefer, hint="Which branch")
        watch(post, "prefer", self._prefer)
        self.free = FreeControls(gui, inspector, post, contents.axis, contents.span)
        self.solving = SolverControls(gui, inspector.robot, contents.setup, post)
        self.slicing = None if contents.slices is None else SliceControls(server, contents.slices, post)
        playback = contents.playback
        self.player = None if playback is None else PlayerControls(gui, inspector.robot, playback, post)
        self._shown = np.zeros(inspector.robot.dof)  # values the sliders were last set to
        with gui.add_folder("Joints"):
            self._joints = [self._add_joint(gui, joint, post) for joint in range(inspector.robot.dof)]
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
            set_value(self._branch, view.selected + 1)
        self.free.show(view.free)
        for joint, slider in enumerate(self._joints):
            value = float(view.q[joint])
            if self._inspector.robot.unlimited[joint] and not self._inspector.robot.sliding[joint]:
                value = texts.wrap(value)
            value = min(max(value, slider.min), slider.max)
            set_value(slider, value)
            self._shown[joint] = value

    def say(self, text: str) -> None:
        """Show a text to paste."""
        set_value(self._text, text)

    @property
    def branch(self) -> int:
        """Number of the branch that the slider is at, from 0, as a client sent it."""
        return int(self._branch.value) - 1

    @property
    def ghosts(self) -> bool:
        """Whether ghosts are to be drawn."""
        return bool(self._ghosts.value)

    @property
    def ellipsoid(self) -> bool:
        """Whether the ellipsoid of manipulability is to be drawn."""
        return bool(self._ellipsoid.value)

    @property
    def track(self) -> bool:
        """Whether a tracker is to follow the gizmo."""
        return bool(self._track.value)

    @property
    def prefer(self) -> str:
        """Which branch is preferred; the nearest for what is not in the list."""
        return self._prefer.value if self._prefer.value in PREFERENCES else PREFERENCES[0]

    @property
    def visuals(self) -> bool:
        """Whether the visual meshes are to be drawn."""
        return bool(self._visuals.value)

    def stop_tracking(self) -> None:
        """Untick "Track"."""
        set_value(self._track, False)

    def joints(self, q: Array) -> Array:
        """(dof,) what the sliders say; a joint whose slider was not moved stays exactly where `q` has it."""
        wanted = np.array(q)
        robot = self._inspector.robot
        for joint, slider in enumerate(self._joints):
            value = float(slider.value)
            if value == self._shown[joint]:
                continue
            turns = robot.unlimited[joint] and not robot.sliding[joint]
            wanted[joint] = q[joint] + texts.wrap(value - q[joint]) if turns and math.isfinite(value) else value
        return wanted

    def _add_joint(self, gui: viser.GuiApi, joint: int, post: Post) -> viser.GuiSliderHandle[float]:
        robot = self._inspector.robot
        low, high = float(robot.lower[joint]), float(robot.upper[joint])
        if robot.unlimited[joint]:
            low, high = (-1.0, 1.0) if robot.sliding[joint] else (-math.pi, math.pi)
        low = high - ONE_SIDED if math.isinf(low) else low
        high = low + ONE_SIDED if math.isinf(high) else high
        slider = gui.add_slider(robot.joint_names[joint], low, high, STEP, low, disabled=not low < high)
        watch(post, "joints", slider)
        self._shown[joint] = low
        return slider
