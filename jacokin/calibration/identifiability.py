"""What measurements can tell apart, and what they cannot, in words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jacokin.arrays import Array
from jacokin.calibration.arm_model import Parameter
from jacokin.model import checks

IDENTIFIED = 1e-10  # of the largest singular value of the scaled Jacobian: rounding leaves 1e-15, real ones have 1e-5
NAMED = 4  # parameters of a combination that a sentence names
SMALL = 0.02  # of the largest part of a combination: smaller parts are not named
USUAL = 1e-2  # [m], [rad] that numbers are off at most: what a user places has a wider prior, to be free


@dataclass(frozen=True, slots=True, eq=False)
class Identifiability:
    """Which combinations of the numbers show in some measurements; arrays are read-only."""

    singular_values: Array
    """(p,) of the Jacobian, rows over their noise and columns times the prior: above 1, data know more than it."""
    rank: int
    """How many combinations show at all."""
    known: Array
    """(rank, p) those combinations, in parameters over their priors; orthonormal rows."""
    unidentified: tuple[str, ...]
    """A sentence for each of the others."""


def identify(jacobian: Array, prior: Array, parameters: Sequence[Parameter]) -> Identifiability:
    """Judge a Jacobian.

    Args:
        jacobian: (m, p) rows over their noise.
        prior: (p,) standard deviations.
        parameters: the p numbers.
    """
    count = len(prior)
    scaled = np.vstack([jacobian * prior, np.zeros((max(count - len(jacobian), 0), count))])
    _, values, rows = np.linalg.svd(scaled, full_matrices=False)
    rank = int(np.sum(values > IDENTIFIED * values[0])) if values[0] > 0.0 else 0
    usual = prior / np.minimum(prior, USUAL)
    sentences = tuple(_sentence(row * usual, parameters) for row in _sparse(rows[rank:]))
    return Identifiability(checks.read_only(values), rank, checks.read_only(rows[:rank]), sentences)


def _sparse(basis: Array) -> Array:
    """Rows that span the same and have few parts: elimination with the largest part of each as pivot."""
    rows = basis.copy()
    for k in range(len(rows)):
        at = int(np.argmax(np.abs(rows[k:]).max(axis=1))) + k
        rows[[k, at]] = rows[[at, k]]
        pivot = int(np.argmax(np.abs(rows[k])))
        rows[k] /= rows[k, pivot]
        others = np.arange(len(rows)) != k
        rows[others] -= np.outer(rows[others, pivot], rows[k])
    return rows


def _sentence(row: Array, parameters: Sequence[Parameter]) -> str:
    """What one combination says in words."""
    size = np.abs(row)
    parts = [int(k) for k in np.argsort(-size, kind="stable") if size[k] > SMALL * size.max()]
    named = [parameters[k].words for k in parts[:NAMED]]
    if len(parts) > NAMED:
        named.append(f"{len(parts) - NAMED} more")
    if len(named) == 1:
        return f"{named[0]} does not show in the measurements"
    return f"{', '.join(named[:-1])} and {named[-1]} cannot be told apart"
