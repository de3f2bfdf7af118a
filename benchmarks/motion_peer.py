"""Free motions beside OMPL's RRT-Connect and sscbirrt: the same problems, the same contact, the same timing.

OMPL's trees and its path simplifier run in C++ and ask jacokin whether a motion is clear; sscbirrt's CBiRRT and its
smoothing ask whether a configuration is, every 0.05 rad, as is its way with a checker of one's own: what of its paths
jacokin cannot certify is counted. Goals are the same configurations, and all ways are timed by the same code, under the
same limits. Needs ``pip install ompl sscbirrt`` (2.0, 3.15); run from the repository:
``python -m benchmarks.motion_peer [--problems 10] [--time-limit 10] [KIND ..]``. Times are those of the processor, and
those of the peers hold the calls back into Python.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from ompl import base, geometric, util
from sscbirrt import CBiRRT, CBiRRTConfig

import jacokin
from benchmarks.motion import ACCELERATION, KINDS, ROBOTS, Problem, problems
from jacokin import Robot, plan_motion
from jacokin.arrays import Array
from jacokin.model.angles import nearest_copy
from jacokin.model.contact import Contact
from jacokin.motion.free_motion.plan_motion import GoalFinder, search_of
from jacokin.motion.free_motion.search import Randomness
from jacokin.motion.free_motion.timed_course import fit_time
from jacokin.motion.rows import Limits

WAYS = (1, 2, 4, 16)


class Space:
    """Configurations of a robot as OMPL's states: a circle for each unlimited joint, an interval for each other."""

    def __init__(self, robot: Robot) -> None:
        """Weigh joints as `plan_motion` does."""
        self._robot = robot
        self.ompl = base.CompoundStateSpace()
        for joint in range(robot.dof):
            weight = float(robot.velocity_limit.mean() / robot.velocity_limit[joint])
            self.ompl.addSubspace(self._of_joint(joint), weight)

    def _of_joint(self, joint: int) -> Any:
        if self._robot.unlimited[joint]:
            return base.SO2StateSpace()
        line, bounds = base.RealVectorStateSpace(1), base.RealVectorBounds(1)
        bounds.setLow(float(self._robot.lower[joint]))
        bounds.setHigh(float(self._robot.upper[joint]))
        line.setBounds(bounds)
        return line

    def state(self, q: Array) -> Any:
        """A new state at a configuration (dof,)."""
        made = self.ompl.allocState()
        for joint, value in enumerate(q.tolist()):
            if self._robot.unlimited[joint]:
                made[joint].value = (value + np.pi) % (2.0 * np.pi) - np.pi
            else:
                made[joint][0] = value
        return made

    def q(self, state: Any) -> Array:
        """The configuration (dof,) of a state."""
        free = self._robot.unlimited
        return np.array([state[j].value if free[j] else state[j][0] for j in range(self._robot.dof)])


class Ends(NamedTuple):
    """A problem as its peers take it."""

    contact: Contact
    clear: list[Array]
    """Configurations (dof,) of the goal that are clear [rad]."""


def plan_ompl(problem: Problem, ends: Ends, limit: float) -> list[Array] | None:
    """OMPL's way within the limit [s]."""
    contact, robot = ends.contact, problem.solver.robot
    space = Space(robot)

    class Validator(base.MotionValidator):  # type: ignore[misc]  # OMPL has no types
        """Certifies motions as `plan_motion` does."""

        def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:
            start = space.q(a)
            return contact.in_the_way(start, nearest_copy(space.q(b), start, robot.unlimited)) is None

    about = base.SpaceInformation(space.ompl)
    about.setStateValidityChecker(lambda state: not contact.touches(space.q(state)))
    about.setMotionValidator(Validator(about))
    about.setup()
    asked, goals = base.ProblemDefinition(about), base.GoalStates(about)
    asked.addStartState(space.state(problem.start))
    for q in ends.clear:
        goals.addState(space.state(q))
    asked.setGoal(goals)
    planner = geometric.RRTConnect(about)
    planner.setProblemDefinition(asked)
    planner.setup()
    planner.solve(limit)
    if not asked.hasExactSolution():
        return None
    path = asked.getSolutionPath()
    geometric.PathSimplifier(about).simplifyMax(path)
    return [space.q(state) for state in path.getStates()]


class Arm:
    """A robot and its contact as sscbirrt asks for them."""

    def __init__(self, robot: Robot, contact: Contact) -> None:
        """Unlimited joints get one turn."""
        self._robot, self._contact = robot, contact
        self.dof = robot.dof
        low, high = (np.where(robot.unlimited, end, of) for end, of in ((-np.pi, robot.lower), (np.pi, robot.upper)))
        self.joint_limits = low, high

    def forward_kinematics(self, q: Array) -> Array:
        """Not needed for goals that are configurations."""
        return np.asarray(self._robot.forward_kinematics(q).homogeneous)

    def is_valid(self, q: Array) -> bool:
        """Whether nothing touches."""
        return not self._contact.touches(np.asarray(q, dtype=np.float64))


