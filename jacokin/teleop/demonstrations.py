"""`demonstrate`: episodes of a task that a hand leads, as data sets that others learn from.

An episode is begun, ended, kept and thrown away by keys or buttons, its success is the task's. It is on disk as soon as
it ends, beside the data set, which is written as a whole in the end; so nothing that has ended is lost.
"""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium
import mujoco
import numpy as np

from jacokin.arrays import Array
from jacokin.chunks.folder import ChunkFolder
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.model.angles import nearest_copy
from jacokin.model.descriptions import bundled
from jacokin.model.loading import load_robot
from jacokin.model.obstacles import Floor
from jacokin.model.robot import Robot
from jacokin.model.scene import Scene
from jacokin.motion.tracking.tracker import Tracker
from jacokin.mujoco_bridge import robots
from jacokin.tasks.datasets.recorded import Recorded, episodes_folder
from jacokin.tasks.datasets.recording import EndEpisode, checked_environment, checked_writer, describe, run_episode
from jacokin.tasks.gym.controls import FINGERS
from jacokin.tasks.gym.environment import TaskEnv
from jacokin.teleop.devices import BEGIN, COMMAND_KEYS, DISCARD, END, KEEP, Device, Fingers
from jacokin.teleop.session import asks_for_clutch, check_stop, read_device, work_clutch
from jacokin.teleop.teleop import Teleop, TeleopStep

CONTROL = "joint_position"  # that actions must be of: they are where the arm is led to
ACCELERATION = 4.0  # [rad/s^2] that suffices for a hand


class TaskArm:
    """The arm of a task's simulation as it is at the start of an episode, and the actions that move it.

    Attributes:
        robot: the arm, with the fingers about as they are.
        q: (6,) where it is [rad].
        dt: control step [s].
        table: what it stands on.
        acceleration: (6,) that its motors are strong enough for, with a reserve [rad/s^2].
        fingers: that keys and buttons move.
    """

    def __init__(self, env: TaskEnv) -> None:
        """Look at an environment that has been reset.

        Raises:
            InvalidInputError: its control is not "joint_position".
        """
        check_control(env)
        lower, upper = env._control.bounds
        angles = env.data.qpos[: len(lower)].clip(lower, upper)
        self.q = checks.read_only(angles[:-FINGERS])
        arm = env.task.arm
        fingers = float(angles[-FINGERS:].mean())
        self.robot: Robot = load_robot(arm.robot_name, finger_angle=fingers, calibration=arm.robot.calibration)
        self.dt = env.dt
        self.table = Scene([Floor(-robots.ARM_OFFSET[2])])
        limits = bundled.robot_table()["finger"]
        self.fingers = Fingers(fingers, lower=limits["lower"], upper=limits["upper"])
        # Torque of the motors less friction and the gravity that they hold here, over the inertia with armature.
        simulated, joints = env.model, slice(self.robot.dof)
        load = simulated.dof_frictionloss[joints] + np.abs(self.robot.gravity(self.q))
        inertia = self.robot.mass_matrix(self.q).diagonal() + simulated.dof_armature[joints]
        # A part of what the motors are strong enough for.
        possible = 0.8 * (simulated.actuator_forcerange[joints, 1] - load) / inertia
        self.acceleration: Array = checks.read_only(possible.clip(max=ACCELERATION))

    def tracker(self) -> Tracker:
        """A tracker that starts where the arm is, with the step of the task, off the table and within its motors."""
        return Tracker(
            self.robot, q=self.q, dt=self.dt, scene=self.table, clearance=0.0, acceleration_limit=self.acceleration
        )

    def action(self, q: Array, finger_angle: float) -> Array:
        """(9,) that moves the arm to (6,) angles [rad], and the fingers to theirs."""
        near = nearest_copy(q, 0.0 * q, self.robot.unlimited)  # actions allow a turn to each side
        return np.append(near, [finger_angle] * FINGERS)


