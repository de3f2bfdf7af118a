"""Recorded episodes: what others read is what was simulated, a kill loses none, and they are replayed bit by bit."""

from __future__ import annotations

import json
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import FlattenObservation, RescaleAction
from numpy.typing import NDArray

import jacokin.tasks
from jacokin.chunks.execution import Progress, worker_processes
from jacokin.errors import InvalidInputError, JacokinError
from jacokin.mujoco_bridge.distributions import Uniform
from jacokin.mujoco_bridge.props import Primitive
from jacokin.tasks import Feature, Randomization, RecordSummary, Task, TaskEnv
from jacokin.tasks.datasets import recording, video
from jacokin.tasks.datasets.recorded import Recorded
from jacokin.tasks.datasets.recording import run_episode
from jacokin.tasks.task import CONTROL_TIMESTEP
from tests.cli.run import leave
from tests.programs import python, run_drawing

h5py = pytest.importorskip("h5py", reason="the extra data is not installed")
parquet = pytest.importorskip("pyarrow.parquet", reason="the extra data is not installed")
hdf5 = pytest.importorskip("jacokin.tasks.datasets.hdf5")

ROOT = Path(__file__).resolve().parents[2]
STEPS, EPISODES, SEED = 6, 3, 4
VARIED = Randomization(mass=Uniform(0.5, 2.0), latency=0.04, observation_noise=0.01)
FORMATS = tuple(recording.FORMATS)


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Episodes of a few steps."""
    monkeypatch.setattr(Task, "time_limit", STEPS * CONTROL_TIMESTEP)


class Wave:
    """Some policy: actions that depend on the time since the reset, and on what is seen."""

    def reset(self) -> None:
        self.time = 0

    def __call__(self, observation: Any) -> NDArray[np.float64]:
        self.time += 1
        return np.asarray(np.sin(np.arange(9.0) * self.time) + observation["duplo2x4/position"][0])


def make(**options: Any) -> TaskEnv:
    return TaskEnv("lift_brick", flatten=False, randomization=VARIED, **options)


def record(path: Path) -> tuple[RecordSummary, list[int]]:
    """Record the episodes; the summary, and the counts of which progress told."""
    told: list[int] = []
    summary = jacokin.tasks.record(
        make(), Wave(), path, episodes=EPISODES, seed=SEED, progress=lambda made: told.append(made.done)
    )
    return summary, told


def expected(**options: Any) -> list[Recorded]:
    """The episodes, run without recording them."""
    environment, policy = make(**options), Wave()
    return [run_episode(environment, policy, SEED + index) for index in range(EPISODES)]


def check_equal(found: Recorded, wanted: Recorded, *, observed: bool = True) -> None:
    for name in ("seed", "actions", "rewards", "success", "states", "error"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    assert found.randomization == wanted.randomization
    if observed:
        assert set(found.observations) == set(wanted.observations)
        for name, values in wanted.observations.items():
            np.testing.assert_array_equal(found.observations[name], values)


def read(path: Path) -> list[Recorded]:
    module = __import__(f"jacokin.tasks.datasets.{recording.FORMATS[path.suffix]}", fromlist=["read"])
    return list(module.read(path)[1])


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("ending", FORMATS)
def test_episodes_are_kept_bit_by_bit_and_replayed(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"demos{ending}"
    summary, told = record(path)
    wanted = expected()
    assert (summary.path, summary.episodes, summary.solved, summary.steps) == (path, EPISODES, 0, EPISODES * STEPS)
    assert summary.mean_return == pytest.approx(np.mean([each.rewards.sum() for each in wanted]))
    assert told == [1, 2, 3]
    assert [each.name for each in tmp_path.iterdir()] == [path.name]
    found = read(path)
    assert len(found) == EPISODES
    for one, other in zip(found, wanted, strict=True):
        check_equal(one, other, observed=ending != ".lerobot")
    replayed = jacokin.tasks.replay(path)
    assert [(each.episode, each.seed, each.is_equal, each.largest_difference) for each in replayed] == [
        (index, SEED + index, True, 0.0) for index in range(EPISODES)
    ]
    others = jacokin.tasks.replay(path, env=TaskEnv("lift_brick", flatten=False))  # another mass, no latency
    assert not any(each.is_equal for each in others)
    assert all(each.largest_difference > 1e-6 for each in others)


@pytest.mark.usefixtures("short")
def test_the_layout_is_that_of_robomimic(tmp_path: Path) -> None:
    """As its `SequenceDataset` and `get_env_metadata_from_dataset` read."""
    jacokin.tasks.record(make(), Wave(), tmp_path / "demos.hdf5", episodes=EPISODES, seed=SEED)
    wanted = expected()
    with h5py.File(tmp_path / "demos.hdf5", "r", swmr=True, libver="latest") as file:
        arguments = json.loads(file["data"].attrs["env_args"])
        assert set(arguments) == {"env_name", "type", "env_kwargs"}
        again: Any = gymnasium.make(arguments["env_name"], **arguments["env_kwargs"])
        assert again.unwrapped.randomization == VARIED
        assert file["data"].attrs["total"] == EPISODES * STEPS
        assert sorted(file["data"], key=lambda name: int(name[5:])) == [f"demo_{index}" for index in range(EPISODES)]
        assert list(file["mask/solved"]) == []
        for index, each in enumerate(wanted):
            demo = file[f"data/demo_{index}"]
            assert demo.attrs["num_samples"] == STEPS
            np.testing.assert_array_equal(demo["obs/duplo2x4_position"], each.observations["duplo2x4/position"][:-1])
            np.testing.assert_array_equal(
                demo["next_obs/jaco_arm_joints_pos"], each.observations["jaco_arm/joints_pos"][1:]
            )
            np.testing.assert_array_equal(demo["actions"], each.actions)
            np.testing.assert_array_equal(demo["states"], each.states[:-1])
            assert demo["dones"][:].tolist() == [0] * (STEPS - 1) + [1]


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("flatten", [False, True])
def test_minari_reads_its_data_sets(flatten: bool, tmp_path: Path) -> None:
    minari = pytest.importorskip("minari", reason="it is no dependency")
    path, env = tmp_path / "demos.minari", TaskEnv("reach_site", flatten=flatten)
    rng = np.random.default_rng(0)
    jacokin.tasks.record(env, lambda observation: rng.uniform(-1.0, 1.0, 9), path, episodes=2, seed=SEED)
    data = minari.MinariDataset(path)
    assert (data.total_episodes, data.total_steps) == (2, 2 * STEPS)
    for episode, wanted in zip(data.iterate_episodes(), read(path), strict=True):
        assert episode.actions.shape == (STEPS, 9)
        np.testing.assert_array_equal(episode.actions, wanted.actions)
        np.testing.assert_array_equal(episode.rewards, wanted.rewards)
        assert episode.truncations.tolist() == [False] * (STEPS - 1) + [True]
        seen = {"observation": episode.observations} if flatten else episode.observations
        for name, values in wanted.observations.items():
            np.testing.assert_array_equal(seen[name.replace("/", "_")], values)
    assert data.recover_environment().unwrapped.options == env.options


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("ending", FORMATS)
def test_goals_are_kept(ending: str, tmp_path: Path) -> None:
    path, env = tmp_path / f"demos{ending}", TaskEnv("reach_site", goal=True)
    jacokin.tasks.record(env, lambda observation: np.full(9, 0.2), path, episodes=2, seed=SEED)
    wanted = run_episode(env, lambda observation: np.full(9, 0.2), SEED)
    if ending != ".lerobot":  # which keeps single precision
        check_equal(read(path)[0], wanted)
    assert all(each.is_equal for each in jacokin.tasks.replay(path))


@pytest.mark.usefixtures("short")
def test_what_a_policy_does_to_an_observation_is_not_kept(tmp_path: Path) -> None:
    def normalizing(observation: NDArray[np.float64]) -> NDArray[np.float64]:
        observation -= observation.mean()
        return np.full(9, 0.2)

    path, env = tmp_path / "demos.hdf5", TaskEnv("reach_site")
    jacokin.tasks.record(env, normalizing, path, seed=SEED)
    check_equal(read(path)[0], run_episode(env, lambda observation: np.full(9, 0.2), SEED))


@pytest.mark.usefixtures("short")
def test_the_layout_is_that_of_lerobot(tmp_path: Path) -> None:
    path = tmp_path / "demos.lerobot"
    jacokin.tasks.record(make(), Wave(), path, episodes=EPISODES, seed=SEED)
    wanted = expected()
    info = json.loads((path / "meta/info.json").read_text())
    assert (info["codebase_version"], info["fps"]) == ("v3.0", 25)
    assert (info["total_episodes"], info["total_frames"]) == (EPISODES, EPISODES * STEPS)
    table = parquet.read_table(path / info["data_path"].format(chunk_index=0, file_index=0))
    assert set(table.column_names) == set(info["features"])
    columns = {name: np.array(table[name].to_pylist()) for name in table.column_names}
    for name, feature in info["features"].items():
        assert str(table.schema.field(name).type).startswith(
            feature["dtype"].replace("float32", "float") if feature["shape"] == [1] else "fixed_size_list"
        )
        if feature["names"]:
            assert len(feature["names"]) == feature["shape"][0] == columns[name].shape[1]
    actions = np.concatenate([each.actions for each in wanted])
    np.testing.assert_array_equal(columns["action"], actions.astype(np.float32))
    assert info["features"]["action"]["names"][0] == "jaco_arm/joint_1"
    place = info["features"]["observation.environment_state"]["names"].index("duplo2x4/position.2")
    heights = np.concatenate([each.observations["duplo2x4/position"][:-1, 2] for each in wanted])
    np.testing.assert_array_equal(
        columns["observation.environment_state"][:, place], heights.astype(np.float32).astype(np.float64)
    )
    np.testing.assert_array_equal(columns["index"], np.arange(EPISODES * STEPS))
    np.testing.assert_array_equal(columns["episode_index"], np.repeat(np.arange(EPISODES), STEPS))
    np.testing.assert_allclose(columns["timestamp"], np.tile(np.arange(STEPS) * 0.04, EPISODES), atol=1e-7)
    episodes = parquet.read_table(path / "meta/episodes/chunk-000/file-000.parquet").to_pylist()
    assert [(each["dataset_from_index"], each["dataset_to_index"]) for each in episodes] == [(0, 6), (6, 12), (12, 18)]
    stats = json.loads((path / "meta/stats.json").read_text())["action"]
    exact = actions.astype(np.float32).astype(np.float64)
    for kind, value in (("mean", exact.mean(0)), ("std", exact.std(0)), ("min", exact.min(0)), ("max", exact.max(0))):
        np.testing.assert_allclose(stats[kind], value, rtol=1e-9, atol=1e-12)
    tasks = parquet.read_table(path / "meta/tasks.parquet").to_pylist()
    assert tasks == [{"task_index": 0, "__index_level_0__": "Lift a brick."}]
    last = path / "meta/jacokin" / f"{EPISODES - 1:06d}.npz"
    last.write_bytes(last.read_bytes()[:1000])
    with pytest.raises(InvalidInputError, match="is not an episode, or damaged"):
        jacokin.tasks.replay(path)
    last.unlink()
    with pytest.raises(InvalidInputError, match=f"{EPISODES - 1} of its {EPISODES} episodes"):
        jacokin.tasks.replay(path)


PICTURES = """
import sys, numpy as np
from pathlib import Path
from jacokin.tasks import TaskEnv, Task, record, replay
Task.time_limit = 0.12
env = TaskEnv("lift_brick", observations="vision")
env.model.vis.quality.shadowsize = 256
record(env, lambda seen: np.zeros(9), sys.argv[1], episodes=2)
np.save(sys.argv[2], np.stack([env.reset(seed=s)[0]["front_close"] for s in (0, 1)]))
"""


@pytest.mark.slow
def test_pictures_are_videos(tmp_path: Path) -> None:
    path, firsts = tmp_path / "demos.lerobot", tmp_path / "first.npy"
    run_drawing("-c", PICTURES, path, firsts)
    info = json.loads((path / "meta/info.json").read_text())
    name = "observation.images.front_close"
    assert info["features"][name]["shape"] == [84, 84, 3]
    file = path / info["video_path"].format(video_key=name, chunk_index=0, file_index=0)
    raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-"]
    done = subprocess.run(
        [video.find_ffmpeg(), "-loglevel", "error", "-i", str(file), *raw], capture_output=True, check=True
    )
    pictures = np.frombuffer(done.stdout, dtype=np.uint8).reshape(-1, 84, 84, 3)
    assert len(pictures) == 6
    difference = np.abs(pictures[[0, 3]].astype(int) - np.load(firsts).astype(int))
    assert difference.mean() < 4.0  # of 255: the video loses some
    row = parquet.read_table(path / "meta/episodes/chunk-000/file-000.parquet").to_pylist()[1]
    assert row[f"videos/{name}/from_timestamp"] == pytest.approx(3 / 25)


KILLED = """
import os, signal, sys
sys.path[:0] = sys.argv[2:]
from tests.tasks.test_datasets import *
Task.time_limit = STEPS * CONTROL_TIMESTEP
class Deadly(Wave):
    __qualname__ = "Wave"
    calls = 0
    def __call__(self, observation):
        Deadly.calls += 1
        if Deadly.calls == 2 * STEPS + 3:
            os.kill(os.getpid(), signal.SIGKILL)
        return super().__call__(observation)
