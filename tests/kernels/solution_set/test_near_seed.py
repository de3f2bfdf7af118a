"""The chords of curves beside which the nearest configuration is: against scans of joint 3."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver
from jacokin.arrays import Array
from jacokin.ik import forms
from jacokin.ik.geometry import measure_seven
from jacokin.ik.solutions.curve_arm import CurveArm
from jacokin.ik.targets import interpret
from jacokin.kernels.chain import linearise7, make_newton
from jacokin.kernels.closed_form.roots import make_roots
from jacokin.kernels.solution_set.curve import LARGEST_RESIDUAL, LONGEST_STEP, make_walk
from jacokin.kernels.solution_set.end_wrist import begin_end_wrist, find_wrist_folds
from jacokin.kernels.solution_set.near_seed import Parts, add_chords, follow_arcs, make_near_seed
from jacokin.kernels.solution_set.seven_joints import (
    LAST_STEPS,
    MOST_ROWS,
    ROUNDING,
    add_folds,
    find_folds,
    solve_at_q3,
)
from jacokin.kernels.solution_set.slices import JOINT_3, make_seven_joints, make_six_joints
from jacokin.kernels.solution_set.trace import make_loops
from jacokin.model.angles import TURN, wrap_to_pi
from jacokin.model.robot import Robot

SCANNED = 240


@pytest.fixture(scope="module")
def robot() -> Robot:
    return jacokin.load_robot("j2s7s300")


def scan(robot: Robot, chain: Array, arm: Array, T: Array, seed: Array) -> Array:
    """The configuration (7,) within the limits that is nearest to a seed, of those at many values of joint 3."""
    rows = np.empty((SCANNED, 8, 7))
    for n, q3 in enumerate((TURN * np.arange(SCANNED) / SCANNED).tolist()):
        solve_at_q3(chain, arm, T, q3, rows[n])
    found = rows[np.isfinite(rows[..., 0])]
    free, middle = robot.unlimited, seed.copy()
    middle[~free] = 0.5 * (robot.lower[~free] + robot.upper[~free])
    found = middle + wrap_to_pi(found - middle)
    found = found[((found >= robot.lower) & (found <= robot.upper)).all(axis=1)]
    return np.asarray(found[np.linalg.norm(found - seed, axis=1).argmin()])


@pytest.mark.parametrize("folded", [False, True])
def test_the_nearest_configuration_is_beside_a_chord(robot: Robot, rng: np.random.Generator, folded: bool) -> None:
    geometry = measure_seven(robot.pin_model, robot.frame_id(), None)
    chain, seven, near = geometry.chain, make_seven_joints(), make_near_seed()
    seven.arm[:] = geometry.arm
    bounded = ~robot.unlimited
    limits = np.array([np.where(bounded, robot.lower, -np.inf), np.where(bounded, robot.upper, np.inf)])
    count, single = -1, False
    while not single or (count > 0) != folded:
        T = robot.forward_kinematics(robot.sample(rng)).homogeneous
        count, single = find_folds(chain, seven.arm, T, LAST_STEPS, seven.waves, make_roots(), seven.folds)
    near.seed[:], near.bounds[:] = robot.sample(rng), limits
    loops = make_loops()
    walk = make_walk()
    walk.chain[:], walk.T[:], walk.parameter[0], near.best[0] = chain, T, 2, np.inf
    assert add_chords(limits, Parts(JOINT_3, 7, make_six_joints(), seven, walk, make_newton()), count, near, loops)
    nearest = scan(robot, chain, seven.arm, T, near.seed)
    distance = np.linalg.norm(nearest - near.seed)
    chords = loops.nodes[: loops.size[0], :7].reshape(-1, 2, 7)
    away = np.linalg.norm(wrap_to_pi(chords - nearest), axis=2)
    assert len(chords) == loops.size[1] > 0
    assert away.max(axis=1).min() < LONGEST_STEP + 0.1  # the scan's is at most so far from the very nearest
    assert distance - 0.1 < near.best[0] < distance + 0.1


def test_a_seed_that_reaches_the_target_is_beside_a_chord(robot: Robot, rng: np.random.Generator) -> None:
    geometry = measure_seven(robot.pin_model, robot.frame_id(), None)
    seven, near, loops = make_seven_joints(), make_near_seed(), make_loops()
    seven.arm[:] = geometry.arm
    limits = np.array([np.full(7, -np.inf), np.full(7, np.inf)])
    near.seed[:] = robot.sample(rng)
    T = robot.forward_kinematics(near.seed).homogeneous
    count, _ = find_folds(geometry.chain, seven.arm, T, LAST_STEPS, seven.waves, make_roots(), seven.folds)
    walk = make_walk()
    walk.chain[:], walk.T[:], walk.parameter[0], near.best[0] = geometry.chain, T, 2, np.inf
    assert add_chords(limits, Parts(JOINT_3, 7, make_six_joints(), seven, walk, make_newton()), count, near, loops)
    chords = loops.nodes[: loops.size[0], :7].reshape(-1, 2, 7)
    along = chords[:, 1] - chords[:, 0]
    share = (wrap_to_pi(near.seed - chords[:, 0]) * along).sum(axis=1) / (along**2).sum(axis=1)
    beside = np.linalg.norm(wrap_to_pi(chords[:, 0] + share[:, np.newaxis] * along - near.seed), axis=1)
    assert beside[(share > -1e-9) & (share < 1.0 + 1e-9)].min() < 1e-2
    assert len(chords) <= 4


def test_rows_of_a_wrist_lead_to_solutions_of_an_arm_that_nearly_has_it(rng: np.random.Generator) -> None:
    robot = jacokin.load_robot("gen3")
    arm = forms.at_poses(IKSolver(robot).verifier)
    assert isinstance(arm, CurveArm)
    assert arm.nearly is not None
    known, found = 0, 0
    for _ in range(3):
        problem = arm.problem(interpret(robot.forward_kinematics(robot.sample(rng)), robot.default_frame))
        work = arm.nearly._prepare(problem, np.empty((0, 7))).solve.work
        assert begin_end_wrist(work.six)
        seven, walk, slices, parameter = work.seven, work.walk, work.slices, int(work.walk.parameter[0])
        count, _ = find_wrist_folds(work.six, ROUNDING, seven.waves, make_roots(), seven.folds)
        parts = Parts(arm.nearly.constants[0], 7, work.six, seven, walk, work.newton)
        slices.size[0], work.loops.window[1] = 0, np.inf
        known += follow_arcs(parts, count, work.near, work.loops, slices)
        values = slices.p[: slices.size[0]]
        for number in range(len(values)):
            points = slices.x[number, : slices.counts[number]]
            assert len(points) <= MOST_ROWS
            found += len(points)
            for x in points:
                assert linearise7(walk.chain, walk.T, x, walk.system) < LARGEST_RESIDUAL
                assert x[parameter] == pytest.approx(values[number], abs=1e-12)
            apart = np.abs(wrap_to_pi(points[:, np.newaxis] - points)).max(axis=2)
            assert (apart[~np.eye(len(points), dtype=bool)] > 1e-6).all()
            assert (slices.passed[number, : len(points)] == 1).all()
        assert len(values) == max(count, 1)  # one between each two folds
    assert (known, found > 8) == (3, True)


def test_where_a_function_is_within_noise_for_longer_is_one_interval() -> None:
    """(1 - cos p)^2 is 1e-6 at the fourth root of 4e-6, and touches zero in between without a bend."""
    waves, folds = np.zeros((2, 5)), np.zeros(64)
    waves[0, :3] = 1.5, -2.0, 0.5
    count, single = add_folds(1e-6, waves, LAST_STEPS, 0, make_roots(), folds)
    assert (count, single) == (2, False)
    np.testing.assert_allclose(folds[:2], [-(4e-6**0.25), 4e-6**0.25], atol=4e-3)
