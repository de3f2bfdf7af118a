"""The law of own answers: a configuration within the limits is the answer to its own pose, with itself as the seed."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cache, lru_cache

import numpy as np
import pinocchio as pin

from fuzz.findings import Finding
from jacokin import FreeAxis, IKSolver, load_robot, pose
from jacokin.arrays import Array
from jacokin.errors import JacokinError
from jacokin.ik import SolutionSet
from jacokin.ik.geometry import ArmGeometry, measure_seven
from jacokin.ik.preferences import cost_of
from jacokin.ik.targets import TargetPose
from jacokin.kernels.solution_set.seven_joints import MOST_ROWS, solve_at_q3
from jacokin.model import NAMES, Robot
from jacokin.model.angles import wrap_to_pi
from jacokin.model.descriptions.bundled import JACOS

BATCH = 50  # configurations in one case
REGULAR, SINGULAR = 1e-6, 1e-4  # [rad] distance of the answer from the configuration
SMALLEST = 1e-3  # smallest singular value of a regular configuration
MOVED = 1e-3  # [rad] distance of a seed from the configuration
ROUNDING = 1e-9  # [rad]
SCANNED = 0.05  # share of the sets that are held against branches at many values of the parameter
NOISE = 1e-9, 3e-2  # [rad]
TIGHT = 1e-3, 0.02, 0.05  # [rad] limits around a configuration
RANGES = (-0.1, 0.1), (-math.pi, 0.0), (-0.7, 0.0), (0.0, 2.0), (-1.0, 2.5)  # [rad] of a free axis
SCAN = 12  # values anywhere, and next to the configuration's at either side
ON_CURVE = 1e-3  # [rad] from a member

Maker = Callable[[Robot, np.random.Generator], Array]


def anywhere(robot: Robot, rng: np.random.Generator) -> Array:
    """Any configuration."""
    return robot.sample(rng)


def multiples(degrees: float) -> Maker:
    """Every joint at a multiple of an angle [deg]."""

    def make(robot: Robot, rng: np.random.Generator) -> Array:
        step = math.radians(degrees)
        return np.asarray(np.round(robot.sample(rng) / step) * step)

    return make


def on_a_limit(robot: Robot, rng: np.random.Generator) -> Array:
    """One joint on a limit."""
    q = robot.sample(rng)
    joint = rng.choice(np.flatnonzero(~robot.unlimited))
    q[joint] = rng.choice([robot.lower[joint], robot.upper[joint]])
    return q


def straight_wrist(robot: Robot, rng: np.random.Generator) -> Array:
    """The joint in the middle of the wrist at 180 degrees."""
    q = robot.sample(rng)
    q[-2] = math.pi
    return q


def stretched(robot: Robot, rng: np.random.Generator) -> Array:
    """The elbow at 180 degrees."""
    q = robot.sample(rng)
    q[-4] = math.pi
    return q


def on_several_limits(robot: Robot, rng: np.random.Generator) -> Array:
    """Any of the others but the noisy ones, and two or three joints on a limit."""
    others = [make for make in CLASSES.values() if make not in (on_several_limits, nearly)]
    q = others[int(rng.integers(len(others)))](robot, rng)
    for joint in rng.permutation(np.flatnonzero(~robot.unlimited))[: rng.integers(2, 4)]:
        q[joint] = rng.choice([robot.lower[joint], robot.upper[joint]])
    return q


def nearly(robot: Robot, rng: np.random.Generator) -> Array:
    """Any of the structured ones and noise of any size."""
    structured = [make for make in CLASSES.values() if make not in (anywhere, nearly)]
    q = structured[int(rng.integers(len(structured)))](robot, rng)
    low, high = np.log10(NOISE)
    return np.asarray(q + 10.0 ** rng.uniform(low, high) * rng.normal(size=robot.dof))


CLASSES: dict[str, Maker] = {
    "random": anywhere,
    "multiples of 30 degrees": multiples(30.0),
    "multiples of 90 degrees": multiples(90.0),
    "on a limit": on_a_limit,
    "straight wrist": straight_wrist,
    "stretched": stretched,
    "on several limits": on_several_limits,
    "nearly structured": nearly,
}


def run(seed: int, first: int, cases: int) -> Iterator[tuple[int, int, list[Finding]]]:
    """Cases of one robot and class each: the number of a case, its configurations, and what it revealed."""
    for case in range(first, first + cases):
        rng = np.random.default_rng([seed, case])
        name = NAMES[int(rng.integers(len(NAMES)))]
        with_tool = bool(rng.random() < 0.5)
        # Some arms have limits of their own.
        solver = _with_own_limits(name, rng) if rng.random() < 0.2 else _solver(name, with_tool)
        kind = list(CLASSES)[int(rng.integers(len(CLASSES)))]
        found: list[Finding] = []
        for _ in range(BATCH):
            robot = solver.robot
            q = np.clip(CLASSES[kind](robot, rng), robot.lower, robot.upper)
            found.extend(check(solver, kind, q, rng))
        yield case, BATCH, found


@cache
def _solver(name: str, with_tool: bool) -> IKSolver:
    return IKSolver(load_robot(name), tool=pose([0.5, 0.0, 0.0]) if with_tool else None, collision="ignore")


def _with_own_limits(name: str, rng: np.random.Generator) -> IKSolver:
    """Limits of some joints anywhere or at tens of degrees, less than a turn or more than one apart; any tool."""
    robot, limits = load_robot(name), {}
    for joint in robot.joint_names:
        if rng.random() < 0.5:
            low, length = (
                rng.uniform(-2.0 * math.pi, 0.0),
                rng.uniform(1.0, 4.0 * math.pi if rng.random() < 0.3 else 6.0),
            )
            ends = np.degrees([low, low + length])
            ends = np.round(ends, -1) if rng.random() < 0.5 else ends
            limits[joint] = float(math.radians(ends[0])), float(math.radians(ends[1]))
    tool = pose(rng.uniform(-0.3, 0.3, 3), rpy=rng.uniform(-math.pi, math.pi, 3))
    return IKSolver(load_robot(name, limits=limits), tool=tool, collision="ignore")


def check(solver: IKSolver, kind: str, q: Array, rng: np.random.Generator) -> Iterator[Finding]:
    """What breaks the law at one configuration (dof,) within the limits."""
    robot, T = solver.robot, solver.verifier.tool_pose(q)
    singular_value = float(np.linalg.svd(robot.jacobian(q), compute_uv=False)[-1])
    near = REGULAR if singular_value > SMALLEST else SINGULAR
    targets: list[FreeAxis | pin.SE3] = [T]
    if robot.dof == 6:
        targets.append(FreeAxis(T, axis=np.eye(3)[int(rng.integers(3))] if rng.random() < 0.7 else rng.normal(size=3)))
    way = rng.normal(size=robot.dof)
    seed = np.clip(q + MOVED * way / np.linalg.norm(way), robot.lower, robot.upper)
    for target in targets:
        where = f"{robot.name}, {kind}, {'FreeAxis' if isinstance(target, FreeAxis) else 'pose'}"
        given = f"q = {q.tolist()}, {target if isinstance(target, FreeAxis) else 'its own pose'}"
        try:
            own, moved = solver.solve(target, seed=q), solver.solve(target, seed=seed)
            everything = solver.solve_all(target)  # not told where to look
            held = _is_held(everything, q, near) if everything.dimension == 1 else True
            (scan_rng,) = rng.spawn(1)  # whether it scans changes no case
            scan = everything.dimension == 1 and scan_rng.random() < SCANNED
            missed = find_missing(solver, everything, target, q, scan_rng) if scan else None
        except JacokinError as error:
            yield Finding("raw", where, f"{error}; {given}")
            continue
        if not own.success:
            yield Finding("lost", where, f"{own.status.name}: {own.message}; {given}")
        elif (away := float(np.linalg.norm(own.q - q))) > near:
            yield Finding("wrong", where, f"the answer is {away:.3g} rad away; {given}")
        away, limit = float(np.linalg.norm(moved.q - seed)), float(np.linalg.norm(seed - q)) + max(near, ROUNDING)
        if not moved.success:
            yield Finding("lost", where, f"{moved.status.name} from a seed near by; {given}, {seed.tolist()}")
        elif away > limit:
            yield Finding("wrong", where, f"{away:.3g} rad from a seed near by; {given}, {seed.tolist()}")
        (other_rng,) = rng.spawn(1)
        if other_rng.random() < 0.1:  # share of the configurations that other ways of asking are tried on
            yield from (
                Finding(kind_of, where, f"{what}; {given}")
                for kind_of, what in otherwise(solver, target, q, near, other_rng)
            )
        if missed is not None:
            yield Finding("lost", where, f"complete, without {missed.tolist()}; {given}")
        if not held:
            yield Finding("lost" if everything.complete else "unsure", where, f"in no interval; {given}")


def otherwise(
    solver: IKSolver, target: FreeAxis | pin.SE3, q: Array, near: float, rng: np.random.Generator
) -> Iterator[tuple[str, str]]:
    """Kinds of findings, and what breaks the law where it is asked for in another way, at one configuration (dof,)."""
    robot, way = solver.robot, int(rng.integers(5))
    seeds = {"": q}
    if way == 0:  # in a batch, from whole turns away
        turned = q + 2.0 * math.pi * np.where(robot.unlimited, rng.integers(-2, 3, robot.dof), 0.0)
        rows = solver.solve_batch([target, target], seeds=np.array([q, turned]))
        for row, seed, good in zip(rows.q, (q, turned), rows.success, strict=True):
            if not good or np.linalg.norm(row - seed) > near + ROUNDING:
                yield "wrong", f"in a batch {np.linalg.norm(row - seed):.3g} rad away, from {seed.tolist()}"
        return
    if way == 1:  # with limits close by
        room = float(rng.choice(TIGHT)) * rng.integers(0, 2, (2, robot.dof))
        room[:, (room == 0.0).all(axis=0)] = TIGHT[0]
        limits = {
            name: (float(q[j] - room[0, j]), float(q[j] + room[1, j])) for j, name in enumerate(robot.joint_names)
        }
        source = robot.source.bundled or robot.source.path
        solver = IKSolver(load_robot(source, limits=limits), tool=solver.tool, collision="ignore")
        seeds["limits close by, "] = solver.robot.home
    elif way == 2:  # where contact is avoided
        solver = _avoiding(solver)
        if solver.verifier.touches(q):
            return
    elif way == 3 and isinstance(target, FreeAxis):  # at the end of a range
        target = FreeAxis(target.pose, axis=target.axis, range=RANGES[int(rng.integers(len(RANGES)))])
        everything = solver.solve_all(target)
        if not _is_held(everything, q, near):
            yield "lost" if everything.complete else "unsure", f"in no interval of {target.range}"
    elif way == 3 and robot.dof == 7:  # where two parameters are free
        target = FreeAxis(target, axis=rng.normal(size=3))
        seeds["from home, "] = robot.home
    elif way == 4:  # with a preference
        for prefer in ("margin", "manipulability"):
            cost = cost_of(prefer, robot, solver.frame)
            result = solver.solve(target, seed=q, prefer=prefer)
            worse = 0.0 if cost is None else (cost(result.q[np.newaxis]) - cost(q[np.newaxis])).item()
            if not result.success or worse > near:
                yield "wrong", f"prefer={prefer} is worse: {result.status.name}, {result.q.tolist()}"
    for name, seed in seeds.items():
        result = solver.solve(target, seed=seed, closest=False)
        if not result.success:
            yield "lost", f"{name}{result.status.name}, {target}"
        elif name == "" and (away := float(np.linalg.norm(result.q - q))) > near:
            yield "wrong", f"{away:.3g} rad away in way {way}"


@lru_cache(maxsize=32)
def _avoiding(solver: IKSolver) -> IKSolver:
    """The same, avoiding contact as users do who say nothing of it."""
    return IKSolver(solver.robot, tool=solver.tool)


def find_missing(
    solver: IKSolver, found: SolutionSet, target: FreeAxis | pin.SE3, q: Array, rng: np.random.Generator
) -> Array | None:
    """A branch (dof,) at some value of the parameter that a complete set lacks, most likely near q (dof,).

    Seven joints are scanned where joint 3 is the parameter, as of a Jaco.
    """
    robot, own = solver.robot, float(q[2]) if solver.robot.dof == 7 else 0.0
    if robot.dof == 7 and robot.source.bundled not in JACOS:
        return None
    limited = ~robot.unlimited
    middle = np.zeros(robot.dof)
    middle[limited] = 0.5 * (robot.lower[limited] + robot.upper[limited])
    apart = 10.0 ** rng.uniform(-6.0, -0.5, 2 * SCAN) * np.repeat([1.0, -1.0], SCAN)
    places = (*(own + apart), *rng.uniform(-math.pi, math.pi, SCAN)) if found.complete else ()
    is_seven = robot.dof == 7
    geometry = measure_seven(robot.pin_model, solver.verifier.frame_id, solver.verifier.tool) if is_seven else None
    for p in map(float, places):
        T = target.at(p) if isinstance(target, FreeAxis) else target
        members = [interval.at(p) for interval in found.intervals if interval.contains(p)]
        for branch in solver.solve_all(T).q if geometry is None else _at_joint_3(geometry, T, p):
            row = middle + wrap_to_pi(branch - middle)
            margin = np.minimum(row - robot.lower, robot.upper - row).min()
            # [rad] from every limit, and [m] and [rad] of branches that are asked for: others are not quite at the
            # target.
            if margin < 1e-6 or max(solver.verifier.measure(row, TargetPose(T.homogeneous))) > 1e-13:
                continue
            if any(_apart(member, row) <= ON_CURVE for member in members):
                continue
            if not any(
                _apart(interval.nearest(row), row) <= ON_CURVE for interval in found.intervals
            ):  # where one ends, too
                return np.asarray(row)
    return None


def _at_joint_3(geometry: ArmGeometry, T: pin.SE3, q3: float) -> Array:
    """Rows (k, 7) with joint 3 at an angle [rad]."""
    rows = np.empty((MOST_ROWS, 7))
    solve_at_q3(geometry.chain, geometry.arm, T.homogeneous, q3, rows)
    return rows[~np.isnan(rows[:, 0])]


def _is_held(found: SolutionSet, q: Array, near: float) -> bool:
    """Whether a configuration is a member."""
    return any(_apart(interval.nearest(q), q) <= max(near, 1e-5) for interval in found.intervals)


def _apart(a: Array, b: Array) -> float:
    return float(np.linalg.norm(wrap_to_pi(a - b)))
