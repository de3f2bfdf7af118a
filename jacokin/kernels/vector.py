"""Vectors of three floats as tuples: what the kernels compute with, compiled by numba or run as plain Python."""

from __future__ import annotations

import math

Vec = tuple[float, float, float]


def dot(a: Vec, b: Vec) -> float:
    """Scalar product."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec, b: Vec) -> Vec:
    """Vector product."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def minus(a: Vec, b: Vec) -> Vec:
    """Difference."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def mix(a: Vec, u: float, b: Vec, v: float, c: Vec, w: float) -> Vec:
    """Linear combination u a + v b + w c."""
    return (
        u * a[0] + v * b[0] + w * c[0],
        u * a[1] + v * b[1] + w * c[1],
        u * a[2] + v * b[2] + w * c[2],
    )


def norm(a: Vec) -> float:
    """Length."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])


def rotated(a: Vec, axis: Vec, sine: float, cosine: float) -> Vec:
    """A vector after a rotation about a unit axis."""
    return mix(a, cosine, cross(axis, a), sine, axis, (1.0 - cosine) * dot(axis, a))
