"""Curves are cut by limits where joints pass them, not where one stands still on its own."""

from __future__ import annotations

from unittest import mock

import numpy as np
import pytest
from jacokin.ik.solutions.curves import FREE_AXIS, CurveArm, CurveProblem
from jacokin.kernels.self_motion import limit_cuts
from jacokin.kernels.self_motion.arcs import Arcs
from jacokin.kernels.self_motion.follow import make_walk, node_between
from jacokin.kernels.self_motion.limit_cuts import DIVISIONS, HALVINGS, add_crossings, make_cuts

import jacokin
from jacokin import FreeAxis, IKSolver, pose
from jacokin.arrays import Array
from jacokin.ik.targets import interpret

RIGHT = 0.5 * np.pi
Q = np.array([RIGHT, 0.8203047484373349, np.pi, -np.pi, 5.759586531581287, -RIGHT])  # joints 1 and 4 stand still
STILL = 0


def curves_of(q: Array) -> tuple[CurveProblem, Arcs, list[int]]:
    """Curves through a configuration (6,), and the nodes at which chords begin along which joint 1 stands still."""
    solver = IKSolver(jacokin.load_robot("j2s6s300"), tool=pose([0.5, 0.0, 0.0]), collision="ignore")
    chain, constants, _ = solver.closed_form().constants
    arm = CurveArm(FREE_AXIS, chain, constants, solver.robot.lower, solver.robot.upper)
    target = FreeAxis(solver.verifier.tool_pose(q), axis=[0.0, 1.0, 0.0])
    problem = arm.problem(interpret(target, solver.frame))
    call = arm.take_call()
    found = problem.find()
    nodes = np.vstack(found.arcs)
    first = np.cumsum([0, *(len(arc) for arc in found.arcs)])[:-1].tolist()
    arcs = call.work.arcs
    arcs.nodes[: len(nodes)] = nodes
    ends = {start - 1 for start in first}
    steady = np.abs(nodes[:-1, STILL] - q[STILL]) < 1e-13
    steady &= (np.abs(nodes[:-1, 7 + STILL]) < 1e-13) & (np.abs(nodes[1:, STILL] - q[STILL]) < 1e-13)
    return problem, arcs, [node for node in np.flatnonzero(steady).tolist() if node not in ends]


@pytest.mark.parametrize(("side", "within"), [(0, -1e-12), (1, 1e-12), (0, -5e-8)])
def test_a_joint_that_stands_still_within_its_limit_cuts_nothing(side: int, within: float) -> None:
    problem, arcs, chords = curves_of(Q)
    assert len(chords) > 100
    with mock.patch.object(limit_cuts, "node_between", wraps=node_between) as looked:
        for node in chords:
            given = problem.chain, problem.T, arcs, node, STILL, Q[STILL] + within, side, 0, make_cuts(), make_walk()
            assert add_crossings(*given) == 0
    assert looked.call_count == 0


def test_chords_of_a_joint_that_is_known_no_better_are_divided_a_few_times() -> None:
    problem, arcs, chords = curves_of(Q)
    rng = np.random.default_rng(1)
    most = 0
    for node in chords[:40]:
        arcs.nodes[node : node + 2, STILL] += rng.normal(scale=1e-10, size=2)
        arcs.nodes[node : node + 2, 7 + STILL] += rng.normal(scale=1e-8, size=2)
        with mock.patch.object(limit_cuts, "node_between", wraps=node_between) as looked:
            level = float(Q[STILL]) + 1e-12
            add_crossings(problem.chain, problem.T, arcs, node, STILL, level, 1, 0, make_cuts(), make_walk())
        most = max(most, looked.call_count)
    assert HALVINGS <= most <= DIVISIONS
