"""Eigenvalues and Cholesky's method of the kernels, against NumPy's."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin.kernels.symmetric import diagonalise, factorise, solve_factorised


@pytest.mark.parametrize("size", [1, 2, 6, 8])
def test_eigenvectors_diagonalise(size: int, rng: np.random.Generator) -> None:
    for scale in (1.0, 1e-8):
        matrix = scale * rng.normal(size=(size, size))
        matrix += matrix.T
        values, vectors = matrix.ravel().copy(), np.zeros(size * size)
        with np.errstate(over="ignore"):  # of an angle that is none
            diagonalise(values, vectors, size, 1e-32)
        found, V = np.diag(values.reshape(size, size)), vectors.reshape(size, size)
        np.testing.assert_allclose(V.T @ V, np.eye(size), atol=1e-14)
        np.testing.assert_allclose((V * found) @ V.T, matrix, atol=1e-14 * scale * size)
        np.testing.assert_allclose(np.sort(found), np.linalg.eigvalsh(matrix), atol=1e-14 * scale * size)


def test_equations_are_solved_and_matrices_that_are_not_positive_are_refused(rng: np.random.Generator) -> None:
    rows, factor = rng.normal(size=(4, 6)), np.zeros(36)
    matrix = rows.T @ rows  # of rank 4
    assert not factorise(matrix.ravel(), factor, 6, 0.0, 1e-9)
    assert factorise(matrix.ravel(), factor, 6, 1e-3, 0.0)
    x = rng.normal(size=6)
    wanted = np.linalg.solve(matrix + 1e-3 * np.eye(6), x)
    solve_factorised(factor, x, 6)
    np.testing.assert_allclose(x, wanted, rtol=1e-9)