def plan_sscbirrt(problem: Problem, ends: Ends, limit: float) -> list[Array] | None:
    """The way of sscbirrt within the limit [s]."""
    robot = problem.solver.robot
    arm = Arm(robot, ends.contact)
    config = CBiRRTConfig(timeout=limit, continuous_joints=tuple(robot.unlimited.tolist()))
    wrapped = [nearest_copy(q, np.zeros(robot.dof), robot.unlimited) for q in (problem.start, *ends.clear)]
    found = CBiRRT(arm, None, arm, config).plan(wrapped[0], wrapped[1:], seed=0)
    return None if found is None else list(found)


#: Plans a problem within so many seconds: configurations (dof,) [rad] from the start to a goal, or None.
Plan: TypeAlias = Callable[[Problem, Ends, float], list[Array] | None]
PEERS: dict[str, Plan] = {"OMPL": plan_ompl, "sscbirrt": plan_sscbirrt}


class Answer(NamedTuple):
    """What a peer found."""

    taken: float
    """[ms]."""
    duration: float
    """Of the motion [s]."""
    certified: bool
    """Whether nothing touches all along it."""


def ask(plan: Plan, problem: Problem, limit: float) -> Answer | None:
    """The answer of a peer; None where it finds no way within the limit [s]."""
    solver, robot = problem.solver, problem.solver.robot
    search = search_of(solver)
    goals, _ = GoalFinder(solver, problem.start, Randomness()).find_all([problem.goal])
    ends = Ends(search.contact, [goal.q for goal in goals if not search.contact.touches(goal.q)])
    full, hard = robot.velocity_limit, np.full(robot.dof, ACCELERATION)
    search.begin(problem.start, np.array(ends.clear), full, Limits(full, hard), Randomness())
    begin = time.process_time()
    found = plan(problem, ends, limit)
    taken = 1e3 * (time.process_time() - begin)
    if found is None:
        return None
    way = [problem.start]
    for q in found[1:]:
        way.append(nearest_copy(q, way[-1], robot.unlimited))
    rows = np.array(way)
    rows = rows[np.append(True, np.abs(np.diff(rows, axis=0)).max(axis=1) > 1e-9)]
    certified = all(search.contact.in_the_way(a, b) is None for a, b in pairwise(rows))
    return Answer(taken, fit_time(*search.cut_corners(rows), full, full, hard).duration, certified)


def compare(robot: Robot, kind: str, count: int, limit: float) -> Iterator[str]:
    """Rows of the table: medians over the problems whose straight motions are blocked."""
    ours: dict[int, list[tuple[float, float]]] = {ways: [] for ways in WAYS}
    theirs: dict[str, list[Answer | None]] = {name: [] for name in PEERS}
    for problem in problems(robot, kind, count):
        plan_motion(problem.solver, problem.start, problem.start)
        if "straight" in plan_motion(problem.solver, problem.start, problem.goal, time_limit=limit).message:
            continue
        for name, plan in PEERS.items():
            theirs[name].append(ask(plan, problem, limit))
        for ways in WAYS:
            begin = time.process_time()
            motion = plan_motion(problem.solver, problem.start, problem.goal, time_limit=limit, ways=ways)
            taken = 1e3 * (time.process_time() - begin)
            ours[ways].append((taken, motion.duration if motion.success else np.inf))
    for name, answers in theirs.items():
        found = [answer for answer in answers if answer is not None]
        heading = f"| {robot.name} | {kind} | {name} |"
        if not found:
            yield f"{heading} 0 of {len(answers)} | 0 |" + " |" * (1 + len(WAYS))
            continue
        durations = np.array([answer.duration for answer in found])
        cells = [f"{np.median([answer.taken for answer in found]):.0f} ms, {np.median(durations):.1f} s"]
        for rows in ours.values():
            taken, duration = np.median(rows, axis=0)
            same = [row[1] for row, answer in zip(rows, answers, strict=True) if answer is not None]
            cells.append(f"{taken:.1f} ms, {duration:.1f} s ({np.median(same / durations):.2f})")
        certified = sum(answer.certified for answer in found)
        yield f"{heading} {len(found)} of {len(answers)} | {certified} | {' | '.join(cells)} |"


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", help=f"of scenes: {', '.join(KINDS)}; all if none is given")
    parser.add_argument("--problems", type=int, default=10)
    parser.add_argument("--time-limit", type=float, default=10.0, help="[s]")
    parser.add_argument("--robot", choices=ROBOTS, action="append")
    given = parser.parse_args()
    util.setLogLevel(util.LOG_WARN)
    ways = " | ".join(f"ways={w}" for w in WAYS)
    print(f"| robot | scene | peer | solved, of those blocked | certified | its time and motion | {ways} |")
    print("| --- " * (6 + len(WAYS)) + "|")
    for name in given.robot or ROBOTS:
        robot = jacokin.load_robot(name)
        for kind in given.kinds or KINDS:
            for row in compare(robot, kind, given.problems, given.time_limit):
                print(row, flush=True)


if __name__ == "__main__":
    main()
