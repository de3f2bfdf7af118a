"""Kernels in plain Python, in place of `library.Call`: the reference, and what a test can look into."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic

import numpy as np

from jacokin.kernels.library import Work


class PlainCall(Generic[Work]):
    """As `Call`, a thousand times slower."""

    def __init__(self, kernel: Callable[[Work], int], work: Work) -> None:
        self.work = work
        self._kernel = kernel

    def __call__(self) -> int:
        with np.errstate(all="ignore"):  # as silent as machine code: squares of large distances are infinite
            return self._kernel(self.work)
