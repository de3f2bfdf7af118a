"""Target poses with a fixed generator, or from a CSV file."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.ik import read_targets

VERTICAL = 1e-13  # [rad] tilt left when a tool counts as vertical; also [m] of the shoulder from axis 5
DIFFERENCE = 1e-7  # [rad] step of difference quotients
NEWTON_STEPS = 30
DAMPING = 1e-9  # far below the square of any lever the wrist has


@dataclass(frozen=True, slots=True)
class Targets:
    """Poses to reach, and where known the configuration they were made from."""

    name: str
    poses: Array
    """(n, 4, 4)"""
    generating: Array
    """(n, dof) [rad]; NaN where not known."""


def random_configurations(robot: Robot, rng: np.random.Generator, size: int) -> Targets:
    """Poses of configurations drawn uniformly within the limits."""
    q = robot.sample(rng, size)
    return Targets("random configurations", np.array([robot.forward_kinematics(row).homogeneous for row in q]), q)


def vertical_tool(robot: Robot, rng: np.random.Generator, size: int, *, up: bool = False) -> Targets:
    """Reachable poses whose tool axis points straight down, or up: what a gripper over a table is asked for.

    Random configurations within the limits are turned by Newton's method until the tool stands vertically. At these
    poses axes of the wrist are parallel to axis 1 in some of the branches, so general methods lose solutions there.
    """
    direction = 1.0 if up else -1.0
    configurations: list[Array] = []
    poses: list[Array] = []
    while len(poses) < size:
        q = _upright(robot, robot.sample(rng), direction)
        if q is None:
            continue
        pose = robot.forward_kinematics(q)
        yaw = np.arctan2(pose.rotation[1, 0], pose.rotation[0, 0])
        cos, sin, z = np.cos(yaw), np.sin(yaw), direction
        exact = np.eye(4)
        exact[:3, :3] = [[cos, -z * sin, 0.0], [sin, z * cos, 0.0], [0.0, 0.0, z]]
        exact[:3, 3] = pose.translation
        configurations.append(q)
        poses.append(exact)
    return Targets(f"tool {'up' if up else 'down'}", np.array(poses), np.array(configurations))


def _upright(robot: Robot, q: Array, direction: float) -> Array | None:
    """A configuration within the limits near `q` with a vertical tool, or None."""
    for _ in range(NEWTON_STEPS):
        rotation = robot.forward_kinematics(q).rotation
        axis = rotation[:, 2]
        sine = np.hypot(axis[0], axis[1])
        if sine < VERTICAL and axis[2] * direction > 0.0:
            return q
        # The turn that brings the axis to the vertical, about its own x and y: turning about itself is free.
        turn = np.array([axis[1], -axis[0]]) * direction * np.arctan2(sine, axis[2] * direction) / sine
        rows = rotation[:, :2].T @ robot.jacobian(q)[3:]
        step = rows.T @ np.linalg.solve(rows @ rows.T + DAMPING * np.eye(2), rotation[:2, :2].T @ turn)
        q = np.clip(q + step * min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-12)), robot.lower, robot.upper)
    return None


def structured(robot: Robot, rng: np.random.Generator, size: int) -> Targets:
    """Reachable poses where eliminating joint angles degenerates: tool vertical, shoulder on axis 5, both in turn.

    The shoulder is the point where axes 1 and 2 meet. Random configurations within the limits are moved by Newton's
    method until the conditions hold to rounding.
    """
    configurations: list[Array] = []
    while len(configurations) < size:
        kind = len(configurations) % 3
        q = _meeting(robot, robot.sample(rng), vertical=kind != 1, shoulder=kind != 0)
        if q is not None:
            configurations.append(q)
    poses = [robot.forward_kinematics(q).homogeneous for q in configurations]
    return Targets("tool vertical, shoulder on axis 5, or both", np.array(poses), np.array(configurations))


def _meeting(robot: Robot, q: Array, *, vertical: bool, shoulder: bool) -> Array | None:
    """A configuration within the limits near `q` that meets the conditions, or None."""
    model, data, frame = robot.pin_model, robot.pin_model.createData(), robot.frame_id()
    pin.forwardKinematics(model, data, q)
    axis = data.oMi[1].rotation[:, 2].copy()
    base = data.oMi[1].translation.copy()
    point = base + ((data.oMi[2].translation - base) @ axis) * axis

    def misses(q: Array) -> Array:
        pin.framesForwardKinematics(model, data, q)
        values = list(data.oMf[frame].rotation[:2, 2]) if vertical else []
        return np.array(values + (list(data.oMi[5].actInv(point)[:2]) if shoulder else []))

    for _ in range(NEWTON_STEPS):
        here = misses(q)
        if np.abs(here).max() < VERTICAL:
            return q
        slopes = np.column_stack([(misses(q + DIFFERENCE * unit) - here) / DIFFERENCE for unit in np.eye(robot.dof)])
        step = -slopes.T @ np.linalg.solve(slopes @ slopes.T + DAMPING * np.eye(len(here)), here)
        q = np.clip(q + step * min(1.0, 0.3 / max(float(np.abs(step).max()), 1e-12)), robot.lower, robot.upper)
    return None


def from_csv(path: Path) -> Targets:
    """Poses of a file that `jacokin.ik.read_targets` reads, and optionally q1, q2, ... [rad].

    Raises:
        InvalidInputError: the file cannot be read, or has no orientations.
    """
    targets = read_targets(path)
    if targets.targets.ndim != 3:
        raise InvalidInputError(f"{path}: orientations are missing, columns qw, qx, qy, qz or roll, pitch, yaw")
    with path.open(newline="", encoding="utf-8-sig") as file:
        rows = [row for row in csv.DictReader(file, skipinitialspace=True) if any(row.values())]
    joints = [name for name in (rows[0] if rows else ()) if name.startswith("q") and name[1:].isdigit()]
    known = [[float(row[name]) for name in joints] for row in rows]
    return Targets(path.stem, targets.targets, np.array(known, dtype=np.float64).reshape(len(rows), len(joints)))
