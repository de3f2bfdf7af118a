"""Both sides: dm_control's environments, and ours put into their states."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

import jacokin.tasks
from jacokin.arrays import Array
from jacokin.mujoco_bridge import Entity
from jacokin.tasks import Environment
from jacokin.tasks.families import BrickTask, Lift, Place, ReachBrick, ReachSite
from tests.optional import make_dm_control_run

NAMES = [name for name in jacokin.tasks.names() if not name.startswith(("reach_top", "reach_bottom"))]
FEATURES = [name for name in NAMES if name.endswith("features")]
VISION = [name for name in NAMES if name.endswith("vision")]
SAME = 1e-6  # the reference rounds its limits and two of its quaternions to six digits
SAME_REWARD = 4e-6  # of positions of the tool that differ by 1.4e-7 m, where rewards change by up to 26 per m


def load_reference(name: str, seed: int = 0) -> Any:
    """An environment of dm_control."""
    make_dm_control_run()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # GLFW without a display
        from dm_control import manipulation

        return manipulation.load(name, seed=seed)


def described(spec: Any) -> list[Any]:
    """All that a specification says."""
    found = [type(spec).__name__, spec.name, spec.shape, np.dtype(spec.dtype).name]
    if hasattr(spec, "minimum"):
        found += [np.ravel(bound).tolist() for bound in (spec.minimum, spec.maximum)]
    return found


def specifications(environment: Any) -> dict[str, Any]:
    """All specifications of an environment, in their order."""
    return {
        "action": described(environment.action_spec()),
        "reward": described(environment.reward_spec()),
        "discount": described(environment.discount_spec()),
        "control timestep": environment.control_timestep(),
        "observations": [[key, *described(spec)] for key, spec in environment.observation_spec().items()],
    }


def take_over(reference: Any, ours: Environment) -> Array:
    """Put our simulation into the state of the reference; returns our goal."""
    from dm_control import mjcf

    their_physics, their_task, task = reference.physics, reference.task, ours.task
    physics = ours.physics
    data, goal = physics.data, np.empty(task.goal_size)
    data.qpos[:9], data.qvel[:9] = their_physics.data.qpos[:9], their_physics.data.qvel[:9]

    def move(own: Entity, other: Any) -> None:
        own.set_pose(physics, *other.get_pose(their_physics))
        if own.freejoint is not None:
            joint = mjcf.get_frame_freejoint(other.mjcf_model)
            physics.bind(own.freejoint).qvel = np.array(their_physics.bind(joint).qvel)

    if isinstance(task, ReachSite):
        data.mocap_pos[0] = their_physics.bind(their_task._target).pos
    elif isinstance(task, ReachBrick | Place):
        move(task.props[0], their_task._prop)
        if isinstance(task, Place):
            move(task.pedestal, their_task._pedestal)
    elif isinstance(task, Lift):
        move(task.prop, their_task._prop)
        goal = np.array([their_task._target_height])
    elif isinstance(task, BrickTask):
        order = np.array(their_task._desired_order)
        goal, slots = task._goal(order, int(order[0]))
        for slot, other in zip(slots, their_task._bricks, strict=True):
            move(task.bricks[slot], other)
        for own, other in zip(task.hints, their_task._goal_hint_bricks, strict=True):
            move(own, other)
    task.show_goal(goal)
    physics.forward()
    return goal
