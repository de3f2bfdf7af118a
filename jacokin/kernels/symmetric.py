"""Symmetric matrices of few rows, in flat arrays: eigenvalues by Jacobi's method, and Cholesky's."""

from __future__ import annotations

import math

from jacokin.arrays import Array

#: Sweeps of Jacobi's method; it converges quadratically.
SWEEPS = 12
#: Part of the mean of the diagonal: with every pivot above it, there is no negative eigenvalue.
LEAST_PIVOT = 1e-9


def diagonalise(a: Array, vectors: Array, size: int, precision: float) -> None:
    """Leave the eigenvalues of a symmetric matrix on its diagonal, and its eigenvectors in the columns (Jacobi).

    Args:
        a: (size size,) the matrix.
        vectors: (size size,) filled.
        size: how many rows it has.
        precision: what is left beside the diagonal, squared and relative, that ends it.
    """
    for i in range(size):
        for j in range(size):
            vectors[i * size + j] = 1.0 if i == j else 0.0
    for _ in range(SWEEPS):
        total, beside = 0.0, 0.0
        for i in range(size):
            for j in range(size):
                total += a[i * size + j] * a[i * size + j]
                if i != j:
                    beside += a[i * size + j] * a[i * size + j]
        if beside <= precision * total:
            return
        for p in range(size):
            for q in range(p + 1, size):
                if a[p * size + q] != 0.0:
                    rotate(a, vectors, p, q, size)


def rotate(a: Array, vectors: Array, p: int, q: int, size: int) -> None:
    """One rotation of Jacobi's method, which makes entry (p, q) vanish."""
    theta = 0.5 * (a[q * size + q] - a[p * size + p]) / a[p * size + q]
    t = math.copysign(1.0, theta) / (abs(theta) + math.sqrt(theta * theta + 1.0))
    c = 1.0 / math.sqrt(t * t + 1.0)
    s = t * c
    for k in range(size):
        x, y = a[k * size + p], a[k * size + q]
        a[k * size + p], a[k * size + q] = c * x - s * y, s * x + c * y
    for k in range(size):
        x, y = a[p * size + k], a[q * size + k]
        a[p * size + k], a[q * size + k] = c * x - s * y, s * x + c * y
    for k in range(size):
        x, y = vectors[k * size + p], vectors[k * size + q]
        vectors[k * size + p], vectors[k * size + q] = c * x - s * y, s * x + c * y


def factorise(a: Array, factor: Array, size: int, added: float, least: float) -> bool:
    """Fill the lower triangle L of L L^T = A + added I; whether every pivot is above the least.

    Args:
        a: (size size,) the matrix.
        factor: (size size,) filled up to the first pivot that is too small.
        size: how many rows it has.
        added: to the diagonal.
        least: pivot.
    """
    for i in range(size):
        for j in range(i + 1):
            product = a[i * size + j] + (added if i == j else 0.0)
            for k in range(j):
                product -= factor[i * size + k] * factor[j * size + k]
            if i > j:
                factor[i * size + j] = product / factor[j * size + j]
            elif product > least:
                factor[i * size + i] = math.sqrt(product)
            else:
                return False
    return True


def is_positive(a: Array, factor: Array, size: int) -> bool:
    """Whether a matrix (size size,) has positive eigenvalues only; fills the factor (size size,) of one that has."""
    least = 0.0
    for i in range(size):
        least += LEAST_PIVOT * abs(a[i * size + i]) / size
    return factorise(a, factor, size, 0.0, least)


def solve_factorised(factor: Array, x: Array, size: int) -> None:
    """Solve L L^T x = b in place, where x (size,) holds b."""
    for i in range(size):
        value = x[i]
        for k in range(i):
            value -= factor[i * size + k] * x[k]
        x[i] = value / factor[i * size + i]
    for i in range(size - 1, -1, -1):
        value = x[i]
        for k in range(i + 1, size):
            value -= factor[k * size + i] * x[k]
        x[i] = value / factor[i * size + i]
