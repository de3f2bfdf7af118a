"""Write examples/targets.csv: 200 poses the arm reaches and 6 it does not. The random numbers are fixed.

python examples/make_targets.py
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

import jacokin
from jacokin.model import poses

REACHABLE = 200
RANDOM_SEED = 20
FOLDED_ELBOW = (0.10, 0.20, 0.30)  # [rad] joint_3, whose lower limit is 0.33
FILE = Path(__file__).parent / "targets.csv"


def make_targets() -> list[list[str]]:
    robot = jacokin.load_robot()
    rng = np.random.default_rng(RANDOM_SEED)
    rows = [_row(robot, q, "reachable") for q in robot.sample(rng, REACHABLE)]
    for angle in FOLDED_ELBOW:
        q = robot.home.copy()
        q[robot.joint_index("joint_3")] = angle
        rows.append(_row(robot, q, "outside the limits"))
    far = ((1.6, 0.2, 0.4), (0.0, 0.0, -1.2), (0.2, -0.1, 1.9))  # [m]
    return rows + [_text(position, (1.0, 0.0, 0.0, 0.0), "out of reach") for position in far]


def _row(robot: jacokin.Robot, q: np.ndarray[tuple[int, ...], np.dtype[np.float64]], note: str) -> list[str]:
    pose = robot.forward_kinematics(q)
    return _text(pose.translation, poses.quat_wxyz(pose.rotation), note)


def _text(position: object, quat_wxyz: object, note: str) -> list[str]:
    numbers = np.concatenate([np.asarray(position, dtype=float), np.asarray(quat_wxyz, dtype=float)])
    return [*(f"{value:.17g}" for value in numbers), note]


def main() -> None:
    with FILE.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["x", "y", "z", "qw", "qx", "qy", "qz", "note"])
        writer.writerows(make_targets())


if __name__ == "__main__":
    main()
