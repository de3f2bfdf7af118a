"""Groups of controls of the panel: target, joints, free axis or joint, the solver, a trajectory, slices of a map."""

from __future__ import annotations

import math
from collections.abc import Callable, Coroutine
from typing import Any, Literal, TypeVar

import numpy as np
import pinocchio as pin
import viser
from viser import uplot

from jacokin.arrays import Array
from jacokin.ik.options import COLLISION
from jacokin.model import checks, poses
from jacokin.model.robot import Robot, unit_of
from jacokin.viewer import texts
from jacokin.viewer.contents import COLOURS, SPEEDS, MapSlices, Playback, Setup
from jacokin.viewer.drawing import Triangles
from jacokin.viewer.inspector import FULL_TURN, Inspector
from jacokin.viewer.view import Free

AXES: tuple[str, ...] = ("none", "x", "y", "z")
NARROWEST = 1.0  # [deg] of a range
STEP = 0.5  # [deg]
MOST_POINTS = 1000  # of a plot
ONE_SIDED = 2.0 * math.pi  # how far a slider goes where a joint has no limit
TARGET_DIGITS = 4, 2  # [m] and [deg]
ALIKE = 2e-4  # entries of two rotations whose angles agree to those digits

Post = Callable[[str], None]
Three = tuple[float, float, float]
Value = TypeVar("Value")


def watch(post: Post, name: str, *controls: viser.GuiInputHandle[Any]) -> None:  # Any: whatever their values
    """Post a name when a client moves one of some controls, and not when the viewer sets one itself."""

    async def moved(event: viser.GuiEvent[Any]) -> None:  # a coroutine, as in `posting`
        if event.client is not None:
            post(name)

    for control in controls:
        control.on_update(moved)


def posting(post: Post, name: str) -> Callable[[object], Coroutine[None, None, None]]:
    """A callback that posts a name.

    A coroutine: viser awaits it before the page's next message, so that names are posted in the order of what was done.
    Plain functions run in threads of their own, and of two messages the second may be answered first.
    """

    async def answer(event: object) -> None:
        post(name)

    return answer


def set_value(control: viser.GuiInputHandle[Value], value: Value) -> None:
    """Bring a control to a value on every page."""
    control.value = value  # type: ignore[misc]  # viser's setter stands behind another method, where mypy misses it


class TargetControls:
    """The folder "Target" of the panel: where the gizmo is, in numbers."""

    def __init__(self, gui: viser.GuiApi, post: Post) -> None:
        """Add the controls, which post "typed"."""
        with gui.add_folder("Target"):
            self._position = gui.add_vector3("x, y, z [m]", (0.0, 0.0, 0.0), step=0.001, hint="Position in the base")
            self._rpy = gui.add_vector3("Roll, pitch, yaw [deg]", (0.0, 0.0, 0.0), step=0.1, hint="R = Rz Ry Rx")
        self._position.precision, self._rpy.precision = TARGET_DIGITS
        self._shown = self._position.value
        watch(post, "typed", self._position, self._rpy)

    def show(self, target: pin.SE3) -> None:
        """Bring the numbers to a pose; angles that say the same rotation in another way stay as they were typed."""
        digits, digits_deg = TARGET_DIGITS
        self._shown = _three(np.round(target.translation, digits) + 0.0)  # without -0
        set_value(self._position, self._shown)
        if not self._says(target):
            set_value(self._rpy, _three(np.round(np.degrees(pin.rpy.matrixToRpy(target.rotation)), digits_deg) + 0.0))

    def wanted(self, target: pin.SE3) -> pin.SE3:
        """What the numbers say, as a client sent them; a number that was not changed leaves `target` exactly as it is.

        Raises:
            InvalidInputError: they are not finite.
        """
        position = checks.vector("target", self._position.value, 3, "m")
        rpy = checks.vector("target", self._rpy.value, 3, "deg")
        kept = position == np.array(self._shown)
        rotation = target.rotation if self._says(target) else poses.rotation_from_rpy(np.radians(rpy))
        return pin.SE3(rotation, np.where(kept, target.translation, position))

    def _says(self, target: pin.SE3) -> bool:
        """Whether the angles are those of a pose, to their digits."""
        rotation = pin.rpy.rpyToMatrix(np.radians(self._rpy.value))
        return bool(np.abs(rotation - target.rotation).max() < ALIKE)


