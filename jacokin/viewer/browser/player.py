"""Controls of a trajectory: play, time, speed, and a plot of each joint against its limits."""

from __future__ import annotations

import numpy as np
import viser
from viser import uplot

from jacokin.model.robot import Robot
from jacokin.viewer.browser.controls import Post, from_client, set_value
from jacokin.viewer.motion.playback import SPEEDS, Playback

MOST_POINTS = 1000  # of a plot
PLOT_HEIGHT = 110  # [pixel]


class Player:
    """The folder "Trajectory" of the panel."""

    def __init__(self, gui: viser.GuiApi, robot: Robot, playback: Playback, post: Post) -> None:
        """Add the controls, which post "play", "time" and "speed"."""
        self._playback = playback
        with gui.add_folder("Trajectory"):
            self._play = gui.add_button("Play")
            self._play.on_click(lambda _: post("play"))
            end = max(playback.duration, 1e-3)
            self._time = gui.add_slider("Time [s]", 0.0, end, min(0.001, end), 0.0)
            self._time.on_update(from_client(post, "time"))
            self._speed = gui.add_slider("Speed", SPEEDS[0], SPEEDS[1], 0.1, 1.0)
            self._speed.on_update(from_client(post, "speed"))
            with gui.add_folder("Joints over time", expand_by_default=False):
                for joint in range(robot.dof):
                    _plot(gui, robot, playback, joint)

    @property
    def time(self) -> float:
        """Where the slider is [s]; as a client sent it."""
        return float(self._time.value)

    @property
    def speed(self) -> float:
        """What the slider says; as a client sent it."""
        return float(self._speed.value)

    def show(self) -> None:
        """Bring the controls to where the trajectory is."""
        self._play.label = "Pause" if self._playback.playing else "Play"
        set_value(self._time, min(self._playback.time, self._time.max))


def _plot(gui: viser.GuiApi, robot: Robot, playback: Playback, joint: int) -> None:
    """A joint over time, with its limits as lines where it has any."""
    rows = np.unique(np.linspace(0, len(playback.t) - 1, min(len(playback.t), MOST_POINTS)).astype(int))
    unit = "m" if robot.sliding[joint] else "rad"
    lines = [(f"{robot.joint_names[joint]} [{unit}]", playback.q[rows, joint], "#1c7ed6")]
    for name, limit in (("lower", robot.lower[joint]), ("upper", robot.upper[joint])):
        if np.isfinite(limit):
            lines.append((name, np.full(len(rows), limit), "#e03131"))
    series: list[uplot.Series] = [{"label": "t [s]"}]
    series += [{"label": label, "stroke": colour, "width": 1.0} for label, _, colour in lines]
    gui.add_uplot(
        (playback.t[rows], *(values for _, values, _ in lines)),
        tuple(series),
        scales={"x": {"time": False}},
        height=PLOT_HEIGHT,
    )
