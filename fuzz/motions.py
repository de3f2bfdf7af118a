"""Motions between random configurations among random obstacles, held against MuJoCo's distances and the limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import cache
from itertools import pairwise
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin

from fuzz.findings import Finding
from jacokin import IKSolver, load_robot, plan_motion, pose
from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.model import NAMES, Box, Capsule, Cylinder, Floor, Robot, Scene, Sphere
from jacokin.motion import Trajectory, move_joints
from tests.compiled_twin import compile_twin

FINE = 1e-3  # [rad] between configurations that the referee looks at
DEEPER = 5e-5  # [m] than this counts: rows are joined by straight lines where the motion turns a corner
SAME = 1e-6  # [m] and [rad] of a pose that is reached, and of limits


class Referee:
    """MuJoCo's distances between the shapes whose contact counts."""

    def __init__(self, robot: Robot, scene: Scene) -> None:
        """Compile the arm among the obstacles."""
        self.model, pairs = compile_twin(robot, scene.surroundings)
        self.data = mujoco.MjData(self.model)
        self.first, self.second = np.array(pairs).T
        sizes = self.model.geom_rbound
        self.far = sizes[self.first] + sizes[self.second]
        self.far[(sizes[self.first] == 0.0) | (sizes[self.second] == 0.0)] = np.inf  # planes

    def distance(self, q: Array, most: float) -> float:
        """The least at a configuration (dof,), or `most` where it is larger [m]."""
        return min(self.near(q, most).values(), default=most)

    def near(self, q: Array, most: float) -> dict[tuple[int, int], float]:
        """Pairs that are no farther apart than `most` at a configuration (dof,), and how far [m]."""
        self.data.qpos[:] = q
        mujoco.mj_kinematics(self.model, self.data)
        places = self.data.geom_xpos
        near = np.linalg.norm(places[self.first] - places[self.second], axis=1) < self.far + most
        pairs = zip(self.first[near].tolist(), self.second[near].tolist(), strict=True)
        found = {(a, b): mujoco.mj_geomDistance(self.model, self.data, a, b, most, None) for a, b in pairs}
        return {pair: distance for pair, distance in found.items() if distance < most}


