"""The panel beside the scene: status, branches, joints, text to paste, and obstacles that pages add.

A hand that leads the arm uses the keys and the gamepad of a page, a clutch, and buttons.
"""

from __future__ import annotations

import html
import json
import math
from pathlib import Path
from typing import NamedTuple
from urllib.parse import parse_qs

import numpy as np
import viser

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik.preferences import PREFERENCES
from jacokin.model import checks
from jacokin.model.obstacles import Box, Cylinder, Obstacle, Sphere
from jacokin.model.scene import Scene
from jacokin.teleop import Controller, TeleopStatus, TeleopStep
from jacokin.teleop.devices import CLUTCH_KEY, COMMAND_KEYS, FINGER_KEYS, KEYS
from jacokin.viewer import texts
from jacokin.viewer.browser.controls import (
    FreeControls,
    JointControls,
    PlayerControls,
    Post,
    SliceControls,
    SolverControls,
    TargetControls,
    posting,
    set_value,
    watch,
)
from jacokin.viewer.browser.server import OWN_HEADER, Server
from jacokin.viewer.contents import Contents
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.view import View

LINE = '<div style="font-size:0.8em;padding:0 0.75em">'
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
                "commanded", "ellipsoid", "visuals", "degrees", "track", "prefer", "typed", "axis", "range", "angle",
                "setup", "slice", "joints", "go", "start", "python", "command", or a name of `BuildingControls` or of
                the player.
            contents: what there is to show beside the arm.
        """
        self._inspector = inspector
        gui = server.gui
        gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        gui.main_panel.dock_right()  # beside the scene, not over the arm
        gui.add_html(STYLE)
        playback = contents.playback
        if playback is not None:
            gui.add_command("Play, or pause", hotkey="space").on_trigger(posting(post, "play"))
        self.player = None if playback is None else PlayerControls(gui, inspector.robot, playback, post)
        self._status = gui.add_html("")
        self._branch = gui.add_slider("Branch", 1, 2, 1, 1, hint="N and P: the next and the previous one")
        watch(post, "branch", self._branch)
        gui.add_command("Next branch", hotkey="N").on_trigger(posting(post, "next"))
        gui.add_command("Previous branch", hotkey="P").on_trigger(posting(post, "previous"))
        gui.add_command("Go, or stop", hotkey="G").on_trigger(posting(post, "go"))
        self._boxes: dict[str, viser.GuiCheckboxHandle] = {}

        def add_box(name: str, label: str, is_ticked: bool, hint: str, *, disabled: bool = False) -> None:
            self._boxes[name] = gui.add_checkbox(label, is_ticked, hint=hint, disabled=disabled)
            watch(post, name, self._boxes[name])

        add_box("ghosts", "Ghosts", playback is None, "Draw the other branches, and the start")
        add_box("ellipsoid", "Manipulability", False, "Draw how fast the tool can move each way")
        if inspector.robot.calibration is not None:
            add_box("datasheet", "Datasheet", True, "Draw the arm as its description has it, in pink")
            self._away = gui.add_html("")
        if playback is not None and len(playback.commanded_t):
            add_box("commanded", "Commanded", True, "Draw where the arm was to be, in green")
        has_visuals = contents.visuals is not None
        hint = "Draw what the file shows instead of the shapes that collide"
        add_box("visuals", "Visual meshes", contents.dressed and has_visuals, hint, disabled=not has_visuals)
        add_box("degrees", "Degrees", False, "Joints and their margins in degrees, not radians")
        if contents.note:
            gui.add_html(f"{LINE}{html.escape(contents.note)}</div>")
        add_box("track", "Track", False, "Follow the gizmo at 100 Hz within the velocity limits")
        self._go = gui.add_button("Go", hint="G: move from the start to what is shown, around what is in the way")
        self._go.on_click(posting(post, "go"))
        gui.add_button("Start here", hint="Motions begin where the arm is shown").on_click(posting(post, "start"))
        self._prefer = gui.add_dropdown("Prefer", PREFERENCES, initial_value=inspector.prefer, hint="Which branch")
        watch(post, "prefer", self._prefer)
        self.target = TargetControls(gui, post)
        self.free = FreeControls(gui, inspector, post, contents.axis, contents.span)
        self.solving = SolverControls(gui, inspector.robot, contents.setup, post)
        self.building = BuildingControls(server, contents.setup.scene, post)
        self.slicing = None if contents.slices is None else SliceControls(server, contents.slices, post)
        self.joints = JointControls(gui, inspector.robot, post)
        with gui.add_folder("Copy", expand_by_default=False):
            gui.add_button("As Python").on_click(posting(post, "python"))
            gui.add_button("As command line").on_click(posting(post, "command"))
            self._text = gui.add_text("Text", "", multiline=True)

    def show(self, view: View) -> None:
        """Bring every control to a view."""
        self._status.content = texts.status_html(self._inspector, view, degrees=self.wants("degrees"))
        if "datasheet" in self._boxes:
            line = html.escape(texts.datasheet(self._inspector, view))
            self._away.content = f"{LINE}{line}</div>"
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

    def wants(self, name: str) -> bool:
        """Whether a checkbox, by the name that it posts, is there and ticked."""
        return name in self._boxes and bool(self._boxes[name].value)

    @property
    def prefer(self) -> str:
        """Which branch is preferred; the nearest for what is not in the list."""
        return self._prefer.value if self._prefer.value in PREFERENCES else PREFERENCES[0]

    def change_unit(self) -> None:
        """Have the sliders of the joints in the unit that is asked for; `show` sets them."""
        self.joints.change_unit("deg" if self.wants("degrees") else "rad")

    def show_going(self, going: bool) -> None:
        """Offer to stop a motion, or to begin one."""
        self._go.label = "Stop" if going else "Go"

    def stop_tracking(self) -> None:
        """Untick "Track"."""
        set_value(self._boxes["track"], False)


KINDS = ("box", "cylinder", "sphere")
SIZE = (0.12, 0.12, 0.12)  # [m]
PLACE = (0.3, -0.3, 0.06)  # [m] of one that is added without the mouse
FARTHEST = 1.5  # [m] from the base, of a click on the floor
MOST = 20  # obstacles of a page
ADD, WAITING = "Add by a click", "Click on the floor"
GIZMO = "/obstacle"
NONE = "none"


class Placed(NamedTuple):
    """An obstacle of the page."""

    kind: str
    """One of `KINDS`."""
    size: Array
    """(3,) edges [m]; a cylinder is as wide as the first and as high as the last, a sphere as wide as the first."""
    place: Array
    """(3,) of its centre in the base [m]."""

    def obstacle(self, name: str) -> Obstacle:
        """The obstacle as a solver takes it.

        Raises:
            InvalidInputError: a size that is not positive, or numbers that are not finite.
        """
        width, _, height = self.size
        if self.kind == "box":
            return Box(name, self.size, self.place)
        if self.kind == "cylinder":
            return Cylinder(name, 0.5 * width, height, self.place)
        return Sphere(name, 0.5 * width, self.place)


class BuildingControls:
    """The folder "Add obstacles" of the panel. They stand upright, beside those of the scene that was given."""

    def __init__(self, server: viser.ViserServer, given: Scene | None, post: Post) -> None:
        """Add the controls, which post "add", "clicked", "pick", "shape", "moved" and "remove"."""
        self._given = Scene() if given is None else given
        self._placed: dict[str, Placed] = {}
        self._chosen: str | None = None
        self._count = 0
        self._waiting = False
        self._ray: tuple[Array, Array] | None = None
        gui = server.gui
        with gui.add_folder("Add obstacles", expand_by_default=False):
            self._by_click = gui.add_button(ADD, hint="Then click on the floor, where it is to stand")
            self._add = gui.add_button("Add in front", hint="Without the mouse; then type where it stands")
            self._pick = gui.add_dropdown("Obstacle", (NONE,), initial_value=NONE, hint="The one that is changed")
            self._kind = gui.add_dropdown("Kind", KINDS, initial_value=KINDS[0])
            self._size = gui.add_vector3("Size [m]", SIZE, step=0.01, hint="x, y, z; of what is round width and height")
            self._place = gui.add_vector3("Place [m]", PLACE, step=0.01, hint="Of its middle: x, y, z in the base")
            self._remove = gui.add_button("Remove", disabled=True)
        self._gizmo = server.scene.add_transform_controls(
            GIZMO, scale=0.12, depth_test=False, disable_rotations=True, visible=False
        )
        self._by_click.on_click(lambda _: self._wait(not self._waiting))
        self._add.on_click(posting(post, "add"))
        self._remove.on_click(posting(post, "remove"))
        watch(post, "pick", self._pick)
        watch(post, "shape", self._kind, self._size, self._place)

        self._gizmo.on_update(posting(post, "moved"))

        @server.scene.on_click()
        def _(event: viser.SceneClickEvent) -> None:
            if self._waiting:
                self._ray = np.array(event.ray_origin), np.array(event.ray_direction)
                post("clicked")

    def change(self, names: dict[str, int]) -> Scene | None:
        """Answer what a page did.

        Args:
            names: what was posted.

        Returns:
            Every obstacle, those that were given first; None where there are none.

        Raises:
            InvalidInputError: a click beside the floor, a size that is not positive, numbers that are not finite, or
                too many obstacles; nothing has changed then.
        """
        before = dict(self._placed), self._chosen
        try:
            self._answer(names)
            scene = self._given.adding(*(each.obstacle(name) for name, each in self._placed.items()))
        except InvalidInputError:
            self._placed, self._chosen = before
            raise
        finally:
            self._show()
        return scene if len(scene) or scene.attached else None

    def _answer(self, names: dict[str, int]) -> None:
        if "clicked" in names and self._ray is not None:
            self._wait(False)
            place = on_floor(*self._ray)
            size = self._typed()
            height = size[0] if self._kind.value == "sphere" else size[2]
            self._insert(Placed(self._checked_kind(), size, place + np.array([0.0, 0.0, 0.5 * height])))
        elif "add" in names:
            self._insert(Placed(self._checked_kind(), self._typed(), np.array(PLACE)))
        elif "pick" in names:
            self._chosen = self._pick.value if self._pick.value in self._placed else None
        elif self._chosen is None:
            return
        elif "remove" in names:
            del self._placed[self._chosen]
            self._chosen = next(reversed(self._placed), None)
        elif "moved" in names:
            place = checks.vector("obstacle", np.array(self._gizmo.position), 3, "m")
            self._placed[self._chosen] = self._placed[self._chosen]._replace(place=place)
        else:
            place = checks.vector("obstacle", self._place.value, 3, "m")
            self._placed[self._chosen] = Placed(self._checked_kind(), self._typed(), place)

    def _insert(self, new: Placed) -> None:
        if len(self._placed) >= MOST:
            raise InvalidInputError(f"a page adds {MOST} obstacles at most; remove one first")
        self._count += 1
        self._chosen = f"added_{self._count}"
        self._placed[self._chosen] = new

    def _checked_kind(self) -> str:
        return checks.choice("kind", self._kind.value, KINDS)

    def _typed(self) -> Array:
        return checks.positive_vector("size", self._size.value, 3, "m")

    def _wait(self, waiting: bool) -> None:
        """Take the next click in the scene for a place, or no longer."""
        self._waiting = waiting
        self._by_click.label = WAITING if waiting else ADD

    def _show(self) -> None:
        """Bring the controls to what there is."""
        options = (NONE, *self._placed)
        if tuple(self._pick.options) != options:
            self._pick.options = options
        set_value(self._pick, self._chosen or NONE)
        self._remove.disabled = self._chosen is None
        self._gizmo.visible = self._chosen is not None
        if self._chosen is not None:
            kind, size, place = self._placed[self._chosen]
            set_value(self._kind, kind)
            set_value(self._size, _rounded(size))
            set_value(self._place, _rounded(place))
            self._gizmo.position = place


def on_floor(origin: Array, direction: Array) -> Array:
    """(3,) where a ray from `origin` in `direction` (3,) meets the floor, z = 0 [m].

    Raises:
        InvalidInputError: it does not, or far from the arm, or numbers are not finite.
    """
    origin, direction = checks.vector("click", origin, 3, "m"), checks.vector("click", direction, 3, "m")
    length = -origin[2] / direction[2] if direction[2] * origin[2] < 0.0 else math.inf
    place = origin + length * direction if math.isfinite(length) else np.full(3, math.inf)
    if not np.linalg.norm(place) <= FARTHEST:
        raise InvalidInputError(f"click on the floor, at most {FARTHEST} m from the arm's base")
    return np.array([place[0], place[1], 0.0])


def _rounded(values: Array) -> tuple[float, float, float]:
    x, y, z = (round(float(value), 4) for value in values)
    return x, y, z


HAND_PATH = "/hand"
REPORT_PERIOD = 40  # [ms] from one report of the page to the next
MOST_REPORTED = 2000  # characters of a report
HAND_HELP = f"""{LINE}
Click into the scene, then hold keys: w s, a d, r f move along x, y, z; j l, i k, u o turn about them;
g and h close and open the fingers; the space bar works the clutch. Where episodes are recorded, b begins one, e ends
it, y keeps it, x throws it away. A gamepad is read as soon as one of its buttons was
pressed. Only a page in front leads.</div>"""

HAND_SCRIPT = "/hand.js"  # beside this file; every page loads it
HAND_MARK = {
    "keys": sorted({*KEYS, *FINGER_KEYS, *COMMAND_KEYS, CLUTCH_KEY}),
    "path": HAND_PATH,
    "header": OWN_HEADER,
    "period": REPORT_PERIOD,
}


def read_hand_script() -> str:
    """The script of pages that lead."""
    return Path(__file__).with_name("hand.js").read_text(encoding="utf-8")


class HandControls:
    """The folder "Hand" of the panel, and what its page reports to a controller."""

    def __init__(self, server: Server, controller: Controller) -> None:
        """Add the controls; from now on pages lead."""
        gui, self._controller = server.gui, controller
        self._folder = gui.add_folder("Hand", order=-1.0)
        with self._folder:
            self._line = gui.add_html("")
            gui.add_button("Clutch", hint="Follow the hand, or stay").on_click(lambda _: controller.toggle())
            gui.add_button("End", hint="Brake, and end the session").on_click(self._end)
            gui.add_html(HAND_HELP)
            gui.add_html(f'<div data-jacokin-hand="{html.escape(json.dumps(HAND_MARK))}"></div>')
        server.listen(HAND_PATH, self._hear)

    def show(self, step: TeleopStep) -> None:
        """Say what a tick did."""
        said = step.status.name.replace("_", " ").capitalize()
        if step.status is not TeleopStatus.FOLLOWING:
            said += f": {step.message or step.status.value}"
        self._line.content = f"{LINE}{html.escape(said)}</div>"

    def remove(self) -> None:
        """Take the controls away."""
        self._folder.remove()

    def _end(self, event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
        self._controller.ended = True

    def _hear(self, query: str) -> None:
        """Take a report of a page.

        Raises:
            InvalidInputError: it is malformed.
        """
        if len(query) > MOST_REPORTED:
            raise InvalidInputError(
                f"a report of a page must have at most {MOST_REPORTED} characters, got {len(query)}"
            )
        given = parse_qs(query)
        keys, axes, buttons = (" ".join(given.get(name, [])).split() for name in ("keys", "axes", "buttons"))
        self._controller.report(keys, _report_numbers("axes", axes), _report_numbers("buttons", buttons))


def _report_numbers(name: str, words: list[str]) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError:
        raise InvalidInputError(f"{name} must be numbers, got {checks.shown(words)}") from None
