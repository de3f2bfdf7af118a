"""Reach for a small cube, grasp it, lift it, and take pictures.

    MUJOCO_GL=egl python examples/grasp_cube.py

After the first frame nothing is written but the controls of the velocity actuators: what moves the cube is contact.
The pictures go to ``grasp_cube.gif`` and, side by side, to ``grasp_cube.png``. Without a display, MUJOCO_GL=egl needs
Debian's libegl1 and libegl-mesa0, MUJOCO_GL=osmesa needs libosmesa6; pillow writes the files.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.mujoco_bridge import (
    Arena,
    JacoArm,
    JacoHand,
    Physics,
    Primitive,
    command_joint_positions,
    observations,
    robots,
)

HALF = 0.02  # [m] half the cube's side
CLEARANCE = 0.15  # [m] above the cube before and after
GRASP_HEIGHT = 0.01  # [m] of the pinch site above the cube's centre
SQUEEZE = 1.0  # [rad/s] commanded to the fingers
STEPS = 20  # physics steps in a control step: 0.04 s
FRAME_EVERY = 10  # control steps
STRIP = 6  # pictures side by side


class Scene:
    """The arm with its hand, and a cube on the floor before it."""

    def __init__(self) -> None:
        """Put everything together and go home."""
        self.arm: JacoArm = robots.make_arm(observations.PERFECT_FEATURES)
        self.hand: JacoHand = robots.make_hand(observations.PERFECT_FEATURES)
        self.arm.attach(self.hand)
        self.cube = Primitive("box", (HALF, HALF, HALF), mass=0.05, name="cube")
        arena = Arena()
        arena.attach(self.arm, position=robots.ARM_OFFSET)
        arena.add_free_entity(self.cube, position=(0.0, 0.0, HALF))
        self.physics = Physics.from_entity(arena)
        self.arm.set_home(self.physics)

    def cube_height(self) -> float:
        """Height of the cube's centre [m]."""
        return float(self.physics.bind(self.cube.geom).xpos[2])

    def plan(self) -> list[NDArray[np.float64]]:
        """Joint angles above the cube, at it, and above it again, solved on a copy of the simulation."""
        copy, waypoints = self.physics.copy(), []
        x, y, z = copy.bind(self.cube.geom).xpos
        for height in (CLEARANCE, 0.0, CLEARANCE):
            goal = (x, y, z + GRASP_HEIGHT + height)
            if not self.arm.set_site_to_xpos(copy, np.random.default_rng(0), self.hand.pinch_site, goal):
                raise RuntimeError(f"the pinch site cannot reach {goal}")
            waypoints.append(copy.bind(self.arm.joints).qpos.copy())
        return waypoints

    def perform(self) -> Iterator[None]:
        """Simulate, one control step at a time."""
        above, at, lifted = self.plan()
        for goal, squeeze, seconds in (
            (above, 0.0, 4.0),
            (at, 0.0, 2.5),
            (at, SQUEEZE, 1.5),
            (lifted, SQUEEZE, 3.0),
            (lifted, SQUEEZE, 1.5),
        ):
            for _ in range(round(seconds / (STEPS * self.physics.timestep))):
                command_joint_positions(self.physics, self.arm, goal)
                self.physics.bind(self.hand.actuators).ctrl = squeeze
                self.physics.step(STEPS)
                yield


def camera(physics: Physics, width: int, height: int) -> Callable[[], NDArray[np.uint8]]:
    """Takes pictures (height, width, 3) of the scene."""
    renderer = mujoco.Renderer(physics.model, height, width)

    def picture() -> NDArray[np.uint8]:
        renderer.update_scene(physics.data, camera="overview")
        return np.asarray(renderer.render())

    return picture


def save(frames: list[NDArray[np.uint8]], folder: Path) -> None:
    """Write the pictures as a GIF, and some of them side by side as a PNG."""
    from PIL import Image

    images = [Image.fromarray(frame) for frame in frames]
    milliseconds = int(1000 * FRAME_EVERY * STEPS * 0.002)
    images[0].save(folder / "grasp_cube.gif", save_all=True, append_images=images[1:], duration=milliseconds, loop=0)
    chosen = [frames[i] for i in np.linspace(0, len(frames) - 1, STRIP).round().astype(int)]
    Image.fromarray(np.hstack(chosen)).save(folder / "grasp_cube.png")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--width", type=int, default=320, help="of a picture [pixels]")
    parser.add_argument("--height", type=int, default=240, help="of a picture [pixels]")
    parser.add_argument("--folder", type=Path, default=Path(), help="where to write the pictures")
    arguments = parser.parse_args()
    scene = Scene()
    picture = camera(scene.physics, arguments.width, arguments.height)
    frames = [picture()]
    for index, _ in enumerate(scene.perform()):
        if index % FRAME_EVERY == FRAME_EVERY - 1:
            frames.append(picture())
    arguments.folder.mkdir(parents=True, exist_ok=True)
    save(frames, arguments.folder)
    print(f"cube at {scene.cube_height():.3f} m after {scene.physics.time:.2f} s, {len(frames)} pictures")


if __name__ == "__main__":
    main()
