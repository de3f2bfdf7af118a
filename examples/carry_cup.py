"""Pick up a cup, carry it past a crate, and put it down; the simulation moves it by contact alone.

    python examples/carry_cup.py

The plans are in the frame of the arm's base; the arm follows their rows by its velocity actuators.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

import jacokin
from jacokin.model import Box, Floor, Scene
from jacokin.motion import grasps, plan_pick, plan_place
from jacokin.mujoco_bridge import (
    Arena,
    Physics,
    Primitive,
    command_joint_positions,
    observations,
    robots,
)

CUP = np.array([0.05, 0.05, 0.12])  # [m]
FROM, TO = np.array([0.42, 0.22]), np.array([0.42, -0.25])  # [m] where it stands, and where it is to stand
ABOVE = 2e-3  # [m] of the floor, where the plans have the cup
CRATE = np.array([0.2, 0.06, 0.12])  # [m] between the two
SQUEEZE = 1.0  # [rad/s] commanded to the fingers
STEPS = 5  # physics steps in a row of a plan: 10 ms
LIFT = 0.12  # [m]


class Kitchen:
    """The arm with its hand, a cup and a crate, in MuJoCo and as the planner sees them."""

    def __init__(self) -> None:
        """Put everything together and go home."""
        self.arm = robots.make_arm(observations.PERFECT_FEATURES)
        self.hand = robots.make_hand(observations.PERFECT_FEATURES)
        self.arm.attach(self.hand)
        self.cup = Primitive("box", 0.5 * CUP, mass=0.05, name="cup")
        crate = Primitive("box", 0.5 * CRATE, name="crate")
        arena = Arena()
        arena.attach(self.arm)
        arena.attach(crate, position=(0.45, 0.0, 0.5 * CRATE[2]))
        arena.add_free_entity(self.cup, position=(*FROM, 0.5 * CUP[2]))
        self.physics = Physics.from_entity(arena)
        self.arm.set_home(self.physics)

        self.robot = jacokin.load_robot()
        self.shape = Box("cup", CUP, [*FROM, 0.5 * CUP[2] + ABOVE])
        self.scene = Scene([Floor(0.0), Box("crate", CRATE, [0.45, 0.0, 0.5 * CRATE[2]]), self.shape])
        self.solver = jacokin.IKSolver(self.robot, scene=self.scene)

    @property
    def q(self) -> NDArray[np.float64]:
        """(6,) joint angles now [rad]."""
        return np.array(self.physics.bind(self.arm.joints).qpos)

    def cup_position(self) -> NDArray[np.float64]:
        """(3,) [m]."""
        return np.array(self.physics.bind(self.cup.geom).xpos)

    def follow(self, rows: Iterable[NDArray[np.float64]], squeeze: float = 0.0, fingers: float | None = None) -> None:
        """Follow rows of joint angles; fingers are squeezed at a speed [rad/s], or kept at an angle [rad]."""
        for q in rows:
            command_joint_positions(self.physics, self.arm, q, gain=20.0)
            angles = self.physics.bind(self.hand.joints).qpos
            self.physics.bind(self.hand.actuators).ctrl = squeeze if fingers is None else 5.0 * (fingers - angles)
            self.physics.step(STEPS)

    def wait(self, seconds: float, squeeze: float = 0.0, fingers: float | None = None) -> None:
        """Stay where the arm is commanded to be."""
        self.follow([self.q] * round(seconds / (STEPS * self.physics.timestep)), squeeze, fingers)


def carry(kitchen: Kitchen) -> None:
    """Plan and perform, one after the other.

    Raises:
        RuntimeError: there is no way.
    """
    ways = grasps.box(CUP, kitchen.shape.pose)
    pick = plan_pick(kitchen.solver, kitchen.robot.home, ways, obstacle="cup", lift=LIFT, time_limit=20.0)
    if pick.reach is None or pick.lift is None:
        raise RuntimeError(pick.message)
    print("pick:", pick.message)
    there = jacokin.pose([*TO, 0.5 * CUP[2] + ABOVE])
    turned = jacokin.FreeAxis(there, axis=[0.0, 0.0, 1.0])  # it may turn about the vertical
    place = plan_place(kitchen.solver, pick.lift.q[-1], pick, turned, time_limit=20.0)
    if place.bring is None or place.retreat is None:
        raise RuntimeError(place.message)
    print("place:", place.message)

    kitchen.follow(pick.reach.q, fingers=pick.opening)
    kitchen.wait(1.5, SQUEEZE)
    kitchen.follow(pick.lift.q, SQUEEZE)
    kitchen.follow(place.bring.q, SQUEEZE)
    kitchen.wait(0.5, SQUEEZE)
    kitchen.wait(1.0, fingers=place.opening)
    kitchen.follow(place.retreat.q, fingers=place.opening)


def main() -> None:
    """Carry the cup and say where it stands."""
    kitchen = Kitchen()
    carry(kitchen)
    x, y, z = kitchen.cup_position()
    print(f"the cup stands at {x:.3f}, {y:.3f}, {z:.3f} m after {kitchen.physics.time:.1f} s")


if __name__ == "__main__":
    main()
