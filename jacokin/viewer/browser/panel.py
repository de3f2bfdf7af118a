"""The panel beside the scene: status, branches, joints, and text to paste."""

from __future__ import annotations

import html

import viser

from jacokin.ik.preferences import PREFERENCES
from jacokin.viewer import texts
from jacokin.viewer.browser.building import BuildingControls
from jacokin.viewer.browser.controls import (
    FreeControls,
    JointControls,
    PlayerControls,
    Post,
    SliceControls,
    SolverControls,
    TargetControls,
    set_value,
    watch,
)
from jacokin.viewer.contents import Contents
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.view import View

# Labels that can be read, numbers that are not cut, and on narrow windows the panel below the scene and not over it.
STYLE = """<style>
:root[data-mantine-color-scheme="light"] { --mantine-color-dimmed: #495057; }
[data-mantine-color-scheme="light"] :is(.mantine-Slider-markLabel, .multi-slider-mark-label) { color: #495057; }
.mantine-Button-root:not(:disabled) { background-color: #1864ab; }
.mantine-Flex-root > .mantine-NumberInput-root .mantine-NumberInput-input { padding: 0 1.1em 0 0.2em !important; }
.mantine-Slider-root + .mantine-NumberInput-root .mantine-NumberInput-input { padding: 0 0.3em !important; }
@media (max-width: 36em) {
  #root div:has(> .mantine-Paper-root > * > .mantine-ScrollArea-root) { flex-direction: column; }
  .mantine-Paper-root:has(> * > .mantine-ScrollArea-root) {
    position: static !important; flex: none; width: 100% !important; max-height: 45% !important;
  }
  .mantine-ScrollArea-content > div { width: 100% !important; }
}
</style>"""


class Panel:
    """Controls that all pages share. What a client does is posted as the name of a control; its value is read later."""

    def __init__(self, server: viser.ViserServer, inspector: Inspector, post: Post, contents: Contents) -> None:
        """Add the controls.

        Args:
            server: viser's.
            inspector: of the robot.
            post: called from any thread with what was moved: "branch", "next", "previous", "ghosts", "datasheet",
                "ellipsoid", "visuals", "degrees", "track", "prefer", "typed", "axis", "range", "angle", "setup",
                "slice", "joints", "go", "start", "python", "command", or a name of `BuildingControls` or of the player.
            contents: what there is to show beside the arm.
        """
        self._inspector = inspector
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        gui.main_panel.dock_right()  # beside the scene, not over the arm
        gui.add_html(STYLE)
        self._status = gui.add_html("")
        self._branch = gui.add_slider("Branch", 1, 2, 1, 1, hint="N and P: the next and the previous one")
        watch(post, "branch", self._branch)
        gui.add_command("Next branch", hotkey="N").on_trigger(lambda _: post("next"))
        gui.add_command("Previous branch", hotkey="P").on_trigger(lambda _: post("previous"))
        gui.add_command("Go, or stop", hotkey="G").on_trigger(lambda _: post("go"))
        self._ghosts = gui.add_checkbox("Ghosts", True, hint="Draw the other branches, and the start")
        watch(post, "ghosts", self._ghosts)
        self._ellipsoid = gui.add_checkbox("Manipulability", False, hint="Draw how fast the tool can move each way")
        watch(post, "ellipsoid", self._ellipsoid)
        self._datasheet = None
        if inspector.robot.calibration is not None:
            self._datasheet = gui.add_checkbox(
                "Datasheet", True, hint="Draw the arm as its description has it, in pink"
            )
            watch(post, "datasheet", self._datasheet)
            self._away = gui.add_html("")
        self._visuals = gui.add_checkbox(
            "Visual meshes",
            contents.dressed and contents.visuals is not None,
            disabled=contents.visuals is None,
            hint="Draw what the file shows instead of the shapes that collide",
        )
        watch(post, "visuals", self._visuals)
        self._degrees = gui.add_checkbox("Degrees", False, hint="Joints and their margins in degrees, not radians")
        watch(post, "degrees", self._degrees)
        if contents.note:
            gui.add_html(f'<div style="font-size:0.8em;padding:0 0.75em">{html.escape(contents.note)}</div>')
        self._track = gui.add_checkbox("Track", False, hint="Follow the gizmo at 100 Hz within the velocity limits")
        watch(post, "track", self._track)
        self._go = gui.add_button("Go", hint="G: move from the start to what is shown, around what is in the way")
        self._go.on_click(lambda _: post("go"))
        gui.add_button("Start here", hint="Motions begin where the arm is shown").on_click(lambda _: post("start"))
        self._prefer = gui.add_dropdown("Prefer", PREFERENCES, initial_value=inspector.prefer, hint="Which branch")
        watch(post, "prefer", self._prefer)
        self.target = TargetControls(gui, post)
        self.free = FreeControls(gui, inspector, post, contents.axis, contents.span)
        self.solving = SolverControls(gui, inspector.robot, contents.setup, post)
        self.building = BuildingControls(server, contents.setup.scene, post)
        self.slicing = None if contents.slices is None else SliceControls(server, contents.slices, post)
        playback = contents.playback
        if playback is not None:
            gui.add_command("Play, or pause", hotkey="space").on_trigger(lambda _: post("play"))
        self.player = None if playback is None else PlayerControls(gui, inspector.robot, playback, post)
        self.joints = JointControls(gui, inspector.robot, post)
        with gui.add_folder("Copy", expand_by_default=False):
            gui.add_button("As Python").on_click(lambda _: post("python"))
            gui.add_button("As command line").on_click(lambda _: post("command"))
            self._text = gui.add_text("Text", "", multiline=True)

    def show(self, view: View) -> None:
        """Bring every control to a view."""
        self._status.content = texts.status_html(self._inspector, view, degrees=bool(self._degrees.value))
        if self._datasheet is not None:
            line = html.escape(texts.datasheet(self._inspector, view))
            self._away.content = f'<div style="font-size:0.8em;padding:0 0.75em">{line}</div>'
        count = len(view.branches)
        self._branch.visible = count > 1
        self._branch.max = max(count, 2)
        if view.selected is not None:
            set_value(self._branch, view.selected + 1)
        self.target.show(view.gizmo)
        self.free.show(view.free)
        self.joints.show(view.q)

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
    def datasheet(self) -> bool:
        """Whether the described arm is to be drawn beside a calibrated one."""
        return self._datasheet is not None and bool(self._datasheet.value)

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

    def change_unit(self) -> None:
        """Have the sliders of the joints in the unit that is asked for; `show` sets them."""
        self.joints.change_unit("deg" if self._degrees.value else "rad")

    def show_going(self, going: bool) -> None:
        """Offer to stop a motion, or to begin one."""
        self._go.label = "Stop" if going else "Go"

    def stop_tracking(self) -> None:
        """Untick "Track"."""
        set_value(self._track, False)
