"""Hold the arm up by torques alone, and lead it by the hand.

    MUJOCO_GL=egl python -m examples.gravity_compensation

The actuators take torques, and get those of gravity, computed by Pinocchio from the joint angles. So the arm stays
wherever it is, and goes wherever a hand pushes it. Friction of the joints is switched off: it would hide what the
torques do. Pictures go to ``gravity_compensation.gif``; pillow writes them.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import jacokin
from examples.drawing import Film
from jacokin.mujoco_bridge import Arena, Physics, observations, robots

STEPS = 5  # physics steps of 2 ms in a tick
FRAME_EVERY = 12  # ticks
PUSHES = ((0.0, 40.0, 0.0), (-30.0, 0.0, 30.0), (0.0, -40.0, -20.0))  # [N] in the world
PUSHED, COASTING = 1.0, 1.5  # [s]
DAMPING = np.array([6.0, 6.0, 6.0, 3.0, 3.0, 3.0])  # [N m s/rad] of the joints, so that the arm comes to rest


class Demonstration:
    """The arm with its hand, which takes torques."""

    def __init__(self) -> None:
        """Put everything together and go home."""
        self.robot = jacokin.load_robot()
        self.arm = robots.make_arm(observations.PERFECT_FEATURES, actuation="torque")
        hand = robots.make_hand(observations.PERFECT_FEATURES)
        self.arm.attach(hand)
        arena = Arena()
        arena.attach(self.arm, position=robots.ARM_OFFSET)
        self.physics = Physics.from_entity(arena)
        self.arm.set_home(self.physics)
        self.joints = self.physics.bind(self.arm.joints)
        self.joints.frictionloss = 0.0
        self.link = self.physics.bind(self.arm.joints[-1].parent)

    def tick(self, force: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
        """One tick, with a force [N] on the last link."""
        self.link.xfrc_applied = [*force, 0.0, 0.0, 0.0]
        torque = self.robot.gravity(self.joints.qpos) - DAMPING * self.joints.qvel
        self.physics.bind(self.arm.actuators).ctrl = torque
        self.physics.step(STEPS)

    def perform(self) -> Iterator[None]:
        """Stay, then be pushed about, one tick at a time."""
        tick = STEPS * self.physics.timestep
        for _ in range(round(COASTING / tick)):
            self.tick()
            yield
        for push in PUSHES:
            for force, seconds in ((push, PUSHED), ((0.0, 0.0, 0.0), COASTING)):
                for _ in range(round(seconds / tick)):
                    self.tick(force)
                    yield


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=Path(), help="where to write the pictures")
    arguments = parser.parse_args()
    show = Demonstration()
    film = Film(show.physics.model, (*robots.ARM_OFFSET[:2], 0.45))
    for index, _ in enumerate(show.perform()):
        if index % FRAME_EVERY == 0:
            film.take(show.physics.data)
    film.save(arguments.folder / "gravity_compensation.gif", FRAME_EVERY * STEPS * show.physics.timestep)
    print(f"at {np.round(show.joints.qpos, 2).tolist()} rad after {show.physics.time:.1f} s")


if __name__ == "__main__":
    main()
