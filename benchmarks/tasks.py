"""What environments cost beside the simulation itself: ratios within one run.

python -m benchmarks.tasks [TASK ...]
"""

from __future__ import annotations

import subprocess
import sys
import time
import warnings
from collections.abc import Callable, Sequence
from functools import partial
from importlib.util import find_spec
from typing import Any

import gymnasium
import mujoco
import numpy as np
from mujoco.batch import Batch
from numpy.typing import NDArray

import jacokin.tasks
from benchmarks import report
from jacokin.mujoco_bridge.distributions import Uniform
from jacokin.tasks import Randomization
from jacokin.tasks.episode import STEPS
from jacokin.tasks.gym.registration import IDS
from jacokin.tasks.gym.vector import VectorTaskEnv
from jacokin.tasks.task import SUBSTEPS

Array = NDArray[np.float64]

TASKS = ("reach_site", "lift_brick", "place_cradle", "stack_3_bricks_random_order")
BLOCK, ROUNDS = 60, 12  # control steps in a timed block, and how often the contestants take turns
RESETS = 40
ENVIRONMENTS, THREADS, VECTOR_BLOCK, VECTOR_ROUNDS = 128, 2, 10, 4
MANY = 1024  # environments whose memory is measured
SPEED = 0.3  # of the largest velocities, for random actions
VARIED = Randomization(
    friction=Uniform(0.3, 1.2),
    mass=Uniform(0.5, 2.0),
    gains=Uniform(0.8, 1.2),
    damping=Uniform(0.5, 2.0),
    latency=Uniform(0.0, 0.12),
    observation_noise=0.01,
    base_pose=Uniform(-0.01, 0.01),
)


def processor_time(run: Callable[[], object]) -> float:
    """Seconds of processor time."""
    start = time.process_time()
    run()
    return time.process_time() - start


def wall_time(run: Callable[[], object]) -> float:
    """Seconds."""
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def actions(count: int, *shape: int) -> Array:
    """Random actions of joint velocities."""
    spec = jacokin.tasks.load("reach_site").action_spec()
    found: Array = SPEED * np.random.default_rng(0).uniform(spec.minimum, spec.maximum, (count, *shape, 9))
    return found


def step_ratios(name: str) -> tuple[float, float, float]:
    """Bare control steps a second; dm_env's step in bare ones, and Gymnasium's in dm_env's.

    All three go through the same states, in turns; the least time of each block counts.
    """
    environment, gym = jacokin.tasks.load(name, seed=0), gymnasium.make(IDS[name])
    model = environment.physics.model
    data = mujoco.MjData(model)
    environment.reset()
    gym.reset(seed=0)
    steps = actions(BLOCK)

    def bare() -> None:
        for action in steps:
            data.ctrl[:] = action
            mujoco.mj_step(model, data, SUBSTEPS)

    def of_dm_env() -> None:
        for action in steps:
            environment.step(action)

    def of_gym() -> None:
        for action in steps:
            gym.step(action)

    state, size = environment.physics.get_state(), mujoco.mjtState.mjSTATE_INTEGRATION
    times = np.empty((ROUNDS, 3))
    for number in range(ROUNDS):
        mujoco.mj_setState(model, data, state, size)
        mujoco.mj_forward(model, data)
        gym_task: Any = gym.unwrapped
        for episode in (environment._episode, gym_task._episode):
            episode.physics.set_state(state)
            episode.physics.forward()
            episode.steps = 0
        runs = [bare, of_dm_env, of_gym]
        for place in np.roll(range(3), number):
            times[number, place] = processor_time(runs[place])
    best = times.min(axis=0)
    return BLOCK / best[0], best[1] / best[0], best[2] / best[1]


