"""What an observation looks like: shape, type and bounds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, DTypeLike

from jacokin.errors import InvalidInputError
from jacokin.model import checks


@dataclass(frozen=True, slots=True, eq=False)
class ArraySpec:
    """Shape, type and bounds of an array.

    Attributes:
        shape: of the array.
        dtype: type of its numbers.
        minimum: inclusive lower bound, a number or an array that broadcasts to the shape; None for no bound.
        maximum: inclusive upper bound, likewise.
        name: of the observation.
    """

    shape: tuple[int, ...]
    dtype: np.dtype[np.generic]
    minimum: ArrayLike | None
    maximum: ArrayLike | None
    name: str

    def __init__(
        self,
        shape: tuple[int, ...],
        dtype: DTypeLike = np.float64,
        *,
        minimum: ArrayLike | None = None,
        maximum: ArrayLike | None = None,
        name: str = "",
    ) -> None:
        """Describe an array.

        Raises:
            InvalidInputError: not a shape or a type of numbers.
        """
        try:
            sizes, kind = tuple(checks.whole_number("shape", size) for size in shape), np.dtype(dtype)
        except (TypeError, ValueError) as error:
            raise InvalidInputError(f"shape must be whole numbers and dtype a NumPy type: {error}") from None
        for field, value in zip(self.__slots__, (sizes, kind, minimum, maximum, name), strict=True):
            object.__setattr__(self, field, value)

    @property
    def is_bounded(self) -> bool:
        """Whether there is a lower or an upper bound."""
        return self.minimum is not None or self.maximum is not None
