"""Two Jacos on one table, planned one after the other: how many pairs of tasks are solved, and contacts in time.

Each arm goes from one tool pose to another over the strip of the table that both reach. The first is planned among the
table and the second arm, which stands at its start; the second beside the motion of the first
(`plan_motion(meanwhile=)`). Where that fails, the other one goes first.

The referee knows nothing of this: MuJoCo has both arms, as their generated files describe them, and the table in one
model, plays both motions by cubics from row to row, no joint more than 2 mrad from one look to the next, and lists what
touches anything, or is nearer than the clearance of 1 mm.

Run from the repository: ``python -m benchmarks.two_arms [--pairs 100] [--step 2e-3]``. Times are of the processor.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Iterator
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio as pin
from scipy.interpolate import CubicHermiteSpline

import jacokin
from benchmarks.report import machine
from jacokin import IKSolver, Robot, plan_motion
from jacokin.arrays import Array
from jacokin.ik import Floor, Scene
from jacokin.model import urdf_folder
from jacokin.model.poses import quaternion
from jacokin.motion import Trajectory

ROBOT = "j2n6s300"
APART = 0.8  # [m] from base to base
STRIP = np.array([(0.2, -0.3, 0.08), (0.6, 0.3, 0.4)])  # [m] where tools begin and end, from the base of the left arm
TILT = 0.5  # [rad] of tools, from straight down, at most
CLEARANCE = 1e-3  # [m] that plans keep
KNOWN = 1e-4  # [m] how well MuJoCo knows distances near contact
SEEN = 5e-3  # [m] up to which the referee measures distances

NAMES = ("left", "right")
T_left_right = pin.SE3(pin.utils.rotate("z", np.pi), np.array([APART, 0.0, 0.0]))


class Pair(NamedTuple):
    """Two tasks at once; of each arm in its base, the left one first."""

    starts: tuple[Array, Array]
    """(dof,) [rad]."""
    goals: tuple[pin.SE3, pin.SE3]
    """Poses of the tools."""


class Outcome(NamedTuple):
    """What became of a pair."""

    motions: tuple[Trajectory, Trajectory] | None
    """That of the left arm first; None where one was not found."""
    order: tuple[int, int]
    """Which arm was planned for first."""
    seconds: float
    """Processor time of the second plan [s]."""
    reasons: tuple[str, ...] = ()
    """Why a plan failed."""


def base_of_other(arm: int) -> pin.SE3:
    """T_base_other for an arm: the other one stands across the table."""
    return T_left_right if arm == 0 else T_left_right.inverse()


def scene_of(robot: Robot, arm: int, other_q: Array) -> Scene:
    """The table, and the other arm where it stands."""
    return Scene([Floor(0.0, "table")]).adding_robot(robot, other_q, name=NAMES[1 - arm], base=base_of_other(arm))


def random_pairs(robot: Robot, count: int) -> Iterator[Pair]:
    """Pairs whose ends touch nothing for some configurations of both arms; whether there is a way is open."""
    rng = np.random.default_rng(43)
    for _ in range(count):
        starts, (left, right) = _clear(robot, rng), _clear(robot, rng)
        yield Pair(starts, (robot.forward_kinematics(left), robot.forward_kinematics(right)))


def _clear(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array]:
    """Configurations (dof,) of both arms over the strip that touch nothing [rad]."""
    while True:
        found = _configurations(robot, rng, _tools(rng))
        if found is not None:
            return found


def _tools(rng: np.random.Generator) -> tuple[pin.SE3, pin.SE3]:
    """Poses of two tools in the base of the left arm."""
    while True:
        places = rng.uniform(STRIP[0], STRIP[1], (2, 3))
        if np.linalg.norm(places[0] - places[1]) >= 0.15:  # [m] of two tools at the same time
            left, right = (jacokin.pose(place, rotation=_downwards(rng)) for place in places)
            return left, right


def _downwards(rng: np.random.Generator) -> Array:
    yaw, tilt = rng.uniform(-np.pi, np.pi), rng.uniform(-TILT, TILT, 2)
    turned: Array = pin.utils.rpyToMatrix(np.pi + tilt[0], tilt[1], yaw)
    return turned


def _configurations(
    robot: Robot, rng: np.random.Generator, tools: tuple[pin.SE3, pin.SE3]
) -> tuple[Array, Array] | None:
    """Configurations of both at tool poses; None where one is out of reach, or something is near."""
    found = list[Array]()
    for arm, pose in enumerate((tools[0], T_left_right.inverse() * tools[1])):
        scene = Scene([Floor(0.0, "table")]) if arm == 0 else scene_of(robot, arm, found[0])
        solver = IKSolver(robot, scene=scene, clearance=2.0 * CLEARANCE)
        result = solver.solve(pose, seed=robot.sample(rng), rng=rng)
        if not result.success:
            return None
        found.append(result.q)
    if scene_of(robot, 0, found[1]).contact(robot).with_clearance(2.0 * CLEARANCE).touches(found[0]):
        return None
    return found[0], found[1]


def plan(robot: Robot, pair: Pair, time_limit: float) -> Outcome:
    """Both motions, one arm after the other, in either order."""
    seconds, reasons = 0.0, list[str]()
    for first, second in ((0, 1), (1, 0)):
        solver = IKSolver(robot, scene=scene_of(robot, first, pair.starts[second]), clearance=CLEARANCE)
        leading = plan_motion(solver, pair.starts[first], pair.goals[first], time_limit=time_limit)
        if not leading.success:
            reasons.append(f"{NAMES[first]} first: {leading.message}")
            continue
        solver = IKSolver(robot, scene=scene_of(robot, second, pair.starts[first]), clearance=CLEARANCE)
        begin = time.process_time()
        following = plan_motion(
            solver, pair.starts[second], pair.goals[second], time_limit=time_limit, meanwhile={NAMES[first]: leading}
        )
        seconds = time.process_time() - begin
        if following.success:
            motions = (leading, following) if first == 0 else (following, leading)
            return Outcome(motions, (first, second), seconds)
        reasons.append(f"{NAMES[second]} second: {following.message}")
    return Outcome(None, (0, 1), seconds, tuple(reasons))


class Referee:
    """Both arms and the table in one model of MuJoCo."""

    def __init__(self, robot: Robot) -> None:
        """Compile it from the files of the arms."""
        spec = mujoco.MjSpec()
        spec.worldbody.add_geom(name="table", type=mujoco.mjtGeom.mjGEOM_PLANE, size=[2.0, 2.0, 0.1])
        for name, base in zip(NAMES, (pin.SE3.Identity(), T_left_right), strict=True):
            frame = spec.worldbody.add_frame(pos=base.translation, quat=quaternion(base.rotation))
            arm = mujoco.MjSpec.from_file(str(urdf_folder() / f"{ROBOT}.xml"))
            spec.attach(arm, prefix=f"{name}/", frame=frame)
        for geom in spec.geoms:
            geom.contype, geom.conaffinity, geom.margin = 1, 1, SEEN
        self._model = model = spec.compile()
        self._data = mujoco.MjData(model)
        joints = [[f"{name}/{joint}" for joint in robot.joint_names] for name in NAMES]
        self._places = [[int(model.joint(joint).qposadr[0]) for joint in each] for each in joints]
        fingers = [k for k in range(model.njnt) if "finger" in model.joint(k).name]
        self._data.qpos[[int(model.jnt_qposadr[k]) for k in fingers]] = robot.finger_angle

    def nearest(self, motions: tuple[Trajectory, Trajectory], step: float) -> tuple[float, str]:
        """The smallest distance along two motions at once [m], at most `SEEN`, and between what.

        Args:
            motions: of both arms.
            step: no joint moves farther between two looks [rad].
        """
        model, data = self._model, self._data
        end = max(motion.duration for motion in motions)
        fastest = max(float(np.abs(motion.v).max()) for motion in motions)
        times = np.linspace(0.0, end, max(int(np.ceil(1.05 * end * fastest / step)), 1) + 1)
        rows = [_played(motion, times) for motion in motions]
        assert max(float(np.abs(np.diff(each, axis=0)).max(initial=0.0)) for each in rows) <= step
        least, what = SEEN, ""
        for left, right in zip(*rows, strict=True):
            data.qpos[self._places[0]], data.qpos[self._places[1]] = left, right
            mujoco.mj_kinematics(model, data)
            mujoco.mj_collision(model, data)
            for contact in data.contact[: data.ncon]:
                if contact.dist < least:
                    least = float(contact.dist)
                    what = " and ".join(model.geom(int(geom)).name for geom in contact.geom)
        return least, what


def _played(motion: Trajectory, times: Array) -> Array:
    """Configurations (n, dof) at times (n,), by cubics from row to row; at rest after the last."""
    if len(motion.t) == 1:
        return np.repeat(motion.q, len(times), axis=0)
    return np.asarray(CubicHermiteSpline(motion.t, motion.q, motion.v)(np.minimum(times, motion.t[-1])))


def main() -> None:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--pairs", type=int, default=100)
    parser.add_argument("--time-limit", type=float, default=5.0, help="of each plan [s]")
    parser.add_argument("--step", type=float, default=2e-3, help="of the referee [rad]")
    given = parser.parse_args()
    robot = jacokin.load_robot(ROBOT)
    referee = Referee(robot)
    touching, near, at_once, waits, aside, swapped = 0, 0, 0, 0, 0, 0
    least, taken, durations = SEEN, list[float](), list[float]()
    for number, pair in enumerate(random_pairs(robot, given.pairs)):
        outcome = plan(robot, pair, given.time_limit)
        taken.append(1e3 * outcome.seconds)
        if outcome.motions is None:
            print(f"pair {number}: {'; '.join(outcome.reasons)}")
            continue
        following = outcome.motions[outcome.order[1]]
        waits, aside = waits + ("waits" in following.message), aside + ("aside" in following.message)
        swapped += outcome.order != (0, 1)
        durations.append(max(each.duration for each in outcome.motions))
        distance, what = referee.nearest(outcome.motions, given.step)
        least = min(least, distance)
        touching, near = touching + (distance <= 0.0), near + (distance < CLEARANCE - KNOWN)
        if distance < CLEARANCE - KNOWN:
            print(f"pair {number}: {what} are {1e3 * distance:.3f} mm apart")
        at_once += _unplanned(robot, pair, referee, given)
    median, most, worst = np.percentile(taken, [50, 95, 99])
    print(machine())
    print(
        f"{len(durations)} of {given.pairs} pairs solved, {swapped} with the right arm first: {touching} in contact, "
        f"{near} nearer than {1e3 * (CLEARANCE - KNOWN):.1f} mm, least distance {1e3 * least:.2f} mm"
    )
    print(
        f"the second arm waits in {waits}, moves aside in {aside}; its plan takes {median:.0f} / {most:.0f} / "
        f"{worst:.0f} ms (median / 95 % / 99 %); both are there after {np.median(durations):.1f} s in the median"
    )
    print(f"planned without each other, and begun at once, {at_once} of these pairs touch")


def _unplanned(robot: Robot, pair: Pair, referee: Referee, given: argparse.Namespace) -> bool:
    """Whether the arms touch where each is planned as if it were alone."""
    solver = IKSolver(robot, scene=Scene([Floor(0.0, "table")]), clearance=CLEARANCE)
    left, right = (
        plan_motion(solver, start, goal, time_limit=given.time_limit)
        for start, goal in zip(pair.starts, pair.goals, strict=True)
    )
    return referee.nearest((left, right), 10.0 * given.step)[0] <= 0.0


if __name__ == "__main__":
    main()