def resets(name: str) -> tuple[float, float | None]:
    """Processor time of a reset here and in dm_control, if that is there."""
    ours = jacokin.tasks.load(name, seed=0)
    ours.reset()
    mine = np.mean([processor_time(ours.reset) for _ in range(RESETS)])
    if find_spec("dm_control") is None:
        return float(mine), None
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW without a display
        from tests.optional import make_dm_control_run

        make_dm_control_run()
        from dm_control import manipulation

        theirs = manipulation.load(f"{name}_features", seed=0)
        theirs.reset()
        return float(mine), float(np.mean([processor_time(theirs.reset) for _ in range(RESETS // 4)]))


def vector_rates(name: str) -> tuple[float, float, float, float, float, float]:
    """Control steps a second of all environments, in those of a loop over them on one thread.

    Returns:
        Bare steps a second of the loop; bare steps of MuJoCo's own batch on two threads; ours,
        with observations and rewards; ours with one reset in 250 steps too; the same randomized; and the cores that
        the batch got, as other processes may take some.
    """
    vector: Any = VectorTaskEnv(ENVIRONMENTS, task=name, threads=THREADS)
    varied: Any = VectorTaskEnv(ENVIRONMENTS, task=name, threads=THREADS, randomization=VARIED)
    model, steps = vector._first.model, actions(VECTOR_BLOCK, ENVIRONMENTS)
    state = mujoco.mjtState.mjSTATE_INTEGRATION
    vector.reset(seed=0)
    states = starts(name)
    datas = [mujoco.MjData(model) for _ in range(ENVIRONMENTS)]
    batch = Batch(model, ENVIRONMENTS, THREADS, persistent=True)

    def loop() -> None:
        for block in steps:
            for data, action in zip(datas, block, strict=True):
                data.ctrl[:] = action
                mujoco.mj_step(model, data, SUBSTEPS)

    def of_batch() -> None:
        for block in steps:
            batch.ctrl = block
            batch.step(None, SUBSTEPS, int(mujoco.mjtStage.mjSTAGE_VEL))

    def of(environments: Any) -> Callable[[], None]:
        def run() -> None:
            for block in steps:
                environments.step(block)

        return run

    times, cores = np.empty((VECTOR_ROUNDS, 6)), []
    for number in range(VECTOR_ROUNDS):
        for data, each in zip(datas, states, strict=True):
            mujoco.mj_setState(model, data, each, state)
            mujoco.mj_forward(model, data)
        batch.state[:] = states
        batch.forward()
        runs = [loop, of_batch, of(vector), of(varied)]
        for place, each in enumerate((vector, varied)):
            times[number, len(runs) + place] = wall_time(partial(each.reset, seed=0))
        for place, run in enumerate(runs):
            used = time.process_time()
            times[number, place] = wall_time(run)
            if run is of_batch:
                cores.append((time.process_time() - used) / times[number, place])
    bare, of_mujoco, ours, randomized, reset, varied_reset = times.min(axis=0)
    episode, blocks = STEPS / VECTOR_BLOCK, ENVIRONMENTS * VECTOR_BLOCK
    return (
        blocks / bare,
        bare / of_mujoco,
        bare / ours,
        episode * bare / (episode * ours + reset),
        episode * bare / (episode * randomized + varied_reset),
        max(cores),
    )


def starts(name: str) -> list[Array]:
    """The initial states of the environments of a vector."""
    found = []
    single = jacokin.tasks.TaskEnv(name)
    for seed in range(ENVIRONMENTS):
        single.reset(seed=seed)
        found.append(single.task.physics.get_state())
    return found


def memory(name: str) -> float:
    """What many environments take in a fresh process, beside the first of them [MB]."""
    program = (
        "import sys, numpy as np; from jacokin.tasks.gym.vector import VectorTaskEnv\n"
        "def used(): return int(open('/proc/self/statm').read().split()[1]) * 4096\n"
        f"def run(n): v = VectorTaskEnv(n, task={name!r}, threads={THREADS}); v.reset(seed=0); "
        "v.step(np.zeros((n, 9))); return v\n"
        f"one = run(1); before = used(); many = run({MANY}); print((used() - before) / 1e6)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    return float(done.stdout)


def main(names: Sequence[str]) -> None:
    """Measure and print."""
    gymnasium.register_envs(jacokin.tasks)
    singles: list[tuple[str, ...]] = []
    vectors: list[tuple[str, ...]] = []
    for name in names:
        rate, dm_env, skin = step_ratios(name)
        mine, theirs = resets(name)
        beside = "-" if theirs is None else f"{1e3 * theirs:.1f} ms"
        singles.append((name, f"{rate:.0f}", f"{dm_env:.3f}", f"{skin:.3f}", f"{1e3 * mine:.2f} ms", beside))
        bare, *ratios = vector_rates(name)
        held = f"{memory(name):.0f} MB" if sys.platform == "linux" else "-"
        vectors.append((name, f"{bare:.0f}", *(f"{ratio:.2f}" for ratio in ratios), held))
    header: tuple[str, ...] = ("task", "bare steps/s", "dm_env / bare", "Gymnasium / dm_env", "reset", "dm_control's")
    print("A control step, with all observations and the reward, of one environment on one thread:\n")
    print(report.table(header, singles))
    print(
        f"\nSteps a second of {ENVIRONMENTS} environments on {THREADS} threads, as multiples of the first column, and "
        f"what {MANY} environments take:\n"
    )
    header = ("task", "bare steps/s", "bare batch", "ours", "with resets", "randomized", "cores", "memory")
    print(report.table(header, vectors))


if __name__ == "__main__":
    main(sys.argv[1:] or TASKS)
