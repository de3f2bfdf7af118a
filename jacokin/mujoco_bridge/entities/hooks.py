"""What an entity may do at certain moments of an episode; subclasses override what they need."""

from __future__ import annotations

import numpy as np

from jacokin.mujoco_bridge.simulation.physics import Physics

RandomState = np.random.RandomState | np.random.Generator | None


class Hooks:
    """Methods that an episode calls on each of its entities, in the order of `Entity.iter_entities`.

    A control step is a number of physics steps, the substeps.
    """

    def initialize_episode(self, physics: Physics, random_state: RandomState) -> None:
        """Called when an episode starts, after the simulation was reset."""

    def before_step(self, physics: Physics, random_state: RandomState) -> None:
        """Called before each control step."""

    def before_substep(self, physics: Physics, random_state: RandomState) -> None:
        """Called before each physics step."""

    def after_substep(self, physics: Physics, random_state: RandomState) -> None:
        """Called after each physics step."""

    def after_step(self, physics: Physics, random_state: RandomState) -> None:
        """Called after each control step."""
