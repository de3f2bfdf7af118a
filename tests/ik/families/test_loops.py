"""Closed curves of a free axis that lie between two slices wholly: on targets built to have one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from jacokin.kernels.self_motion import gaps
from jacokin.kernels.self_motion.intervals import make_curve_work
from jacokin.kernels.self_motion.slices import SLICES_SIX

from jacokin import FreeAxis, IKSolver, Robot
from jacokin.arrays import Array
from jacokin.model.angles import TURN, wrap_to_pi

#: Of the loops built here at random, some with next to no curvature in one direction, this share is found at least.
FOUND = 0.9


def singular(robot: Robot, rng: np.random.Generator) -> Array:
    """A configuration (6,) within the limits where the Jacobian has rank 5: one joint is turned until it does."""
    while True:
        q, joint = robot.sample(rng), int(rng.integers(2, 5))

        def determinant(angle: float, q: Array = q, joint: int = joint) -> float:
            at = q.copy()
            at[joint] = angle
            return float(np.linalg.det(robot.jacobian(at, reference="local")))

        bounds = (-np.pi, np.pi) if robot.unlimited[joint] else (robot.lower[joint], robot.upper[joint])
        angles = np.linspace(bounds[0], bounds[1], 60)
        signs = np.sign([determinant(angle) for angle in angles])
        changes = np.flatnonzero(signs[:-1] * signs[1:] < 0.0)
        if len(changes) == 0:
            continue
        index = int(rng.choice(changes))
        low, high = angles[index], angles[index + 1]
        for _ in range(60):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if np.sign(determinant(middle)) == signs[index] else (low, middle)
        q[joint] = 0.5 * (low + high)
        return q


def with_loop(robot: Robot, rng: np.random.Generator, width: float) -> tuple[FreeAxis, Array, float] | None:
    """A target with a loop of this width [rad] of the parameter, a configuration near it, and where it is.

    About a singular configuration, the axis is chosen so that turning about it is no way out either: there the
    configuration is an isolated point of the family, or a crossing of two curves (None). Moving the target in the
    direction that no joint moves it in makes a loop of the point.
    """
    q = singular(robot, rng)
    T, J = robot.forward_kinematics(q), robot.jacobian(q, reference="local")
    axis = np.cross(np.linalg.svd(J)[0][3:, 5], rng.normal(size=3))
    axis /= np.linalg.norm(axis)
    U, sizes, V = np.linalg.svd(np.column_stack([J, [0.0, 0.0, 0.0, *-axis]]))
    if sizes[4] < 1e-2 or sizes[5] > 1e-6:
        return None
    lost, ways = U[:, 5], V[5:].T

    def error(x: Array) -> float:
        turned = T * pin.SE3(pin.exp3(axis * x[6]), np.zeros(3))
        return float(lost @ pin.log6(turned.actInv(robot.forward_kinematics(q + x[:6]))).vector)

    step = 1e-3
    second = [
        [sum(i * j * error(step * (i * a + j * b)) for i in (1, -1) for j in (1, -1)) / (4.0 * step**2) for b in ways.T]
        for a in ways.T
    ]
    curvatures = np.linalg.eigvalsh(second)
    if curvatures[0] * curvatures[1] <= 0.0:
        return None
    reach = abs(ways[6] @ np.linalg.solve(second, ways[6]))
    moved = T * pin.exp6(pin.Motion(np.sign(curvatures[0]) * (0.5 * width) ** 2 / (2.0 * reach) * lost))
    parameter = rng.uniform(-np.pi, np.pi)
    return FreeAxis(moved * pin.SE3(pin.exp3(-axis * parameter), np.zeros(3)), axis=axis), q, parameter


def is_near(robot: Robot, rows: Array, q: Array, width: float) -> bool:
    """Whether a configuration within the limits is on the loop about q."""
    return any(robot.within_limits(row) and np.abs(wrap_to_pi(row - q)).max() < 20.0 * width + 0.02 for row in rows)


@pytest.mark.parametrize("width", [0.05, 0.01, 0.001])
@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s300", "m1n6s300"])
def test_loops_between_slices_are_found(bundled: Callable[[str], Robot], name: str, width: float) -> None:
    robot, rng = bundled(name), np.random.default_rng(5)
    solver = IKSolver(robot, collision="ignore")
    found = number = 0
    while number < 40:
        built = with_loop(robot, rng, width)
        if built is None:
            continue
        target, q, parameter = built
        seen = [
            is_near(robot, solver.solve_all(target.at(parameter + d), seed=q).q, q, width) for d in (-width, 0.0, width)
        ]
        if seen != [False, True, False]:  # of another form, or outside the limits
            continue
        number += 1
        family = solver.family(target)
        middles = [interval.at(0.5 * (interval.start + interval.stop)) for interval in family]
        found += is_near(robot, np.array(middles), q, width)
    assert found >= FOUND * number


def test_roots_are_those_of_numpy(bundled: Callable[[str], Robot], rng: np.random.Generator) -> None:
    robot = bundled("j2n6s300")
    _, constants, _ = IKSolver(robot, collision="ignore").closed_form().constants
    work = make_curve_work()
    work.six.arm[:], work.six.axis[:] = constants, (1.0, 0.0, 0.0)
    parameters = TURN / SLICES_SIX * np.arange(4)
    for q in robot.sample(rng, 3):
        work.T[:] = robot.forward_kinematics(q).homogeneous
        work.slices.p[:4] = parameters
        gaps.add_loops(work.T, 4, False, work.slices, work.six, work.loops)
        gaps.fill_polynomial(work.T, parameters[3], work.six, work.loops)
        coefficients = work.loops.polynomial[0, :, 0] + 1j * work.loops.polynomial[0, :, 1]
        mine = work.loops.roots[1, :, 0] + 1j * work.loops.roots[1, :, 1]
        for root in np.roots(coefficients[::-1]):
            assert np.abs(mine - root).min() < 1e-5 * abs(root)
