"""What environments cost beside the simulation itself: ratios within one run.

python -m benchmarks.tasks
"""

from __future__ import annotations

import time
from collections.abc import Callable

import mujoco
import numpy as np

import jacokin.tasks
from jacokin.tasks.gym.make_vector import make_vector

STEPS, ROUNDS = 100, 5
ENVIRONMENTS, THREADS = 128, 2


def seconds(run: Callable[[], object], count: int) -> float:
    """Processor time of one call."""
    start = time.process_time()
    for _ in range(count):
        run()
    return (time.process_time() - start) / count


def step_ratios(name: str) -> tuple[float, float, float]:
    """Bare control steps a second; dm_env's and Gymnasium's step in bare steps."""
    environment, gym = jacokin.tasks.load(name, seed=0), jacokin.tasks.TaskEnv(name)
    bare, action = environment.physics.model, np.zeros(9)
    data = mujoco.MjData(bare)
    found = []
    for _ in range(ROUNDS):
        environment.reset()
        gym.reset(seed=0)
        data.qpos[:] = environment.physics.data.qpos
        data.mocap_pos[:] = environment.physics.data.mocap_pos
        mujoco.mj_forward(bare, data)
        found.append(
            (
                seconds(lambda: mujoco.mj_step(bare, data, 20), STEPS),
                seconds(lambda: environment.step(action), STEPS),
                seconds(lambda: gym.step(action), STEPS),
            )
        )
    best = np.min(found, axis=0)
    return 1.0 / best[0], best[1] / best[0], best[2] / best[0]


def vector_ratio(name: str) -> float:
    """Control steps a second of a vector on two threads, wall-clock, in those of a bare loop on one."""
    vector = make_vector(ENVIRONMENTS, task=name, threads=THREADS)
    vector.reset(seed=0)
    actions = np.zeros((ENVIRONMENTS, 9))
    start = time.perf_counter()
    for _ in range(20):
        vector.step(actions)
    mine = 20 * ENVIRONMENTS / (time.perf_counter() - start)
    environment = jacokin.tasks.load(name, seed=0)
    environment.reset()
    model, data = environment.physics.model, environment.physics.data
    start = time.perf_counter()
    for _ in range(500):
        mujoco.mj_step(model, data, 20)
    return mine * (time.perf_counter() - start) / 500


def main() -> None:
    for name in ("reach_site", "lift_brick", "place_cradle", "stack_3_bricks_random_order"):
        rate, dm_env, gym = step_ratios(name)
        environment = jacokin.tasks.load(name, seed=0)
        reset = seconds(environment.reset, 20)
        print(f"{name}: {rate:.0f} bare control steps/s; dm_env {dm_env:.2f} x, Gymnasium {gym:.2f} x", end="; ")
        print(
            f"reset {1e3 * reset:.2f} ms; {ENVIRONMENTS} on {THREADS} threads {vector_ratio(name):.2f} x bare steps/s"
        )


if __name__ == "__main__":
    main()
