"""Everything that can be randomized."""

from __future__ import annotations

from jacokin.mujoco_bridge.distributions import Uniform
from jacokin.tasks import Randomization

ALL = Randomization(
    friction=Uniform(0.3, 1.2),
    mass=Uniform(0.5, 2.0),
    gains=Uniform(0.8, 1.2),
    damping=Uniform(0.5, 2.0),
    lights=Uniform(0.5, 1.5),
    latency=Uniform(0.0, 0.2),
    observation_noise=Uniform(0.0, 0.01),
    camera=Uniform(0.0, 0.05),
    base_pose=Uniform(-0.02, 0.02),
    armature=Uniform(0.5, 1.5),
    dry_friction=Uniform(0.5, 1.5),
    ambient=Uniform(0.5, 1.5),
    field_of_view=Uniform(0.9, 1.1),
    joint_offsets=Uniform(-0.01, 0.01),
    joint_gains=Uniform(0.8, 1.2),
    link_masses=Uniform(0.8, 1.2),
    action_noise=Uniform(0.0, 0.05),
    observation_bias=Uniform(0.0, 0.01),
    colors=Uniform(0.0, 0.3),
    observation_delay=Uniform(0.0, 0.1),
    feature_noise={"jaco_arm/joints_pos": Uniform(0.0, 0.01), "jaco_arm/joints_vel": Uniform(0.0, 0.1)},
    feature_bias={"jaco_arm/joints_pos": Uniform(0.0, 0.01)},
    textures=Uniform(0.5, 2.0),
    camera_turn=Uniform(0.0, 0.1),
    arm_push=Uniform(0.0, 20.0),
    prop_push=Uniform(0.0, 0.2),
    push_rate=Uniform(2.0, 10.0),
    push_duration=Uniform(0.04, 0.2),
)
