"""The arm and the hand in MuJoCo: scenes made of entities, physics, observables.

    arm = robots.make_arm(observations.PERFECT_FEATURES)
    hand = robots.make_hand(observations.PERFECT_FEATURES)
    arm.attach(hand)
    arena = Arena()
    arena.attach(arm, position=robots.ARM_OFFSET)
    physics = Physics.from_entity(arena)
    arm.set_home(physics)

Everything public is imported from here. Read `simulation/physics` first, then `entities/entity`, `base` and `jaco_arm`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from jacokin import lazy

if TYPE_CHECKING:
    from jacokin.mujoco_bridge import base as base
    from jacokin.mujoco_bridge import cameras as cameras
    from jacokin.mujoco_bridge import distributions as distributions
    from jacokin.mujoco_bridge import jaco_arm as jaco_arm
    from jacokin.mujoco_bridge import jaco_hand as jaco_hand
    from jacokin.mujoco_bridge import observations as observations
    from jacokin.mujoco_bridge import props as props
    from jacokin.mujoco_bridge import rewards as rewards
    from jacokin.mujoco_bridge import robots as robots
    from jacokin.mujoco_bridge import workspaces as workspaces
    from jacokin.mujoco_bridge.arena import Arena as Arena
    from jacokin.mujoco_bridge.base import DOWN_QUATERNION as DOWN_QUATERNION
    from jacokin.mujoco_bridge.base import RobotArm as RobotArm
    from jacokin.mujoco_bridge.base import RobotHand as RobotHand
    from jacokin.mujoco_bridge.control.commands import command_joint_positions as command_joint_positions
    from jacokin.mujoco_bridge.control.commands import command_site_velocity as command_site_velocity
    from jacokin.mujoco_bridge.control.initializers import TcpInitializer as TcpInitializer
    from jacokin.mujoco_bridge.control.initializers import ToolCenterPointInitializer as ToolCenterPointInitializer
    from jacokin.mujoco_bridge.control.prop_placer import PropPlacer as PropPlacer
    from jacokin.mujoco_bridge.distributions import uniform_box as uniform_box
    from jacokin.mujoco_bridge.entities.entity import Entity as Entity
    from jacokin.mujoco_bridge.entities.entity import ModelWrapperEntity as ModelWrapperEntity
    from jacokin.mujoco_bridge.jaco_arm import JacoArm as JacoArm
    from jacokin.mujoco_bridge.jaco_hand import JacoHand as JacoHand
    from jacokin.mujoco_bridge.observables.angles import angles_from_sin_cos as angles_from_sin_cos
    from jacokin.mujoco_bridge.observables.declaration import Observables as Observables
    from jacokin.mujoco_bridge.observables.declaration import observable as observable
    from jacokin.mujoco_bridge.observables.declaration import observables_of as observables_of
    from jacokin.mujoco_bridge.observables.features import MJCFFeature as MJCFFeature
    from jacokin.mujoco_bridge.observables.joints import JointsObservables as JointsObservables
    from jacokin.mujoco_bridge.observables.observable import Observable as Observable
    from jacokin.mujoco_bridge.observables.specs import ArraySpec as ArraySpec
    from jacokin.mujoco_bridge.observables.updater import Updater as Updater
    from jacokin.mujoco_bridge.props.box import Box as Box
    from jacokin.mujoco_bridge.props.box import large_box as large_box
    from jacokin.mujoco_bridge.props.brick import Brick as Brick
    from jacokin.mujoco_bridge.props.pedestal import Cradle as Cradle
    from jacokin.mujoco_bridge.props.pedestal import Pedestal as Pedestal
    from jacokin.mujoco_bridge.props.primitive import Primitive as Primitive
    from jacokin.mujoco_bridge.simulation.physics import Physics as Physics

__all__, __getattr__, __dir__ = lazy.door(
    __name__,
    {
        "jacokin.mujoco_bridge.arena": ("Arena",),
        "jacokin.mujoco_bridge.base": (
            "DOWN_QUATERNION",
            "RobotArm",
            "RobotHand",
        ),
        "jacokin.mujoco_bridge.entities.entity": (
            "Entity",
            "ModelWrapperEntity",
        ),
        "jacokin.mujoco_bridge.jaco_arm": ("JacoArm",),
        "jacokin.mujoco_bridge.jaco_hand": ("JacoHand",),
        "jacokin.mujoco_bridge.simulation.physics": ("Physics",),
        "jacokin.mujoco_bridge.props.box": ("Box", "large_box"),
        "jacokin.mujoco_bridge.props.brick": ("Brick",),
        "jacokin.mujoco_bridge.props.pedestal": ("Cradle", "Pedestal"),
        "jacokin.mujoco_bridge.props.primitive": ("Primitive",),
        "jacokin.mujoco_bridge.control.commands": (
            "command_joint_positions",
            "command_site_velocity",
        ),
        "jacokin.mujoco_bridge.control.initializers": (
            "TcpInitializer",
            "ToolCenterPointInitializer",
        ),
        "jacokin.mujoco_bridge.control.prop_placer": ("PropPlacer",),
        "jacokin.mujoco_bridge.distributions": ("uniform_box",),
        "jacokin.mujoco_bridge.observables.specs": ("ArraySpec",),
        "jacokin.mujoco_bridge.observables.joints": ("JointsObservables",),
        "jacokin.mujoco_bridge.observables.declaration": (
            "Observables",
            "observable",
            "observables_of",
        ),
        "jacokin.mujoco_bridge.observables.features": ("MJCFFeature",),
        "jacokin.mujoco_bridge.observables.observable": ("Observable",),
        "jacokin.mujoco_bridge.observables.angles": ("angles_from_sin_cos",),
        "jacokin.mujoco_bridge.observables.updater": ("Updater",),
    },
    (
        "base",
        "cameras",
        "distributions",
        "jaco_arm",
        "jaco_hand",
        "observations",
        "props",
        "rewards",
        "robots",
        "workspaces",
    ),
)
