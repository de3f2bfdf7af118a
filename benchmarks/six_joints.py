"""Arms of any structure: branches lost, closure, times and preparation, exact and with every joint moved by a little.

python -m benchmarks.six_joints [--quick]

Branches are judged by Newton's method from random starts, which knows no structure. ssik has no row: it prepares a
solver for each arm first, which this program does not do.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

import jacokin
from benchmarks import report
from jacokin.arrays import Array
from jacokin.ik.closed_form import ClosedForm
from jacokin.ik.geometry import chain_of

H = np.pi / 2  # [rad]
#: a [m], d [m], alpha [rad] of each joint, Denavit and Hartenberg's. Structures to solve, named after the arms whose
#: numbers they are close to: they have not been compared with the makers' documents, and are no description of an arm.
ARMS: dict[str, tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]] = {
    # Drawn once at random: no structure at all.
    "generic": (
        (0.37, 0.42, 0.29, 0.18, 0.22, 0.31),
        (0.1, 0.43, 0.31, 0.27, 0.19, 0.24),
        (1.3, -2.1, 0.8, 2.4, -1.1, 0.6),
    ),
    # A spherical wrist.
    "Puma 560": ((0, 0.4318, 0.0203, 0, 0, 0), (0.6718, 0, 0.15005, 0.4318, 0, 0.056), (H, 0, -H, H, -H, 0)),
    # Made up after common industrial arms: offsets at the shoulder and the elbow, a spherical wrist.
    "industrial": ((0.15, 0.6, 0.12, 0, 0, 0), (0.45, 0, 0, 0.62, 0, 0.1), (-H, 0, -H, H, -H, 0)),
    # Three parallel axes.
    "UR5": ((0, -0.425, -0.39225, 0, 0, 0), (0.089159, 0, 0, 0.10915, 0.09465, 0.0823), (H, 0, 0, H, -H, 0)),
    # A wrist offset, two parallel axes.
    "CRX-10iA": ((0, 0.54, 0, 0, 0, 0), (0.245, 0, 0, 0.54, 0.15, 0.16), (-H, np.pi, -H, H, -H, 0)),
    # Built like a Jaco to rounding, so that its closed form takes it.
    "Gen3 lite": ((0, 0.28, 0, 0, 0, 0), (0.2433, 0.03, 0.02, 0.245, 0.057, 0.235), (H, np.pi, H, H, H, 0)),
    # Offsets at the elbow and the wrist.
    "xArm6": ((0, 0.28949, 0.0775, 0, 0.076, 0), (0.267, 0, 0, 0.3425, 0, 0.097), (-H, 0, -H, H, -H, 0)),
    # Made up: a wrist whose axes miss each other.
    "offset wrist": ((0.05, 0.4, 0.03, 0.02, 0.07, 0), (0.3, 0.1, 0.05, 0.35, 0.08, 0.1), (H, 0, H, -H, H, 0)),
}
#: Bundled ones, for comparison: exact, the first two have closed forms of their own.
BUNDLED = ("j2n6s300", "j2s6s300")
#: [rad] and [m]; every placement is moved at random by about this.
MOVES = (0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 3e-5, 1e-4, 3e-4, 1e-3, 2e-3, 3.5e-3, 5e-3)
PROMISED = ("own lost", "wrongly complete")
REGULAR = 1e-3  # smallest singular value of a branch that must be found
SAME = 1e-6  # [rad]
NEWTON_STEPS, LONGEST_STEP, CLOSED = 40, 0.7, 1e-10  # -, [rad], [m] and [rad]


@dataclass(frozen=True, slots=True)
class Score:
    """Figures of one arm."""

    preparation: float
    """[s]"""
    times: Array
    """(n,) of one random pose each, the better of two calls [s]."""
    round_times: Array
    """(m,) of one pose of round angles each [s]."""
    lost: int
    """Regular branches that brute force knows and the solver does not."""
    wrong: int
    """Poses of which `complete` is said although a regular branch is lost."""
    known: int
    """Regular branches that brute force knows."""
    own_lost: int
    """Regular configurations that poses were made from and that are not found."""
    incomplete: int
    """Poses of which `complete` is not said."""
    closure: float
    """Largest distance of a regular branch from its target, by Pinocchio [m] and [rad]."""


def placements(name: str) -> Array:
    """(7, 3, 4) of an arm."""
    if name in BUNDLED:
        robot = jacokin.load_robot(name)
        return chain_of(robot.pin_model, robot.frame_id(robot.default_frame), None, 6)
    chain = np.zeros((7, 3, 4))
    chain[0, :, :3] = np.eye(3)
    for i, (a, d, alpha) in enumerate(zip(*ARMS[name], strict=True)):
        chain[i + 1, :, :3] = pin.exp3(np.array([alpha, 0.0, 0.0]))
        chain[i + 1, :, 3] = a, 0.0, d
    return chain


def moved(chain: Array, size: float) -> Array:
    """Each placement followed by a random one of about this size [rad], [m]; the same directions at every size."""
    rng = np.random.default_rng(0)
    result = chain.copy()
    for link in result:
        link[:, :3] = link[:, :3] @ pin.exp3(size * rng.normal(size=3))
        link[:, 3] += size * rng.normal(size=3)
    return result


def model_of(chain: Array) -> tuple[pin.Model, int]:
    """Pinocchio's model of placements, and the frame of its tool."""
    model = pin.Model()
    for i in range(6):
        model.addJoint(i, pin.JointModelRZ(), pin.SE3(chain[i, :, :3], chain[i, :, 3]), f"joint_{i + 1}")
    tool = pin.Frame("tool", 6, 0, pin.SE3(chain[6, :, :3], chain[6, :, 3]), pin.FrameType.OP_FRAME)
    return model, model.addFrame(tool)


