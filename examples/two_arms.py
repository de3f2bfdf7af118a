"""Two arms at one table: each fetches from the middle, and is planned beside the motion of the other one.

    python examples/two_arms.py
    MUJOCO_GL=egl python -m examples.two_arms --picture two_arms.gif

Both reach the places in the middle, and bring what is there to their own side. Whenever an arm comes to rest, its next
motion is planned in time beside the motion that the other one is on: it goes at once, waits, or moves aside. Where the
other one is going to stand at its goal, it stays until that has moved on. Nothing is grasped here.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import jacokin
from jacokin import IKSolver, Robot
from jacokin.model import Floor, Scene, urdf_folder
from jacokin.model.poses import quat_wxyz
from jacokin.motion import Trajectory, move_joints, plan_motion

MIDDLE = ((0.40, -0.22, 0.06), (0.40, 0.04, 0.06), (0.40, 0.25, 0.06))  # [m] places from the base of the left arm
SIDES = {"left": (0.15, 0.35, 0.15), "right": (0.65, -0.35, 0.15)}  # [m]
BASES = {"left": jacokin.pose([0.0, 0.0, 0.0]), "right": jacokin.pose([0.8, 0.0, 0.0], rpy=[0.0, 0.0, np.pi])}
ORDER = {"left": (0, 2, 1), "right": (1, 0, 2)}  # of the places in the middle
CLEARANCE = 0.01  # [m]
PATIENCE = 1.0  # [s] for which an arm stays when there is no way yet
FRAMES = 4  # pictures a second


@dataclass(eq=False)
class Arm:
    """One arm: what it is on, and what it is still to do."""

    name: str
    robot: Robot
    motion: Trajectory
    """The last one that was planned; it began at `begin` [s]."""
    goals: list[pin.SE3]
    """Poses of the tool in its own base, those that are left."""
    begin: float = 0.0
    told: list[str] = field(default_factory=list)
    """What the plans say."""

    @property
    def end(self) -> float:
        """When it comes to rest [s]."""
        return self.begin + self.motion.duration

    def at(self, time: float) -> NDArray[np.float64]:
        """Where its joints are (dof,) [rad]."""
        return np.asarray(self.motion.state_at(time - self.begin).q)


def arms() -> tuple[Arm, Arm]:
    """Both at their own sides, with all to do."""
    robot, found = jacokin.load_robot(), list[Arm]()
    alone = IKSolver(robot, scene=Scene([Floor(0.0, "table")]), clearance=CLEARANCE)
    for name, base in BASES.items():
        places = [place for number in ORDER[name] for place in (MIDDLE[number], SIDES[name])]
        poses = [base.inverse() * jacokin.pose(place, down=True) for place in (SIDES[name], *places)]
        start = alone.solve(poses[0], seed=robot.home)
        start.raise_for_status()
        found.append(Arm(name, robot, move_joints(robot, start.q, start.q), poses[1:]))
    return found[0], found[1]


def step(arm: Arm, other: Arm, now: float) -> None:
    """Plan the next motion of an arm that rests at a time [s] beside what the other one is on."""
    base = BASES[arm.name].inverse() * BASES[other.name]
    scene = Scene([Floor(0.0, "table")]).adding_robot(other.robot, other.at(now), name=other.name, base=base)
    solver = IKSolver(arm.robot, scene=scene, clearance=CLEARANCE)
    meanwhile = {other.name: (other.motion, now - other.begin)}
    motion = plan_motion(solver, arm.motion.q[-1], arm.goals[0], meanwhile=meanwhile, time_limit=5.0)
    if motion.success:
        arm.goals.pop(0)
        arm.told.append(motion.message)
    else:
        arm.told.append("stays")
        motion = stay(arm.robot, arm.motion.q[-1])
    arm.motion, arm.begin = motion, now


def stay(robot: Robot, q: NDArray[np.float64]) -> Trajectory:
    """A motion that stands still."""
    still = np.zeros((2, robot.dof))
    rows = np.array([0.0, PATIENCE]), np.vstack([q, q]), still, still
    return Trajectory.of(robot, robot.velocity_limit, rows)


def perform() -> tuple[tuple[Arm, Arm], list[tuple[Arm, Trajectory, float]]]:
    """Both arms when all is done, and every motion with the time at which it begins [s]."""
    both = arms()
    motions = list[tuple[Arm, Trajectory, float]]()
    while any(arm.goals for arm in both):
        arm, other = sorted(both, key=lambda each: each.end if each.goals else np.inf)
        step(arm, other, arm.end)
        motions.append((arm, arm.motion, arm.begin))
    return both, motions


def film(motions: list[tuple[Arm, Trajectory, float]], end: float, file: Path) -> None:
    """Write a moving picture of both."""
    from examples.drawing import Film
    from jacokin.cli.picture import FINGERS, scene

    spec, base = scene(), BASES["right"]
    frame = spec.worldbody.add_frame(pos=base.translation, quat=quat_wxyz(base.rotation))
    spec.attach(mujoco.MjSpec.from_file(str(urdf_folder() / "j2n6s300.xml")), prefix="right/", frame=frame)
    for place in (*MIDDLE, *SIDES.values()):
        kind = mujoco.mjtGeom.mjGEOM_CYLINDER
        spec.worldbody.add_geom(type=kind, size=[0.04, 0.002, 0.0], pos=[*place[:2], 0.002], rgba=[0.9, 0.5, 0.2, 1.0])
    model = spec.compile()
    data, camera = mujoco.MjData(model), Film(model, [0.4, 0.0, 0.3], azimuth=75.0, distance=1.6)
    for finger in (k for k in range(model.njnt) if "finger" in model.joint(k).name):
        data.qpos[model.jnt_qposadr[finger]] = FINGERS
    for time in np.arange(0.0, end, 1.0 / FRAMES).tolist():
        for name, prefix in (("left", ""), ("right", "right/")):
            own = [(motion, begin) for arm, motion, begin in motions if arm.name == name]
            motion, begin = next(((m, b) for m, b in reversed(own) if b <= time), own[0])
            for joint, angle in zip(motion.joint_names, motion.state_at(time - begin).q, strict=True):
                data.joint(prefix + joint).qpos[0] = angle
        mujoco.mj_forward(model, data)
        camera.take(data)
    camera.save(file, 1.0 / FRAMES)


def main() -> None:
    """Print what happens, and draw it if asked to."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--picture", type=Path, help="write a moving picture here (.gif)")
    given = parser.parse_args()
    both, motions = perform()
    for arm, motion, begin in motions:
        print(f"{begin:6.2f} s  {arm.name:5}  {motion.message or 'stays where it is'}")
    end = max(arm.end for arm in both)
    print(f"both are done after {end:.1f} s; their motions add up to {sum(m.duration for _, m, _ in motions):.1f} s")
    if given.picture is not None:
        film(motions, end, given.picture)


if __name__ == "__main__":
    main()
