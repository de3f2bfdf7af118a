"""What `IKSolver` refuses, one table for each entry point: the argument is named, with what is valid."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, JacokinError, Robot
from jacokin.errors import InvalidInputError, StructureError, UnknownNameError
from jacokin.ik import Box, Scene
from jacokin.motion import AxisTarget, OrientationTarget, PositionTarget, RegionTarget

POSITION = [0.3, 0.2, 0.4]
POSE = np.array([[1.0, 0, 0, 0.3], [0, -1.0, 0, -0.2], [0, 0, -1.0, 0.4], [0, 0, 0, 1.0]])
PART, AXIS = PositionTarget(POSITION), AxisTarget((0.0, 0.0, -1.0))
BOX = Box("b", (0.1, 0.1, 0.1), (1, 0, 0))
FREE = FreeAxis(jacokin.pose(POSITION), axis=(1.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"method": "newton"}, UnknownNameError, "method 'newton'.*closed_form"),
        ({"method": ["qp"]}, UnknownNameError, "method"),
        ({"qp_solver": "gurobi_x"}, UnknownNameError, "qp_solver 'gurobi_x'.*daqp"),
        ({"qp_solver": np.array(["daqp", "osqp"])}, UnknownNameError, "qp_solver"),
        ({"collision": "avoid"}, UnknownNameError, "collision 'avoid'.*ignore, report, reject"),
        ({"frame": "tool0"}, UnknownNameError, "frame 'tool0'"),
        ({"frame": "link_base"}, InvalidInputError, "'link_base' is moved by no joint"),
        ({"tool": np.zeros((4, 4))}, InvalidInputError, "tool"),
        ({"position_tolerance": 0.0}, InvalidInputError, "position_tolerance"),
        ({"position_tolerance": "a"}, InvalidInputError, "position_tolerance"),
        ({"position_tolerance": None}, InvalidInputError, "position_tolerance"),
        ({"position_tolerance": True}, InvalidInputError, "position_tolerance"),
        ({"orientation_tolerance": math.nan}, InvalidInputError, "orientation_tolerance"),
        ({"orientation_tolerance": np.ones(2)}, InvalidInputError, "orientation_tolerance"),
        ({"limit_snap": -1.0}, InvalidInputError, "limit_snap"),
        ({"limit_snap": "x"}, InvalidInputError, "limit_snap"),
        ({"max_restarts": -1}, InvalidInputError, "max_restarts"),
        ({"max_restarts": 1.5}, InvalidInputError, "max_restarts"),
        ({"clearance": -0.1, "collision": "reject"}, InvalidInputError, "clearance"),
        (
            {"clearance": 0.1, "collision": "ignore"},
            InvalidInputError,
            "clearance has no effect",
        ),
        ({"scene": Scene([BOX]), "collision": "ignore"}, InvalidInputError, "scene has no effect"),
        ({"frame": "link_4", "method": "closed_form"}, StructureError, "link_4"),
    ],
)
def test_a_solver_is_not_made_of(
    robot: Robot, options: dict[str, Any], error: type[JacokinError], message: str
) -> None:
    with pytest.raises(error, match=message):
        IKSolver(robot, **options)


def test_a_solver_is_made_of_a_robot() -> None:
    with pytest.raises(InvalidInputError, match="robot must be"):
        IKSolver("j2n6s300")  # type: ignore[arg-type]  # wrong on purpose


@pytest.mark.parametrize(
    ("target", "arguments", "error", "message"),
    [
        ([0.3, 0.2], {}, InvalidInputError, "target must have shape"),
        ([0.3, math.nan, 0.2], {}, InvalidInputError, "target must be finite"),
        ("pose", {}, InvalidInputError, r"target must be a pin.SE3, a \(4, 4\) matrix or a \(3,\) position"),
        (POSE + 0j, {}, InvalidInputError, "target"),
        (POSE.astype(object), {}, InvalidInputError, "target"),
        (np.ones((4, 4), dtype=bool), {}, InvalidInputError, "target"),
        (["0.3", "0.2", "0.4"], {}, InvalidInputError, "target"),
        ([True] * 3, {}, InvalidInputError, "target"),
        ([AXIS], {}, InvalidInputError, "the position is free: give a PositionTarget"),
        ([PART, PositionTarget((0.0, 0.0, 1.0))], {}, InvalidInputError, "two targets fix the position"),
        ([PART, AXIS, OrientationTarget(np.eye(3))], {}, InvalidInputError, "both an orientation and an axis"),
        ([RegionTarget((0, 0, 0), (1, 1, 1))], {}, InvalidInputError, "RegionTarget is for the tracker only"),
        ([PositionTarget(POSITION, frame="link_4")], {}, InvalidInputError, "is for frame 'link_4'"),
        ([PART, POSE], {}, InvalidInputError, "must hold targets of the tracker only"),
        (POSE, {"seed": [0.0] * 5}, InvalidInputError, r"seed must have shape \(6,\)"),
        (POSE, {"seed": [math.nan] * 6}, InvalidInputError, "seed must be finite"),
        (POSE, {"seed": np.array([math.inf, 3.0, 3.0, 0.0, 1.0, 1.0])}, InvalidInputError, "seed must be finite"),
        (POSE, {"seed": np.array([0.0, math.nan, 3.0, 0.0, 1.0, 1.0])}, InvalidInputError, "seed must be finite"),
        (POSE, {"seed": [1e15, 3, 3, 0, 1, 1]}, InvalidInputError, r"seed: joint_1 = 1e\+15 rad is too far from zero"),
        (POSE, {"rng": np.random.RandomState(0)}, InvalidInputError, "rng"),
        (POSE, {"max_restarts": -1}, InvalidInputError, "max_restarts"),
        (POSE, {"closest": 1}, InvalidInputError, "closest must be True or False"),
        (POSE, {"prefer": "widest"}, UnknownNameError, "'widest'.*nearest, margin, manipulability"),
        (POSE, {"prefer": 3}, InvalidInputError, "prefer must be one of nearest"),
        (POSE, {"prefer": lambda q: math.nan}, InvalidInputError, "the cost that prefer returns must be a finite"),
        (POSITION, {"prefer": "margin"}, InvalidInputError, "prefer needs an orientation"),
    ],
)
def test_solve_refuses(
    robot: Robot, target: Any, arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        IKSolver(robot).solve(target, **arguments)


@pytest.mark.parametrize(
    ("options", "target", "arguments", "error", "message"),
    [
        ({"method": "qp"}, FREE, {"prefer": "margin"}, InvalidInputError, "prefer needs the closed form"),
        ({"method": "qp"}, POSE, {"prefer": "margin"}, InvalidInputError, "prefer needs the closed form"),
        ({"method": "closed_form"}, POSITION, {}, InvalidInputError, "the closed form needs an orientation"),
        ({"frame": "link_4"}, FREE, {"prefer": "margin"}, InvalidInputError, "prefer needs the closed form"),
        ({"frame": "link_4"}, POSE, {"prefer": "margin"}, InvalidInputError, "prefer needs the closed form"),
    ],
)
def test_what_a_method_cannot_do_is_refused(
    robot: Robot,
    options: dict[str, Any],
    target: Any,
    arguments: dict[str, Any],
    error: type[Exception],
    message: str,
) -> None:
    with pytest.raises(error, match=message):
        IKSolver(robot, **options).solve(target, **arguments)


@pytest.mark.parametrize(
    ("options", "target", "error", "message"),
    [
        ({}, POSITION, InvalidInputError, "solve_all needs an orientation"),
        ({"method": "qp"}, FREE, InvalidInputError, "a FreeAxis needs the closed form"),
        ({"frame": "link_4"}, POSE, StructureError, "link_4"),
        ({"frame": "link_4"}, FREE, StructureError, "link_4"),
    ],
)
def test_solve_all_refuses(
    robot: Robot, options: dict[str, Any], target: Any, error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        IKSolver(robot, **options).solve_all(target)


def test_what_a_target_has_is_said_beforehand(robot: Robot) -> None:
    seven = IKSolver(jacokin.load_robot("j2s7s300"))
    assert [IKSolver(robot).dimension(target) for target in (None, POSE, FREE, POSITION)] == [0, 0, 1, None]
    assert [seven.dimension(target) for target in (None, POSE, FREE, POSITION)] == [1, 1, None, None]
    assert [IKSolver(robot, method="qp").dimension(target) for target in (POSE, FREE)] == [None, None]
    with pytest.raises(InvalidInputError, match="points have no parameter"):
        IKSolver(robot).solve_all(POSE).parameter_of(robot.home)
    with pytest.raises(InvalidInputError, match="leaves two free parameters"):
        seven.solve_all(FREE)


@pytest.mark.parametrize(
    ("targets", "arguments", "error", "message"),
    [
        ([], {}, InvalidInputError, "targets is empty"),
        (np.array(0.0), {}, InvalidInputError, "targets must be a sequence of poses"),
        (5, {}, InvalidInputError, "targets must be a sequence of poses"),
        (POSE, {}, InvalidInputError, r"got one pose of shape \(4, 4\): solve\(target\) takes it, or give \[target\]"),
        (np.array(POSE).tolist(), {}, InvalidInputError, r"got one pose of shape \(4, 4\)"),
        (POSITION, {}, InvalidInputError, r"got one position of shape \(3,\): solve\(target\) takes it"),
        (pin.SE3.Identity(), {}, InvalidInputError, "got one SE3: solve"),
        (FREE, {}, InvalidInputError, "got one FreeAxis: solve"),
        ([POSITION, [0.3, 0.1], POSITION], {}, InvalidInputError, r"targets\[1\] must have shape \(3,\)"),
        ([POSITION, [0.3, math.nan, 0.4]], {}, InvalidInputError, r"targets\[1\]"),
        (POSE + 0j, {}, InvalidInputError, r"targets\[0\]"),
        (np.array([POSE + 0j]), {}, InvalidInputError, "targets must be real numbers"),
        (np.ones((2, 4, 4), dtype=bool), {}, InvalidInputError, "targets must be real numbers"),
        (np.array([POSE, 1.1 * POSE]), {}, InvalidInputError, r"targets\[1\]"),
        ([POSITION], {"seeds": np.zeros((2, 6))}, InvalidInputError, "seeds must have one row"),
        ([POSE], {"seeds": [[1e15, 3, 3, 0, 1, 1]]}, InvalidInputError, "too far from zero"),
        ([POSITION], {"workers": 0}, InvalidInputError, "workers"),
        ([POSE], {"progress": 5}, InvalidInputError, "progress must be callable"),
        ([POSE], {"closest": "no"}, InvalidInputError, "closest must be True or False"),
        ([POSE], {"prefer": "widest"}, UnknownNameError, "nearest, margin, manipulability"),
        ([POSE], {"prefer": lambda q: 0.0, "workers": 2}, InvalidInputError, "prefer must be picklable"),
    ],
)
def test_solve_batch_refuses(
    robot: Robot, targets: Any, arguments: dict[str, Any], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        IKSolver(robot).solve_batch(targets, **arguments)
