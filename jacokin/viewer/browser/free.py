"""Controls of a free parameter: the axis that the tool may turn about, from where to where, and the value itself."""

from __future__ import annotations

import math

import viser

from jacokin.viewer.browser.controls import Post, from_client, set_value
from jacokin.viewer.inspector import FULL_TURN, Inspector
from jacokin.viewer.texts import wrapped
from jacokin.viewer.view import Free

AXES: tuple[str, ...] = ("none", "x", "y", "z")
NARROWEST = 1.0  # [deg] of a range
STEP = 0.5  # [deg]


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
        seven = inspector.solver.has_families
        self._span = span
        chosen = AXES[0] if axis is None else AXES[axis + 1]
        self._axis = gui.add_dropdown(
            "Free axis", AXES, initial_value=chosen, disabled=seven, hint="The tool may turn about this axis of its own"
        )
        self._axis.on_update(from_client(post, "axis"))
        low, high = (min(max(math.degrees(end), -180.0), 180.0) for end in span)
        self._range = gui.add_multi_slider(
            "Range [deg]", -180.0, 180.0, STEP, (low, high), min_range=NARROWEST, disabled=axis is None
        )
        self._range.on_update(from_client(post, "range"))
        self._shown = (low, high)
        label = f"{inspector.robot.joint_names[2]}, free [deg]" if seven else "Angle [deg]"
        self._value = gui.add_slider(label, -180.0, 180.0, STEP, 0.0, disabled=True)
        self._value.on_update(from_client(post, "angle"))

    @property
    def axis(self) -> int | None:
        """0, 1 or 2; None for none, and for what is not in the list."""
        return AXES.index(self._axis.value) - 1 if self._axis.value in AXES[1:] else None

    @property
    def span(self) -> tuple[float, float]:
        """Least and largest angle [rad]; what a client sent that is no range goes back to what was there."""
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
            set_value(self._value, min(max(math.degrees(wrapped(free.value)), -180.0), 180.0))