class BruteForce:
    """Newton's method from random starts, in Pinocchio."""

    def __init__(self, chain: Array) -> None:
        """Make the model."""
        self.model, self.frame = model_of(chain)
        self.data = self.model.createData()

    def pose(self, q: Array) -> pin.SE3:
        """Of the tool at q (6,)."""
        pin.framesForwardKinematics(self.model, self.data, q)
        return self.data.oMf[self.frame].copy()

    def miss(self, q: Array, target: pin.SE3) -> float:
        """How far the tool at q (6,) is from a pose [m] and [rad]."""
        return float(np.abs(pin.log6(self.pose(q).actInv(target)).vector).max())

    def regular(self, q: Array) -> bool:
        """Whether the Jacobian at q (6,) is far from singular."""
        J = pin.computeFrameJacobian(self.model, self.data, q, self.frame, pin.LOCAL)
        return bool(np.linalg.svd(J, compute_uv=False)[-1] > REGULAR)

    def branches(self, target: pin.SE3, starts: int, rng: np.random.Generator) -> list[Array]:
        """Regular configurations (6,) that reach a pose."""
        found: list[Array] = []
        for q in rng.uniform(-np.pi, np.pi, (starts, 6)):
            for _ in range(NEWTON_STEPS):
                rest = pin.log6(self.pose(q).actInv(target)).vector
                if np.abs(rest).max() < CLOSED:
                    break
                J = pin.computeFrameJacobian(self.model, self.data, q, self.frame, pin.LOCAL)
                step = np.linalg.lstsq(J, rest, rcond=None)[0]
                q += step * min(1.0, LONGEST_STEP / max(np.abs(step).max(), 1e-300))
            else:
                continue
            if self.regular(q) and not contains(found, q, 1e-5):
                found.append(q.copy())
        return found


def contains(rows: Array | list[Array], q: Array, within: float) -> bool:
    """Whether one of the rows is q (6,) on the circle, within so much [rad]."""
    return any(np.abs((row - q + np.pi) % (2.0 * np.pi) - np.pi).max() < within for row in rows)


