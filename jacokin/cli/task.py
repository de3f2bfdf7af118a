"""`jacokin task`: run episodes of a task, with random actions or its expert, and record them."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import files
from jacokin.cli import display, options
from jacokin.cli.command import Argument, Command
from jacokin.cli.display import progress_bar
from jacokin.cli.process import NOT_SOLVED
from jacokin.errors import InvalidInputError, MissingExtraError

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import ArrayLike, NDArray

    from jacokin.tasks import TaskEnv
    from jacokin.tasks.experts.expert import Expert

ARRAYS, VIDEO = ".npz", ".mp4"
RATE = 25  # pictures a second, one for each control step


@click.command(cls=Command, no_args_is_help=True)
@click.argument(
    "name", cls=Argument, metavar="NAME", text="Such as reach_site or lift_brick; an unknown name lists all."
)
@click.option("--expert", is_flag=True, help="Let the scripted expert act; otherwise actions are random.")
@click.option("--episodes", type=click.IntRange(min=1), default=1, metavar="N", help="How many episodes to run.")
@click.option("--seed", type=click.IntRange(min=0), default=0, metavar="N", help="Start of the random numbers.")
@click.option(
    "--record",
    type=options.FILE,
    metavar="FILE",
    help="Write pictures (.mp4) or observations, actions and rewards (.npz).",
)
@click.option("--render", is_flag=True, help="Show a window, which needs a display.")
def task(name: str, expert: bool, episodes: int, seed: int, record: Path | None, render: bool) -> None:
    """Run episodes of a task, and show how they end.

    Needs the extra `tasks`, and for videos ffmpeg or the extra `video`. Episodes take 10 s of simulated time.
    Exit code: 1 where the expert does not solve every episode, else 0, whatever random actions bring about.

    Examples:
      jacokin task reach_site --expert
      jacokin task lift_brick --expert --episodes 10 --record episodes.npz
      jacokin task place_brick --expert --record video.mp4
    """
    has_pictures = is_video(record)
    if render and has_pictures:
        raise InvalidInputError("give one of --render and --record with a video, not both: each draws in its own way")
    if render and not has_display():
        raise InvalidInputError("--render needs a display; without one, --record video.mp4 writes a video")
    if has_pictures:
        choose_renderer()
    with contextlib.ExitStack() as stack:
        recorder = None if record is None else stack.enter_context(record_to(record))
        from jacokin import tasks

        policy = tasks.expert(name) if expert else None
        mode = "human" if render else "rgb_array" if has_pictures else None
        environment = stack.enter_context(contextlib.closing(tasks.TaskEnv(name, flatten=False, render_mode=mode)))
        environment.action_space.seed(seed)
        solved, returns = 0, []
        for episode in range(episodes):
            with progress_bar(f"episode {episode + 1} of {episodes}, step") as progress:
                total, success = _run(environment, policy, seed if episode == 0 else None, episode, recorder, progress)
            solved += success
            returns.append(total)
            is_solved = "solved" if success else "not solved"
            display.echo(f"episode {episode + 1} of {episodes}: return {total:.1f}, {is_solved}")
        display.echo(f"{solved} of {episodes} solved, mean return {sum(returns) / episodes:.1f}")
    if record is not None:
        display.echo(f"wrote {record}")
    if expert and solved < episodes:
        raise SystemExit(NOT_SOLVED)


def _run(
    environment: TaskEnv,
    policy: Expert | None,
    seed: int | None,
    episode: int,
    recorder: ArrayRecorder | VideoRecorder | None,
    progress: Callable[[int, int], None],
) -> tuple[float, bool]:
    """Run one episode; returns the sum of its rewards and whether the task is solved at the end."""
    from jacokin.tasks.episode import STEPS

    observation, info = environment.reset(seed=seed)
    if policy is not None:
        policy.reset()
    total, is_over, steps = 0.0, False, 0
    while not is_over:
        progress(steps, STEPS)
        action = environment.action_space.sample() if policy is None else policy(observation)
        following, reward, _, is_over, info = environment.step(action)
        if isinstance(recorder, VideoRecorder):
            picture = environment.render()
            assert picture is not None  # render_mode
            recorder.add(picture)
        elif recorder is not None:
            assert isinstance(observation, dict)
            recorder.add(episode=episode, action=action, reward=reward, success=info["is_success"], **observation)
        observation = following
        total += reward
        steps += 1
    return total, bool(info["is_success"])


def has_display() -> bool:
    """Whether windows can be opened."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def choose_renderer() -> None:
    """Choose EGL where there is no display and MUJOCO_GL is not set; MuJoCo reads that once, when it is loaded."""
    if not has_display() and "mujoco" not in sys.modules:
        os.environ.setdefault("MUJOCO_GL", "egl")