def run(seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """Case after case, one motion each."""
    for case in range(first, first + cases):
        rng = np.random.default_rng([seed, case])
        robot = _robot(NAMES[int(rng.integers(len(NAMES)))])
        yield case, 1, list(check_joints(robot, rng) if rng.random() < 0.3 else check_plan(robot, rng))


_robot = cache(load_robot)


def random_scene(robot: Robot, rng: np.random.Generator) -> Scene:
    """Up to six obstacles around the arm, often a floor."""
    found: list[Box | Sphere | Capsule | Cylinder | Floor] = []
    for number in range(int(rng.integers(7))):
        name, size = f"obstacle {number}", 10.0 ** rng.uniform(-2.0, -0.5, 3)  # [m]
        place = pose(rng.uniform((-0.8, -0.8, 0.0), (0.8, 0.8, 1.1)), rpy=rng.uniform(-3.0, 3.0, 3))
        kind = int(rng.integers(4))
        if kind == 0:
            found.append(Box(name, size, place))
        elif kind == 1:
            found.append(Sphere(name, float(size[0]), place.translation))
        else:
            round_one = Capsule if kind == 2 else Cylinder
            found.append(round_one(name, float(size[0]), float(size[1]), place))
    if rng.random() < 0.5:
        found.append(Floor(float(rng.uniform(-0.1, 0.0))))
    return Scene(found)


def check_plan(robot: Robot, rng: np.random.Generator) -> Iterator[Finding]:
    """`plan_motion`: free of contact where it succeeds; where it does not, what it says is true."""
    scene = random_scene(robot, rng)
    clearance = float(rng.choice([0.0, 0.0, 0.01, 0.03]))  # [m]
    solver = IKSolver(robot, collision="reject", scene=scene, clearance=clearance)
    start, end = robot.sample(rng, 2)
    goal: Array | pin.SE3 = end
    aim = rng.random()
    if aim < 0.4:
        goal = robot.forward_kinematics(end) if aim < 0.3 else robot.forward_kinematics(end).translation
    limits = random_limits(robot, rng)
    given = f"{robot.name}, clearance {clearance}, start {start.tolist()}, goal {goal}, {limits}"
    try:
        motion = plan_motion(
            solver, start, goal, time_limit=20.0, ways=int(rng.integers(1, 4)), rng=np.random.default_rng(0), **limits
        )
    except JacokinError as error:
        yield Finding("raw", "plan_motion", f"{error}; {given}")
        return
    referee = Referee(robot, scene)
    if motion.success:
        yield from check_motion(robot, motion, start, limits, given)
        if isinstance(goal, pin.SE3):
            missed = pin.log6(goal.actInv(robot.forward_kinematics(motion.q[-1]))).vector
            if not np.abs(missed).max() < 3.0 * SAME:
                yield Finding("wrong", "plan_motion, its goal", f"missed by {missed}; {given}")
        rows = np.array(list(between(motion.q)))
        pairs = [referee.near(q, clearance - DEEPER) for q in rows]
        apart_at = [k for k, near in enumerate(pairs) if not near] or [len(rows)]
        for k, near in enumerate(pairs):  # at its start it leaves what is near, and at its end it comes to that
            least: dict[tuple[int, int], float] = {}
            if k < apart_at[0] or k > apart_at[-1]:
                least = pairs[0] if k < apart_at[0] else pairs[-1]
            nearer = [distance for pair, distance in near.items() if distance < least.get(pair, clearance) - DEEPER]
            if nearer:
                yield Finding("wrong", "plan_motion, contact", f"{min(nearer):.3g} m at {rows[k].tolist()}; {given}")
                break
        return
    apart = clearance + 2e-3  # [m] farther apart than the clearance is not in contact
    ends_clear = [referee.distance(q, 2.0 * apart) > apart for q in (start, end)]
    if motion.outcome == "START_IN_CONTACT":
        if ends_clear[0]:
            yield Finding("wrong", "START_IN_CONTACT", given)
    elif motion.outcome in ("UNREACHABLE", "GOAL_IN_CONTACT"):
        if ends_clear[1]:  # it is a configuration that reaches the goal, or the goal itself
            yield Finding("lost", motion.outcome, given)
    elif motion.outcome == "NO_WAY" and aim >= 0.4:
        line = np.array([start, start + robot_difference(robot, start, end)])
        if all(referee.distance(q, 2.0 * apart) > apart for q in between(line)):
            yield Finding("lost", "NO_WAY, and the straight motion is free", given)


def check_joints(robot: Robot, rng: np.random.Generator) -> Iterator[Finding]:
    """`move_joints`: within its limits, and not slower than they ask for."""
    start, end = robot.sample(rng, 2)
    if rng.random() < 0.2:
        end = np.clip(start + 10.0 ** rng.uniform(-12.0, -1.0) * rng.normal(size=robot.dof), robot.lower, robot.upper)
    limits = random_limits(robot, rng)
    given = f"{robot.name}, from {start.tolist()} to {end.tolist()}, {limits}"
    try:
        motion = move_joints(robot, start, end, **limits)
    except JacokinError as error:
        yield Finding("raw", "move_joints", f"{error}; {given}")
        return
    if not motion.success:
        if motion.outcome != "TOO_HEAVY" or limits["torque_limit"] is None:
            yield Finding("wrong", "move_joints", f"{motion.outcome}; {given}")
        return
    yield from check_motion(robot, motion, start, limits, given)
    size = np.abs(robot_difference(robot, start, end))
    velocity, acceleration = motion.velocity_limit, limits["acceleration_limit"]
    ramp = np.where(size > velocity**2 / acceleration, size / velocity + velocity / acceleration, 0.0)
    least = np.where(ramp > 0.0, ramp, 2.0 * np.sqrt(size / acceleration)).max()  # [s]
    if motion.duration < least - 1e-6:
        yield Finding("wrong", "move_joints, faster than its limits", f"{motion.duration} of {least}; {given}")
    if limits["jerk_limit"] is None and limits["torque_limit"] is None and motion.duration > least + 3.0 * limits["dt"]:
        yield Finding("wrong", "move_joints, slower than its limits", f"{motion.duration} of {least}; {given}")


def random_limits(robot: Robot, rng: np.random.Generator) -> dict[str, Any]:
    """Limits that a motion is asked to hold."""
    slow = robot.velocity_limit * 10.0 ** rng.uniform(-1.0, 0.0, robot.dof)
    return {
        "velocity_limit": slow if rng.random() < 0.3 else None,
        "acceleration_limit": 10.0 ** rng.uniform(-1.0, 1.0),
        "jerk_limit": 10.0 ** rng.uniform(0.0, 2.0) if rng.random() < 0.3 else None,
        "torque_limit": True if rng.random() < 0.2 else None,
        "dt": float(rng.choice([0.001, 0.01, 0.05])),
    }


def check_motion(
    robot: Robot, motion: Trajectory, start: Array, limits: Mapping[str, Any], given: str
) -> Iterator[Finding]:
    """Rows within all limits, from rest to rest, and following from each other."""
    q, v, a, t = motion.q, motion.v, motion.a, motion.t
    velocity = robot.velocity_limit if limits["velocity_limit"] is None else limits["velocity_limit"]
    acceleration = limits["acceleration_limit"]
    step = np.diff(t)[:, None]
    jerk = limits["jerk_limit"]
    for what, good in (
        ("the limits of position", ((q >= robot.lower) & (q <= robot.upper)).all()),
        ("the limits of velocity", (np.abs(v) <= velocity * (1.0 + SAME)).all()),
        ("the limits of acceleration", (np.abs(a) <= acceleration * (1.0 + SAME)).all()),
        ("velocity between rows", (np.abs(np.diff(q, axis=0)) <= velocity * step * (1.0 + SAME) + 1e-12).all()),
        ("acceleration between rows", (np.abs(np.diff(v, axis=0)) <= acceleration * step * (1.0 + SAME) + 1e-9).all()),
        ("jerk between rows", jerk is None or (np.abs(np.diff(a, axis=0)) <= jerk * step * (1.0 + SAME) + 1e-6).all()),
        (
            "positions that follow from velocities",
            (np.abs(np.diff(q, axis=0) - 0.5 * step * (v[1:] + v[:-1])) <= acceleration * step**2 + 1e-9).all(),
        ),
        ("its start", np.array_equal(q[0], start)),
        ("rest at both ends", not v[[0, -1]].any()),
        ("rising times", t[0] == 0.0 and (step > 0.0).all()),
    ):
        if not good:
            yield Finding("wrong", f"a motion breaks {what}", given)
    if limits["torque_limit"]:
        needed = np.array([robot.inverse_dynamics(*row) for row in zip(q, v, a, strict=True)])
        if (np.abs(needed) > robot.effort_limit * (1.0 + 1e-3)).any():
            yield Finding("wrong", "a motion breaks the limits of torque", given)


def between(rows: Array) -> Iterator[Array]:
    """Configurations on the lines between rows (n, dof), at most `FINE` apart."""
    for a, b in pairwise(rows):
        count = max(1, int(np.ceil(np.abs(b - a).max() / FINE)))
        for k in range(count):
            yield a + k / count * (b - a)
    yield rows[-1]


def robot_difference(robot: Robot, start: Array, end: Array) -> Array:
    """The straight way (dof,) [rad], the short way round on joints without limits."""
    size = end - start
    return np.where(robot.unlimited, (size + np.pi) % (2.0 * np.pi) - np.pi, size)
