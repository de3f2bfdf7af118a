"""Letting some joints of a scene come to rest while all others are held still."""

from __future__ import annotations

from dataclasses import dataclass

import mujoco
import numpy as np
from numpy.typing import NDArray

from jacokin.errors import PhysicsError
from jacokin.mujoco_bridge.simulation.physics import Physics

_QPOS_SIZE = {int(mujoco.mjtJoint.mjJNT_FREE): 7, int(mujoco.mjtJoint.mjJNT_BALL): 4}  # hinges and slides have 1


@dataclass(frozen=True, slots=True)
class Settled:
    """How a settling ended.

    Attributes:
        success: whether all joints came to rest in time.
        velocity: greatest absolute velocity at the end [rad/s, m/s].
        acceleration: greatest absolute acceleration at the end [rad/s^2, m/s^2].
    """

    success: bool
    velocity: float
    acceleration: float


def settle(
    physics: Physics,
    bodies: NDArray[np.bool_],
    *,
    velocity: float,
    acceleration: float,
    shortest: float,
    longest: float,
) -> Settled:
    """Simulate until the joints of some bodies are at rest; everything else keeps its position and velocity.

    Simulated time is put back afterwards.

    Args:
        physics: the simulation.
        bodies: (nbody,) which bodies may move.
        velocity: bound of the velocities of joints at rest [rad/s, m/s].
        acceleration: bound of their accelerations [rad/s^2, m/s^2].
        shortest: least time to simulate [s].
        longest: most time to simulate [s].
    """
    model, data = physics.model, physics.data
    dofs = np.flatnonzero(bodies[model.dof_bodyid])
    if not len(dofs):
        return Settled(True, 0.0, 0.0)
    other_dofs = np.flatnonzero(~bodies[model.dof_bodyid])
    other_qpos = _qpos_rows(model, ~bodies)
    qpos, qvel, time = data.qpos[other_qpos], data.qvel[other_dofs], data.time
    fastest = strongest = np.inf
    try:
        while data.time - time < longest:
            try:
                physics.step()
            except PhysicsError:
                return Settled(False, np.inf, np.inf)
            fastest = float(np.abs(data.qvel[dofs]).max())
            strongest = float(np.abs(data.qacc[dofs]).max())
            data.qpos[other_qpos], data.qvel[other_dofs] = qpos, qvel
            if fastest < velocity and strongest < acceleration and data.time - time > shortest:
                return Settled(True, fastest, strongest)
    finally:
        data.time = time
    return Settled(False, fastest, strongest)


def _qpos_rows(model: mujoco.MjModel, bodies: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Addresses in qpos of the joints of some bodies."""
    rows = [
        np.arange(model.jnt_qposadr[joint], model.jnt_qposadr[joint] + _QPOS_SIZE.get(int(model.jnt_type[joint]), 1))
        for joint in np.flatnonzero(bodies[model.jnt_bodyid])
    ]
    return np.concatenate([np.empty(0, dtype=np.intp), *rows]).astype(np.intp)