class JointControls:
    """The folder "Joints" of the panel, in radians or degrees."""

    def __init__(self, gui: viser.GuiApi, robot: Robot, post: Post) -> None:
        """Add the sliders, which post "joints"."""
        self._gui, self._robot, self._post = gui, robot, post
        self._folder = gui.add_folder("Joints")
        self._sliders: list[viser.GuiSliderHandle[float]] = []
        self.change_unit("rad")

    def change_unit(self, unit: str) -> None:
        """Have sliders in "rad" or "deg", new ones: what a page sends of the old ones is then of no effect."""
        for slider in self._sliders:
            slider.remove()
        sliding = self._robot.sliding
        # A box has room for six characters; what slides has millimetres.
        self._digits = np.where(sliding, 3, {"rad": 3, "deg": 1}[unit]).tolist()
        self._scale = np.where(sliding, 1.0, math.degrees(1.0) if unit == "deg" else 1.0)
        self._shown = np.zeros(self._robot.dof)  # values the sliders were last set to
        self._folder.label = f"Joints [{unit}]"
        with self._folder:
            self._sliders = [self._add(joint) for joint in range(self._robot.dof)]

    def show(self, q: Array) -> None:
        """Bring the sliders to joint values (dof,)."""
        for joint, slider in enumerate(self._sliders):
            value = texts.wrap(float(q[joint])) if self._turns(joint) else float(q[joint])
            value = round(value * float(self._scale[joint]), self._digits[joint])
            self._shown[joint] = min(max(value, slider.min), slider.max)
            set_value(slider, float(self._shown[joint]))

    def wanted(self, q: Array) -> Array:
        """(dof,) what the sliders say; a joint whose slider was not moved stays exactly where `q` has it."""
        wanted = np.array(q)
        for joint, slider in enumerate(self._sliders):
            if slider.value == self._shown[joint]:
                continue
            value = float(slider.value) / float(self._scale[joint])
            turns = self._turns(joint) and math.isfinite(value)
            wanted[joint] = q[joint] + texts.wrap(value - q[joint]) if turns else value
        return wanted

    def _turns(self, joint: int) -> bool:
        """Whether a joint turns without end."""
        return bool(self._robot.unlimited[joint] and not self._robot.sliding[joint])

    def _add(self, joint: int) -> viser.GuiSliderHandle[float]:
        robot, digits = self._robot, self._digits[joint]
        low, high = float(robot.lower[joint]), float(robot.upper[joint])
        if robot.unlimited[joint]:
            low, high = (-1.0, 1.0) if robot.sliding[joint] else (-math.pi, math.pi)
        low = high - ONE_SIDED if math.isinf(low) else low
        high = low + ONE_SIDED if math.isinf(high) else high
        fixed, steps = not low < high, float(self._scale[joint]) * 10**digits
        # The ends are outside the limits by less than a step, and a joint that is sent there goes to its limit.
        low, high = (
            round(math.floor(low * steps) / 10**digits, digits),
            round(math.ceil(high * steps) / 10**digits, digits),
        )
        slider = self._gui.add_slider(robot.joint_names[joint], low, high, 10.0**-digits, low, disabled=fixed)
        watch(self._post, "joints", slider)
        self._shown[joint] = low
        return slider


class FreeControls:
    """An axis to choose, its range and its angle; for a seven-joint arm its free joint."""

    def __init__(
        self, gui: viser.GuiApi, inspector: Inspector, post: Post, axis: int | None, span: tuple[float, float]
    ) -> None:
        """Add the controls, which post "axis", "range" and "angle".

        Args:
            gui: viser's.
            inspector: of the robot.
            post: as for the panel.
            axis: 0, 1 or 2 of the tool to begin with, or None.
            span: least and largest angle to begin with [rad].
        """
        curves = inspector.solver.dimension() == 1
        self._span = span
        chosen = AXES[0] if axis is None else AXES[axis + 1]
        self._axis = gui.add_dropdown(
            "Free axis",
            AXES,
            initial_value=chosen,
            disabled=curves,
            hint="The tool may turn about this axis of its own",
        )
        low, high = (min(max(math.degrees(end), -180.0), 180.0) for end in span)
        self._range = gui.add_multi_slider(
            "Range [deg]", -180.0, 180.0, STEP, (low, high), min_range=NARROWEST, disabled=axis is None
        )
        self._shown = (low, high)
        label = f"{inspector.solver.parameter}, free [deg]" if curves else "Angle [deg]"
        self._value = gui.add_slider(label, -180.0, 180.0, STEP, 0.0, disabled=True)
        for name, control in (("axis", self._axis), ("range", self._range), ("angle", self._value)):
            watch(post, name, control)

    @property
    def axis(self) -> int | None:
        """0, 1 or 2; None for none, and for what is not in the list."""
        return AXES.index(self._axis.value) - 1 if self._axis.value in AXES[1:] else None

    @property
    def span(self) -> tuple[float, float]:
        """Least and largest angle [rad]; an invalid range that a client sent is put back to the one before."""
        sent = self._range.value
        try:
            low, high = (float(end) for end in sent)
        except (TypeError, ValueError):
            low, high = math.nan, math.nan
        if not -180.0 <= low < high <= 180.0:
            if self._range.value is sent:  # and not something newer
                set_value(self._range, self._shown)
        elif (low, high) != self._shown:  # what was given stays exact until somebody moves it
            self._shown = (low, high)
            self._span = FULL_TURN if (low, high) == (-180.0, 180.0) else (math.radians(low), math.radians(high))
        return self._span

    @property
    def value(self) -> float:
        """The angle or the joint [rad], as a client sent it."""
        return math.radians(float(self._value.value))

    def show(self, free: Free | None) -> None:
        """Bring the value to a view's."""
        self._value.disabled = free is None
        self._range.disabled = free is None or free.axis is None
        if free is not None:
            set_value(self._value, min(max(math.degrees(texts.wrap(free.value)), -180.0), 180.0))