def check_control(env: TaskEnv) -> None:
    """Check that actions are angles.

    Raises:
        InvalidInputError: they are something else.
    """
    if env.options.control != CONTROL:
        raise InvalidInputError(f"a hand leads an environment with control={CONTROL!r}, not {env.options.control!r}")


MOST_EPISODES = 1_000_000  # in a data set
REST = 1.0  # [s] after the end of a recorded hand, in which the arm comes to where it led
KEY = {name: key for key, name in COMMAND_KEYS.items()}


@dataclass(frozen=True, slots=True)
class Demonstrations:
    """What came of a session."""

    path: Path
    """The file or folder of the data set."""
    kept: int
    """Episodes that are kept, those of earlier sessions among them."""
    solved: int
    """How many of them were solved at their end."""
    steps: int
    """Control steps of all of them."""
    discarded: int
    """Episodes that were thrown away in this session."""
    late: int
    """Control steps that began later than a step after their time; 0 without pacing."""
    is_written: bool
    """Whether the data set is there; False while fewer episodes are kept than were asked for, or none: the same call
    goes on."""


def demonstrate(
    env: gymnasium.Env[Any, Any],
    device: Device,
    path: str | Path,
    *,
    episodes: int | None = None,
    seed: int = 0,
    pace: float = 1.0,
    make: Callable[[TaskArm], Teleop] | None = None,
    watch: Callable[[TaskArm, TeleopStep | None], None] | None = None,
    tell: Callable[[str], None] | None = None,
    stop: threading.Event | None = None,
) -> Demonstrations:
    """Record episodes of a task that a hand leads.

    Each episode starts from a seed of its own, and stands until it is begun. A device with `commands()` begins, ends,
    keeps and discards: `Keyboard` and `Controller` by keys (b, e, y and x) and buttons. Before an episode is begun,
    discard takes another start; while it runs, keep ends it, too. It also ends at the time limit of the task. What has
    ended is asked for: keep, or discard. A device without commands, such as `Player`, has every episode begun at once,
    ended a second after its own end, and kept; one that cannot `reset` leads one episode.

    Args:
        env: an environment of a task with control="joint_position", of ours or your own; what it observes is recorded,
            pictures too. Wrappers around it are left out.
        device: leads the tool, and the fingers where it has `fingers`. Where it has `ended`, that ends the session.
        path: where to, and nothing may be there yet: `.hdf5`, `.minari`, or `.lerobot`, as for `jacokin.tasks.record`.
        episodes: how many are to be kept; a session that ends with fewer is continued by the same call. None for as
            many as are kept until the session ends.
        seed: of the first episode; each further one, kept or not, has the next number.
        pace: simulated seconds in a second: 1 is real time, 0.5 slow motion, `math.inf` as fast as it can.
        make: gives the teleoperation for an arm, with its clutch open or closed; None for ``Teleop(arm.tracker())``.
        watch: called with each tick, and with None while nothing is recorded, many times a second.
        tell: called with a sentence whenever something is begun, ended, kept, thrown away or asked for.
        stop: once set, by another thread or a signal, the session ends; an episode that has not ended is not kept.

    Returns:
        What was recorded.

    Raises:
        InvalidInputError: an argument is wrong, or a file cannot be written.
        MissingExtraError: the package that writes the format is not installed.
        EpisodeInitializationError: an episode has no initial state.
    """
    inner = checked_environment(env)
    check_control(inner)
    if not callable(getattr(device, "read", None)):
        raise checks.refusal("device", "something with read(time), such as a Keyboard", device)
    target = checks.path("path", path)
    writer = checked_writer(target, inner)
    wanted = None if episodes is None else checks.whole_number("episodes", episodes, 1, MOST_EPISODES)
    if wanted is None and not hasattr(device, "commands"):
        wanted = 1
    first = checks.whole_number("seed", seed)
    if pace != math.inf:
        checks.positive("pace", pace)
    for name, function in (("make", make), ("watch", watch), ("tell", tell)):
        if function is not None:
            checks.function(name, function)
    check_stop(stop)
    description = describe(inner)
    recipe = {"environment": description, "policy": "teleoperation", "seed": first, "mujoco": mujoco.__version__}
    folder = ChunkFolder(episodes_folder(target), recipe, MOST_EPISODES, ".npz")
    with folder.locked():
        folder.remove_unfinished()
        files, hand = folder.finished(), _Hand(inner, device, pace, make, watch, tell, stop)
        discarded = _lead_episodes(hand, folder, files, first, wanted)
        if not files:
            folder.remove()
        every = [files[number] for number in sorted(files)]
        solved = steps = 0
        for each in map(Recorded.from_file, every):
            solved, steps = solved + bool(each.success[-1]), steps + len(each.actions)
        is_written = bool(every) and (wanted is None or len(every) >= wanted)
        if is_written:
            writer.write(target, description, inner, lambda: map(Recorded.from_file, every))
            folder.remove()
    return Demonstrations(target, len(every), solved, steps, discarded, hand.late, is_written)


