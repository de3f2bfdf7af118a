"""`jacokin task`: run episodes of a task, with random actions or its expert, and record them."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import files
from jacokin.cli import display, options
from jacokin.cli.command import Argument, Command
from jacokin.cli.display import progress_bar
from jacokin.cli.process import NOT_SOLVED
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from jacokin.tasks import TaskEnv
    from jacokin.tasks.datasets.video import VideoRecorder
    from jacokin.tasks.experts.expert import Expert

ARRAYS, VIDEO = ".npz", ".mp4"
DATA_SETS = (".hdf5", ".minari", ".lerobot")
REPLAY = "replay"
CONTROL = "joint_velocity"


@click.command(cls=Command, no_args_is_help=True)
@click.argument(
    "name",
    cls=Argument,
    metavar="NAME",
    text="Such as reach_site or lift_brick, or MODULE:ID of a task of your own; an unknown name lists all.",
)
@click.argument(
    "data_set", cls=Argument, metavar="[FILE]", type=options.FILE, required=False, text="After `replay`: a data set."
)
@click.option("--expert", is_flag=True, help="Let the scripted expert act; otherwise actions are random.")
@click.option(
    "--control",
    metavar="NAME",
    help=f"What actions are: {CONTROL} (as if not given), joint_position, joint_delta, tool_velocity or tool_pose.",
)
@click.option(
    "--noise",
    type=click.FloatRange(min=0.0),
    metavar="RAD/S",
    help="With --expert: standard deviation of noise on its velocities, such as 0.05.",
)
@click.option(
    "--mistakes",
    type=click.IntRange(min=0),
    metavar="N",
    help="With --expert: how many times in an episode the arm goes astray, and comes back.",
)
@click.option("--episodes", type=click.IntRange(min=1), default=1, metavar="N", help="How many episodes to run.")
@click.option("--seed", type=click.IntRange(min=0), default=0, metavar="N", help="Start of the random numbers.")
@click.option(
    "--record",
    type=options.FILE,
    metavar="FILE",
    help="Write pictures (.mp4), observations, actions and rewards (.npz), or a data set (.hdf5, .minari, .lerobot).",
)
@click.option("--render", is_flag=True, help="Show a window, which needs a display.")
def task(
    name: str,
    data_set: Path | None,
    expert: bool,
    control: str | None,
    noise: float | None,
    mistakes: int | None,
    episodes: int,
    seed: int,
    record: Path | None,
    render: bool,
) -> None:
    """Run episodes of a task, and show how they end; `jacokin task replay FILE` runs those of a data set again.

    Needs the extra `tasks`, for videos ffmpeg or the extra `video`, and `data` for data sets: .hdf5 in the layout of
    robomimic, folders .minari and .lerobot. Their episodes have the seeds N, N + 1, ...; a run that was killed goes on
    when it is started again. Episodes take 10 s of simulated time, and so do their videos.
    Exit code: 1 where the expert does not solve every episode, or a replay differs, else 0.

    Examples:
      jacokin task reach_site --expert
      jacokin task lift_brick --expert --episodes 10 --record episodes.npz
      jacokin task place_brick --expert --record video.mp4
      jacokin task lift_brick --expert --episodes 200 --record demos.hdf5
      jacokin task lift_brick --expert --control tool_velocity --record demos.hdf5
      jacokin task lift_brick --expert --noise 0.05 --mistakes 1 --episodes 200 --record demos.hdf5
      jacokin task replay demos.hdf5 --record video.mp4
    """
    if not expert and (noise is not None or mistakes is not None):
        raise InvalidInputError("--noise and --mistakes are those of the expert: give --expert too")
    has_pictures = is_video(record)
    if render and has_pictures:
        raise InvalidInputError("give one of --render and --record with a video, not both: each draws in its own way")
    if render and not has_display():
        raise InvalidInputError("--render needs a display; without one, --record video.mp4 writes a video")
    if has_pictures:
        choose_renderer()
    if data_set is not None or name == REPLAY:
        if data_set is None or name != REPLAY or expert:
            raise InvalidInputError("a data set is played back by `jacokin task replay FILE`, which takes no --expert")
        if control is not None:
            raise InvalidInputError("--control is that of the data set: leave it out")
        _replay(data_set, record, render)
        return
    control = control or CONTROL
    if record is not None and record.suffix in DATA_SETS:
        if render:
            raise InvalidInputError("give one of --render and --record with a data set, not both")
        _record_data(name, expert, control, noise or 0.0, mistakes or 0, episodes, seed, record)
        return
    with contextlib.ExitStack() as stack:
        recorder = None if record is None else stack.enter_context(record_to(record))
        from jacokin import tasks

        if ":" in name:
            sys.path.insert(0, "")  # the module before the colon may be in the present folder, as for Python itself
        policy = None
        if expert:
            policy = tasks.expert(name, control=control, noise=noise or 0.0, mistakes=mistakes or 0)
        mode = "human" if render else "rgb_array" if has_pictures else None
        environment = tasks.TaskEnv(name, control=control, flatten=False, render_mode=mode)
        stack.enter_context(contextlib.closing(environment))
        environment.action_space.seed(seed)
        solved, returns = 0, []
        for episode in range(episodes):
            with progress_bar(f"episode {episode + 1} of {episodes}, step") as progress:
                total, success = _run(environment, policy, seed, episode, recorder, progress)
            solved += success
            returns.append(total)
            is_solved = "solved" if success else "not solved"
            display.echo(f"episode {episode + 1} of {episodes}: return {total:.1f}, {is_solved}")
        display.echo(f"{solved} of {episodes} solved, mean return {sum(returns) / episodes:.1f}")
    if record is not None:
        display.echo(f"wrote {record}")
    if expert and solved < episodes:
        raise SystemExit(NOT_SOLVED)


def _record_data(
    name: str, expert: bool, control: str, noise: float, mistakes: int, episodes: int, seed: int, path: Path
) -> None:
    from jacokin import tasks

    if ":" in name:
        sys.path.insert(0, "")
    with contextlib.closing(tasks.TaskEnv(name, control=control, flatten=False)) as environment:
        policy: Expert | _RandomActions = _RandomActions(environment)
        if expert:
            policy = tasks.expert(name, control=control, noise=noise, mistakes=mistakes)
        with progress_bar("episode") as progress:
            found = tasks.record(
                environment,
                policy,
                path,
                episodes=episodes,
                seed=seed,
                progress=lambda made: progress(made.done, made.total),
            )
    display.echo(f"{found.solved} of {found.episodes} solved, mean return {found.mean_return:.1f}")
    display.echo(f"wrote {path}")
    if expert and found.solved < found.episodes:
        raise SystemExit(NOT_SOLVED)


class _RandomActions:
    """Actions that follow from the seed of an episode, so that a recording can go on after a kill."""

    def __init__(self, environment: TaskEnv) -> None:
        self._space = environment.action_space

    def reset(self, seed: int) -> None:
        self._space.seed(seed)

    def __call__(self, observation: object) -> ArrayLike:
        return self._space.sample()


def _replay(path: Path, record: Path | None, render: bool) -> None:
    from jacokin import tasks

    if record is not None and not is_video(record):
        raise InvalidInputError(f"--record of a replay must end in {VIDEO}, got {record}")
    mode = "human" if render else "rgb_array" if record is not None else None

    with contextlib.ExitStack() as stack:
        recorder = None if record is None else stack.enter_context(record_to(record))

        def watch(environment: TaskEnv) -> None:
            if not isinstance(recorder, ArrayRecorder | None):
                recorder.film(environment)
            elif render:
                environment.render()

        found = tasks.replay(path, render_mode=mode, watch=watch)
    for each in found:
        what = "equal" if each.is_equal else f"{', '.join(each.differing)} differ"
        if "states" in each.differing:
            what = f"states differ by {each.largest_difference:.3g}"
        display.echo(f"episode {each.episode + 1}, seed {each.seed}: {what}")
    equal = sum(each.is_equal for each in found)
    display.echo(f"{equal} of {len(found)} equal bit by bit")
    if equal < len(found):
        raise SystemExit(NOT_SOLVED)


def _run(
    environment: TaskEnv,
    policy: Expert | None,
    seed: int,
    episode: int,
    recorder: ArrayRecorder | VideoRecorder | None,
    progress: Callable[[int, int], None],
) -> tuple[float, bool]:
    """Run one episode; returns the sum of its rewards and whether the task is solved at the end."""
    from jacokin.tasks.datasets.video import VideoRecorder

    observation, info = environment.reset(seed=seed if episode == 0 else None)
    if policy is not None:
        policy.reset(seed=seed + episode)
    total, is_over, steps = 0.0, False, 0
    while not is_over:
        progress(steps, environment.task.steps)
        action = environment.action_space.sample() if policy is None else policy(observation)
        following, reward, _, is_over, info = environment.step(action)
        if isinstance(recorder, VideoRecorder):
            recorder.film(environment)
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


def is_video(path: Path | None) -> bool:
    """Whether pictures are to be recorded."""
    return path is not None and path.suffix == VIDEO


@contextlib.contextmanager
def record_to(path: Path) -> Iterator[ArrayRecorder | VideoRecorder]:
    """Record to a file, which is there when the block has ended well and untouched otherwise.

    Raises:
        InvalidInputError: another ending, or a file that cannot be written: before the block runs, as far as that can
            be known.
        MissingExtraError: a video, and no ffmpeg.
    """
    from jacokin.tasks.datasets.video import VideoRecorder, find_ffmpeg

    if path.suffix not in (ARRAYS, VIDEO):
        raise InvalidInputError(f"--record must end in {', '.join((ARRAYS, VIDEO, *DATA_SETS))}, got {path}")
    if not path.absolute().parent.is_dir():
        raise InvalidInputError(f"--record: there is no folder {path.absolute().parent}")
    ffmpeg = find_ffmpeg() if is_video(path) else ""
    with files.replacing(path) as unfinished:
        if not is_video(path):
            arrays = ArrayRecorder()
            yield arrays
            try:
                arrays.write(unfinished)
            except OSError as error:  # a full disk
                raise InvalidInputError(f"{path}: cannot be written: {error.strerror or error}") from error
            return
        video = VideoRecorder(unfinished, ffmpeg)
        try:
            yield video
            video.finish()
        finally:
            video.close()
