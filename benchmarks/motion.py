"""Free motions: seven kinds of scenes, how many are solved, in what time, and every path checked by other code.

The kinds are those of MotionBenchMaker (Chamzas et al. 2022), written anew for the reach of a Jaco: a table with
objects, under a table, three bookshelves, a box and a cage. Each problem is a scene, a start and a goal pose, which
have configurations without contact; whether there is a way between them is not known.

Run from the repository: ``python -m benchmarks.motion [--problems 100] [--ways 2] [--step 1e-3] [KIND ..]``. Times are
those of the processor, which are those of the clock on an idle core: other programs do not count. The referee samples
each path in steps of ``--step`` [rad] and has MuJoCo's own pipeline look for contact.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio as pin

import jacokin
from jacokin import IKSolver, Robot, plan_motion
from jacokin.arrays import Array
from jacokin.ik import Box, Cylinder, Floor, Obstacle, Scene
from jacokin.model.mujoco_twin import to_spec
from jacokin.motion import Trajectory

ROBOTS = ("j2n6s300", "j2s7s300")
ACCELERATION = 1.0  # [rad/s^2]
TRIES = 400  # poses for each end of a problem
DEEP = 1e-6  # [m] two shapes this deep in each other are in contact
ROUNDING = 1e-9


class Problem(NamedTuple):
    """One motion to be planned."""

    solver: IKSolver
    scene: Scene
    start: Array
    """(dof,) [rad]."""
    goal: pin.SE3


class Kind(NamedTuple):
    """A scene, and where the tool begins and ends in it."""

    obstacles: list[Obstacle]
    start: Callable[[], pin.SE3]
    goal: Callable[[], pin.SE3]


def ahead(position: Array, yaw: float, pitch: float = 0.0) -> pin.SE3:
    """A tool that points away from the base, turned to the side and down [rad]."""
    return pin.SE3(pin.utils.rotate("z", yaw) @ pin.utils.rotate("y", 0.5 * np.pi + pitch), np.asarray(position))


def down(position: Array, turn: float) -> pin.SE3:
    """A tool that points down, turned about the vertical [rad]."""
    return jacokin.pose(position, rpy=[np.pi, 0.0, turn])


def above(rng: np.random.Generator) -> pin.SE3:
    """The tool high in front of the base or beside it, pointing down."""
    angle, radius = rng.uniform(-2.2, 2.2), rng.uniform(0.3, 0.5)
    place = np.array([radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0.4, 0.65)])
    return down(place, rng.uniform(-np.pi, np.pi))


def table_pick(rng: np.random.Generator) -> Kind:
    """Objects close to each other on a table; the tool goes down to one of them."""
    height = rng.uniform(-0.05, 0.05)
    objects: list[Obstacle] = [Box("table", [0.7, 1.4, 0.04], [0.55, 0.0, height - 0.02])]
    places = [np.array([rng.uniform(0.3, 0.6), y + rng.uniform(-0.03, 0.03)]) for y in np.linspace(-0.45, 0.45, 7)]
    tall = rng.uniform(0.08, 0.3, len(places))
    for k, (place, size) in enumerate(zip(places, tall, strict=True)):
        centre = [*place, height + 0.5 * size + 1e-3]
        objects.append(
            Cylinder(f"can_{k}", 0.03, size, centre) if k % 2 else Box(f"box_{k}", [0.06, 0.05, size], centre)
        )
    which = int(rng.integers(len(places)))
    top = height + tall[which]

    def goal() -> pin.SE3:
        return down(np.array([*places[which], top + rng.uniform(0.03, 0.06)]), rng.uniform(-np.pi, np.pi))

    return Kind(objects, lambda: above(rng), goal)


def table_under(rng: np.random.Generator) -> Kind:
    """From above a table on four legs to below it."""
    height, x = rng.uniform(0.45, 0.6), 0.55
    objects: list[Obstacle] = [Box("top", [0.5, 1.0, 0.03], [x, 0.0, height])]
    for k, (dx, dy) in enumerate(((-0.22, -0.45), (-0.22, 0.45), (0.22, -0.45), (0.22, 0.45))):
        objects.append(Cylinder(f"leg_{k}", 0.02, height, [x + dx, dy, 0.5 * height]))

    def start() -> pin.SE3:
        place = np.array([rng.uniform(0.25, 0.45), rng.uniform(-0.3, 0.3), height + rng.uniform(0.12, 0.25)])
        return ahead(place, rng.uniform(-0.5, 0.5), rng.uniform(0.0, 0.3))

    def goal() -> pin.SE3:
        place = np.array([rng.uniform(0.35, 0.5), rng.uniform(-0.25, 0.25), rng.uniform(0.12, height - 0.15)])
        return ahead(place, rng.uniform(-0.5, 0.5), rng.uniform(0.0, 0.5))

    return Kind([*objects, Floor(-0.01)], start, goal)


def shelf(rng: np.random.Generator, levels: int, width: float, low: float, gap: float) -> Kind:
    """Boards between two sides and a back; from one compartment to another."""
    front, depth = rng.uniform(0.38, 0.44), 0.3
    x, total = front + 0.5 * depth, low + gap * (levels - 1)
    objects: list[Obstacle] = [Box(f"board_{k}", [depth, width, 0.02], [x, 0.0, low + gap * k]) for k in range(levels)]
    middle = 0.5 * (low + total)
    objects += [
        Box(f"side_{k}", [depth, 0.02, total - low + 0.02], [x, sign * 0.5 * width, middle])
        for k, sign in enumerate((-1.0, 1.0))
    ]
    objects.append(Box("back", [0.02, width, total - low + 0.02], [front + depth, 0.0, middle]))
    first, second = rng.permutation(levels - 1)[:2].tolist()

    def inside(level: int) -> pin.SE3:
        z = low + gap * (level + 0.5) + rng.uniform(-0.02, 0.02)
        side = max(0.5 * width - 0.16, 0.0)
        place = np.array([front + rng.uniform(0.02, 0.12), rng.uniform(-side, side), z])
        return ahead(place, rng.uniform(-0.3, 0.3))

    return Kind([*objects, Floor(-0.05)], lambda: inside(first), lambda: inside(second))


def box(rng: np.random.Generator) -> Kind:
    """Down into an open box, from outside."""
    size, thick, tall = rng.uniform(0.32, 0.4), 0.015, rng.uniform(0.15, 0.25)
    angle, radius = rng.uniform(-0.8, 0.8), rng.uniform(0.42, 0.5)
    place = pin.SE3(
        pin.utils.rotate("z", rng.uniform(-np.pi, np.pi)),
        np.array([radius * np.cos(angle), radius * np.sin(angle), 0.0]),
    )
    objects: list[Obstacle] = [Box("bottom", [size, size, thick], place * pin.SE3(np.eye(3), np.array([0, 0, 0.02])))]
    for k, (dx, dy) in enumerate(((-1, 0), (1, 0), (0, -1), (0, 1))):
        edges = [thick if dx else size, thick if dy else size, tall]
        centre = np.array([0.5 * size * dx, 0.5 * size * dy, 0.5 * tall + 0.02])
        objects.append(Box(f"side_{k}", edges, place * pin.SE3(np.eye(3), centre)))

    def goal() -> pin.SE3:
        away = place.act(np.array([rng.uniform(-0.06, 0.06), rng.uniform(-0.06, 0.06), rng.uniform(0.12, 0.2)]))
        return down(away, rng.uniform(-np.pi, np.pi))

    return Kind([*objects, Floor(-0.01)], lambda: above(rng), goal)


def cage(rng: np.random.Generator) -> Kind:
    """Between the bars of a cage in front of the arm, from the other side of the base."""
    front, low, high, half = rng.uniform(0.34, 0.4), 0.15, 0.65, 0.26
    objects: list[Obstacle] = []
    corners = [(front, y) for y in np.linspace(-half, half, 3)] + [
        (front + 0.36, y) for y in np.linspace(-half, half, 4)
    ]
    corners += [(front + 0.18, -half), (front + 0.18, half)]
    for k, (x, y) in enumerate(corners):
        objects.append(Cylinder(f"bar_{k}", 0.012, high - low, [x, y, 0.5 * (low + high)]))
    for k, z in enumerate((low, high)):
        for m, x in enumerate((front, front + 0.36)):
            objects.append(Box(f"rail_{k}_{m}", [0.025, 2 * half, 0.025], [x, 0.0, z]))
        for m, y in enumerate((-half, half)):
            objects.append(Box(f"beam_{k}_{m}", [0.36, 0.025, 0.025], [front + 0.18, y, z]))

    def start() -> pin.SE3:
        return ahead(np.array([rng.uniform(-0.4, -0.3), rng.uniform(-0.3, 0.3), rng.uniform(0.3, 0.5)]), np.pi)

    def goal() -> pin.SE3:
        side = float(rng.choice([-1.0, 1.0]))
        place = np.array([front + rng.uniform(0.06, 0.12), side * rng.uniform(0.1, 0.15), rng.uniform(0.3, 0.5)])
        return ahead(place, side * rng.uniform(0.0, 0.3))

    return Kind([*objects, Floor(-0.05)], start, goal)


KINDS: dict[str, Callable[[np.random.Generator], Kind]] = {
    "table pick": table_pick,
    "table under pick": table_under,
    "bookshelf small": lambda rng: shelf(rng, 3, rng.uniform(0.6, 0.8), 0.15, 0.34),
    "bookshelf tall": lambda rng: shelf(rng, 4, rng.uniform(0.6, 0.8), 0.05, 0.32),
    "bookshelf thin": lambda rng: shelf(rng, 4, rng.uniform(0.42, 0.5), 0.05, 0.32),
    "box": box,
    "cage": cage,
}


def problems(robot: Robot, kind: str, count: int) -> Iterator[Problem]:
    """So many problems of a kind, the same in each call."""
    found, seed = 0, 0
    while found < count:
        rng = np.random.default_rng((list(KINDS).index(kind), robot.dof, seed))
        seed += 1
        made = KINDS[kind](rng)
        scene = Scene(made.obstacles)
        solver = IKSolver(robot, scene=scene, collision="reject")
        start = _with_answer(solver, made.start)
        goal = None if start is None else _with_answer(solver, made.goal)
        if start is not None and goal is not None:
            found += 1
            answers = solver.solve(start, seed=robot.sample(rng))
            yield Problem(solver, scene, answers.q if answers.success else solver.solve(start).q, goal)


def _with_answer(solver: IKSolver, draw: Callable[[], pin.SE3]) -> pin.SE3 | None:
    """The first of some poses that a configuration reaches without contact."""
    for _ in range(TRIES):
        pose = draw()
        if solver.solve(pose, closest=False).success:
            return pose
    return None


def faults(robot: Robot, problem: Problem, motion: Trajectory, step: float) -> list[str]:
    """What is wrong with a motion, by other code: MuJoCo's kinematics and contact, and differences of its rows."""
    wrong = []
    if (motion.q < robot.lower).any() or (motion.q > robot.upper).any():
        wrong.append("position limit")
    dt = np.diff(motion.t)[:, None]
    if len(motion) > 1:
        if (np.abs(np.diff(motion.q, axis=0)) > robot.velocity_limit * dt * (1.0 + 1e-6) + ROUNDING).any():
            wrong.append("velocity limit")
        if (np.abs(np.diff(motion.v, axis=0)) > ACCELERATION * dt * (1.0 + 1e-6) + ROUNDING).any():
            wrong.append("acceleration limit")
    end = robot.forward_kinematics(motion.q[-1])
    if np.abs(end.homogeneous - problem.goal.homogeneous).max() > 2e-6:
        wrong.append("goal missed")
    spec = to_spec(robot, geometry=True)
    moving = [geom.name for geom in spec.geoms if geom.parent.parent.name != "world"]
    for obstacle in problem.scene.obstacles:
        obstacle.add_to(spec.worldbody)
    for obstacle in problem.scene.obstacles:
        for name in moving:
            spec.add_pair(name=f"{obstacle.name}~{name}", geomname1=obstacle.name, geomname2=name)
    model = spec.compile()
    data = mujoco.MjData(model)
    for a, b in zip(motion.q[:-1], motion.q[1:], strict=True):
        count = max(1, int(np.ceil(np.abs(b - a).max() / step)))
        for share in np.arange(1, count + 1) / count:
            data.qpos[:] = a + share * (b - a)
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            if (data.contact.dist < -DEEP).any():
                return [*wrong, "contact"]
    return wrong


