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
)
