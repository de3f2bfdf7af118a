"""Arms of three to five joints: own configurations lost, and microseconds a target: `python -m benchmarks.few_joints`.

Configurations whose smallest singular value of the task is below 1e-3 are left out.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
import pinocchio as pin

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array

H = np.pi / 2
#: Joints by name: position [m], roll, pitch and yaw [rad] in the one before; all turn about z; then the tool.
ARMS: dict[str, list[tuple[float, ...]]] = {
    "SO-101": [
        (0, 0, 0.0624, 0, 0, 0), (0.03, 0, 0.054, -H, 0, 0), (0.028, -0.1126, 0, 0, 0, 0),
        (0.1349, 0.0052, 0, 0, 0, 0), (0.0611, 0, 0, -H, 0.0487, -H), (0, -0.008, 0.098, 0, 0, 0),
    ],
    "ViperX 300": [
        (0, 0, 0.079, 0, 0, 0), (0, 0, 0.048, -H, 0, 0), (0.06, -0.3, 0, 0, 0, 0),
        (0.3, 0, 0, 0, 0, 0), (0.065, 0, 0, 0, H, 0), (0, 0, 0.13, 0, 0, 0),
    ],
    "five with parallel axes": [
        (0, 0, 0.4, 0, 0, 0), (0.05, 0, 0.1, -H, 0, 0), (0.44, 0.02, 0, 0, 0, 0),
        (0.45, 0, 0, 0, 0, 0), (0.08, 0, 0.03, -H, 0, 0), (0.02, 0.01, 0.09, 0, 0, 0),
    ],
    "generic five": [
        (0.1, 0.05, 0.3, 0.2, 0.1, 0), (0.15, -0.1, 0.1, -1.2, 0.3, 0.1), (0.3, 0.05, 0.1, 0.9, 0.4, 0.3),
        (0.25, 0.1, -0.08, -1.1, 0.2, 0.5), (0.15, 0.04, 0.1, 1.3, -0.5, 0.2), (0.05, 0.02, 0.1, 0.3, 0.2, 0.1),
    ],
    "palletizer": [
        (0, 0, 0.3, 0, 0, 0), (0.1, 0, 0.1, -H, 0, 0), (0.4, 0, 0, 0, 0, 0), (0.35, 0, 0, 0, 0, 0),
        (0.1, 0.03, 0.02, 0.3, 0, 0),
    ],
    "three": [(0, 0, 0.3, 0, 0, 0), (0.05, 0, 0.1, -H, 0, 0), (0.4, 0, 0.02, 0, 0, 0), (0.3, 0.01, 0, 0, 0, 0)],
}  # fmt: skip


def urdf_of(places: list[tuple[float, ...]], limit: float = 3.1) -> str:
    """A description of turning joints with the same limits [rad] to both sides."""
    lines = ['<robot name="arm"><link name="link_0"/>']
    for k, (x, y, z, roll, pitch, yaw) in enumerate(places):
        kind = "fixed" if k == len(places) - 1 else "revolute"
        lines.append(
            f'<link name="link_{k + 1}"/><joint name="joint_{k + 1}" type="{kind}"><parent link="link_{k}"/>'
            f'<child link="link_{k + 1}"/><origin xyz="{x} {y} {z}" rpy="{roll!r} {pitch!r} {yaw!r}"/>'
            f'<axis xyz="0 0 1"/><limit lower="{-limit}" upper="{limit}" velocity="2" effort="10"/></joint>'
        )
    return "".join([*lines, "</robot>"])


def tip(robot: Robot) -> str:
    """The frame of the tool."""
    return f"link_{robot.dof + 1}"


def kinds(dof: int) -> dict[str, Array | str | None]:
    """Kinds of target that arms of so many joints have points for: a free axis (3,), None for a pose, or a position."""
    free: dict[str, Array | str | None] = {"pose": None}
    if dof > 3:
        free |= {"axis z": np.array([0.0, 0, 1]), "axis x": np.array([1.0, 0, 0])}
    else:
        free["position"] = "position"
    return free


def target_at(T: pin.SE3, kind: Array | str | None) -> pin.SE3 | FreeAxis | Array:
    """The target of one kind that a pose of the tool meets."""
    if kind is None:
        return T
    if isinstance(kind, str):
        return np.array(T.translation)
    return FreeAxis(T * pin.SE3(pin.exp3(0.7 * kind), np.zeros(3)), axis=kind)


def regular(robot: Robot, q: Array, kind: Array | str | None, least: float = 1e-3) -> bool:
    """Whether the joints, and the angle about a free axis, move the tool in independent ways."""
    J = pin.computeFrameJacobian(
        robot.pin_model, robot.pin_model.createData(), q, robot.frame_id(tip(robot)), pin.ReferenceFrame.LOCAL
    )
    if isinstance(kind, str):
        J = J[:3]
    elif kind is not None:
        J = np.column_stack([J, np.concatenate([np.zeros(3), kind])])
        if np.linalg.svd(J, compute_uv=False)[-1] < 1e-9:  # the last joint is the axis
            J = J[:, :-1]
    return bool(np.linalg.svd(J, compute_uv=False)[-1] > least)


def measure(robot: Robot, kind: Array | str | None, count: int) -> tuple[int, int, float, float]:
    """How many configurations are regular, how many are lost, mean number of branches, microseconds a target."""
    solver, rng = IKSolver(robot, tip(robot), collision="ignore"), np.random.default_rng(1)
    tried = lost = branches = 0
    spent = 0.0
    for q in robot.sample(rng, count):
        if not regular(robot, q, kind):
            continue
        target = target_at(robot.forward_kinematics(q, tip(robot)), kind)
        if not tried:
            solver.solve_all(target, q)
        start = time.perf_counter()
        found = solver.solve_all(target, q)
        spent += time.perf_counter() - start
        tried, branches = tried + 1, branches + len(found)
        lost += not len(found) or bool(np.abs(found.q - q).max(axis=1).min() > 1e-6)
    return tried, lost, branches / max(tried, 1), 1e6 * spent / max(tried, 1)


def main() -> None:
    """Print a line for each arm and kind of target."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=1000, help="configurations of each arm and kind")
    count = parser.parse_args().count
    for name, places in ARMS.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arm.urdf"
            path.write_text(urdf_of(places))
            robot = jacokin.load_robot(path)
        for word, kind in kinds(robot.dof).items():
            tried, lost, branches, spent = measure(robot, kind, count)
            print(f"{name:24} {word:9} lost {lost} of {tried}, {branches:.1f} branches, {spent:.0f} us")


if __name__ == "__main__":
    main()
