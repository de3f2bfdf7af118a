"""The MuJoCo bridge against bare MuJoCo and against dm_control, in one run.

Run it with ``python benchmarks/bridge.py``. dm_control is needed for the comparison only.
"""

from __future__ import annotations

import logging
import time
import warnings
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np

import jacokin
from jacokin.arrays import Array
from jacokin.model import quat_wxyz
from jacokin.mujoco_bridge import Arena, JacoArm, JacoHand, Physics, observations, robots
from jacokin.mujoco_bridge.simulation.elements import KINDS

Solve = Callable[[Array, Array | None], bool]

LOWER, UPPER = (-0.2, -0.2, 0.02), (0.2, 0.2, 0.4)  # [m] where the manipulation tasks place the pinch site
POSES = 1000
BLOCKS = 10  # of poses, in which the two take turns
ROUNDS = 300
BINDINGS = 1000


def timed(call: Callable[[], Any]) -> float:
    """Seconds of processor time of one call: other processes on the machine do not count."""
    start = time.thread_time()
    call()
    return time.thread_time() - start


def scene() -> tuple[Physics, JacoArm, JacoHand]:
    arm = robots.make_arm(observations.PERFECT_FEATURES)
    hand = robots.make_hand(observations.PERFECT_FEATURES)
    arm.attach(hand)
    arena = Arena(contact="dm_control")
    arena.attach(arm, position=robots.ARM_OFFSET)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)
    return physics, arm, hand


def step_overhead() -> None:
    """`Physics.step` against the same calls of MuJoCo, taken in turns, before and after many bindings were made."""
    physics, _, _ = scene()
    bound = physics.copy()
    for each, label in ((physics, "nothing bound"), (bound, f"{BINDINGS} bindings, {bind_much(bound)} fields")):
        for n in (1, 20):
            own_time, bare_time = step_times(each, n)
            ratio = own_time / bare_time
            print(f"step({n}), {label}: {own_time * 1e6:.1f} us, bare {bare_time * 1e6:.1f} us, ratio {ratio:.3f}")


def step_times(physics: Physics, n: int) -> tuple[float, float]:
    """Seconds of n steps here and in bare MuJoCo."""
    model, data = physics.model, physics.data

    def bare() -> None:
        mujoco.mj_step2(model, data)
        if n > 1:
            mujoco.mj_step(model, data, n - 1)
        mujoco.mj_step1(model, data)

    bare_times, own_times = [], []
    for _ in range(ROUNDS):
        state = physics.get_state()
        bare_times.append(timed(bare))
        physics.set_state(state)
        physics.forward()
        own_times.append(timed(lambda: physics.step(n)))
    return float(np.median(own_times)), float(np.median(bare_times))


def bind_much(physics: Physics) -> int:
    """Bind random lists of elements of every kind, and hold every field of theirs; returns how many fields."""
    rng = np.random.default_rng(0)
    kinds = [
        [mujoco.mj_id2name(physics.model, kind.object_type, i) for i in range(getattr(physics.model, kind.count))]
        for kind in KINDS.values()
    ]
    names = [[name for name in each if name] for each in kinds]
    names = [each for each in names if each]
    fields = 0
    for number in range(BINDINGS):
        known = names[number % len(names)]
        chosen = rng.choice(known, size=rng.integers(1, len(known) + 1), replace=False)
        bound = physics.bind([str(name) for name in chosen])
        for field in dir(bound):
            if not field.startswith(("_", "element_id")):
                getattr(bound, field)
                fields += 1
    return fields


def observation_time() -> None:
    """All enabled observables of the arm and the hand, after a step."""
    physics, arm, hand = scene()
    enabled = [o for e in (arm, hand) for o in e.observables.as_dict().values() if o.enabled]
    times = []
    for _ in range(ROUNDS):
        physics.step(20)
        times.append(timed(lambda: [each(physics) for each in enabled]))
    print(f"{len(enabled)} observables: {np.median(times) * 1e6:.1f} us")


