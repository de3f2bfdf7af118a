"""Contacts of configurations that are tried out beside a simulation."""

from __future__ import annotations

import weakref

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.mujoco_bridge.entity import Entity
from jacokin.mujoco_bridge.simulation.physics import Physics

Geoms = NDArray[np.bool_]  # one flag for each geom of the model
Pairs = tuple[tuple[Geoms, Geoms], ...]

_FULL = int(mujoco.mjtWarning.mjWARN_CONTACTFULL)
_TRIALS: weakref.WeakKeyDictionary[Physics, Trial] = weakref.WeakKeyDictionary()


class Trial:
    """A second `mujoco.MjData` of a model, in which configurations are tried out.

    Attributes:
        qpos: the configuration to try.
        arms: the pairs of sets of geoms that must not touch, by the ids of the bodies that hold an arm and its hand.
    """

    def __init__(self, model: mujoco.MjModel) -> None:
        """Make the data."""
        self._model = model
        self._data = mujoco.MjData(model)
        self.qpos: Array = self._data.qpos
        self.arms: dict[tuple[int, ...], Pairs] = {}

    def follow_mocap(self, physics: Physics) -> None:
        """Copy the poses of the mocap bodies of a simulation."""
        data = physics.data
        self._data.mocap_pos[:], self._data.mocap_quat[:] = data.mocap_pos, data.mocap_quat

    def touching(self, *pairs: tuple[Geoms, Geoms]) -> bool:
        """Whether, for one of the pairs of sets, a geom of the first set touches one of the second, at `qpos`.

        A configuration with more contacts than MuJoCo has memory for counts as touching.
        """
        data = self._data
        data.warning.number[_FULL] = 0
        try:
            mujoco.mj_kinematics(self._model, data)
            mujoco.mj_comPos(self._model, data)
            mujoco.mj_collision(self._model, data)
        except mujoco.FatalError:
            return True
        if data.warning.number[_FULL]:
            return True
        contact = data.contact
        near = contact.dist <= 0.0
        one, other = contact.geom1[near], contact.geom2[near]
        return any(bool((a[one] & b[other]).any() or (b[one] & a[other]).any()) for a, b in pairs)


def trial_of(physics: Physics) -> Trial:
    """The trial data of a simulation, made once, at the present positions."""
    trial = _TRIALS.get(physics)
    if trial is None:
        trial = _TRIALS[physics] = Trial(physics.model)
    trial.qpos[:] = physics.data.qpos
    trial.follow_mocap(physics)
    return trial


def bodies_of(physics: Physics, entity: Entity) -> NDArray[np.bool_]:
    """For each body whether it belongs to an entity or to one attached to it."""
    model = physics.model
    top = int(physics.bind(entity.root_body).element_ids[0])
    found = np.zeros(model.nbody, dtype=bool)
    found[top] = True
    for body in range(top + 1, model.nbody):
        found[body] = found[model.body_parentid[body]]
    return found


def arm_pairs(physics: Physics, arm: Entity, hand: Entity | None) -> Pairs:
    """The pairs of sets of geoms that must not touch: the arm and all but free things, the hand and fixed things."""
    model = physics.model
    with_hand = bodies_of(physics, arm)
    in_hand = np.zeros(model.nbody, dtype=bool) if hand is None else bodies_of(physics, hand)
    in_arm = with_hand & ~in_hand
    free_roots = model.jnt_bodyid[model.jnt_type == mujoco.mjtJoint.mjJNT_FREE]
    fixed = ~np.isin(model.body_rootid, free_roots) & ~with_hand & ~in_hand
    geom_body = model.geom_bodyid
    return (in_arm[geom_body], (in_arm | in_hand | fixed)[geom_body]), (in_hand[geom_body], fixed[geom_body])
