"""The type of arrays inside the package, and dataclasses that keep theirs read-only."""

from __future__ import annotations

from dataclasses import fields
from types import MappingProxyType
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]


class Sealed:
    """A frozen dataclass whose arrays and mappings stay read-only when it is copied or pickled.

    NumPy makes arrays anew then, which can be written to.
    """

    __slots__ = ()

    def __reduce__(self) -> tuple[object, tuple[object, ...]]:
        """Rebuild from the fields; `pickle` takes no read-only mapping."""
        values = (getattr(self, each.name) for each in fields(self))  # type: ignore[arg-type]  # every subclass is a dataclass
        return rebuilt, (type(self), *(dict(each) if isinstance(each, MappingProxyType) else each for each in values))


def rebuilt(kind: type, *values: object) -> object:
    """An object of a frozen dataclass with these fields, which were checked before."""
    made: object = object.__new__(kind)
    for each, value in zip(fields(kind), values, strict=True):
        seal(value)
        object.__setattr__(made, each.name, MappingProxyType(value) if isinstance(value, dict) else value)
    return made


def seal(value: object) -> None:
    """Make an array, or the arrays of a tuple, read-only."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif type(value) is tuple:
        for each in value:
            seal(each)