def own_ik() -> Solve:
    """Brings the pinch site to a position, tool down; or the wrist site to a pose."""
    physics, arm, hand = scene()
    random_state = np.random.RandomState(0)

    def solve(position: Array, quat_wxyz: Array | None) -> bool:
        site = hand.pinch_site if quat_wxyz is None else arm.wrist_site
        return arm.set_site_to_xpos(physics, random_state, site, position, quat_wxyz)

    return solve


def reference_ik() -> Solve:
    """The same by dm_control."""
    logging.getLogger("absl").setLevel(logging.ERROR)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW without a display
        from dm_control.mujoco.wrapper.mjbindings import sizes

        # dm_control 1.0.50 lists fields that MuJoCo 4 has dropped.
        for struct, owner in (("mjmodel", mujoco.MjModel), ("mjdata", mujoco.MjData)):
            for name in [name for name in sizes.array_sizes[struct] if not hasattr(owner, name)]:
                sizes.array_sizes[struct].pop(name)
        from dm_control import mjcf
        from dm_control.manipulation.shared import arenas
        from dm_control.manipulation.shared import observations as reference_observations
        from dm_control.manipulation.shared import robots as reference_robots
    arm = reference_robots.make_arm(reference_observations.PERFECT_FEATURES)
    hand = reference_robots.make_hand(reference_observations.PERFECT_FEATURES)
    arm.attach(hand)
    arena = arenas.Standard()
    arena.attach_offset(arm, reference_robots.ARM_OFFSET)
    physics = mjcf.Physics.from_mjcf_model(arena.mjcf_model)
    random_state = np.random.RandomState(0)

    def solve(position: Array, quat_wxyz: Array | None) -> bool:
        site = hand.pinch_site if quat_wxyz is None else arm.wrist_site
        return bool(arm.set_site_to_xpos(physics, random_state, site, position, quat_wxyz))

    return solve


def targets() -> dict[str, list[tuple[Array, Array | None]]]:
    """Tool down in the workspace of the tasks; and wrist poses of random configurations within the limits."""
    box = np.random.RandomState(1).uniform(LOWER, UPPER, (POSES, 3))
    robot = jacokin.load_robot()
    T_world_base = jacokin.pose(robots.ARM_OFFSET)
    random: list[tuple[Array, Array | None]] = []
    for q in robot.sample(np.random.default_rng(1), POSES):
        T = T_world_base * robot.forward_kinematics(q, "wristsite")
        random.append((T.translation.copy(), quat_wxyz(T.rotation)))
    return {"tool down": [(position, None) for position in box], "random wrist poses": random}


def ik_comparison() -> None:
    """set_site_to_xpos on both sets of targets; the two take turns."""
    solvers = {"jacokin": own_ik(), "dm_control": reference_ik()}
    for label, poses in targets().items():
        compare(label, poses, solvers)


def compare(label: str, poses: list[tuple[Array, Array | None]], solvers: dict[str, Solve]) -> None:
    """Time the solvers on the same targets, block by block."""
    print(f"set_site_to_xpos, {label}:")
    times: dict[str, list[float]] = {name: [] for name in solvers}
    reached = dict.fromkeys(solvers, 0)
    for solve in solvers.values():
        solve(*poses[0])  # what is made on the first call stays
    for first in range(0, len(poses), len(poses) // BLOCKS):
        for name, solve in solvers.items():
            for position, quat in poses[first : first + len(poses) // BLOCKS]:
                start = time.thread_time()
                reached[name] += solve(position, quat)
                times[name].append(time.thread_time() - start)
    percentiles = {name: np.percentile(seconds, (50, 99)) * 1e6 for name, seconds in times.items()}
    for name, (median, p99) in percentiles.items():
        print(f"  {name}: median {median:.0f} us, p99 {p99:.0f} us, reached {reached[name]} of {POSES}")
    median, p99 = percentiles["dm_control"] / percentiles["jacokin"]
    print(f"  faster by {median:.1f} (median), {p99:.1f} (p99)")


def main() -> None:
    print(f"MuJoCo {mujoco.__version__}")
    step_overhead()
    observation_time()
    ik_comparison()


if __name__ == "__main__":
    main()
