"""F along the parameter, from a few values of it."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import ARM_CONSTANTS, unpack_arm
from jacokin.kernels.six_joints.equations import P
from jacokin.kernels.six_joints.loop import LABELLINGS
from jacokin.kernels.solution_set.slices import OWN, SCALE, SixJoints, make_six_joints
from jacokin.kernels.solution_set.surface import (
    WELL_KNOWN,
    Surface,
    fill_at,
    fill_equations,
    fill_F,
    fill_surface,
    link_of_target,
    make_surface,
    size_of,
    square_of_null,
)


def any_arm(rng: np.random.Generator, labelling: int) -> SixJoints:
    """Six joints of no structure at a target that turns about some axis, whose F is that of a labelling."""
    six = make_six_joints()
    for placement in (*six.chain, six.T):
        quaternion = rng.normal(size=4)
        placement[:3, :3] = pin.Quaternion(quaternion / np.linalg.norm(quaternion)).toRotationMatrix()
        placement[:3, 3] = rng.normal(scale=0.3, size=3)
    axis = rng.normal(size=3)
    six.axis[:] = axis / np.linalg.norm(axis)
    six.arm[:ARM_CONSTANTS] = 0.0
    six.arm[SCALE], six.arm[OWN] = 1.0, labelling
    six.general[:] = six.arm
    return six


def numbers(F: Surface) -> Array:
    """The coefficients (18,) at hand."""
    return np.concatenate([F.cosine, F.sine])


@pytest.mark.parametrize("labelling", range(LABELLINGS))
def test_a_table_tells_F_at_every_value(labelling: int, rng: np.random.Generator) -> None:
    """As determinants do at a value that was not sampled, up to a factor, which has no sign."""
    for _ in range(3):
        six, F = any_arm(rng, labelling), make_surface()
        k = unpack_arm(six.arm)
        fill_surface(k, six, F)
        for p in rng.uniform(-np.pi, np.pi, 5):
            noise = fill_F(k, six, F, p, -1)
            if F.waves[1] == 0:
                continue
            told = numbers(F)
            fill_at(k, six, F, p, -1)
            found = numbers(F)
            factor = (told @ found) / (found @ found)
            assert factor > 0.0
            assert np.abs(told - factor * found).max() < 10.0 * noise + 1e-9 * size_of(told[:9], told[9:])


def test_F_is_well_known(rng: np.random.Generator) -> None:
    """From the table, wherever it is asked for: it is nowhere as small as what is known of it."""
    for labelling in range(LABELLINGS):
        six, F = any_arm(rng, labelling), make_surface()
        k = unpack_arm(six.arm)
        fill_surface(k, six, F)
        for p in rng.uniform(-np.pi, np.pi, 20):
            noise = fill_F(k, six, F, p, -1)
            assert F.waves[1] == 1
            assert size_of(F.cosine, F.sine) > WELL_KNOWN * noise


@pytest.mark.parametrize("labelling", [each for each in range(LABELLINGS) if link_of_target(each) == 5])
def test_minors_of_the_turned_columns_have_a_factor_in_common(labelling: int, rng: np.random.Generator) -> None:
    """They are of third degree in the target: what they are multiples of is of first degree, the factor of second."""
    six, F = any_arm(rng, labelling), make_surface()
    k, size = unpack_arm(six.arm), 32
    squares, factors = np.empty(size), np.empty(size)
    for n in range(size):
        fill_equations(k, six, F, 2.0 * np.pi * n / size, labelling)
        columns = F.equations.right[:, P : P + 12].reshape(3, 4, 3)
        turned = columns[..., 0] + 1j * columns[..., 1]
        squares[n] = square_of_null(F.equations)
        factors[n] = np.linalg.det(turned @ turned.conj().T).real / squares[n]
    for values, degree in ((squares, 2), (factors, 4)):
        waves = np.abs(np.fft.rfft(values))
        assert waves[degree + 1 :].max() < 1e-11 * waves[0]
        assert waves[degree] > 1e-9 * waves[0]
