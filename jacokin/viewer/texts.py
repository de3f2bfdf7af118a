"""What a view says in words: the status, why a branch is out, and the joints with their margins."""

from __future__ import annotations

import html
import math

import numpy as np

from jacokin.arrays import Array
from jacokin.ik.results import Status
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.view import Free, View

GREEN, RED, ORANGE, GREY = "#237032", "#c92a2a", "#a34700", "#495057"  # each readable on white
REACHED = 1e-5  # [m] and [rad] an error below this cannot be seen
RIGHT = "text-align:right;white-space:nowrap"


def headline(inspector: Inspector, view: View) -> str:
    """The status in one sentence, with the numbers of this view."""
    total, good = len(view.branches), int(view.feasible.sum())
    if view.note:
        return view.note
    if view.selected is not None:
        place = f"branch {view.selected + 1} of {total}"
        over = inspector.excess(view.q)
        if over:
            return f"{place} is outside the limits: {_joints(inspector, over)}"
        if view.arm_touching:
            return f"{place} is in contact: {_pairs(view.arm_touching)}"
        return f"Reached: {place}, {good} of them feasible"
    if view.arm_touching and max(view.errors) < REACHED:
        return f"Reached, in contact: {_pairs(view.arm_touching)}"
    if view.status is Status.OK:
        return "Reached" if not total else f"Reached, in a posture that is none of the {total} branches"
    return f"{_name(view.status)}: {view.message}"


def advice(view: View) -> str:
    """What to try, and how far away the closest configuration is; empty when the target is reached."""
    if view.status is Status.OK or view.note:
        return ""
    if view.selected is not None:
        return "Another branch is feasible." if view.feasible.any() else ""
    if view.pending:
        return f"{view.status.value}. Looking for the closest configuration."
    position, angle = view.errors
    if max(view.errors) < REACHED:
        return f"{view.status.value}."
    return (
        f"{view.status.value}. The arm shows the closest configuration found: {1e3 * position:.1f} mm and "
        f"{math.degrees(angle):.1f} deg from the target."
    )


def datasheet(inspector: Inspector, view: View) -> str:
    """How far the arm as its description has it puts the tool from where the calibrated one has it."""
    solver = inspector.solver
    described = inspector.robot.described.forward_kinematics(view.q, solver.frame)
    position, angle = inspector.errors(view.q, described if solver.tool is None else described * solver.tool)
    return f"The datasheet has the tool {1e3 * position:.1f} mm and {math.degrees(angle):.2f} deg away."


def reason(inspector: Inspector, view: View, branch: int) -> str:
    """Why a branch is not feasible; or its smallest margin."""
    over = inspector.excess(view.branches[branch])
    if over:
        return f"outside: {_joints(inspector, over)}"
    if view.touching is not None and view.touching[branch]:
        return f"touches: {_pairs(view.touching[branch], most=1)}"
    margins = view.margins[branch]
    joint = int(np.argmin(margins))
    if math.isinf(margins[joint]):
        return "no joint has limits"
    return f"margin {_amount(inspector, joint, float(margins[joint]))} at {inspector.robot.joint_names[joint]}"


def status_html(inspector: Inspector, view: View, *, degrees: bool = False) -> str:
    """Headline, advice, the list of branches, and a bar for each joint, in degrees or radians."""
    colour = {Status.OK: GREEN, Status.IN_COLLISION: ORANGE}.get(view.status, RED)
    lines = [f'<div style="color:{colour};font-weight:600">{html.escape(headline(inspector, view))}</div>']
    if words := advice(view):
        lines.append(f"<div>{html.escape(words[:1].upper() + words[1:])}</div>")
    if len(view.branches):
        # Of branches eight are seen, members of curves are scrolled.
        lines.append('<div style="max-height:14em;overflow-y:auto" tabindex="0"><table style="border-spacing:4px 0">')
        feasible = view.feasible
        for branch in range(len(view.branches)):
            shade = GREEN if feasible[branch] else (ORANGE if view.within[branch] else RED)
            mark = "&#9654;" if branch == view.selected else ""
            words = html.escape(reason(inspector, view, branch))
            lines.append(f'<tr><td>{mark}</td><td>{branch + 1}</td><td style="color:{shade}">{words}</td></tr>')
        lines.append("</table></div>")
    if view.free is not None:
        lines.append(intervals_html(view.free))
    lines.append(bars_html(inspector, view.q, degrees=degrees))
    return f'<div style="font-size:0.8em;padding:0 0.75em">{"".join(lines)}</div>'


