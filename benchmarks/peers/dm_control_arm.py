"""dm_control: `set_site_to_xpos` of its own Jaco, 10 attempts, on the wrist site, from home."""

# ruff: noqa: D101, D102, D107 - worker.py says what a Peer and its methods are
from __future__ import annotations

from importlib.metadata import version

import mujoco
import numpy as np
from dm_control.mujoco.wrapper.mjbindings import sizes


def skip_fields_gone_from_mujoco():
    """dm_control 1.0.50 lists fields that MuJoCo 4 dropped, and cannot make a Physics unless they are taken out."""
    for struct, owner in (("mjmodel", mujoco.MjModel), ("mjdata", mujoco.MjData)):
        listed = sizes.array_sizes[struct]
        for field in [name for name in listed if not hasattr(owner, name)]:
            del listed[field]


skip_fields_gone_from_mujoco()

from dm_control import mjcf  # noqa: E402 - after the fields are right
from dm_control.entities.manipulators import kinova  # noqa: E402 - as above


class Peer:
    version = f"dm_control {version('dm_control')}, mujoco {version('mujoco')}"

    def __init__(self, setup):
        self.arm = kinova.JacoArm()
        self.physics = mjcf.Physics.from_mjcf_model(self.arm.mjcf_model)
        self.joints = self.physics.bind(self.arm.joints)
        self.site = self.physics.bind(self.arm.wrist_site)
        self.home = np.array(setup["home"])
        self.random_state = np.random.RandomState(0)

    def forward(self, q):
        self.joints.qpos = q
        T = np.eye(4)
        T[:3, 3] = self.site.xpos
        T[:3, :3] = np.reshape(self.site.xmat, (3, 3))
        return T

    def prepare(self, T):
        self.joints.qpos = self.home
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, T[:3, :3].flatten())
        return T[:3, 3].copy(), quaternion

    def solve(self, target):
        position, quaternion = target
        return self.arm.set_site_to_xpos(self.physics, self.random_state, self.arm.wrist_site, position, quaternion)

    def answers(self, raw):
        return [np.array(self.joints.qpos)] if raw else []
