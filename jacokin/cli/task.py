"""`jacokin task`: run episodes of a task, by chance or by its expert."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import click

from jacokin.cli.declared import Argument, Option
from jacokin.cli.exit_codes import NOT_SOLVED
from jacokin.errors import InvalidInputError

if TYPE_CHECKING:
    from jacokin.cli.recording import Recorder
    from jacokin.tasks import TaskEnv
    from jacokin.tasks.experts.expert import Expert


def task(
    name: Annotated[str, Argument(metavar="NAME", help="Such as reach_site or lift_brick; an unknown name lists all.")],
    expert: Annotated[
        bool, Option("--expert", help="Let the scripted expert act; otherwise actions are random.")
    ] = False,
    episodes: Annotated[int, Option("--episodes", metavar="N", at_least=1, help="How many episodes to run.")] = 1,
    seed: Annotated[int, Option("--seed", metavar="N", at_least=0, help="Start of the random numbers.")] = 0,
    record: Annotated[
        Path | None,
        Option("--record", metavar="FILE", help="Write pictures (.mp4) or observations, actions and rewards (.npz)."),
    ] = None,
    render: Annotated[bool, Option("--render", help="Show a window, which needs a display.")] = False,
) -> None:
    """Run episodes of a task, and show how they end.

    Needs the extra `tasks`, and for videos ffmpeg or the extra `video`. Episodes take 10 s of simulated time.
    Exit code: 1 where the expert does not solve every episode, else 0, whatever random actions bring about.

    Examples:
      jacokin task reach_site --expert
      jacokin task lift_brick --expert --episodes 10 --record episodes.npz
      jacokin task place_brick --expert --record video.mp4
    """
    from jacokin.cli import recording

    has_pictures = recording.is_video(record)
    if render and has_pictures:
        raise InvalidInputError("give one of --render and --record with a video, not both: each draws in its own way")
    if render and not has_display():
        raise InvalidInputError("--render needs a display; without one, --record video.mp4 writes a video")
    if has_pictures:
        choose_renderer()
    with contextlib.ExitStack() as stack:
        recorder = None if record is None else stack.enter_context(recording.recorder(record))
        from jacokin import tasks

        policy = tasks.expert(name) if expert else None
        mode = "human" if render else "rgb_array" if has_pictures else None
        environment = stack.enter_context(contextlib.closing(tasks.TaskEnv(name, flatten=False, render_mode=mode)))
        environment.action_space.seed(seed)
        solved, returns = 0, []
        for episode in range(episodes):
            total, success = _run(environment, policy, seed if episode == 0 else None, episode, recorder)
            solved += success
            returns.append(total)
            is_solved = "solved" if success else "not solved"
            click.echo(f"episode {episode + 1} of {episodes}: return {total:.1f}, {is_solved}")
        click.echo(f"{solved} of {episodes} solved, mean return {sum(returns) / episodes:.1f}")
    if record is not None:
        click.echo(f"wrote {record}")
    if expert and solved < episodes:
        raise SystemExit(NOT_SOLVED)


def _run(
    environment: TaskEnv, policy: Expert | None, seed: int | None, episode: int, recorder: Recorder | None
) -> tuple[float, bool]:
    """Run one episode; returns its return and whether the task is solved at its end."""
    observation, info = environment.reset(seed=seed)
    if policy is not None:
        policy.reset()
    total, is_over = 0.0, False
    while not is_over:
        action = environment.action_space.sample() if policy is None else policy(observation)
        following, reward, _, is_over, info = environment.step(action)
        if recorder is not None and environment.render_mode == "rgb_array":
            recorder.add(picture=environment.render())
        elif recorder is not None:
            assert isinstance(observation, dict)
            recorder.add(episode=episode, action=action, reward=reward, success=info["is_success"], **observation)
        observation = following
        total += reward
    return total, bool(info["is_success"])


def has_display() -> bool:
    """Whether windows can be opened."""
    return sys.platform != "linux" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def choose_renderer() -> None:
    """Draw with EGL where there is no display and nothing else was chosen; MuJoCo looks once, when it is loaded."""
    if not has_display() and "mujoco" not in sys.modules:
        os.environ.setdefault("MUJOCO_GL", "egl")