class SolverControls:
    """The folder "Solver" of the panel."""

    def __init__(self, gui: viser.GuiApi, robot: Robot, setup: Setup, post: Post) -> None:
        """Add the controls, which post "setup"."""
        moved = [name for name in robot.frames if robot.pin_model.frames[robot.frame_id(name)].parentJoint]
        with gui.add_folder("Solver", expand_by_default=False):
            self._frame = gui.add_dropdown("Frame", moved, initial_value=setup.frame, hint="What goes to the target")
            self._position = gui.add_vector3("Tool [m]", (0.0, 0.0, 0.0), step=0.001, hint="After the frame: x, y, z")
            self._rpy = gui.add_vector3("Tool [deg]", (0.0, 0.0, 0.0), step=0.1, hint="Roll, pitch, yaw")
            self._collision = gui.add_dropdown("Contact", COLLISION, initial_value=setup.collision)
            self._obstacles = gui.add_checkbox(
                "Obstacles", setup.obstacles, disabled=setup.scene is None, hint="They are there, and count as contact"
            )
            self._clearance = gui.add_number("Clearance [m]", setup.clearance, min=0.0, step=0.001)
        self._shown: tuple[Three, Three] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
        self.show(setup)
        controls = (self._frame, self._position, self._rpy, self._collision, self._obstacles, self._clearance)
        watch(post, "setup", *controls)

    def show(self, setup: Setup) -> None:
        """Bring the controls to what is in force."""
        tool = pin.SE3.Identity() if setup.tool is None else setup.tool
        set_value(self._frame, setup.frame)
        set_value(self._position, _three(tool.translation))
        set_value(self._rpy, _three(np.degrees(pin.rpy.matrixToRpy(tool.rotation))))
        self._shown = _three(self._position.value), _three(self._rpy.value)
        set_value(self._collision, setup.collision)
        set_value(self._obstacles, setup.obstacles)
        self._obstacles.disabled = setup.scene is None
        set_value(self._clearance, setup.clearance)

    def wanted(self, setup: Setup) -> Setup:
        """What the controls say. A tool that was not touched stays exactly as it is; the rest is as a client sent it.

        Raises:
            InvalidInputError: the tool is not made of finite numbers.
        """
        position = checks.vector("tool", self._position.value, 3, "m")
        rpy = checks.vector("tool", self._rpy.value, 3, "deg")
        tool = setup.tool
        if (_three(position), _three(rpy)) != self._shown:
            tool = pin.SE3(poses.rotation_from_rpy(np.radians(rpy)), position)
        return Setup(
            frame=self._frame.value,
            tool=tool,
            collision=self._collision.value,
            scene=setup.scene,
            obstacles=bool(self._obstacles.value),
            clearance=self._clearance.value,
        )


def _three(values: Array | Three) -> Three:
    x, y, z = (float(value) for value in values)
    return x, y, z


class PlayerControls:
    """The folder "Trajectory" of the panel."""

    def __init__(self, gui: viser.GuiApi, robot: Robot, playback: Playback, post: Post) -> None:
        """Add the controls, which post "play", "time" and "speed"."""
        self.playback = playback
        with gui.add_folder("Trajectory"):
            self._play = gui.add_button("Play")
            self._play.on_click(posting(post, "play"))
            end = max(math.ceil(1e3 * playback.duration), 1) / 1e3  # in whole steps, so that the box shows no more
            self._time = gui.add_slider("Time [s]", 0.0, end, 0.001, 0.0)
            watch(post, "time", self._time)
            self._speed = gui.add_slider("Speed", SPEEDS[0], SPEEDS[1], 0.1, 1.0)
            watch(post, "speed", self._speed)
            with gui.add_folder("Joints over time", expand_by_default=False):
                for joint in range(robot.dof):
                    _plot(gui, robot, playback, joint)

    @property
    def time(self) -> float:
        """Where the slider is [s], as a client sent it."""
        return float(self._time.value)

    @property
    def speed(self) -> float:
        """The value of the slider, as a client sent it."""
        return float(self._speed.value)

    def show(self) -> None:
        """Bring the controls to where the trajectory is."""
        self._play.label = "Pause" if self.playback.playing else "Play"
        set_value(self._time, min(self.playback.time, self._time.max))