def _lead_episodes(hand: _Hand, folder: ChunkFolder, files: dict[int, Path], first: int, wanted: int | None) -> int:
    """Add episodes to the files by number, until there are as many as wanted; returns how many were thrown away."""
    discarded, number = 0, max(files, default=-1) + 1
    while (wanted is None or len(files) < wanted) and hand.goes_on:
        recorded = hand.episode(first + number, len(files))
        if recorded is not None:
            files[number] = folder.put(number, recorded.to_bytes())  # before anybody is asked: a kill loses nothing
            if hand.is_kept(recorded):
                hand.say(f"kept: {len(files)}{' so far' if wanted is None else f' of {wanted}'}")
            else:
                files.pop(number).unlink()
        discarded += hand.was_thrown_away
        number += 1
    return discarded


class _Hand:
    """A device, from episode to episode.

    Attributes:
        goes_on: whether the session does.
        was_thrown_away: whether the last episode was.
        late: control steps that began later than a step after their time.
    """

    def __init__(
        self,
        env: TaskEnv,
        device: Device,
        pace: float,
        make: Callable[[TaskArm], Teleop] | None,
        watch: Callable[[TaskArm, TeleopStep | None], None] | None,
        tell: Callable[[str], None] | None,
        stop: threading.Event | None,
    ) -> None:
        self._env, self._device, self._pace, self._stop = env, device, pace, stop
        self._make = make or (lambda arm: Teleop(arm.tracker()))
        self._watch = watch or (lambda arm, step: None)
        self.say = tell or (lambda text: None)
        self._commands: Callable[[], list[str]] | None = getattr(device, "commands", None)
        self._ticks, self._began = 0, time.monotonic()
        self._verdict: bool | None = None
        self._played = self._is_cut = False
        self._taken, self._rest = 0, 0.0
        self._last: Array | None = None
        self.was_thrown_away, self.late = False, 0

    @property
    def goes_on(self) -> bool:
        if self._stop is not None and self._stop.is_set():
            return False
        if self._commands is None:  # a recorded hand ends with each episode
            return self._taken > 0 or not self._played or hasattr(self._device, "reset")
        return not getattr(self._device, "ended", False)

    def episode(self, seed: int, kept: int) -> Recorded | None:
        """An episode that was begun and has ended; None for one that was thrown away, or for none."""
        self.was_thrown_away, self._verdict = False, None
        self._env.reset(seed=seed)
        arm = TaskArm(self._env)
        if not self._is_begun(arm, seed, kept):
            return None
        self._played = True
        reset = getattr(self._device, "reset", None)
        if reset is not None:
            reset(self._now)
        self._arm, self._teleop = arm, self._make(arm)
        checks.instance("make(arm)", self._teleop, Teleop, "a Teleop")
        if not self._teleop.engaged:
            self._teleop.clutch(True)
        self._taken, self._last, self._rest, self._is_cut = 0, None, 0.0, False
        recorded = run_episode(self._env, self._act, seed)
        taken, self._taken = self._taken, 0
        if self._verdict is False:
            self.was_thrown_away = True
            self.say(f"thrown away after {taken} steps")
            return None
        if self._is_cut:
            self.say(f"not kept: the session ended after {taken} steps of it")
            return None
        return recorded

    def is_kept(self, recorded: Recorded) -> bool:
        """Whether an episode that has ended is kept: as was said, or is asked for; what nobody answers is kept."""
        solved = "solved" if recorded.success[-1] else "not solved"
        self.say(f"ended, {solved}, {len(recorded.actions)} steps, return {recorded.rewards.sum():.1f}")
        if self._commands is None:
            return True
        if self._verdict is None:
            self.say(f"{KEY[KEEP]} keeps it, {KEY[DISCARD]} throws it away")
        while self._verdict is None and self.goes_on:
            self._idle()
            for command in self._commands():
                if command in (KEEP, DISCARD):
                    self._verdict = command == KEEP
        if self._verdict is False:
            self.was_thrown_away = True
            self.say("thrown away")
        return self._verdict is not False

    def _is_begun(self, arm: TaskArm, seed: int, kept: int) -> bool:
        """Wait until the episode is begun; False for another start, or when the session ends."""
        if self._commands is None:
            return True
        self.say(
            f"episode {kept + 1}, seed {seed}: {KEY[BEGIN]} begins it, {KEY[DISCARD]} takes another start; then "
            f"{KEY[END]} ends it, {KEY[KEEP]} keeps it, {KEY[DISCARD]} throws it away"
        )
        while self.goes_on:
            self._watch(arm, None)
            self._idle()
            for command in self._commands():
                if command in (BEGIN, DISCARD):
                    return command == BEGIN
        return False

    def _act(self, observation: object) -> Array:
        """The action of a control step.

        Raises:
            EndEpisode: there is none.
        """
        if not self._taken:  # what took long before counts for nothing
            self._began = time.monotonic() - self._now / self._pace
        now = self._tick()
        heard, _ = read_device(self._device, now)
        work_clutch(self._teleop, self._device)
        if self._taken and self._is_to_end():
            raise EndEpisode
        if self._commands is None and getattr(self._device, "ended", False):
            heard = self._last if heard is None else heard  # the last pose holds
            self._rest += self._arm.dt
        self._last = self._last if heard is None else heard
        step = self._teleop.step(heard)
        pushed = checks.number("fingers of the device", getattr(self._device, "fingers", 0.0))
        angle = self._arm.fingers.move(pushed, self._arm.dt)
        self._watch(self._arm, step)
        self._taken += 1
        return self._arm.action(step.q, angle)

    def _is_to_end(self) -> bool:
        """Whether the episode ends before the next step; says what was decided of it."""
        if self._rest > REST:
            return True
        for command in [] if self._commands is None else self._commands():
            if command in (END, KEEP, DISCARD):
                self._verdict = None if command == END else command == KEEP
                return True
        self._is_cut = not self.goes_on
        return self._is_cut

    def _idle(self) -> None:
        """A tick in which nothing moves: keys are read, motions are not heard."""
        self._taken = 0
        read_device(self._device, self._tick())
        asks_for_clutch(self._device)

    @property
    def _now(self) -> float:
        """[s] of simulated time since the session began, by ticks."""
        return self._ticks * self._env.dt

    def _tick(self) -> float:
        """Wait for the next tick; its time [s]."""
        ahead = self._began + self._now / self._pace - time.monotonic()
        if ahead > 0.0:
            time.sleep(ahead)
        elif -ahead > self._env.dt / self._pace and math.isfinite(self._pace):
            self.late += self._taken > 0
            self._began -= ahead  # what is lost is not caught up with
        now = self._now
        self._ticks += 1
        return now
