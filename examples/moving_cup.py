"""Grasp a cup that moves, behind a board: a scene every 50 ms, a new plan for each from the motion under way.

    python examples/moving_cup.py
    MUJOCO_GL=egl python -m examples.moving_cup --picture moving_cup.gif

The cup is pushed along in MuJoCo: first away, then, as nobody had said, to the side. Every scene says where it is; how
fast it is follows from the scene before. The plan leads over the board to above where the cup will be, and is made anew
from the arm's own positions and velocities of that instant. Near the cup the tracker takes over at the speed of the
plan, moves along with the cup, goes down and closes the hand. The frame is that of the arm's base throughout.
"""

from __future__ import annotations

import argparse
import itertools
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import jacokin
from jacokin.model import Box, Floor, Scene
from jacokin.motion import MotionState, Trajectory, grasps, plan_motion
from jacokin.mujoco_bridge import Arena, Physics, Primitive, command_joint_positions, observations, robots

if TYPE_CHECKING:
    from examples.drawing import Film

CUP = np.array([0.05, 0.05, 0.12])  # [m]
START = np.array([0.40, 0.06, 0.5 * CUP[2]])  # [m]
PUSHES = ((2.0, (0.0, 0.05, 0.0)), (30.0, (-0.035, 0.02, 0.0)))  # until [s], velocity of the cup [m/s]
BOARD, BOARD_AT = np.array([0.4, 0.02, 0.3]), np.array([0.45, -0.06, 0.15])  # [m] between the hand and the cup
DT, STEPS = 0.01, 5  # [s] control step, and physics steps in it
SCENE_EVERY = 5  # control steps: 20 scenes a second
GAIN = 20.0  # [1/s] commanded velocity for each radian of lag
ABOVE = 0.1  # [m] of the grasp, where plans lead
TAKEN_OVER = 0.5  # [s] before the end of a plan by the tracker
CLOSE = 0.01  # [m] of the target, from where the hand goes down
DOWN, UP = 0.06, 0.1  # [m/s]
SQUEEZE, SQUEEZING = 1.0, 1.5  # [rad/s] commanded to the fingers, for so long [s]
LIFT = 0.12  # [m]
PATIENCE = 25.0  # [s] of simulated time
PICTURE_EVERY = 25  # control steps


class Seen(NamedTuple):
    """The cup in a scene."""

    position: NDArray[np.float64]
    """(3,) [m]."""
    velocity: NDArray[np.float64]
    """(3,) [m/s]."""

    def after(self, seconds: float) -> NDArray[np.float64]:
        """Where it will be if it goes on as it does (3,) [m]."""
        return self.position + seconds * self.velocity


class Happened(NamedTuple):
    """What a run came to."""

    plans: int
    """How many were made from a motion under way."""
    going_on: int
    """How many of them go on without stopping."""
    failed: int
    """How many led nowhere, so that the arm went on as before."""
    slowest: float
    """The longest that a plan took [s]."""
    height: float
    """By how much the cup is lifted at the end [m]."""
    seconds: float
    """Simulated time [s]."""


class Bench:
    """The arm with its hand, a board and a cup that is pushed, in MuJoCo; and the board as the planner sees it."""

    def __init__(self) -> None:
        """Put everything together and go home."""
        self.arm = robots.make_arm(observations.PERFECT_FEATURES)
        self.hand = robots.make_hand(observations.PERFECT_FEATURES)
        self.arm.attach(self.hand)
        self.cup = Primitive("box", 0.5 * CUP, mass=0.05, name="cup")
        arena = Arena()
        arena.attach(self.arm)
        arena.attach(Primitive("box", 0.5 * BOARD, name="board"), position=BOARD_AT)
        arena.add_free_entity(self.cup, position=START)
        self.physics = Physics.from_entity(arena)
        self.arm.set_home(self.physics)
        self.pushed = True
        self.fingers: float | None = None  # [rad] where they are kept; None while they squeeze
        self.watch: Callable[[], None] | None = None  # called after every control step
        self._last = self._pushed_to = START

        self.robot = jacokin.load_robot()
        ways = grasps.box(CUP, START)
        self.ways = [way.target.pose for way in ways if way.target.pose.rotation[2, 2] < -0.9]  # from above
        self.fingers = ways[0].opening
        self.around = Scene([Floor(0.0), Box("board", BOARD, BOARD_AT)], finger_angle=self.fingers)
        self.scene = self.around.adding(Box("cup", CUP, START))
        self.solver = jacokin.IKSolver(self.robot, scene=self.scene, clearance=0.005)

    @property
    def time(self) -> float:
        """Simulated [s]."""
        return float(self.physics.time)

    def look(self) -> Seen:
        """The cup now, with its velocity since the last look."""
        here = np.array(self.physics.bind(self.cup.geom).xpos)
        seen = Seen(here, (here - self._last) / (SCENE_EVERY * DT))
        self._last = here
        return seen

    def command(self, q: NDArray[np.float64], v: NDArray[np.float64]) -> None:
        """A control step towards joint angles [rad] that move at velocities [rad/s]."""
        command_joint_positions(self.physics, self.arm, q + v / GAIN, gain=GAIN)
        angles = self.physics.bind(self.hand.joints).qpos
        self.physics.bind(self.hand.actuators).ctrl = SQUEEZE if self.fingers is None else 5.0 * (self.fingers - angles)
        for _ in range(STEPS):
            self.physics.step()
            if self.pushed:
                self._push()
        if self.watch is not None:
            self.watch()

    def _push(self) -> None:
        """Move the cup on, upright, by a physics step."""
        velocity = next(np.array(velocity) for until, velocity in PUSHES if self.time < until)
        self._pushed_to = self._pushed_to + self.physics.timestep * velocity
        self.cup.set_pose(self.physics, self._pushed_to, (1.0, 0.0, 0.0, 0.0))
        self.cup.set_velocity(self.physics, velocity, np.zeros(3))


