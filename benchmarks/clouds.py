"""Clouds of points: what 100,000 of them cost beside the boxes that they were seen on.

Run from the repository: ``python -m benchmarks.clouds``. The points are on the surface of a table and a shelf, which
boxes are, too; those within 3 cm of the arm are dropped, as they are of a camera's image. Times are of one core, the
median of some rounds.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

import jacokin
from benchmarks.report import seconds, table
from jacokin import IKSolver, Robot, Tracker, plan_motion
from jacokin.arrays import Array
from jacokin.ik import Box, PointCloud, Scene

ROBOTS = ("j2n6s300", "gen3")
POINTS = 100_000
RADIUS = 0.005  # [m]
MARGIN = 0.03  # [m] around the arm, within which points are dropped
ROWS = 2000  # random configurations
MOTIONS = 40
ROUNDS = 7
FURNITURE = (
    Box("table", [1.2, 1.2, 0.05], [0.3, -0.3, -0.05]),
    *(Box(f"shelf at {height}", [0.3, 0.8, 0.02], [0.0, -0.65, height]) for height in (0.2, 0.45, 0.7)),
    *(Box(f"side at {y}", [0.3, 0.02, 0.8], [0.0, y, 0.45]) for y in (-1.05, -0.25)),
)


def surface(boxes: Sequence[Box], count: int, rng: np.random.Generator) -> Array:
    """Points (count, 3) evenly on the faces of upright boxes [m]."""
    sizes = np.array([box.size for box in boxes])
    centres = np.array([box.solid.placement.translation for box in boxes])
    areas = np.prod(sizes, axis=1, keepdims=True) / sizes  # of the face across each axis
    number, axis = np.unravel_index(rng.choice(areas.size, count, p=(areas / areas.sum()).ravel()), areas.shape)
    points = rng.uniform(-0.5, 0.5, (count, 3))
    points[np.arange(count), axis] = rng.choice([-0.5, 0.5], count)
    return np.asarray(points * sizes[number] + centres[number])


def median(call: Callable[[], object], rounds: int = ROUNDS) -> float:
    """Processor time of a call [s]."""
    times = []
    for _ in range(rounds):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return float(np.median(times))


def measured(robot: Robot, scene: Scene, others: Scene) -> list[str]:
    """What a scene costs, at configurations where it and another one are clear."""
    rows = robot.sample(np.random.default_rng(1), ROWS)
    free = rows[~(scene.contact(robot).touches_at(rows) | others.contact(robot).touches_at(rows))]
    contact, solver = scene.contact(robot), IKSolver(robot, scene=scene)
    ends = list(pairwise(free[: MOTIONS + 1]))
    motions = [median(partial(contact.in_the_way, a, b), 3) for a, b in ends]
    plans = [median(partial(plan_motion, solver, a, b), 1) for a, b in ends]
    return [
        seconds(median(lambda: solver.in_scene(Scene(scene.obstacles)))),
        seconds(median(lambda: contact.touches_at(free)) / len(free)),
        seconds(median(lambda: contact.touches_at(rows)) / len(rows)),
        seconds(median(lambda: contact.distances(rows)) / len(rows)),
        seconds(float(np.median(motions))),
        f"{seconds(float(np.median(plans)))}, at most {seconds(max(plans))}",
        seconds(tick(robot, scene)),
    ]


def tick(robot: Robot, scene: Scene) -> float:
    """A tick of a tracker on its way down to the table [s]."""
    tracker = Tracker(robot, scene=scene)
    start = robot.forward_kinematics(robot.home)
    target = jacokin.pose([*start.translation[:2], -0.2], rotation=start.rotation)
    times = []
    for _ in range(200):
        begin = time.process_time()
        tracker.step(target)
        times.append(time.process_time() - begin)
    return float(np.median(times))


HEADS = ("", "in_scene", "free, each", "any, each", "distance, each", "a motion", "plan_motion", "tracker, tick")


def main() -> None:
    """Print the tables."""
    seen = surface(FURNITURE, POINTS, np.random.default_rng(0))
    print(f"PointCloud of {POINTS:,} points: {seconds(median(lambda: PointCloud('seen', seen, RADIUS)))}\n")
    for name in ROBOTS:
        robot = jacokin.load_robot(name)
        points = robot.without_own_points(robot.home, seen, margin=MARGIN)
        taken = seconds(median(partial(robot.without_own_points, robot.home, seen, margin=MARGIN)))
        print(f"{name}: without_own_points leaves {len(points):,} points, in {taken}\n")
        cloud, boxes = Scene([PointCloud("seen", points, RADIUS)]), Scene(FURNITURE)
        rows = [["points", *measured(robot, cloud, boxes)], ["boxes", *measured(robot, boxes, cloud)]]
        print(table(HEADS, rows), "\n")


if __name__ == "__main__":
    main()