def _plot(gui: viser.GuiApi, robot: Robot, playback: Playback, joint: int) -> None:
    """A joint over time, with its limits as lines where it has any."""
    rows = playback.rows(MOST_POINTS)
    lines = [(f"{robot.joint_names[joint]} [{unit_of(robot, joint)}]", playback.q[rows, joint], "#1c7ed6")]
    if len(playback.commanded_t):
        commanded = np.interp(playback.t[rows], playback.commanded_t, playback.commanded_q[:, joint])
        lines.append(("commanded", commanded, "#12b886"))
    for name, limit in (("lower", robot.lower[joint]), ("upper", robot.upper[joint])):
        if np.isfinite(limit):
            lines.append((name, np.full(len(rows), limit), "#e03131"))
    series: list[uplot.Series] = [{"label": "t [s]"}]
    series += [{"label": label, "stroke": colour, "width": 1.0} for label, _, colour in lines]
    gui.add_uplot(
        (playback.t[rows], *(values for _, values, _ in lines)),
        tuple(series),
        scales={"x": {"time": False}},
        height=110,  # [pixel]
    )


def add_batch(
    scene: viser.SceneApi,
    name: str,
    mesh: Triangles,
    *,
    opacity: float,
    wireframe: bool = False,
    flat_shading: bool = False,
    side: Literal["front", "double"] = "front",
) -> viser.BatchedMeshHandle:
    """Meshes of one shape that are seen through, out of sight until they are placed and coloured."""
    return scene.add_batched_meshes_simple(
        name,
        mesh.vertices,
        mesh.faces,
        batched_wxyzs=np.array([[1.0, 0.0, 0.0, 0.0]]),
        batched_positions=np.zeros((1, 3)),
        batched_colors=np.zeros((1, 3), dtype=np.uint8),
        opacity=opacity,
        wireframe=wireframe,
        lod="off",
        flat_shading=flat_shading,
        side=side,
        cast_shadow=False,
        receive_shadow=False,
        visible=False,
    )


class SliceControls:
    """The folder "Reachability map" of the panel, and what it draws."""

    def __init__(self, server: viser.ViserServer, slices: MapSlices, post: Post) -> None:
        """Add the controls, which post "slice"; nothing is drawn before they are used."""
        self._slices = slices
        self._drawn: int | None = None
        gui, heights = server.gui, slices.heights
        with gui.add_folder("Reachability map", expand_by_default=False):
            self._show = gui.add_checkbox("Slice", False, hint="Where the tool gets to, at one height")
            low, high = round(float(heights[0]), 3), round(float(heights[-1]), 3)
            step = round(float(heights[1] - heights[0]), 3) if len(heights) > 1 else 1.0
            middle = round(float(heights[slices.layer(0.5 * (low + high))]), 3)
            self._height = gui.add_slider("Height [m]", low, max(high, low + step), step, middle)
            watch(post, "slice", self._show, self._height)
            stops = ",".join(f"rgb({red},{green},{blue})" for red, green, blue in COLOURS.tolist())
            gui.add_html(
                f'<div style="font-size:0.8em;padding:0 0.75em">0 to 1: {slices.caption}'
                f'<div style="height:8px;background:linear-gradient(to right,{stops})"></div></div>'
            )
        self._node = add_batch(server.scene, "/map", slices.square(), opacity=0.55, side="double")

    def show(self) -> None:
        """Draw the slice that the controls ask for, whatever a client sent."""
        height = float(self._height.value)
        layer = self._slices.layer(height) if np.isfinite(height) else 0
        cells = self._slices.cells(layer)
        if len(cells.positions) and layer != self._drawn:
            quats = np.zeros((len(cells.positions), 4), dtype=np.float32)
            quats[:, 0] = 1.0
            self._node.batched_positions = cells.positions
            self._node.batched_wxyzs = quats
            self._node.batched_colors = cells.colours
            self._drawn = layer
        self._node.visible = bool(self._show.value) and len(cells.positions) > 0
