"""What one move of the gizmo costs the viewer's server: every branch, and the messages that show them.

python -m benchmarks.viewer [--moves N]

Processor time of the thread that answers, which is what delays the picture; sending and drawing are up to the browser.
"""

from __future__ import annotations

import argparse
import time

import numpy as np

import jacokin
from benchmarks import report
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.model import quat_wxyz
from jacokin.viewer import Viewer, ViewerOptions, serve
from jacokin.viewer.browser.controls import set_value

MOVES = 1000
STEP = 0.01  # [m] of a move in each direction
RADIUS = 0.25  # [m] the gizmo stays this near to where it began
ALLOWED = 2e-3  # [s] of one move
SLICE = "slice of the map"
SETS = ("free axis", "seven joints")  # members of curves, of which there are more than branches
CASES: tuple[tuple[str, str, str, str | None], ...] = (  # robot, what is shown, contact, free axis
    ("j2n6s300", "", "ignore", None),
    ("j2n6s300", SLICE, "ignore", None),
    ("j2n6s300", "contact", "report", None),
    ("j2s6s300", "", "ignore", None),
    ("j2n6s300", SETS[0], "ignore", "z"),
    ("j2s7s300", SETS[1], "ignore", None),
)


def walk(robot: Robot, moves: int) -> list[Array]:
    """Positions (3,) of a gizmo that wanders about the tool at home [m]."""
    rng = np.random.default_rng(8)
    start = robot.forward_kinematics(robot.home).translation
    positions = [start]
    while len(positions) <= moves:
        position = positions[-1] + rng.uniform(-STEP, STEP, 3)
        if np.linalg.norm(position - start) < RADIUS:
            positions.append(position)
    return positions[1:]


def slice_shown(viewer: Viewer) -> None:
    """Let the page show a slice of the map."""
    slicing = viewer._panel.slicing
    assert slicing is not None
    set_value(slicing._show, True)
    viewer._act({"slice": 1})
    assert slicing._node.visible


def measured(viewer: Viewer, robot: Robot, moves: int) -> tuple[Array, Array]:
    """Processor time of each move [s], and how many branches it had."""
    wxyz = quat_wxyz(robot.forward_kinematics(robot.home).rotation)
    seconds, branches = [], []
    for position in walk(robot, moves):
        viewer._stage.gizmo.position = position
        viewer._stage.gizmo.wxyz = wxyz
        begin = time.thread_time()
        viewer._act({"target": 1})
        seconds.append(time.thread_time() - begin)
        branches.append(len(viewer.view.branches))
    return np.array(seconds), np.array(branches, dtype=np.float64)


def main(moves: int = MOVES) -> float:
    """Print a table; the largest median of a move [s]."""
    rows, worst = [], 0.0
    for name, shown, collision, axis in CASES:
        robot = jacokin.load_robot(name)
        with serve(robot, ViewerOptions(collision=collision, free_axis=axis), port=0) as viewer:
            if shown == SLICE:
                slice_shown(viewer)
            measured(viewer, robot, min(moves, 20))
            seconds, branches = measured(viewer, robot, moves)
        median = float(np.median(seconds))
        if shown not in SETS:
            worst = max(worst, median)
        slow = float(np.quantile(seconds, 0.99))
        rows.append((name, shown, f"{branches.mean():.1f}", report.seconds(median), report.seconds(slow)))
    print(report.table(("robot", "with", "branches", "median", "99 %"), rows))
    print(f"allowed for all branches of a pose: {report.seconds(ALLOWED)}")
    return worst


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moves", type=int, default=MOVES)
    slowest = main(parser.parse_args().moves)
    if slowest > ALLOWED:
        raise SystemExit(f"a move takes {report.seconds(slowest)} in the median; {report.seconds(ALLOWED)} are allowed")
