"""Episodes that a hand leads: begun, ended, kept and thrown away, on disk as they end, and replayed bit by bit."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

pytest.importorskip("gymnasium")
pytest.importorskip("h5py")
pytest.importorskip("pyarrow")

import jacokin.tasks
from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge import robots
from jacokin.mujoco_bridge.observations import PERFECT_FEATURES
from jacokin.tasks import Task, TaskEnv, replay
from jacokin.tasks.datasets import hdf5
from jacokin.teleop import Controller, Keyboard, Player, Stream, TaskArm, Teleop, TeleopStep, demonstrate
from tests.programs import python, run_drawing

Array = np.ndarray[Any, np.dtype[np.float64]]

ROOT = str(Path(__file__).parents[2])


class Typist(Keyboard):
    """Keys at ticks: "w" moves, "b" begins; "q" ends the session, "!" is Ctrl-C, and "k" a kill."""

    def __init__(self, script: Iterable[str], stop: threading.Event | None = None) -> None:
        super().__init__(speed=0.1)
        self._script, self._stop, self.ended = list(script), stop, False

    def read(self, time: float) -> Array:
        for key in self._script.pop(0) if self._script else "q":
            if key == "q":
                self.ended = True
            elif key == "!":
                assert self._stop is not None
                self._stop.set()
            else:
                self.press(key, time)
        return super().read(time)


def typed(*parts: str) -> list[str]:
    """A tick for each key of each part; a space is a tick without one."""
    return ["" if key == " " else key for part in parts for key in part]


@pytest.fixture
def env() -> Iterable[TaskEnv]:
    made = TaskEnv("reach_site", control="joint_position", flatten=False)
    yield made
    made.close()


@pytest.mark.slow
def test_keys_begin_end_keep_and_throw_away_episodes(env: TaskEnv, tmp_path: Path) -> None:
    said = list[str]()
    device = Typist(
        typed(
            "   x b" + "w" * 20 + "g" * 5 + "e  y",  # another start, then an episode that is kept
            "b" + "s" * 10 + "x",  # thrown away as it runs
            "bdddex",  # and after its end
            "b" + "r" * 12 + "y",  # kept as it runs
            "q",
        )
    )
    made = demonstrate(env, device, tmp_path / "demos.hdf5", seed=5, pace=math.inf, tell=said.append)
    assert (made.kept, made.discarded, made.is_written) == (2, 2, True)
    _, episodes = hdf5.read(tmp_path / "demos.hdf5")
    first, second = episodes
    assert (first.seed, second.seed) == (6, 9)
    assert 24 <= len(first.actions) <= 26
    assert len(second.actions) == 12
    assert made.steps == len(first.actions) + len(second.actions)
    assert first.actions[-1, 6] > first.actions[0, 6] + 0.1  # g closes the fingers
    assert np.abs(first.actions[-1, :6] - first.actions[0, :6]).max() > 0.05
    assert [each.is_equal for each in replay(tmp_path / "demos.hdf5")] == [True, True]
    assert not (tmp_path / "demos.hdf5.episodes").exists()
    assert any("b begins it" in text for text in said)
    assert [text for text in said if text.startswith(("kept", "thrown"))] == [
        "kept: 1 so far",
        "thrown away after 10 steps",
        "thrown away",
        "kept: 2 so far",
    ]


@pytest.mark.one_quick
@pytest.mark.parametrize("ending", [".lerobot", ".minari", ".hdf5"])
def test_a_recorded_hand_demonstrates_and_is_replayed_bit_by_bit(env: TaskEnv, ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"demos{ending}"
    time = np.arange(0.0, 1.0, 0.02)
    hand = np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (len(time), 1))
    hand[:, 2] = 0.05 * time
    made = demonstrate(env, Player(Stream(time, hand)), path, episodes=2, pace=math.inf)
    assert (made.kept, made.discarded, made.late) == (2, 0, 0)
    played = replay(path)
    assert [each.seed for each in played] == [0, 1]
    assert all(each.is_equal and each.largest_difference == 0.0 for each in played)
    assert 40 <= made.steps / 2 <= 60  # a second, and another at the end


PICTURES = """
import math, sys
sys.path.append(sys.argv[1])
from tests.teleop.test_demonstrations import Typist, typed
from jacokin.tasks import TaskEnv, replay
from jacokin.teleop import demonstrate
env = TaskEnv("lift_brick", control="joint_position", flatten=False, observations="vision", cameras={"wrist": (32, 32)})
for ending in ("hdf5", "lerobot"):
    path = f"{sys.argv[2]}/demos.{ending}"
    demonstrate(env, Typist(typed("bwwwy")), path, pace=math.inf)
    assert all(each.is_equal for each in replay(path))
