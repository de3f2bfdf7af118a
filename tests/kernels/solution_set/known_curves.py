"""Curves of seven joints for the tests: walks along them, and one whose points are known."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pinocchio as pin

import jacokin
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.ik.geometry import chain_of
from jacokin.kernels.solution_set.curve import StepResult, Walk, advance, go_on, make_walk, tangent
from jacokin.kernels.solution_set.slices import Slices, add_start, make_slices
from jacokin.kernels.solution_set.trace import Loops, begin, make_loops, trace

#: Index of joints of a seven-joint Jaco: of its wrist the first, the middle and the last.
FIRST, MIDDLE, LAST = 4, 5, 6


class Curve(NamedTuple):
    """A chain (8, 3, 4), the pose (4, 4) that its curve reaches, and a point (7,) of it."""

    robot: Robot
    chain: Array
    T: Array
    q: Array


def curve_through(robot: Robot, q: Array) -> Curve:
    """The curve through a configuration (7,)."""
    chain = chain_of(robot.pin_model, robot.frame_id(None), None, 7)
    return Curve(robot, chain, robot.forward_kinematics(q).homogeneous, q)


def residual(curve: Curve, x: Array) -> float:
    """How far Pinocchio's kinematics of x (7,) are from the pose [m or rad]."""
    reached = curve.robot.forward_kinematics(x)
    return float(np.abs(pin.log6(pin.SE3(curve.T).actInv(reached)).vector).max())


def walk_on(curve: Curve, parameter: int = FIRST) -> Walk:
    """A walk along a curve, which has not begun."""
    walk = make_walk()
    walk.chain[:], walk.T[:], walk.parameter[0] = curve.chain, curve.T, parameter
    return walk


def begun(curve: Curve, parameter: int) -> tuple[Walk, float]:
    """A walk at the point of a curve, the parameter rising ahead; and the volume there, see `tangent`."""
    walk = walk_on(curve, parameter)
    begin(curve.q, walk)
    return walk, tangent(walk.x, walk.t, walk.ty, walk)


def nodes_along(curve: Curve, parameter: int, steps: int, longest: float) -> Array:
    """Nodes (steps + 1, 14) from the point of a curve on, nearer to each other where it bends."""
    walk, volume = begun(curve, parameter)
    nodes, h = [np.concatenate([walk.x, walk.t])], longest
    while len(nodes) <= steps:
        if advance(walk, h, volume, walk.y, walk.ty) == StepResult.STEPPED:
            nodes.append(np.concatenate([walk.y, walk.ty]))
            volume = walk.volume[0]
            go_on(walk)
            h = min(1.5 * h, longest)
        else:
            h *= 0.5
            assert h > 1e-4
    return np.array(nodes)


def traced(curve: Curve, parameter: int, slices: Slices | None = None) -> tuple[Loops, Slices]:
    """The curves through the points of slices, or else through the point of the curve."""
    if slices is None:
        slices = make_slices()
        add_start(slices, curve.q)
    loops = make_loops()
    trace(slices, loops, walk_on(curve, parameter))
    return loops, slices


def straight_wrist(rng: np.random.Generator) -> Curve:
    """A Jaco of seven joints with axes 5 and 7 in one line: joints 5 and 7 turn against each other on a circle.

    Its points are known: (q1, q2, q3, q4, q5 + s, q6, q7 - s) for any s, with s the other way round where both axes
    have one direction.
    """
    robot = jacokin.load_robot("j2s7s300")
    q = robot.sample(rng)
    q[MIDDLE] = np.pi
    return curve_through(robot, q)


def along_circle(curve: Curve, s: float) -> Array:
    """The point (7,) of that circle where joint 5 has turned by s [rad]."""
    J = curve.robot.jacobian(curve.q)
    x = curve.q.copy()
    x[FIRST] += s
    x[LAST] -= s * float(np.sign(J[3:, FIRST] @ J[3:, LAST]))
    return x