def bars_html(inspector: Inspector, q: Array, *, degrees: bool = False) -> str:
    """The value of each joint, a bar from limit to limit with a mark there, and the margin to the nearer limit.

    A joint without limits has its angle within half a turn, and a bar of a full turn.
    """
    robot = inspector.robot
    unit = "deg" if degrees else "rad"
    rows = [
        f'<tr style="color:{GREY}"><td>joint</td><td style="{RIGHT}">[{unit}]</td><td></td>'
        f'<td style="{RIGHT}">margin to limit</td></tr>'
    ]
    for joint, margin in enumerate(inspector.margin(q).tolist()):
        low, high, value = float(robot.lower[joint]), float(robot.upper[joint]), float(q[joint])
        if math.isinf(margin):
            low, high, said, shade = -math.pi, math.pi, "no limits", GREY
            value = value if robot.sliding[joint] else wrap(value)
            share = (value - low) / (high - low)
        else:
            share = (value - low) / (high - low) if math.isfinite(high - low) and high > low else 0.5
            said = amount(inspector, joint, margin, degrees=degrees)
            shade = RED if margin < 0.0 else (ORANGE if margin < 0.1 * (high - low) else GREEN)
        left = 100.0 * min(max(share, 0.0), 1.0)
        rows.append(
            f"<tr><td>{html.escape(robot.joint_names[joint])}</td>"
            f'<td style="{RIGHT}">{amount(inspector, joint, value, degrees=degrees)}</td>'
            '<td style="width:45%"><div style="background:#dee2e6;height:8px;position:relative">'
            f'<div style="position:absolute;left:calc({left:.1f}% - 3px);width:6px;height:8px;background:{shade}">'
            f'</div></div></td><td style="color:{shade};{RIGHT}">{said}</td></tr>'
        )
    return f'<table style="width:100%;margin-top:4px">{"".join(rows)}</table>'


def intervals_html(free: Free) -> str:
    """A bar of a full turn: what is reached within the limits in green, and a mark where the arm is."""

    def share(angle: float) -> float:
        return 100.0 * (angle + math.pi) / (2.0 * math.pi)

    bars, words = [], []
    for start, stop in sorted(set(free.intervals)):
        words.append(f"{math.degrees(start):.1f} to {math.degrees(stop):.1f}")
        for turn in (-2.0 * math.pi, 0.0, 2.0 * math.pi):
            left, right = max(share(start + turn), 0.0), min(share(stop + turn), 100.0)
            if left < right:
                bars.append(
                    f'<div style="position:absolute;left:{left:.2f}%;width:{right - left:.2f}%;height:8px;'
                    f'background:{GREEN};opacity:0.6"></div>'
                )
    mark = share(wrap(free.value))
    said = "; ".join(dict.fromkeys(words)) if words else "none"  # branches may share an interval, but for rounding
    return (
        f"<div>{html.escape(free.name.capitalize())} within the limits [deg]: {said}</div>"
        '<div style="background:#dee2e6;height:8px;position:relative">'
        f'{"".join(bars)}<div style="position:absolute;left:calc({mark:.2f}% - 2px);width:4px;height:8px;'
        'background:#212529"></div></div>'
    )


def wrap(angle: float) -> float:
    """An angle [rad] by full turns into [-pi, pi]."""
    return math.remainder(angle, 2.0 * math.pi)


def amount(inspector: Inspector, joint: int, value: float, *, degrees: bool) -> str:
    """A value of a joint in the unit of the panel, which stands above it; that of a sliding joint with its own."""
    if inspector.robot.sliding[joint]:
        return f"{value:.4f} m"
    return f"{math.degrees(value):.1f}" if degrees else f"{value:.3f}"


def _name(status: Status) -> str:
    return status.name.replace("_", " ").capitalize()


def _amount(inspector: Inspector, joint: int, value: float) -> str:
    if inspector.robot.sliding[joint]:
        return f"{value:.4f} m"
    return f"{value:.3f} rad ({math.degrees(value):.1f} deg)"


def _joints(inspector: Inspector, over: list[tuple[str, float]]) -> str:
    robot = inspector.robot
    return ", ".join(f"{name} by {_amount(inspector, robot.joint_index(name), value)}" for name, value in over)


def _pairs(pairs: tuple[tuple[str, str], ...], most: int = 3) -> str:
    more = f", {len(pairs) - most} more" if len(pairs) > most else ""
    return ", ".join(f"{a} and {b}" for a, b in pairs[:most]) + more