def run(robot: Robot, kind: str, count: int, time_limit: float, step: float, ways: int = 2) -> str:
    """One row of the table."""
    taken, durations, ratios, straight, solved, wrong = [], [], [], 0, 0, 0
    for problem in problems(robot, kind, count):
        plan_motion(problem.solver, problem.start, problem.start)  # prepares contact, once for each scene
        begin = time.process_time()
        motion = plan_motion(
            problem.solver,
            problem.start,
            problem.goal,
            time_limit=time_limit,
            ways=ways,
            acceleration_limit=ACCELERATION,
        )
        taken.append(1e3 * (time.process_time() - begin))
        if not motion.success:
            continue
        solved += 1
        straight += "straight" in motion.message
        durations.append(motion.duration)
        least = problem.solver.solve(problem.goal, seed=problem.start).q - problem.start
        ratios.append(motion.duration / max(float((np.abs(least) / robot.velocity_limit).max()), 0.1))
        found = faults(robot, problem, motion, step) if step > 0.0 else []
        if found:
            wrong += 1
            print(f"{kind}: {', '.join(found)}")
    median, most, worst = np.percentile(taken, [50, 95, 99])
    return (
        f"| {robot.name} | {kind} | {solved} of {count} | {straight} | {median:.1f} / {most:.1f} / {worst:.1f} | "
        f"{np.median(durations):.1f} s | {np.median(ratios):.2f} | {wrong} |"
    )


def main() -> None:
    """Print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", help=f"of scenes: {', '.join(KINDS)}; all if none is given")
    parser.add_argument("--problems", type=int, default=100)
    parser.add_argument("--ways", type=int, default=2, help="around what is in the way, of which the quickest is taken")
    parser.add_argument("--time-limit", type=float, default=10.0, help="[s]")
    parser.add_argument("--step", type=float, default=1e-3, help="of the referee [rad]; 0 for none")
    parser.add_argument("--robot", choices=ROBOTS, action="append")
    given = parser.parse_args()
    print(
        "| robot | scene | solved | straight | ms: median / 95 % / 99 % | motion | over the nearest goal's | faults |"
    )
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    for name in given.robot or ROBOTS:
        robot = jacokin.load_robot(name)
        for kind in given.kinds or KINDS:
            print(run(robot, kind, given.problems, given.time_limit, given.step, given.ways), flush=True)


if __name__ == "__main__":
    main()