"""


@pytest.mark.slow
def test_pictures_are_recorded(tmp_path: Path) -> None:
    run_drawing("-c", PICTURES, ROOT, tmp_path)
    _, (episode,) = hdf5.read(tmp_path / "demos.hdf5")
    assert episode.observations["wrist"].shape == (4, 32, 32, 3)
    assert len(np.unique(episode.observations["wrist"])) > 10
    assert list((tmp_path / "demos.lerobot" / "videos").rglob("*.mp4"))


@pytest.mark.slow
def test_success_is_the_task_s(env: TaskEnv, tmp_path: Path) -> None:
    """The hand goes to the site."""

    class Seeking:
        """Moves the tool to the site."""

        ended = False

        def read(self, time: float) -> Array:
            env_now = env.data
            names = [env.model.site(i).name for i in range(env.model.nsite)]
            target = env_now.site(next(name for name in names if "target" in name)).xpos
            pinch = env_now.site(next(name for name in names if name.endswith("pinchsite"))).xpos
            return np.append(np.clip(3.0 * (target - pinch), -0.2, 0.2), np.zeros(3))

    made = demonstrate(env, Seeking(), tmp_path / "demos.hdf5", episodes=1, pace=math.inf)
    assert made.solved == 1
    assert replay(tmp_path / "demos.hdf5")[0].success
    _, (episode,) = hdf5.read(tmp_path / "demos.hdf5")
    assert len(episode.actions) == 250  # the time limit of the task


@pytest.mark.slow
def test_a_session_that_stops_keeps_what_has_ended_and_goes_on(env: TaskEnv, tmp_path: Path) -> None:
    path, stop = tmp_path / "demos.hdf5", threading.Event()
    device = Typist(typed("bwwwy", "bssse", "  !"), stop)
    made = demonstrate(env, device, path, episodes=4, pace=math.inf, stop=stop)
    assert (made.kept, made.is_written) == (2, False)  # the second had ended, nobody had thrown it away
    assert not path.exists()
    made = demonstrate(env, Typist(typed("bwww", "q")), path, episodes=4, pace=math.inf)
    assert (made.kept, made.is_written) == (2, False)  # what runs has not ended
    made = demonstrate(env, Typist(typed("bdddy", "bfffy")), path, episodes=4, pace=math.inf)
    assert (made.kept, made.is_written) == (4, True)
    assert all(each.is_equal for each in replay(path))
    assert [each.seed for each in replay(path)] == [0, 1, 2, 3]
    with pytest.raises(InvalidInputError, match="is there already"):
        demonstrate(env, Typist([]), path, pace=math.inf)


KILLED = """
import math, os, signal, sys
sys.path.append(sys.argv[1])
from tests.teleop.test_demonstrations import Typist, typed
from jacokin.tasks import TaskEnv
from jacokin.teleop import demonstrate
class Killed(Typist):
    def read(self, time):
        if not self._script:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().read(time)
env = TaskEnv("reach_site", control="joint_position", flatten=False)
demonstrate(env, Killed(typed(*sys.argv[3:])), sys.argv[2], pace=math.inf)
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "script", ["bwwwy bss", *(pytest.param(each, marks=pytest.mark.slow) for each in ("bwwwe", "bwwwx bddde  "))]
)
def test_a_kill_loses_no_episode_that_has_ended(env: TaskEnv, script: str, tmp_path: Path) -> None:
    path = tmp_path / "demos.hdf5"
    python("-c", KILLED, ROOT, path, *script.split(" "), code=-9)
    assert len(list((tmp_path / "demos.hdf5.episodes").glob("*.npz"))) == 1
    made = demonstrate(env, Typist(typed("q")), path, pace=math.inf)
    assert (made.kept, made.is_written) == (1, True)
    assert all(each.is_equal for each in replay(path))


def test_nothing_kept_leaves_nothing(env: TaskEnv, tmp_path: Path) -> None:
    made = demonstrate(env, Typist(typed("bwwwx", "q")), tmp_path / "demos.lerobot", pace=math.inf)
    assert (made.kept, made.discarded, made.is_written) == (0, 1, False)
    assert not list(tmp_path.iterdir())


def test_a_failure_of_the_caller_s_leaves_what_has_ended_and_nothing_else(env: TaskEnv, tmp_path: Path) -> None:
    def fail(text: str) -> None:
        if text.startswith(word):
            raise KeyboardInterrupt

    word = "episode 1"
    with pytest.raises(KeyboardInterrupt):
        demonstrate(env, Typist(typed("bwwwy")), tmp_path / "demos.hdf5", pace=math.inf, tell=fail)
    assert not list(tmp_path.iterdir())
    word = "ended"
    with pytest.raises(KeyboardInterrupt):
        demonstrate(env, Typist(typed("bwwwy")), tmp_path / "demos.hdf5", pace=math.inf, tell=fail)
    assert demonstrate(env, Typist(typed("q")), tmp_path / "demos.hdf5", pace=math.inf).kept == 1


