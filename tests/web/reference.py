"""What the native library answers, for the tests of the npm package: `python -m tests.web.reference FOLDER`.

Each arm with six joints has `NAME.json`, and `NAME.f64` with doubles one after another: poses, seeds, the nearest
configurations and all branches.
"""

from __future__ import annotations

import ctypes
import json
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

import jacokin
from jacokin.arrays import Array
from jacokin.ik import IKSolver
from jacokin.ik.c_library import solver_file
from tests.c import binding
from tests.c.binding import CSolver, make_targets
from tests.seven_joint_arms import STRAIGHT, load_arm

STATUSES = ("ok", "unreachable", "outside_limits", "no_convergence")
ENDS = ("limit", "fold", "range", "circle", "lost")
#: Poses of each arm with six joints: those of the first robot are the measure.
POSES = {"j2n6s300": 10_000, "j2s6s300": 1_000, "gen3_lite": 1_000}
#: Targets with a free parameter: about an axis of the tool, and of seven joints.
CURVES: dict[str, dict[str, Any] | None] = {
    "j2n6s300": {"axis": [1.0, 0.2, 0.0], "range": [-1.0, 2.0]},
    "gen3_lite": {"axis": [0.0, 0.0, 1.0]},
    "j2s7s300": None,
    "gen3": None,
}
TARGETS = 60


def write(folder: Path) -> None:
    """Write all files; the folder is made where it is not there."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, n in POSES.items():
        about, doubles = _six_joints(name, n)
        (folder / f"{name}.json").write_text(json.dumps(about), encoding="ascii")
        (folder / f"{name}.f64").write_bytes(doubles.astype("<f8").tobytes())
    curves = {name: _curves(name, about) for name, about in CURVES.items()}
    (folder / "curves.json").write_text(json.dumps(curves), encoding="ascii")
    _write_straight(folder)
    robot = jacokin.load_robot("j2n6s300", limits={"joint_2": (1.0, 5.0)})
    (folder / "own.jacokin").write_bytes(solver_file(IKSolver(robot, tool=jacokin.pose([0.0, 0.0, 0.1]))))


def _write_straight(folder: Path) -> None:
    """An arm with the pose that has most intervals, and how many."""
    with tempfile.TemporaryDirectory() as place:
        robot = load_arm("iiwa14", Path(place))
    solver = IKSolver(robot, collision="ignore")
    (folder / "straight.jacokin").write_bytes(solver_file(solver))
    T = np.ascontiguousarray(robot.forward_kinematics(STRAIGHT).homogeneous)
    count = len(CSolver(solver, binding.INTERVALS).intervals(T)[1])
    (folder / "straight.json").write_text(json.dumps({"pose": T.ravel().tolist(), "count": count}), encoding="ascii")


def _six_joints(name: str, n: int) -> tuple[dict[str, Any], Array]:
    solver = IKSolver(jacokin.load_robot(name), collision="ignore")
    c = CSolver(solver)
    T, seeds = make_targets(solver.robot, n, 44)
    found = [c.all(pose, seed) for pose, seed in zip(T, seeds, strict=True)]
    status, q = c.batch(T, seeds)
    branches = [np.array(each.q[:6]) for _, several, _ in found for each in several]
    about = {
        "n": n,
        "status": [STATUSES[code] for code in status],
        "counts": [len(several) for _, several, _ in found],
        "within": [bool(each.success) for _, several, _ in found for each in several],
    }
    return about, np.concatenate([T.ravel(), seeds.ravel(), q.ravel(), *branches])


def _curves(name: str, about: dict[str, Any] | None) -> list[dict[str, Any]]:
    solver = IKSolver(jacokin.load_robot(name), collision="ignore")
    c = CSolver(solver, binding.INTERVALS)
    axis = None
    if about is not None:
        low, high = about.get("range", (-np.pi, np.pi))
        axis = binding.Axis((ctypes.c_double * 3)(*about["axis"]), (ctypes.c_double * 2)(low, high))
    rows = []
    for T, seed in zip(*make_targets(solver.robot, TARGETS, 44), strict=True):
        status, intervals, complete = c.intervals(T, axis)
        middles = [c.at(each, 0.5 * (each.start + each.stop), seed)[1].tolist() for each in intervals]
        shown = [
            {"start": each.start, "stop": each.stop, "ends": [ENDS[end] for end in each.ends], "middle": middle}
            for each, middle in zip(intervals, middles, strict=True)
        ]
        row = {"pose": T.ravel().tolist(), "seed": seed.tolist(), "about": about, "intervals": shown}
        nearest, q, parameter = c.nearest_about(T, axis, seed)
        answer = {"status": STATUSES[nearest], "q": q.tolist(), "parameter": parameter} if nearest == 0 else None
        rows.append({**row, "status": STATUSES[status], "complete": complete, "nearest": answer})
    return rows


if __name__ == "__main__":
    write(Path(sys.argv[1]))