jacokin.tasks.record(make(), Deadly(), sys.argv[1], episodes=EPISODES, seed=SEED)
"""


@pytest.mark.slow
@pytest.mark.usefixtures("short")
def test_a_kill_loses_no_finished_episode(tmp_path: Path) -> None:
    path = tmp_path / "demos.hdf5"
    python("-c", KILLED, path, ROOT, *sys.path, code=-signal.SIGKILL)
    assert not path.exists()
    assert len(list((tmp_path / "demos.hdf5.episodes").glob("*.npz"))) == 2
    assert record(path)[1] == [3]  # only the one that was lost is run
    for one, other in zip(read(path), expected(), strict=True):
        check_equal(one, other)


@pytest.mark.slow
def test_workers_record_the_same(tmp_path: Path) -> None:
    paths = tmp_path / "one.hdf5", tmp_path / "two.hdf5"
    env, policy = TaskEnv("reach_site", flatten=False), jacokin.tasks.expert("reach_site")
    with worker_processes(2) as executor:
        summary = jacokin.tasks.record(env, policy, paths[0], episodes=2, executor=executor)
    jacokin.tasks.record(env, policy, paths[1], episodes=2)
    assert summary.solved == 2
    for one, other in zip(read(paths[0]), read(paths[1]), strict=True):
        check_equal(one, other)
    with h5py.File(paths[0]) as file:
        assert [name.decode() for name in file["mask/solved"]] == ["demo_0", "demo_1"]


class Drawn:
    """Actions that a seed determines, drawn slowly enough for threads to take turns."""

    def reset(self, seed: int) -> None:
        self.random = np.random.default_rng(seed)

    def __call__(self, observation: Any) -> NDArray[np.float64]:
        time.sleep(1e-3)  # [s]
        return self.random.uniform(-0.5, 0.5, 9)


@pytest.mark.usefixtures("short")
def test_threads_record_the_same(tmp_path: Path) -> None:
    path, env = tmp_path / "demos.hdf5", TaskEnv("reach_site", flatten=False)
    with ThreadPoolExecutor(3) as executor:
        jacokin.tasks.record(env, Drawn(), path, episodes=6, seed=SEED, executor=executor)
    for number, each in enumerate(read(path)):
        check_equal(each, run_episode(env, Drawn(), SEED + number))


@pytest.mark.usefixtures("short")
def test_actions_are_kept_as_they_are_applied(tmp_path: Path) -> None:
    env = TaskEnv("lift_brick", flatten=False)
    env.reset(seed=0)
    recorded = run_episode(env, lambda observation: np.full(9, 10.0), 0)
    np.testing.assert_array_equal(recorded.actions, np.tile(env._control.bounds[1], (STEPS, 1)))
    # The noise of an episode follows from its seed: from whichever episode a recording is started again.
    expert = jacokin.tasks.expert("lift_brick", noise=0.05)
    path = tmp_path / "a.hdf5"
    jacokin.tasks.record(env, expert, path, episodes=2, seed=SEED)
    expert.reset()
    second = run_episode(env, jacokin.tasks.expert("lift_brick", noise=0.05), SEED + 1)
    check_equal(read(path)[1], second)
    assert all(each.is_equal for each in jacokin.tasks.replay(path))


@pytest.mark.usefixtures("short")
def test_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = str(tmp_path / "demos.hdf5")
    assert leave("task", "reach_site", "--episodes", "2", "--seed", "3", "--record", path) == 0
    assert "0 of 2 solved" in capsys.readouterr().out
    assert leave("task", "replay", path) == 0
    assert "episode 2, seed 4: equal\n2 of 2 equal bit by bit" in capsys.readouterr().out
    with h5py.File(path, "r+") as file:
        file["data/demo_0/actions"][2, 0] += 0.1
    assert leave("task", "replay", path) == 1
    assert "seed 3: states differ by" in capsys.readouterr().out
    for words in (
        ["replay"],
        ["reach_site", path],
        ["replay", path, "--expert"],
        ["replay", str(tmp_path / "no.hdf5")],
    ):
        assert leave("task", *words) == 2


@pytest.mark.one_quick
@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("ending", FORMATS)
def test_control_steps_of_another_length_are_kept(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"demos{ending}"
    jacokin.tasks.record(make(control_timestep=0.02), Wave(), path, seed=SEED)
    assert read(path)[0].actions.shape == (2 * STEPS, 9)
    assert [each.is_equal for each in jacokin.tasks.replay(path)] == [True]
    if ending == ".lerobot":
        assert json.loads((path / "meta/info.json").read_text())["fps"] == 50
        times = parquet.read_table(path / "data/chunk-000/file-000.parquet")["timestamp"].to_numpy()
        np.testing.assert_allclose(times, 0.02 * np.arange(2 * STEPS), atol=1e-6)
        with pytest.raises(InvalidInputError, match="a whole number of steps a second, not 33.33"):
            jacokin.tasks.record(make(control_timestep=0.03), Wave(), tmp_path / "odd.lerobot")


@pytest.mark.usefixtures("own_tasks")
def test_mistakes(tmp_path: Path) -> None:
    env = TaskEnv("reach_site")
    for path, words in ((tmp_path / "a.txt", "path must end in"), (tmp_path / "no" / "a.hdf5", "there is no folder")):
        with pytest.raises(InvalidInputError, match=words):
            jacokin.tasks.record(env, len, path)
    for ending in FORMATS:  # the same for files and folders
        there = tmp_path / f"there{ending}"
        there.touch()
        with pytest.raises(InvalidInputError, match="is there already"):
            jacokin.tasks.record(env, len, there)
        assert there.read_bytes() == b""
    seeing = TaskEnv("lift_brick", observations="vision", cameras={"wrist/depth": (8, 8)})
    with pytest.raises(InvalidInputError, match=r"keeps videos of colours, not wrist/depth: use \.hdf5"):
        jacokin.tasks.record(seeing, len, tmp_path / "seen.lerobot")
    with pytest.raises(InvalidInputError, match="env must be"):
        jacokin.tasks.record(3, len, tmp_path / "a.hdf5")  # type: ignore[arg-type]
    for wrapped in (
        RescaleAction(env, np.float64(-1.0), np.float64(1.0)),
        FlattenObservation(TaskEnv("reach_site", flatten=False)),
    ):
        with pytest.raises(InvalidInputError, match="env must have the actions and observations of env.unwrapped"):
            jacokin.tasks.record(wrapped, len, tmp_path / "a.hdf5")
    with pytest.raises(InvalidInputError, match="policy must be"):
        jacokin.tasks.record(env, 3, tmp_path / "a.hdf5")  # type: ignore[arg-type]
    strange = TaskEnv("reach_site", randomization=Randomization(mass=lambda *_: 1.0))
    with pytest.raises(InvalidInputError, match="mass: data sets keep numbers"):
        jacokin.tasks.record(strange, len, tmp_path / "a.hdf5")
    alike = Task(
        props=[Primitive("sphere", (0.02,), name="ball")],
        success=lambda state: state["ball/position"][..., 2] > 0.3,
        observables=[Feature("ball_position", (3,), lambda view, goal: view.qpos[..., -7:-4])],
    )
    jacokin.tasks.register(alike, id="mine/Alike-v0")
    for ending in (".hdf5", ".minari"):
        with pytest.raises(InvalidInputError, match="'ball/position' and 'ball_position' have the same name in HDF5"):
            jacokin.tasks.record(TaskEnv("mine/Alike-v0", flatten=False), len, tmp_path / f"alike{ending}")
    (tmp_path / "b.hdf5").write_bytes(b"no data set")
    with pytest.raises(InvalidInputError, match="watch must be"):
        jacokin.tasks.replay(tmp_path / "b.hdf5", watch=3)  # type: ignore[arg-type]
    with pytest.raises(InvalidInputError, match="is not a data set that jacokin wrote"):
        jacokin.tasks.replay(tmp_path / "b.hdf5")


@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("action", ["right", None, [[0.0], [0.0, 1.0]], True, {}])
def test_a_policy_that_gives_no_action_leaves_nothing(action: Any, tmp_path: Path) -> None:
    path = tmp_path / "demos.hdf5"
    with pytest.raises(InvalidInputError, match="action must be"):
        jacokin.tasks.record(make(), lambda observation: action, path)
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("short")
def test_a_policy_that_fails_in_its_first_episode_leaves_the_path_to_another(tmp_path: Path) -> None:
    def broken(observation: Any) -> Any:
        raise ZeroDivisionError

    path = tmp_path / "demos.hdf5"
    with pytest.raises(ZeroDivisionError):
        jacokin.tasks.record(make(), broken, path)
    assert jacokin.tasks.record(make(), Wave(), path).episodes == 1


@pytest.mark.usefixtures("short")
def test_a_function_as_a_reward_needs_the_environment(tmp_path: Path) -> None:
    env = TaskEnv("reach_site", reward=lambda state: state["target_position"][..., 0])
    path = tmp_path / "demos.minari"
    jacokin.tasks.record(env, lambda observation: np.zeros(9), path)
    with pytest.raises(InvalidInputError, match="give env="):
        jacokin.tasks.replay(path)
    assert jacokin.tasks.replay(path, env=env)[0].is_equal


def is_continued_when_there_is_room(path: Path, make_room: Callable[[], None]) -> None:
    """After a recording that found no room: nothing but whole episodes is there, and a second one goes on from them."""
    kept = sorted(path.parent.rglob("*"))
    folder = path.with_name(f"{path.name}.episodes")
    assert [each for each in kept if each not in (folder, folder / "recipe.json") and each.suffix != ".npz"] == []
    make_room()
    assert len(record(path)[1]) == EPISODES - sum(each.suffix == ".npz" for each in kept)
    for one, other in zip(read(path), expected(), strict=True):
        check_equal(one, other, observed=path.suffix != ".lerobot")
    assert [each.name for each in path.parent.iterdir()] == [path.name]


@pytest.mark.one_quick("room")
@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("room", [10, 3_000, 16_000, 50_000])  # [byte] an episode takes 12,000
@pytest.mark.parametrize("ending", FORMATS)
def test_files_that_may_not_grow(ending: str, room: int, tmp_path: Path) -> None:
    path, (_, most) = tmp_path / f"demos{ending}", resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (room, most))
    try:
        with pytest.raises(JacokinError, match=f"demos{ending}.*: cannot be .*: File too large"):
            jacokin.tasks.record(make(), Wave(), path, episodes=EPISODES, seed=SEED)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
    is_continued_when_there_is_room(path, lambda: None)


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[tuple[Path, Callable[[int], None]]]:
    """A disk in memory, and what changes its size [KiB]."""
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=200k", "tmpfs", str(place)]
    if shutil.which("mount") is None or subprocess.run(mount, check=False, capture_output=True).returncode:
        pytest.skip("disks cannot be mounted here")

    def resize(size: int) -> None:
        subprocess.run(["mount", "-o", f"remount,size={size}k", str(place)], check=True)

    try:
        yield place, resize
    finally:
        subprocess.run(["umount", str(place)], check=True)


@pytest.mark.one_quick("size")
@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("size", [4, 24, 60, 100, 160])  # [KiB] the episodes take 52
@pytest.mark.parametrize("ending", FORMATS)
def test_a_full_disk(ending: str, size: int, small_disk: tuple[Path, Callable[[int], None]]) -> None:
    folder, resize = small_disk
    path = folder / f"demos{ending}"
    resize(size)
    with pytest.raises(JacokinError, match=f"demos{ending}.*: cannot be .*: No space left on device"):
        jacokin.tasks.record(make(), Wave(), path, episodes=EPISODES, seed=SEED)
    is_continued_when_there_is_room(path, lambda: resize(10_000))


KILLED_WRITING = """
import os, signal, sys
sys.path[:0] = sys.argv[3:]
from tests.tasks.test_datasets import *
from jacokin.tasks.datasets import hdf5, lerobot
Task.time_limit = STEPS * CONTROL_TIMESTEP
where = {"hdf5": (hdf5, "_dones"), "minari": (hdf5, "_serialized"), "lerobot": (lerobot, "_features")}
module, name = where[sys.argv[2]]
setattr(module, name, lambda *_: os.kill(os.getpid(), signal.SIGKILL))
jacokin.tasks.record(make(), Wave(), sys.argv[1], episodes=EPISODES, seed=SEED)
"""


@pytest.mark.slow
@pytest.mark.usefixtures("short")
@pytest.mark.parametrize("ending", FORMATS)
def test_a_kill_in_the_last_write_leaves_nothing_for_ever(ending: str, tmp_path: Path) -> None:
    path = tmp_path / f"demos{ending}"
    python("-c", KILLED_WRITING, path, ending[1:], ROOT, *sys.path, code=-signal.SIGKILL)
    folder = path.with_name(f"{path.name}.episodes")
    assert list(tmp_path.iterdir()) == [folder]
    assert any(each.name.endswith(".unfinished") for each in folder.iterdir())
    assert record(path)[1] == []
    assert list(tmp_path.iterdir()) == [path]


INTERRUPTED_WRITING = """
import os, signal, sys
sys.path[:0] = sys.argv[3:]
from tests.tasks.test_datasets import *
from jacokin.cli import process
from jacokin.tasks.datasets import hdf5
Task.time_limit = STEPS * CONTROL_TIMESTEP
write = hdf5._Sink.write
def interrupted(sink, data):
    hdf5._Sink.write = write
    os.kill(os.getpid(), int(sys.argv[2]))
    return write(sink, data)