def test_two_sessions_do_not_write_the_same(env: TaskEnv, tmp_path: Path) -> None:
    path, said = tmp_path / "demos.hdf5", list[str]()

    def watch(arm: TaskArm, step: TeleopStep | None) -> None:
        if not said:
            with pytest.raises(InvalidInputError, match="another process is working on it") as caught:
                demonstrate(env, Typist([]), path, pace=math.inf)
            said.append(str(caught.value))

    demonstrate(env, Typist(typed("  bwwwy")), path, pace=math.inf, watch=watch)
    assert said


def test_slow_motion_takes_its_time(env: TaskEnv, tmp_path: Path) -> None:
    began = time.monotonic()
    made = demonstrate(env, Typist(typed("bwwwwwwwwwy")), tmp_path / "demos.hdf5", pace=0.5)
    assert made.steps == 9
    assert time.monotonic() - began > 9 * 0.04 / 0.5


def test_a_page_and_a_gamepad_ask_as_keys_do() -> None:
    controller = Controller()
    for keys in ([], ["b"], ["b"], [], ["b", "y"]):
        controller.report(keys)
    assert controller.commands() == ["begin", "begin", "keep"]
    controller.report()
    controller.report(buttons=[0.0] * 8 + [1.0])
    controller.report(buttons=[0.0, 0.0, 1.0])
    controller.report(buttons=[0.0, 0.0, 1.0])
    assert controller.commands() == ["begin", "discard"]
    assert controller.commands() == []


def test_the_hand_is_made_and_watched_as_wished(env: TaskEnv, tmp_path: Path) -> None:
    seen = list[bool]()

    def make(arm: TaskArm) -> Teleop:
        return Teleop(arm.tracker(), scale=0.5)

    def watch(arm: TaskArm, step: TeleopStep | None) -> None:
        seen.append(step is not None)

    demonstrate(env, Typist(typed("  bwwwy")), tmp_path / "demos.hdf5", pace=math.inf, make=make, watch=watch)
    assert seen[:3] == [False, False, False]
    assert sum(seen) == 3


@pytest.mark.parametrize(
    ("options", "match"),
    [
        ({"device": 3}, "device must be something with read"),
        ({"path": "demos.csv"}, "path must end in .hdf5, .minari, .lerobot"),
        ({"path": "nowhere/demos.hdf5"}, "there is no folder"),
        ({"episodes": 0}, "episodes must be"),
        ({"seed": -1}, "seed must be"),
        ({"pace": 0.0}, "pace must be"),
        ({"make": 3}, "make must be"),
        ({"stop": 3}, "stop must be something with is_set"),
        ({"env": 3}, "env must be an environment"),
    ],
)
def test_what_is_refused(env: TaskEnv, options: dict[str, Any], match: str, tmp_path: Path) -> None:
    given: dict[str, Any] = {"env": env, "device": Keyboard(), "path": "demos.hdf5", **options}
    given["path"] = tmp_path / given["path"]
    with pytest.raises(InvalidInputError, match=match):
        demonstrate(given.pop("env"), given.pop("device"), given.pop("path"), **given)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("own_tasks")
def test_the_hand_leads_the_arm_of_the_task() -> None:
    name = "j2s6s300"
    task = Task(
        robots.make_arm(PERFECT_FEATURES, name),
        robots.make_hand(PERFECT_FEATURES, name),
        success=lambda state: state.view.qpos[..., 0] > 9.0,
    )
    jacokin.tasks.register(task, id="mine/OtherLed-v0")
    env = TaskEnv("mine/OtherLed-v0", control="joint_position")
    env.reset(seed=0)
    arm = TaskArm(env)
    tool = arm.robot.forward_kinematics(arm.q, "pinchsite").translation + robots.ARM_OFFSET
    np.testing.assert_allclose(tool, env.task.physics.bind(env.task.hand.pinch_site).xpos, atol=1e-9)


def test_actions_must_be_angles(tmp_path: Path) -> None:
    env = gymnasium.make("jacokin/ReachSite-v0", flatten=False)
    try:
        with pytest.raises(InvalidInputError, match="control='joint_position', not 'joint_velocity'"):
            demonstrate(env, Keyboard(), tmp_path / "demos.hdf5")
    finally:
        env.close()


@pytest.mark.parametrize("fingers", ["wide", math.nan])
def test_fingers_that_are_no_number_are_named(env: TaskEnv, fingers: object, tmp_path: Path) -> None:
    class Odd(Typist):
        def read(self, time: float) -> Array:
            twist = super().read(time)
            self.fingers = fingers  # type: ignore[assignment]  # that is the test
            return twist

    device = Odd(typed("bwww"))
    with pytest.raises(InvalidInputError, match=f"fingers of the device must be a finite number, got '?{fingers}"):
        demonstrate(env, device, tmp_path / "demos.hdf5", pace=math.inf)
    assert not list(tmp_path.iterdir())
