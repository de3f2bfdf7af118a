"""Where episodes start, here and in dm_control: each quantity by Kolmogorov and Smirnov, and the entropy of branches.

python -m benchmarks.resets --resets 500          # about seven minutes; needs dm_control, which runs on MuJoCo 3.17
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

import jacokin
import jacokin.tasks

Array = NDArray[np.float64]

FIXED = 1e-4  # what varies by less is compared by its mean
JOINTS = 6
AT_REST = ("_vel", "velocity", "torque", "rmat")  # ends of the names of what is the same in every episode


@dataclass(frozen=True, slots=True, eq=False)
class Starts:
    """Initial states: samples (n,) by quantity, and the branch of the arm in each."""

    quantities: dict[str, Array]
    branches: list[tuple[bool, ...]]


@dataclass(frozen=True, slots=True)
class Comparison:
    """How far two samples of initial states agree."""

    least_p: float
    """The smallest p-value of all quantities, times their number (Bonferroni's correction)."""
    at: str
    """The quantity that has it."""
    count: int
    """How many quantities vary."""
    largest_difference: float
    """The largest difference of the means of those that do not [m or rad]."""
    entropies: tuple[float, float]
    """Of the branches [bit]."""


def starts(environment: Any, count: int) -> Starts:
    """Reset an environment of either side many times."""
    robot = jacokin.load_robot()
    rows: list[dict[str, float]] = []
    branches = []
    for _ in range(count):
        observation = environment.reset().observation
        q = np.array(environment.physics.data.qpos[:JOINTS])
        row = {f"joint {index + 1}": wrapped(angle) for index, angle in enumerate(q)}
        for key, value in observation.items():
            values = np.ravel(value)
            if key.endswith("orientation"):
                w, x, y, z = values
                row[f"{key} yaw"] = float(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))
            elif not key.endswith(("jaco_arm/joints_pos", *AT_REST)):
                row.update({f"{key} {index}": float(number) for index, number in enumerate(values)})
        rows.append(row)
        branches.append(branch(robot, q))
    return Starts({name: np.array([row[name] for row in rows]) for name in rows[0]}, branches)


def compare(one: Starts, other: Starts) -> Comparison:
    """Compare two samples.

    Raises:
        ValueError: of different quantities.
    """
    if list(one.quantities) != list(other.quantities):
        raise ValueError(f"{list(one.quantities)} and {list(other.quantities)} cannot be compared")
    p_values, difference = {}, 0.0
    for name, sample in one.quantities.items():
        pair = sample, other.quantities[name]
        if max(np.ptp(pair[0]), np.ptp(pair[1])) > FIXED:
            p_values[name] = float(stats.ks_2samp(*pair, method="asymp").pvalue)
        else:
            difference = max(difference, abs(float(pair[0].mean() - pair[1].mean())))
    at = min(p_values, key=lambda name: p_values[name])
    count = len(p_values)
    bits = entropy(one.branches), entropy(other.branches)
    return Comparison(min(1.0, p_values[at] * count), at, count, difference, bits)


def wrapped(angle: float) -> float:
    """The same angle in -pi..pi."""
    return float(np.arctan2(np.sin(angle), np.cos(angle)))


def branch(robot: jacokin.Robot, q: Array) -> tuple[bool, ...]:
    """Which way the arm faces its tool, the side of the elbow, and the turns of axes 4 and 5."""
    x, y, _ = robot.forward_kinematics(q, "pinchsite").translation
    facing = np.cos(q[0] - np.arctan2(y, x)) > 0.0
    return bool(facing), bool(q[2] % (2.0 * np.pi) > np.pi), bool(np.sin(q[3]) > 0.0), bool(np.sin(q[4]) > 0.0)


def entropy(labels: list[tuple[bool, ...]]) -> float:
    """Of the frequencies of labels [bit]."""
    shares = np.array(list(Counter(labels).values())) / len(labels)
    return float(-(shares * np.log2(shares)).sum())


def main() -> None:
    """Compare all tasks that dm_control has and print a table."""
    names = [name for name in jacokin.tasks.names("features") if not name.startswith(("reach_top", "reach_bottom"))]
    parser = argparse.ArgumentParser(prog="python -m benchmarks.resets", description=__doc__)
    parser.add_argument("names", nargs="*", default=names)
    parser.add_argument("--resets", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    warnings.simplefilter("ignore")  # GLFW without a display
    from dm_control import manipulation

    print("| task | quantities | smallest p, corrected | at | largest difference of the fixed | entropy there, here |")
    print("|---|---|---|---|---|---|")
    for name in options.names:
        reference = starts(manipulation.load(name, seed=options.seed), options.resets)
        found = compare(reference, starts(jacokin.tasks.load(name, seed=options.seed + 1), options.resets))
        print(
            f"| {name} | {found.count} | {found.least_p:.3f} | {found.at} | {found.largest_difference:.1e} "
            f"| {found.entropies[0]:.2f}, {found.entropies[1]:.2f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
