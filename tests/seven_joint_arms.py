"""Arms by other makers, mostly of seven joints, by the numbers that these publish: kinematics and limits."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from jacokin import Robot
from tests.robot_files import load_text, serial_urdf

HALF = 0.5 * math.pi
Placement = tuple[tuple[float, float, float], tuple[float, float, float]]

#: Placements of the joints (xyz [m], rpy [rad]), which turn about z, and of the tool after them.
PANDA: list[Placement] = [
    ((0.0, 0.0, 0.333), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, -0.316, 0.0), (HALF, 0.0, 0.0)),
    ((0.0825, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((-0.0825, 0.384, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((0.088, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.107), (0.0, 0.0, 0.0)),
]
IIWA: list[Placement] = [
    ((0.0, 0.0, 0.36), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, -0.42, 0.0), (HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((0.0, 0.4, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.126), (0.0, 0.0, 0.0)),
]
XARM7: list[Placement] = [
    ((0.0, 0.0, 0.267), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, -0.293, 0.0), (HALF, 0.0, 0.0)),
    ((0.0525, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((0.0775, -0.3425, 0.0), (HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (HALF, 0.0, 0.0)),
    ((0.076, 0.097, 0.0), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
]
GEN3: list[Placement] = [
    ((0.0, 0.0, 0.15643), (math.pi, 0.0, 0.0)),
    ((0.0, 0.005375, -0.12838), (HALF, 0.0, 0.0)),
    ((0.0, -0.21038, -0.006375), (-HALF, 0.0, 0.0)),
    ((0.0, 0.006375, -0.21038), (HALF, 0.0, 0.0)),
    ((0.0, -0.20843, -0.006375), (-HALF, 0.0, 0.0)),
    ((0.0, 0.00017505, -0.10593), (HALF, 0.0, 0.0)),
    ((0.0, -0.10593, -0.00017505), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, -0.0615250000000001), (math.pi, 0.0, 0.0)),
]
SAWYER: list[Placement] = [
    ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
    ((0.081, 0.0, 0.317), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.1925), (HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.4), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, -0.1685), (HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.4), (-HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.1363), (HALF, 0.0, 0.0)),
    ((0.0, 0.0, 0.13375), (0.0, 0.0, 0.0)),
]
#: Its file rounds right angles.
ROUNDED = 1.5708
RM75: list[Placement] = [
    ((0.0, 0.0, 0.2405), (0.0, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-ROUNDED, 0.0, 0.0)),
    ((0.0, -0.256, 0.0), (ROUNDED, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-ROUNDED, 0.0, 0.0)),
    ((0.0, -0.21, 0.0), (ROUNDED, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (-ROUNDED, 0.0, 0.0)),
    ((0.0, -0.144, 0.0), (ROUNDED, 0.0, 0.0)),
    ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0)),
]
#: Half of a range that is symmetric about zero [rad], both limits, or None for a joint without limits.
Limits = float | tuple[float, float] | None
ARMS: dict[str, tuple[list[Placement], list[Limits]]] = {
    "panda": (PANDA, [2.8973, 1.7628, 2.8973, (-3.0718, -0.0698), 2.8973, (-0.0175, 3.7525), 2.8973]),
    "iiwa14": (IIWA, [math.radians(degrees) for degrees in (170, 120, 170, 120, 170, 120, 175)]),
    "xarm7": (
        XARM7,
        [
            2 * math.pi,
            (-2.059, 2.0944),
            2 * math.pi,
            (-0.19198, 3.927),
            2 * math.pi,
            (-1.69297, math.pi),
            2 * math.pi,
        ],
    ),
    "gen3": (GEN3, [None, 2.41, None, 2.66, None, 2.23, None]),
    "rm75": (RM75, [3.1, 2.268, 3.1, 2.355, 3.1, 2.233, 6.28]),
    "sawyer": (SAWYER, [3.05, (-3.81, 2.27), 3.04, 3.04, 2.98, 2.98, 4.71]),
}


#: Of an iiwa14 whose joint 7 is on its limit, as along a whole curve of configurations at the same pose.
STRAIGHT = math.pi * np.array([0.0, -0.5, -0.75, 0.0, 0.0, 0.5, -175.0 / 180.0])


def load_arm(name: str, folder: Path) -> Robot:
    """One of the arms."""
    return load_placed(name, *ARMS[name], folder)


def load_placed(name: str, placements: list[Placement], limits: list[Limits], folder: Path) -> Robot:
    """An arm of so many joints from the placements of these and of the tool."""
    both = [(-limit, limit) if isinstance(limit, float) else limit for limit in limits]
    return load_text(
        folder / f"{name}.urdf", serial_urdf(placements, both, name=name), base="link_0", tip=f"link_{len(placements)}"
    )
