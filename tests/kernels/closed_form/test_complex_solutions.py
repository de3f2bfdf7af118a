"""Joint 5 of complex solutions, against the roots that both its conditions have in common."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from jacokin import Robot
from jacokin.arrays import Array
from jacokin.ik.geometry import measure
from jacokin.kernels.closed_form.arm import ArmConstants, Pose, pose_of, unpack_arm
from jacokin.kernels.closed_form.resultant import fourier_of_F, q5_apart

Complex = NDArray[np.complex128]


def vectors_at(parts: tuple[tuple[float, ...], ...], z: complex) -> Complex:
    """A vector that is linear in cosine and sine of joint 6, where z = exp(i q6)."""
    constant, cosine, sine = (np.array(part) for part in parts)
    return np.asarray(constant + 0.5 * (z + 1.0 / z) * cosine - 0.5j * (z - 1.0 / z) * sine)


def conditions_at(k: ArmConstants, pose: Pose, z: complex, zeta: complex) -> tuple[complex, complex]:
    """By how much axis 4 misses the sphere, and axis 3 its distance, where zeta = exp(i q5)."""
    D, m = vectors_at((pose.D0, pose.Dc, pose.Ds), z), vectors_at((pose.m0, pose.mc, pose.ms), z)
    axis_4 = np.array([0.5 * k.sin_a * (zeta + 1.0 / zeta), 0.5j * k.sin_a * (zeta - 1.0 / zeta), k.cos_a])
    normal, C = np.cross(m, axis_4), D + k.c4 * axis_4
    return complex(C @ C - k.R2), complex((normal @ D) ** 2 - k.e3**2 * (normal @ normal))


def joint_5_at(k: ArmConstants, pose: Pose, z: complex, condition: int) -> Complex:
    """All zeta for which one condition, a polynomial upwards and downwards, of degree 1 or 2, is zero."""
    degree = condition + 1
    points = np.exp(2j * np.pi * np.arange(2 * degree + 1) / (2 * degree + 1))
    values = [zeta**degree * conditions_at(k, pose, z, zeta)[condition] for zeta in points]
    return np.roots(np.linalg.solve(np.vander(points), values)).astype(np.complex128)


def all_roots(cosine: Array, sine: Array) -> Complex:
    """All sixteen exp(i q6)."""
    half = 0.5 * (cosine[1:] + 1j * sine[1:])
    return np.roots(np.concatenate([half.conj()[::-1], [cosine[0]], half])).astype(np.complex128)


@pytest.mark.parametrize("name", ["j2n6s300", "gen3_lite", "gen3_6dof"])
def test_joint_5_is_where_both_conditions_hold(
    name: str, bundled: Callable[[str], Robot], rng: np.random.Generator
) -> None:
    robot = bundled(name)
    arm = measure(robot.pin_model, robot.frame_id(None)).arm
    k, cosine, sine = unpack_arm(arm), np.zeros(9), np.zeros(9)
    seen = 0
    for q in robot.sample(rng, 10):
        pose = pose_of(arm, k, np.ascontiguousarray(robot.forward_kinematics(q).homogeneous))
        assert q5_apart(k, pose, complex(np.exp(1j * q[5]))) < 1e-6
        fourier_of_F(k, pose, cosine, sine, np.zeros((2, 16)))
        for z in map(complex, all_roots(cosine, sine)):
            sphere, axis_3 = joint_5_at(k, pose, z, 0), joint_5_at(k, pose, z, 1)
            away = np.abs(np.log(sphere[:, None] / axis_3))
            if away.min() > 1e-4:  # a root that others are too near to
                continue
            seen += 1
            common = sphere[away.min(axis=1).argmin()]
            assert q5_apart(k, pose, z) == pytest.approx(abs(np.log(abs(common))), rel=1e-2, abs=1e-3)
    assert seen > 80
