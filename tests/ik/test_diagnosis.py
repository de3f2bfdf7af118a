"""Which status a failure gets, and the sentence that goes with it."""

from __future__ import annotations

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot, Status
from jacokin.arrays import Array
from jacokin.ik import diagnosis
from jacokin.ik.diagnosis import LimitExcess
from jacokin.ik.options import SolverOptions
from jacokin.ik.seeds import seed_within_limits
from jacokin.ik.solutions.points import Points
from jacokin.ik.targets import Request, interpret
from jacokin.ik.verification import Candidate
from jacokin.kernels.branches import COLUMNS, ORIENTATION_ERROR, POSITION_ERROR, WITHIN_LIMITS

NAMES = tuple(f"joint_{number}" for number in range(1, 7))
FREE = [1.0] * 6  # [rad] from every limit


def branches(*margins: list[float], dropped: bool = False) -> Points:
    """Branches with these distances (6,) to their limits [rad], a little off their target."""
    rows = np.zeros((len(margins), COLUMNS))
    for row, margin in zip(rows, margins, strict=True):
        row[6:12], row[WITHIN_LIMITS] = margin, min(margin) >= 0.0
        row[POSITION_ERROR], row[ORIENTATION_ERROR] = 2e-5, 3e-5
    return Points(rows, dropped)


@pytest.mark.parametrize(
    ("found", "status", "message"),
    [
        (branches(), Status.UNREACHABLE, "no configuration reaches this pose, whatever the limits"),
        (
            branches([1.0, -0.5, 1.0, 1.0, -0.1, 1.0], [1.0, 1.0, -0.25, 1.0, 1.0, -0.125]),
            Status.OUTSIDE_LIMITS,
            "each of the 2 branches is outside the limits; the closest one exceeds the limits of joint_3 by 0.25 rad, "
            "joint_6 by 0.125 rad",
        ),
        (
            branches(FREE, [-1.0] * 6),
            Status.NO_CONVERGENCE,
            "a branch within the limits misses the target by 2e-05 m and 3e-05 rad, which is rounding and more than "
            "the tolerances allow",
        ),
        (
            branches([-1.0] * 6, dropped=True),
            Status.NO_CONVERGENCE,
            "none of the 1 branches found is within the limits, and some may be missing",
        ),
    ],
)
def test_branches(found: Points, status: Status, message: str) -> None:
    assert diagnosis.explain_branches(found, NAMES) == (status, message)


@pytest.mark.parametrize(
    ("complete", "least", "status", "message"),
    [
        (
            True,
            None,
            Status.UNREACHABLE,
            "no configuration reaches the target, whatever the parameter and the limits",
        ),
        (
            True,
            LimitExcess(np.zeros(6), np.array([0.0, 0.5, 0.0, 0.0, 0.0, 0.0]), 1.25),
            Status.OUTSIDE_LIMITS,
            "each of the 3 branches is outside the limits for every value of the parameter; the closest one exceeds "
            "the limits of joint_2 by 0.5 rad, at parameter 1.25 rad",
        ),
        (
            False,
            None,
            Status.NO_CONVERGENCE,
            "none of the 3 branches found is within the limits, and some curves were lost",
        ),
    ],
)
def test_families(complete: bool, least: LimitExcess | None, status: Status, message: str) -> None:
    assert diagnosis.explain_curves(complete, 3, least, NAMES) == (status, message)


def test_descents() -> None:
    def explained(best: tuple[float, float], *, failed: bool = False) -> diagnosis.Outcome:
        return diagnosis.explain_descents(7, best, SolverOptions(), failed=failed)

    assert explained((1.0, 1.0), failed=True) == (Status.SOLVER_ERROR, "no QP solver solved the step")
    assert explained((0.2, 0.1)) == (Status.NO_CONVERGENCE, "7 starts ended in local minima")
    missed = "what comes nearest after 7 starts misses by"
    assert explained((1e-7, 7.3e-6)).message == f"{missed} 7.3e-6 rad: orientation_tolerance=1e-5 accepts it"
    both = "2.0e-5 m and 3.0e-4 rad: position_tolerance=1e-4, orientation_tolerance=1e-3 accept it"
    assert explained((2e-5, 3e-4)).message == f"{missed} {both}"


def test_contact_names_three_pairs() -> None:
    pairs = [("a", "b"), ("c", "d"), ("e", "f"), ("g", "h"), ("i", "j")]
    named = "all touch at a and b, c and d, e and f"
    assert diagnosis.explain_contact("all touch", pairs[:3]) == named
    assert diagnosis.explain_contact("all touch", pairs[:4]) == f"{named} and 1 more pair"
    assert diagnosis.explain_contact("all touch", pairs) == f"{named} and 2 more pairs"


def test_the_first_candidate_that_is_a_success_is_selected(robot: Robot, monkeypatch: pytest.MonkeyPatch) -> None:
    verifier = IKSolver(robot, collision="reject").verifier
    target = interpret(robot.forward_kinematics(robot.home), "end_effector")
    seed, note = seed_within_limits(robot, None)
    request = Request(target, seed, note, None, 0, False)
    turned = [robot.home + 2.0 * np.pi * turns * robot.unlimited for turns in range(3)]
    off = robot.home + 1e-3
    clear: list[Array] = []
    monkeypatch.setattr(verifier, "touches", lambda q: not any(np.array_equal(q, row) for row in clear))
    monkeypatch.setattr(verifier, "pairs_in_contact", lambda _: [("hand", "link_2")])

    def select(*rows: Array) -> jacokin.IKResult | None:
        candidates = [Candidate(q, target, f"number {number}") for number, q in enumerate(rows)]
        return verifier.select(candidates, request, "all are in contact; the first")

    assert select() is None
    assert select(off) is None
    touched = select(off, *turned)
    assert touched is not None
    assert (touched.status, touched.touching) == (Status.IN_COLLISION, (("hand", "link_2"),))
    assert touched.message == "all are in contact; the first at hand and link_2"
    np.testing.assert_array_equal(touched.q, turned[0])
    clear.append(turned[1])
    found = select(off, *turned)
    assert found is not None
    assert (found.status, found.message, found.touching) == (Status.OK, "number 2", ())
    np.testing.assert_array_equal(found.q, turned[1])


def test_a_target_beyond_reach_is_so_with_or_without_a_closed_form(robot: Robot) -> None:
    solver = IKSolver(robot, "link_4")
    result = solver.solve(jacokin.pose([5.0, 0.0, 0.0], down=True))
    assert result.status is Status.UNREACHABLE
    assert result.message == "the target is farther away than the arm is long"
    assert "no closed form" in solver.solve(robot.forward_kinematics(robot.home, "link_4")).message
