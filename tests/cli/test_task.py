"""`jacokin task`: episodes and their recordings."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

import jacokin.tasks
from jacokin.arrays import Array
from jacokin.cli import display, task
from jacokin.errors import InvalidInputError
from jacokin.tasks import TaskEnv
from jacokin.tasks.datasets import video
from jacokin.tasks.datasets.video import find_ffmpeg
from jacokin.tasks.task import CONTROL_TIMESTEP, Task
from tests.cli.run import Run, start
from tests.programs import backends

STEPS = 3  # of the episodes that are only recorded
SHORT = f"import jacokin.tasks.task as short; short.Task.time_limit = {STEPS} * short.CONTROL_TIMESTEP"
DEADLINE = 60.0  # [s]


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """Episodes of a few steps."""
    monkeypatch.setattr(Task, "time_limit", STEPS * CONTROL_TIMESTEP)


@pytest.fixture
def no_display(monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)


def record_black(file: Path, pictures: int) -> None:
    with task.record_to(file) as recorder:
        for _ in range(pictures):
            recorder.add(picture=np.zeros((480, 480, 3), dtype=np.uint8))


def decoded(file: Path, height: int, width: int) -> NDArray[np.uint8]:
    """The pictures of a video (n, height, width, 3), by ffmpeg."""
    command = [
        find_ffmpeg(),
        "-loglevel",
        "error",
        "-i",
        str(file),
        "-f",
        "rawvideo",
        "-pix_fmt",
        "rgb24",
        "-",
    ]
    done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, check=True)
    return np.frombuffer(done.stdout, dtype=np.uint8).reshape(-1, height, width, 3)


@pytest.mark.slow
def test_the_expert_reaches_and_is_recorded(run: Run, tmp_path: Path) -> None:
    file = tmp_path / "episodes.npz"
    assert "2 of 2 solved" in run("task", "reach_site", "--expert", "--episodes", "2", "--record", file).out
    with np.load(file) as arrays:
        assert arrays["action"].shape == (500, 9)
        assert arrays["target_position"].shape == (500, 3)
        assert arrays["success"][[249, 499]].all()
        np.testing.assert_array_equal(arrays["episode"], np.repeat([0, 1], 250))


@pytest.mark.usefixtures("short")
def test_the_steps_of_an_episode_are_counted_on_a_terminal(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    answer = run("task", "reach_site", "--episodes", "2")
    for number in (1, 2):
        assert f"{display.CLEAR}episode {number} of 2, step 0 of {STEPS} (0 %)" in answer.err
    assert answer.err.endswith(display.CLEAR)


@pytest.mark.slow
def test_random_actions_are_those_of_the_seed(run: Run, tmp_path: Path) -> None:
    def actions(seed: int) -> Array:
        file = tmp_path / "episodes.npz"
        run("task", "reach_site", "--seed", f"{seed}", "--record", file)
        with np.load(file) as arrays:
            return np.asarray(arrays["action"])

    first = actions(3)
    np.testing.assert_array_equal(actions(3), first)
    assert not np.isclose(actions(4), first).any()


@pytest.mark.slow
def test_a_video_has_a_picture_for_each_step_of_all_episodes(tmp_path: Path) -> None:
    if "egl" not in backends():
        pytest.skip("needs EGL")
    file = tmp_path / "video.mp4"
    words = ["task", "reach_site", "--expert", "--episodes", "2", "--record", str(file)]
    process = start(*words, before=f"import os; os.environ['MUJOCO_GL'] = 'egl'\n{SHORT}")
    _, errors = process.communicate(timeout=DEADLINE)
    assert process.returncode == 1, errors  # a few steps do not solve the task
    pictures = decoded(file, 480, 480)
    assert len(pictures) == 2 * STEPS
    assert pictures[0].std() > 10.0  # something is to be seen
    assert list(tmp_path.iterdir()) == [file]


def test_pictures_arrive_in_the_video_unchanged_but_for_the_encoding(tmp_path: Path) -> None:
    file = tmp_path / "video.mp4"
    colors = np.array([[200, 30, 30], [30, 200, 30], [30, 30, 200]], dtype=np.uint8)
    with task.record_to(file) as recorder:
        for color in colors:
            recorder.add(picture=np.broadcast_to(color, (64, 96, 3)))
        assert not file.exists()
    np.testing.assert_allclose(decoded(file, 64, 96).mean(axis=(1, 2)), colors, atol=8)


def test_an_encoder_that_fails_is_a_sentence_and_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file, encoder = tmp_path / "video.mp4", tmp_path / "encoder"
    file.write_text("old", encoding="utf-8")
    encoder.write_text("#!/bin/sh\necho no such codec >&2\nexit 3\n", encoding="utf-8")
    encoder.chmod(0o755)
    monkeypatch.setenv("IMAGEIO_FFMPEG_EXE", str(encoder))
    with pytest.raises(InvalidInputError, match="no such codec"):
        record_black(file, 50)
    assert file.read_text(encoding="utf-8") == "old"
    assert sorted(tmp_path.iterdir()) == [encoder, file]


def test_without_an_encoder_the_command_that_installs_one_is_told(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("IMAGEIO_FFMPEG_EXE", raising=False)
    monkeypatch.setattr(shutil, "which", lambda name: None)
    monkeypatch.setattr(video, "find_spec", lambda name: None)
    assert "pip install '.[video]'" in run("task", "reach_site", "--record", tmp_path / "video.mp4", code=2).err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there always is a display")
@pytest.mark.usefixtures("no_display")
@pytest.mark.parametrize(
    ("loaded", "chosen", "expected"), [(False, None, "egl"), (False, "osmesa", "osmesa"), (True, None, None)]
)
def test_pictures_without_a_display_are_drawn_with_egl_unless_told_otherwise(
    monkeypatch: pytest.MonkeyPatch, loaded: bool, chosen: str | None, expected: str | None
) -> None:
    monkeypatch.setenv("MUJOCO_GL", "")  # so that it is restored
    monkeypatch.delenv("MUJOCO_GL") if chosen is None else monkeypatch.setenv("MUJOCO_GL", chosen)
    if not loaded:
        monkeypatch.delitem(sys.modules, "mujoco", raising=False)
    task.choose_renderer()
    assert os.environ.get("MUJOCO_GL") == expected


@pytest.mark.skipif(sys.platform != "linux", reason="elsewhere there always is a display")
@pytest.mark.usefixtures("no_display")
def test_a_window_without_a_display_is_a_sentence(run: Run) -> None:
    answer = run("task", "reach_site", "--render", code=2)
    assert "--render needs a display; without one, --record video.mp4" in answer.err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("reach_sit",), "unknown task 'reach_sit'. Did you mean 'reach_site'"),
        (("reach_sit", "--expert"), "unknown expert 'reach_sit'. Did you mean 'reach_site'"),
        (("reach_sit", "--record", "a.npz"), "unknown task 'reach_sit'"),
        (("reassemble_5_bricks_random_order", "--expert"), "unknown expert 'reassemble_5_bricks_random_order'"),
        (("reach_site", "--record", "episodes.csv"), "must end in .npz, .mp4, .hdf5"),
        (("reach_site", "--record", "none/a.npz"), "--record: there is no folder"),
        (("reach_site", "--record", "none/a.hdf5"), "--record: there is no folder"),
        (("replay", "none.hdf5"), "none.hdf5: is not a data set that is there"),
        (("reach_site", "--record", "folder.npz"), "folder.npz"),
        (("reach_site", "--render", "--record", "a.mp4"), "give one of --render and --record with a video"),
        (("reach_site", "--episodes", "0"), "--episodes"),
        (("reach_site", "--seed", "-1"), "--seed"),
        (("reach_site", "--noise", "0.1"), "--noise goes with --expert"),
        (("reach_site", "--control", "tool_velocty"), "unknown control 'tool_velocty'. Did you mean 'tool_velocity'"),
        (("reach_site", "--expert", "--control", "joints"), "unknown control 'joints'"),
        (("replay", "demos.hdf5", "--control", "tool_pose"), "--control is that of the data set"),
        (("reach_site", "--mistakes", "1"), "--mistakes goes with --expert"),
        (("reach_site", "--expert", "--noise", "nan"), "noise must be finite"),
    ],
)
def test_mistakes_are_sentences_and_leave_no_file(
    run: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, words: tuple[str, ...], message: str
) -> None:
    (tmp_path / "folder.npz").mkdir()
    monkeypatch.chdir(tmp_path)
    answer = run("task", *words, code=2)
    assert message in answer.err
    assert "Traceback" not in answer.err
    assert [path.name for path in tmp_path.iterdir()] == ["folder.npz"]


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="everything is writable for root")
def test_a_folder_that_cannot_be_written_to_is_told_before_an_episode_runs(run: Run, tmp_path: Path) -> None:
    tmp_path.chmod(0o500)
    answer = run("task", "reach_site", "--record", tmp_path / "a.npz", code=2)
    assert "cannot be written" in answer.err
    assert "episode 1" not in answer.out


@pytest.mark.usefixtures("short")
def test_the_exit_code_tells_whether_the_expert_solved_every_episode(run: Run) -> None:
    run("task", "reach_site", "--expert", code=1)
    run("task", "reach_site")


@pytest.mark.usefixtures("short")
def test_an_expert_with_noise_acts_otherwise_and_repeats(run: Run, tmp_path: Path) -> None:
    found = []
    for number, words in enumerate(((), ("--noise", "0.1", "--mistakes", "1"), ("--noise", "0.1", "--mistakes", "1"))):
        path = tmp_path / f"{number}.npz"
        run("task", "lift_brick", "--expert", *words, "--record", path, code=1)
        with np.load(path) as arrays:
            found.append(arrays["action"])
    assert not np.array_equal(found[0], found[1])
    np.testing.assert_array_equal(found[1], found[2])


@pytest.mark.one_quick
@pytest.mark.usefixtures("short")
@pytest.mark.parametrize(("control", "size"), [("joint_delta", 9), ("tool_velocity", 7), ("tool_pose", 8)])
def test_actions_are_those_of_the_control(run: Run, tmp_path: Path, control: str, size: int) -> None:
    arrays_file, data_set = tmp_path / "a.npz", tmp_path / "a.hdf5"
    run("task", "reach_site", "--control", control, "--record", arrays_file)
    with np.load(arrays_file) as arrays:
        assert arrays["action"].shape == (STEPS, size)
    words = ["task", "lift_brick", "--expert", "--control", control, "--record", str(data_set)]
    assert "0 of 1 solved" in run(*words, code=1).out
    with h5py.File(data_set) as file:
        recorded = np.asarray(file["data/demo_0/actions"])
    bounds = TaskEnv("lift_brick", control=control)._control.bounds
    acted = jacokin.tasks.expert("lift_brick", control=control)
    environment = TaskEnv("lift_brick", control=control, flatten=False)
    np.testing.assert_array_equal(recorded[0], np.clip(acted(environment.reset(seed=0)[0]), *bounds))
    assert "1 of 1 equal bit by bit" in run("task", "replay", data_set).out


def test_a_film_takes_as_long_as_what_it_shows(tmp_path: Path) -> None:
    """Short control steps leave pictures out; ffmpeg says how long the video is."""
    for dt, pictures in ((0.01, 13), (0.03, 17), (0.08, 6)):
        file = tmp_path / f"{dt}.mp4"
        environment = TaskEnv("reach_site", control_timestep=dt)
        environment.render = lambda: np.zeros((64, 64, 3), dtype=np.uint8)  # type: ignore[method-assign]  # needs no OpenGL
        with task.record_to(file) as recorder:
            assert isinstance(recorder, video.VideoRecorder)
            for _ in range(round(0.5 / dt)):
                recorder.film(environment)
        assert len(decoded(file, 64, 64)) == pictures
        said = subprocess.run([find_ffmpeg(), "-i", str(file)], capture_output=True, text=True, check=False).stderr
        hours, minutes, seconds = re.search(r"Duration: (\d+):(\d+):([\d.]+)", said).groups()  # type: ignore[union-attr]  # else it fails
        assert (hours, minutes) == ("00", "00")
        assert float(seconds) == pytest.approx(0.5, abs=0.07)


@pytest.mark.usefixtures("short")
def test_recordings_have_a_row_for_each_step(run: Run, tmp_path: Path) -> None:
    run("task", "reach_site", "--record", tmp_path / "a.npz")
    with np.load(tmp_path / "a.npz") as arrays:
        assert len(arrays["action"]) == STEPS


@pytest.mark.slow
def test_an_interrupt_leaves_the_old_recording_and_nothing_beside_it(tmp_path: Path) -> None:
    file = tmp_path / "episodes.npz"
    file.write_text("old", encoding="utf-8")
    words = ["task", "reach_site", "--episodes", "1000000", "--record", str(file)]
    process = start(*words, before=SHORT)
    # While modules are imported, Python may ignore an interrupt: it falls into a callback of the import lock.
    assert process.stdout is not None
    assert process.stdout.readline().startswith("episode 1 of")
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=DEADLINE)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == [file]
    assert file.read_text(encoding="utf-8") == "old"