class ArrayRecorder:
    """Keeps all rows in memory until they are written."""

    def __init__(self) -> None:
        """Start without rows."""
        self._columns: dict[str, list[ArrayLike]] = {}

    def add(self, **values: ArrayLike) -> None:
        """Add a row: one value for each name."""
        for name, value in values.items():
            self._columns.setdefault(name, []).append(value)

    def write(self, path: Path) -> None:
        """Write one array for each name, with the rows along its first axis."""
        import numpy as np

        columns = {name: np.stack(rows) for name, rows in self._columns.items()}
        with path.open("wb") as file:
            np.savez_compressed(file, **columns)  # type: ignore[arg-type]  # numpy's type of keywords is a flag


class VideoRecorder:
    """Hands pictures to ffmpeg."""

    def __init__(self, path: Path, ffmpeg: str) -> None:
        """Encode to a file, as soon as the first picture tells the size."""
        self._path, self._ffmpeg = path, ffmpeg
        self._complaints = tempfile.TemporaryFile()  # noqa: SIM115 - closed by `close`
        self._process: subprocess.Popen[bytes] | None = None

    def add(self, picture: NDArray[np.uint8]) -> None:
        """Add a picture (height, width, 3).

        Raises:
            InvalidInputError: ffmpeg does not go on.
        """
        if self._process is None:
            height, width = picture.shape[:2]
            raw = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", str(RATE), "-i", "-"]
            encoded = ["-c:v", "libx264", "-pix_fmt", "yuv420p", "-f", "mp4", str(self._path)]
            self._process = subprocess.Popen(
                [self._ffmpeg, "-y", "-loglevel", "error", *raw, *encoded],
                stdin=subprocess.PIPE,
                stdout=subprocess.DEVNULL,
                stderr=self._complaints,
                start_new_session=True,  # Ctrl-C is for this process, which then ends the other
            )
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(picture.tobytes())
        except OSError:
            self._fail()

    def finish(self) -> None:
        """Wait until the file is complete.

        Raises:
            InvalidInputError: ffmpeg has failed.
        """
        if self._process is None:
            return
        with contextlib.suppress(OSError):  # told by the exit code
            self._process.communicate()
        if self._process.returncode:
            self._fail()

    def close(self) -> None:
        """Stop ffmpeg if it still runs."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()
            assert self._process.stdin is not None
            with contextlib.suppress(OSError):  # what was not handed over is lost
                self._process.stdin.close()
        self._complaints.close()

    def _fail(self) -> None:
        assert self._process is not None
        self._process.wait()
        self._complaints.seek(0)
        said = self._complaints.read().decode(errors="replace").strip() or f"exit code {self._process.returncode}"
        raise InvalidInputError(f"--record: ffmpeg: {said}")


def is_video(path: Path | None) -> bool:
    """Whether pictures are to be recorded."""
    return path is not None and path.suffix == VIDEO


@contextlib.contextmanager
def record_to(path: Path) -> Iterator[ArrayRecorder | VideoRecorder]:
    """Record to a file, which is there when the block has ended well and untouched otherwise.

    Raises:
        InvalidInputError: another ending, or a file that cannot be written; before the block runs.
        MissingExtraError: a video, and no ffmpeg.
    """
    if path.suffix not in (ARRAYS, VIDEO):
        raise InvalidInputError(f"--record must end in {ARRAYS} or {VIDEO}, got {path}")
    if not path.absolute().parent.is_dir():
        raise InvalidInputError(f"--record: there is no folder {path.absolute().parent}")
    ffmpeg = find_ffmpeg() if is_video(path) else ""
    with files.replacing(path) as unfinished:
        if not is_video(path):
            arrays = ArrayRecorder()
            yield arrays
            arrays.write(unfinished)
            return
        video = VideoRecorder(unfinished, ffmpeg)
        try:
            yield video
            video.finish()
        finally:
            video.close()


def find_ffmpeg() -> str:
    """The program that encodes videos: that of the machine, or the one in the package imageio-ffmpeg.

    Raises:
        MissingExtraError: there is neither.
    """
    found = os.environ.get("IMAGEIO_FFMPEG_EXE") or shutil.which("ffmpeg")
    if found:
        return found
    if find_spec("imageio_ffmpeg") is None:
        raise MissingExtraError("ffmpeg", "video")
    import imageio_ffmpeg

    return str(imageio_ffmpeg.get_ffmpeg_exe())
