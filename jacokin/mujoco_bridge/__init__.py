"""The arm and the hand in MuJoCo: scenes made of entities, physics, observables.

    arm = robots.make_arm(observations.PERFECT_FEATURES)
    hand = robots.make_hand(observations.PERFECT_FEATURES)
    arm.attach(hand)
    arena = Arena()
    arena.attach(arm, position=robots.ARM_OFFSET)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)

Read `physics` first, then `entity`, `base` and `jaco_arm`.
"""

from jacokin.mujoco_bridge import cameras, observations, robots
from jacokin.mujoco_bridge.arena import Arena
from jacokin.mujoco_bridge.base import DOWN_QUATERNION, JointsObservables, RobotArm, RobotHand
from jacokin.mujoco_bridge.entity import Entity, ModelWrapperEntity
from jacokin.mujoco_bridge.jaco_arm import JacoArm
from jacokin.mujoco_bridge.jaco_hand import JacoHand
from jacokin.mujoco_bridge.physics import Physics

__all__ = [
    "DOWN_QUATERNION",
    "Arena",
    "Entity",
    "JacoArm",
    "JacoHand",
    "JointsObservables",
    "ModelWrapperEntity",
    "Physics",
    "RobotArm",
    "RobotHand",
    "cameras",
    "observations",
    "robots",
]
