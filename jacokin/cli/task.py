"""`jacokin task`: run episodes of a task, with random actions or its expert, and record them."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from jacokin import files
from jacokin.cli import display
from jacokin.cli.command import command, option, switch
from jacokin.cli.display import progress_bar
from jacokin.cli.process import NOT_SOLVED
from jacokin.errors import InvalidInputError
from jacokin.showing import has_display

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from jacokin.tasks import TaskEnv
    from jacokin.tasks.datasets.video import VideoRecorder
    from jacokin.tasks.experts.expert import Expert

ARRAYS, VIDEO = ".npz", ".mp4"
DATA_SETS = (".hdf5", ".minari", ".lerobot")
REPLAY = "replay"
CONTROL = "joint_velocity"


@dataclass(frozen=True, slots=True)
class TaskOptions:
    """Episodes of what, by whom, and what is kept of them."""

    name: str = option(
        metavar="NAME",
        text="Such as reach_site or lift_brick, or MODULE:ID of a task of your own; an unknown name lists all.",
    )
    data_set: Path | None = option(metavar="[FILE]", required=False, text="After `replay`: a data set.")
    expert: bool = switch("--expert", help="Let the scripted expert act; otherwise actions are random.")
    control: str | None = option(
        "--control",
        metavar="NAME",
        help=f"What actions are: {CONTROL} (as if not given), joint_position, joint_delta, tool_velocity or tool_pose.",
    )
    noise: float | None = option(
        "--noise",
        needs=("--expert",),
        type=click.FloatRange(min=0.0),
        metavar="RAD/S",
        help="With --expert: standard deviation of noise on its velocities, such as 0.05.",
    )
    mistakes: int | None = option(
        "--mistakes",
        needs=("--expert",),
        type=click.IntRange(min=0),
        metavar="N",
        help="With --expert: how many times in an episode the arm goes astray, and comes back.",
    )
    episodes: int = option(
        "--episodes", type=click.IntRange(min=1), default=1, metavar="N", help="How many episodes to run."
    )
    seed: int = option(
        "--seed", type=click.IntRange(min=0), default=0, metavar="N", help="Start of the random numbers."
    )
    record: Path | None = option(
        "--record",
        help="Write pictures (.mp4), observations, actions and rewards (.npz), "
        "or a data set (.hdf5, .minari, .lerobot).",
    )
    render: bool = switch("--render", help="Show a window, which needs a display.")

    @property
    def mode(self) -> str | None:
        """How the environment draws."""
        return "human" if self.render else "rgb_array" if is_video(self.record) else None

    def check(self) -> None:
        """Refuse options that do not go together.

        Raises:
            InvalidInputError: names them.
        """
        if self.record is not None and not self.record.absolute().parent.is_dir():
            raise InvalidInputError(f"--record: there is no folder {self.record.absolute().parent}")
        if self.render and is_video(self.record):
            raise InvalidInputError(
                "give one of --render and --record with a video, not both: each draws in its own way"
            )
        if self.render and not has_display():
            raise InvalidInputError("--render needs a display; without one, --record video.mp4 writes a video")
        if self.data_set is not None or self.name == REPLAY:
            if self.data_set is None or self.name != REPLAY or self.expert:
                raise InvalidInputError(
                    "a data set is played back by `jacokin task replay FILE`, which takes no --expert"
                )
            if self.control is not None:
                raise InvalidInputError("--control is that of the data set: leave it out")
            if self.episodes != 1 or self.seed != 0:
                raise InvalidInputError("--episodes and --seed are those of the data set: leave them out")
            if not self.data_set.exists() or self.data_set.suffix not in DATA_SETS:
                raise InvalidInputError(f"{self.data_set}: is not a data set that is there: {', '.join(DATA_SETS)}")
        elif self.record is not None and self.record.suffix in DATA_SETS and self.render:
            raise InvalidInputError("give one of --render and --record with a data set, not both")

    def load(self) -> tuple[TaskEnv, Expert | None]:
        """The environment, and the expert if it is asked for.

        Raises:
            InvalidInputError: as `tasks.expert` and `TaskEnv`.
        """
        from jacokin import tasks

        if ":" in self.name:
            sys.path.insert(0, "")  # the module before the colon may be in the present folder, as for Python itself
        control, policy = self.control or CONTROL, None
        if self.expert:
            policy = tasks.expert(self.name, control=control, noise=self.noise or 0.0, mistakes=self.mistakes or 0)
        return tasks.TaskEnv(self.name, control=control, flatten=False, render_mode=self.mode), policy

    def tell(self, solved: int, mean_return: float) -> None:
        """Say how the episodes went.

        Raises:
            SystemExit: the expert has not solved all.
        """
        display.echo(f"{solved} of {self.episodes} solved, mean return {mean_return:.1f}")
        if self.record is not None:
            display.echo(f"wrote {self.record}")
        if self.expert and solved < self.episodes:
            raise SystemExit(NOT_SOLVED)


@command(no_args_is_help=True)
def task(given: TaskOptions) -> None:
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
    given.check()
    if is_video(given.record):
        choose_renderer()
    if given.data_set is not None:
        _replay(given.data_set, given)
    elif given.record is not None and given.record.suffix in DATA_SETS:
        _record_data(given, given.record)
    else:
        _play(given)


def _play(given: TaskOptions) -> None:
    """Run episodes, and record them row by row or as a film."""
    with contextlib.ExitStack() as stack:
        recorder = None if given.record is None else stack.enter_context(record_to(given.record))
        environment, policy = given.load()
        stack.enter_context(contextlib.closing(environment))
        environment.action_space.seed(given.seed)
        solved, returns = 0, []
        for episode in range(given.episodes):
            with progress_bar(f"episode {episode + 1} of {given.episodes}, step") as progress:
                total, success = _run(environment, policy, given.seed, episode, recorder, progress)
            solved += success
            returns.append(total)
            is_solved = "solved" if success else "not solved"
            display.echo(f"episode {episode + 1} of {given.episodes}: return {total:.1f}, {is_solved}")
    given.tell(solved, sum(returns) / given.episodes)


def _record_data(given: TaskOptions, path: Path) -> None:
    """Record a data set."""
    from jacokin import tasks

    environment, policy = given.load()
    with contextlib.closing(environment), progress_bar("episode") as progress:
        found = tasks.record(
            environment,
            policy or _RandomActions(environment),
            path,
            episodes=given.episodes,
            seed=given.seed,
            progress=lambda made: progress(made.done, made.total),
        )
    given.tell(found.solved, found.mean_return)


class _RandomActions:
    """Actions that follow from the seed of an episode, so that a recording can go on after a kill."""

    def __init__(self, environment: TaskEnv) -> None:
        self._space = environment.action_space

    def reset(self, seed: int) -> None:
        self._space.seed(seed)

    def __call__(self, observation: object) -> ArrayLike:
        return self._space.sample()


def _replay(path: Path, given: TaskOptions) -> None:
    """Run the episodes of a data set again.

    Raises:
        InvalidInputError: another file than a video to record to, or as `tasks.replay`.
        SystemExit: one differs.
    """
    from jacokin import tasks

    record = given.record
    if record is not None and not is_video(record):
        raise InvalidInputError(f"--record of a replay must end in {VIDEO}, got {record}")

    with contextlib.ExitStack() as stack:
        recorder = None if record is None else stack.enter_context(record_to(record))

        def watch(environment: TaskEnv) -> None:
            if not isinstance(recorder, ArrayRecorder | None):
                recorder.film(environment)
            elif given.render:
                environment.render()

        found = tasks.replay(path, render_mode=given.mode, watch=watch)
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