def configurations(rng: np.random.Generator, count: int) -> Array:
    """Random ones (n, 6), each fifth of multiples of 30 or 90 degrees [rad]."""
    q = rng.uniform(-np.pi, np.pi, (count, 6))
    for i in range(1, count, 5):
        step = np.pi / 6 if i % 2 else np.pi / 2
        q[i] = np.round(q[i] / step) * step
    return q


def measure(chain: Array, count: int, checked: int, starts: int) -> Score:
    """Solve for poses of one arm, some of them checked by brute force."""
    rng = np.random.default_rng(1)
    judge = BruteForce(chain)
    free = np.full(6, np.inf)
    begin = time.perf_counter()
    form = ClosedForm(*model_of(chain), None, -free, free)
    preparation = time.perf_counter() - begin
    times, home = np.empty(count), np.zeros(6)
    lost = wrong = known = own_lost = incomplete = 0
    closure = 0.0
    for i, q in enumerate(configurations(rng, count)):
        target = judge.pose(q)
        T = np.ascontiguousarray(target.homogeneous)
        durations = []
        for _ in range(2):
            begin = time.perf_counter()
            branches = form.solve_all(T, home)
            durations.append(time.perf_counter() - begin)
        times[i] = min(durations)
        incomplete += not branches.complete
        own_lost += judge.regular(q) and not contains(branches.q, q, SAME)
        closure = max([closure, *(judge.miss(row, target) for row in branches.q if judge.regular(row))])
        if i < checked:
            there = judge.branches(target, starts, rng)
            missing = sum(not contains(branches.q, other, SAME) for other in there)
            lost, known, wrong = lost + missing, known + len(there), wrong + (missing > 0 and branches.complete)
    rounded = np.arange(count) % 5 == 1
    return Score(preparation, times[~rounded], times[rounded], lost, wrong, known, own_lost, incomplete, closure)


def row_of(title: str, score: Score) -> tuple[str, ...]:
    """A row of the table."""
    slow, slow_round = (float(np.quantile(times, 0.99)) for times in (score.times, score.round_times))
    return (
        title,
        f"{score.own_lost}",
        f"{score.lost} of {score.known}",
        f"{score.wrong}",
        report.percent(score.incomplete / (len(score.times) + len(score.round_times))),
        f"{score.closure:.1e}",
        report.seconds(float(np.median(score.times))),
        report.seconds(slow),
        report.seconds(slow_round),
        report.seconds(score.preparation),
    )


def all_of(scores: list[Score]) -> Score:
    """Figures of several arms together, the worst of what is not counted."""
    return Score(
        max(score.preparation for score in scores),
        np.concatenate([score.times for score in scores]),
        np.concatenate([score.round_times for score in scores]),
        sum(score.lost for score in scores),
        sum(score.wrong for score in scores),
        sum(score.known for score in scores),
        sum(score.own_lost for score in scores),
        sum(score.incomplete for score in scores),
        max(score.closure for score in scores),
    )


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few poses, two sizes of the moves")
    quick = parser.parse_args().quick
    count, checked, starts = (50, 1, 50) if quick else (1000, 24, 250)
    header = (
        "own lost",
        "branches lost",
        "wrongly complete",
        "incomplete",
        "residual",
        "median",
        "p99",
        "p99, round",
        "preparation",
    )
    names = (*ARMS, *BUNDLED)
    chains = {name: placements(name) for name in names}
    print(f"Exact arms, {count:,} poses each, a fifth of round angles; {checked} of them also by brute force.")
    print("Times of random poses, and of those of round angles:\n")
    rows = [row_of(name, measure(chains[name], count, checked, starts)) for name in names]
    print(report.condensed(("arm", *header), rows, PROMISED))
    print("\nAll arms together, every joint moved at random by about so much (m and rad):\n")
    rows = []
    for size in MOVES[1::6] if quick else MOVES[1:]:
        scores = [
            measure(moved(chains[name], size), max(count // 5, 20), max(checked // 8, 1), starts) for name in names
        ]
        rows.append(row_of(f"{size:g}", all_of(scores)))
    print(report.condensed(("moved by", *header), rows, PROMISED))


if __name__ == "__main__":
    main()
