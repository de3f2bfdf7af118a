"""Write examples/targets.csv: 200 poses the arm reaches and 6 it does not. The random numbers are fixed.

python examples/make_targets.py
"""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

import jacokin
from jacokin.arrays import Array
from jacokin.model import quat_wxyz

REACHABLE = 200
RANDOM_SEED = 20
FOLDED_ELBOW = (-0.3, 0.3)  # [rad] joint_3, whose lower limit is 0.33
FILE = Path(__file__).parent / "targets.csv"


def make_targets() -> list[list[str]]:
    robot = jacokin.load_robot()
    rng = np.random.default_rng(RANDOM_SEED)
    rows = [_row(robot, q, "reachable") for q in robot.sample(rng, REACHABLE)]
    rows += [_row(robot, q, "outside the limits") for q in _folded(robot, rng, 3)]
    far = ((1.6, 0.2, 0.4), (0.0, 0.0, -1.2), (0.2, -0.1, 1.9))  # [m]
    return rows + [_text(position, (1.0, 0.0, 0.0, 0.0), "out of reach") for position in far]


def _folded(robot: jacokin.Robot, rng: np.random.Generator, count: int) -> list[Array]:
    """Configurations with a folded elbow whose pose no other branch reaches within the limits either."""
    solver = jacokin.IKSolver(robot, collision="ignore")
    found: list[Array] = []
    while len(found) < count:
        q = robot.sample(rng)
        q[robot.joint_index("joint_3")] = rng.uniform(*FOLDED_ELBOW)
        if not len(solver.solve_all(robot.forward_kinematics(q)).q_within_limits):
            found.append(q)
    return found


def _row(robot: jacokin.Robot, q: Array, note: str) -> list[str]:
    pose = robot.forward_kinematics(q)
    return _text(pose.translation, quat_wxyz(pose.rotation), note)


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
