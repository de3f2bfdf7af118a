"""The closed loop and the equations, as plain Python, at configurations that are known."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest

from jacokin.arrays import Array
from jacokin.kernels.closed_form.roots import make_roots
from jacokin.kernels.six_joints.characteristic import determinant, fourier_of_determinant, make_determinant
from jacokin.kernels.six_joints.equations import Equations, make_equations, write_equations
from jacokin.kernels.six_joints.loop import LABELLINGS, fill_links, joint_of
from jacokin.kernels.six_joints.roots import find_six_roots, make_six_roots
from tests.kernels.six_joints.arms import chain_of_arm, poses_and_jacobians


def at(name: str, q: Array, labelling: int) -> Equations:
    """The equations of the pose at q in a labelling."""
    chain = chain_of_arm(name)
    e = make_equations()
    fill_links(chain, poses_and_jacobians(chain, q[None])[0][0], 1.0, labelling, e.links)
    write_equations(e)
    return e


@pytest.mark.parametrize("labelling", range(LABELLINGS))
def test_the_loop_closes_however_it_is_numbered(labelling: int, rng: np.random.Generator) -> None:
    q = rng.uniform(-np.pi, np.pi, 6)
    e = at("generic", q, labelling)
    loop = pin.SE3.Identity()
    for i in range(6):
        turn = pin.SE3(pin.exp3(np.array([0.0, 0.0, q[joint_of(labelling, i)]])), np.zeros(3))
        loop = loop * turn * pin.SE3(e.links[i, :, :3], e.links[i, :, 3])
    np.testing.assert_allclose(loop.homogeneous, np.eye(4), atol=1e-14)
    assert sorted(joint_of(labelling, i) for i in range(6)) == list(range(6))


@pytest.mark.parametrize("labelling", range(LABELLINGS))
def test_the_six_equations_hold_at_the_configuration(labelling: int, rng: np.random.Generator) -> None:
    q = rng.uniform(-np.pi, np.pi, 6)
    e = at("generic", q, labelling)
    theta_3, theta_4, theta_5 = (q[joint_of(labelling, i)] for i in (2, 3, 4))
    matrix = math.cos(theta_3) * e.parts[0] + math.sin(theta_3) * e.parts[1] + e.parts[2]
    forms = [
        np.array([math.cos(0.5 * t) ** 2, math.cos(0.5 * t) * math.sin(0.5 * t), math.sin(0.5 * t) ** 2])
        for t in (theta_4, theta_5)
    ]
    np.testing.assert_allclose(matrix @ np.outer(*forms).ravel(), 0.0, atol=1e-14)
    assert np.linalg.norm(matrix) > 0.1


def test_the_determinant_is_that_of_the_twelve_equations_and_of_degree_eight(rng: np.random.Generator) -> None:
    q = rng.uniform(-np.pi, np.pi, 6)
    e = at("xarm6", q, 11)
    work, roots = make_determinant(), make_roots()
    ratios = []
    for theta in rng.uniform(-np.pi, np.pi, 5):
        six = math.cos(theta) * e.parts[0] + math.sin(theta) * e.parts[1] + e.parts[2]
        twelve = np.zeros((12, 12))
        twelve[:6, :9], twelve[6:, 3:] = six, six
        ratios.append(determinant(e, math.cos(theta), math.sin(theta), work) / np.linalg.det(twelve))
    np.testing.assert_allclose(np.abs(ratios), 1.0, rtol=1e-9)
    assert np.ptp(ratios) < 1e-9
    noise, _ = fourier_of_determinant(e, work, roots.cosine, roots.sine)
    theta = 0.7
    k = np.arange(9)
    value = roots.cosine @ np.cos(k * theta) + roots.sine @ np.sin(k * theta)
    assert abs(value - determinant(e, math.cos(theta), math.sin(theta), work)) < noise
    assert noise < 1e-12 * np.abs(roots.cosine).max()


def test_two_roots_about_a_place_where_F_nearly_touches_zero() -> None:
    """Between them F is as small as its noise, and their distance from its extremum more than the noise tells."""
    q = np.array([1.20194446, 2.092521107, -0.895600544, 2.795363446, 1.963163031, 3.012826597])
    e, work = at("crx", q, 5), make_six_roots()
    assert find_six_roots(e, work) == 8
    roots, widths = np.sort(work.found[:8, 0]), work.found[:8, 1]
    assert (widths >= 0.0).all()
    for root in roots:
        values = [determinant(e, math.cos(root + d), math.sin(root + d), work.determinant) for d in (-1e-6, 1e-6)]
        assert values[0] * values[1] < 0.0
    assert np.diff(roots).min() > 1e-3
