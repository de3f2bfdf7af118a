"""One solve as it was asked for, after every argument was checked."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.ik import seeds
from jacokin.ik.targets import TargetPose


class Request(NamedTuple):
    """What to reach, from where, and how hard to try."""

    target: TargetPose
    """What to reach."""
    seed: Array
    """(dof,) where the solve starts [rad], inside the limits."""
    note: str
    """What had to be done to the seed; empty for nothing."""
    rng: np.random.Generator | None
    """Randomness of the restarts; None for a fixed seed."""
    restarts: int
    """Random starts of the QP at most."""
    closest: bool
    """Whether a failure looks for the closest configuration."""

    def generator(self) -> np.random.Generator:
        """The caller's generator, or a fresh one with a fixed seed."""
        return np.random.default_rng(seeds.DEFAULT_RANDOM_SEED) if self.rng is None else self.rng

    def message(self, sentence: str) -> str:
        """A sentence and the note in one."""
        return joined(sentence, self.note) if self.note else sentence


def joined(*sentences: str) -> str:
    """The sentences that are not empty, in one."""
    return "; ".join([sentence for sentence in sentences if sentence])