hdf5._Sink.write = interrupted
signal.signal(signal.SIGTERM, process._leave)
try:
    jacokin.tasks.record(make(), Wave(), sys.argv[1], episodes=EPISODES, seed=SEED)
except KeyboardInterrupt:
    sys.exit(130)
"""


@pytest.mark.one_quick
@pytest.mark.usefixtures("short")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
@pytest.mark.parametrize("ending", [".hdf5", ".minari"])
def test_an_interrupt_in_the_last_write_loses_no_episode(
    ending: str, number: signal.Signals, code: int, tmp_path: Path
) -> None:
    """HDF5 crashed where what Python calls for it raised an exception."""
    path = tmp_path / f"demos{ending}"
    assert python("-c", INTERRUPTED_WRITING, path, str(int(number)), ROOT, *sys.path, code=code).stderr == ""
    (folder,) = tmp_path.iterdir()
    assert sorted(each.suffix for each in folder.iterdir()) == [".json", *[".npz"] * EPISODES]


class StopError(Exception):
    """Ends a recording in the middle."""


def interrupted(path: Path, env: TaskEnv, policy: Any, episodes: int = 2) -> None:
    """Record until some episodes are kept."""

    def stop(made: Progress) -> None:
        if made.done == episodes:
            raise StopError

    with pytest.raises(StopError):
        jacokin.tasks.record(env, policy, path, episodes=EPISODES, seed=SEED, progress=stop)


class Steady:
    """The same action always, or another one late in the episode."""

    def __init__(self, speed: float, last: float | None = None) -> None:
        self.speed, self.last = speed, speed if last is None else last

    def reset(self) -> None:
        self.time = 0

    def __call__(self, observation: Any) -> NDArray[np.float64]:
        self.time += 1
        return np.full(9, self.last if self.time == STEPS else self.speed)


@pytest.mark.slow
@pytest.mark.usefixtures("short")
def test_a_recording_goes_on_with_what_began_it_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    env, path = TaskEnv("reach_site", flatten=False), tmp_path / "demos.hdf5"
    interrupted(path, env, Steady(0.1))
    kept = sorted(tmp_path.rglob("*"))
    for policy in (Steady(0.2), Steady(0.1, last=0.1001)):
        with pytest.raises(InvalidInputError, match="holds episodes by another policy: its actions differ"):
            jacokin.tasks.record(env, policy, path, episodes=EPISODES, seed=SEED)
    others = {
        "environment.id": TaskEnv("reach_duplo", flatten=False),
        "environment.kwargs.flatten": TaskEnv("reach_site"),
        "environment.kwargs.control ": TaskEnv("reach_site", flatten=False, control="joint_delta"),
        "environment.kwargs.control_timestep": TaskEnv("reach_site", flatten=False, control_timestep=0.02),
        "environment.kwargs.reward": TaskEnv("reach_site", flatten=False, reward="sparse"),
        "environment.kwargs.randomization": TaskEnv("reach_site", flatten=False, randomization=VARIED),
    }
    for words, other in others.items():
        with pytest.raises(InvalidInputError, match=f"another recipe, which differs in.*{words}"):
            jacokin.tasks.record(other, Steady(0.1), path, episodes=EPISODES, seed=SEED)
    with pytest.raises(InvalidInputError, match="another recipe, which differs in seed"):
        jacokin.tasks.record(env, Steady(0.1), path, episodes=EPISODES, seed=SEED + 1)
    heavy = TaskEnv("reach_site", flatten=False)
    heavy.model.opt.gravity[0] = 3.0  # what no option tells of
    with pytest.raises(InvalidInputError, match="of another environment: .*states"):
        jacokin.tasks.record(heavy, Steady(0.1), path, episodes=EPISODES, seed=SEED)
    with monkeypatch.context() as patched:
        patched.setattr(Task, "time_limit", 2 * STEPS * CONTROL_TIMESTEP)
        with pytest.raises(InvalidInputError, match="of another environment"):
            jacokin.tasks.record(TaskEnv("reach_site", flatten=False), Steady(0.1), path, episodes=EPISODES, seed=SEED)
    assert sorted(tmp_path.rglob("*")) == kept
    jacokin.tasks.record(env, Steady(0.1), path, episodes=EPISODES, seed=SEED)
    assert all(each.is_equal for each in jacokin.tasks.replay(path))
    for each in read(path):
        np.testing.assert_array_equal(each.actions, 0.1)


@pytest.mark.usefixtures("short")
def test_rewards_of_the_same_name_are_told_apart(tmp_path: Path) -> None:
    def make_with(factor: float) -> TaskEnv:
        return TaskEnv("reach_site", reward=lambda state: factor * state["target_position"][..., 0])

    path = tmp_path / "demos.hdf5"
    interrupted(path, make_with(1.0), Steady(0.1))
    with pytest.raises(InvalidInputError, match="of another environment: rewards differ"):
        jacokin.tasks.record(make_with(2.0), Steady(0.1), path, episodes=EPISODES, seed=SEED)
    jacokin.tasks.record(make_with(1.0), Steady(0.1), path, episodes=EPISODES, seed=SEED)


@pytest.mark.usefixtures("short")
def test_policies_that_do_not_follow_from_the_seed_go_on(tmp_path: Path) -> None:
    env, path, rng = TaskEnv("reach_site"), tmp_path / "demos.hdf5", np.random.default_rng(0)

    def act(observation: Any) -> NDArray[np.float64]:
        return rng.uniform(-0.1, 0.1, 9)

    interrupted(path, env, act)
    told: list[int] = []
    jacokin.tasks.record(env, act, path, episodes=EPISODES, seed=SEED, progress=lambda made: told.append(made.done))
    assert told == [3]
    assert all(each.is_equal for each in jacokin.tasks.replay(path))


@pytest.mark.usefixtures("short")
def test_one_process_records_to_a_path_at_a_time(tmp_path: Path) -> None:
    path, env = tmp_path / "demos.hdf5", TaskEnv("reach_site")

    def act(observation: Any) -> NDArray[np.float64]:
        with pytest.raises(InvalidInputError, match="another process is working on it"):
            jacokin.tasks.record(TaskEnv("reach_site"), act, path, seed=SEED)
        return np.zeros(9)

    jacokin.tasks.record(env, act, path, seed=SEED)


@pytest.mark.usefixtures("short")
def test_actions_at_random_go_on_as_they_would_have(tmp_path: Path) -> None:
    """Of the command line: those of an episode follow from its seed."""
    paths = [str(tmp_path / f"{name}.hdf5") for name in ("whole", "last")]
    assert leave("task", "reach_site", "--episodes", "2", "--seed", "3", "--record", paths[0]) == 0
    assert leave("task", "reach_site", "--episodes", "1", "--seed", "4", "--record", paths[1]) == 0
    check_equal(read(Path(paths[0]))[1], read(Path(paths[1]))[0])


@pytest.mark.usefixtures("short")
def test_episodes_that_end_early_are_equal_as_far_as_they_go(tmp_path: Path) -> None:
    path, env = tmp_path / "demos.hdf5", TaskEnv("reach_site", flatten=False)
    short = run_episode(env, Steady(0.1), SEED, most=3)
    hdf5.write(path, recording.describe(env), env, lambda: [short])
    (found,) = jacokin.tasks.replay(path)
    assert (found.is_equal, found.differing) == (True, ())
    Task.time_limit = 2 * CONTROL_TIMESTEP  # shorter than the recording
    (found,) = jacokin.tasks.replay(path)
    assert not found.is_equal
    assert found.largest_difference == np.inf
    assert set(found.differing) >= {"actions", "rewards", "states"}
