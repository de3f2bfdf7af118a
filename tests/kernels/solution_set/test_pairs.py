"""The other angles of complex solutions, against the roots of F in the labellings in which those are solved for."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from jacokin.arrays import Array
from jacokin.kernels.six_joints.characteristic import fourier_of_determinant, make_determinant
from jacokin.kernels.six_joints.equations import Equations, make_equations, write_equations
from jacokin.kernels.six_joints.loop import fill_links
from jacokin.kernels.solution_set.pairs import make_pair_work, other_angles_apart


def roots_of(chain: Array, T: Array, labelling: int) -> tuple[NDArray[np.complex128], Equations]:
    """All sixteen exp(i theta_3) in a labelling, and its equations."""
    e, cosine, sine = make_equations(), np.zeros(9), np.zeros(9)
    fill_links(chain, T, 1.0, labelling, e.links)
    write_equations(e)
    fourier_of_determinant(e, make_determinant(), cosine, sine)
    half = 0.5 * (cosine[1:] + 1j * sine[1:])  # of z^-n
    return np.roots(np.concatenate([half.conj()[::-1], [cosine[0]], half])).astype(np.complex128), e


@pytest.mark.one_quick
@pytest.mark.parametrize("seed", range(20))
def test_other_angles_are_the_roots_of_their_own_functions(seed: int) -> None:
    """Theta_4 and theta_5 are the next two theta_3, and as far from the real axis there, one by one."""
    rng = np.random.default_rng(seed)
    chain, T = np.zeros((7, 3, 4)), np.eye(4)
    chain[:, :, :3], chain[:, :, 3] = Rotation.random(7, rng).as_matrix(), rng.normal(scale=0.4, size=(7, 3))
    T[:3, :3], T[:3, 3] = Rotation.random(1, rng).as_matrix()[0], rng.normal(scale=0.4, size=3)
    roots, e = roots_of(chain, T, 0)
    found = np.sort([other_angles_apart(e, complex(z), make_pair_work()) for z in roots], axis=0)
    for column, labelling in enumerate((1, 2)):
        expected = np.sort(np.abs(np.log(np.abs(roots_of(chain, T, labelling)[0]))))
        assert found[:, column] == pytest.approx(expected, rel=1e-3, abs=1e-3)
