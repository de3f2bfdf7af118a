"""What is solved for: frame, tool, contact and clearance, as controls."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import viser

from jacokin.arrays import Array
from jacokin.model import checks, poses
from jacokin.model.robot import Robot
from jacokin.viewer.browser.controls import Post, from_client, set_value
from jacokin.viewer.setup import COLLISION, Setup

Three = tuple[float, float, float]


class Solving:
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
        for control in (self._frame, self._collision):
            control.on_update(from_client(post, "setup"))
        for vector in (self._position, self._rpy):
            vector.on_update(from_client(post, "setup"))
        self._obstacles.on_update(from_client(post, "setup"))
        self._clearance.on_update(from_client(post, "setup"))

    def show(self, setup: Setup) -> None:
        """Bring the controls to what is in force."""
        tool = pin.SE3.Identity() if setup.tool is None else setup.tool
        set_value(self._frame, setup.frame)
        set_value(self._position, _three(tool.translation))
        set_value(self._rpy, _three(np.degrees(pin.rpy.matrixToRpy(tool.rotation))))
        self._shown = _three(self._position.value), _three(self._rpy.value)
        set_value(self._collision, setup.collision)
        set_value(self._obstacles, setup.obstacles)
        set_value(self._clearance, setup.clearance)

    def wanted(self, setup: Setup) -> Setup:
        """What the controls say. A tool that was not touched stays exactly as it is; the rest is as a client sent it.

        Raises:
            InvalidInputError: the numbers of the tool are none.
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