class Run:
    """One attempt: plans to the cup, then the tracker with it."""

    def __init__(self, bench: Bench) -> None:
        """Start where the bench has the arm."""
        self._bench = bench
        self._plans = self._going_on = self._failed = 0
        self._slowest = 0.0

    def perform(self) -> Happened:
        """Reach, follow, grasp and lift.

        Raises:
            RuntimeError: the first plan leads nowhere, or time runs out.
        """
        bench = self._bench
        state = self._reach()
        self._follow(state)
        return Happened(
            self._plans,
            self._going_on,
            self._failed,
            self._slowest,
            float(bench.physics.bind(bench.cup.geom).xpos[2] - START[2]),
            bench.time,
        )

    def _plan(self, start: NDArray[np.float64] | MotionState, seen: Seen, ahead: float) -> Trajectory:
        """To above where the cup will be after a time [s], clear of it where it is."""
        bench = self._bench
        solver = bench.solver.in_scene(bench.scene.moving({"cup": seen.position}))
        shift = seen.after(ahead) - START + [0.0, 0.0, ABOVE]
        goals = [pin.SE3(way.rotation, way.translation + shift) for way in bench.ways]
        began = time.perf_counter()
        plan = plan_motion(solver, start, goals, acceleration_limit=2.0)
        if isinstance(start, MotionState):
            self._slowest = max(self._slowest, time.perf_counter() - began)
        return plan

    def _reach(self) -> MotionState:
        """Follow a plan, each scene another one; the motion where the tracker takes over.

        Raises:
            RuntimeError: the first plan leads nowhere, or time runs out.
        """
        bench = self._bench
        plan, at, tick = self._plan(bench.robot.home, bench.look(), 2.0), 0.0, 0
        if not plan.success:
            raise RuntimeError(plan.message)
        print(f"{bench.time:5.2f} s  {plan.message}")
        while plan.duration - at > TAKEN_OVER:
            if tick and tick % SCENE_EVERY == 0:
                another = self._plan(plan.state_at(at), bench.look(), plan.duration - at)
                self._plans += 1
                if another.success:
                    plan, at = another, 0.0
                    self._going_on += "going on" in another.message
                else:
                    self._failed += 1
            state = plan.state_at(at + DT)
            bench.command(state.q, state.v)
            at, tick = at + DT, tick + 1
            self._check_time()
        print(f"{bench.time:5.2f} s  the tracker takes over: {plan.message}")
        self._above = bench.robot.forward_kinematics(plan.q[-1]).rotation
        return plan.state_at(at)

    def _follow(self, state: MotionState) -> None:
        """Move along with the cup, go down, close the hand, and go up with it.

        Raises:
            RuntimeError: time runs out.
        """
        bench = self._bench
        tracker = jacokin.Tracker(bench.robot, dt=DT, scene=bench.around, clearance=0.005, state=state)
        way = min(bench.ways, key=lambda each: float(np.linalg.norm(each.rotation - self._above)))
        above, closing, lifted, tick = ABOVE, 0.0, 0.0, 0
        seen, behind = bench.look(), np.zeros(3)
        while lifted < LIFT:
            if tick % SCENE_EVERY == 0 and bench.pushed and tick:
                seen, behind = bench.look(), np.zeros(3)
            if bench.pushed:
                behind = behind + DT * seen.velocity  # of the cup since it was seen
            target = way.translation + seen.position + behind - START + [0.0, 0.0, above + lifted]
            step = tracker.step(pin.SE3(way.rotation, target))
            bench.command(step.q, step.v)
            if closing >= SQUEEZING:
                if bench.pushed:
                    print(f"{bench.time:5.2f} s  the hand is closed")
                bench.pushed, lifted = False, lifted + UP * DT
            elif above <= 0.0:
                bench.fingers, closing = None, closing + DT
            elif step.position_error < CLOSE:
                above = max(above - DOWN * DT, 0.0)
                if above == 0.0:
                    print(f"{bench.time:5.2f} s  the hand is at the cup, which moves")
            tick += 1
            self._check_time()

    def _check_time(self) -> None:
        """Give up in the end.

        Raises:
            RuntimeError: time is up.
        """
        if self._bench.time > PATIENCE:
            raise RuntimeError("the cup was not reached in time")


def film_of(bench: Bench) -> Film:
    """A film of what happens from now on."""
    from examples.drawing import Film

    film, steps = Film(bench.physics.model, (0.25, 0.05, 0.3), azimuth=-130.0, distance=1.5), itertools.count()

    def take() -> None:
        if next(steps) % PICTURE_EVERY == 0:
            film.take(bench.physics.data)

    bench.watch = take
    return film


def main() -> None:
    """Grasp the cup, say what happened, and perhaps film it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--picture", type=Path, help="write a moving picture (.gif) to this file")
    file: Path | None = parser.parse_args().picture
    bench = Bench()
    film = None if file is None else film_of(bench)
    happened = Run(bench).perform()
    if file is not None and film is not None:
        film.save(file, PICTURE_EVERY * DT)
    print(
        f"{happened.plans} plans from a motion under way, {happened.going_on} without stopping, "
        f"{happened.failed} led nowhere; the slowest took {1e3 * happened.slowest:.1f} ms"
    )
    print(f"the cup is {happened.height:.3f} m above the floor after {happened.seconds:.1f} s")


if __name__ == "__main__":
    main()
