"""What tasks read of a simulation, or of many at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.mujoco_bridge import Physics

Elements = Any  # an element of a spec or a list of them, whose classes mypy does not know
Rows = slice | NDArray[np.intp]


class HasFields(Protocol):
    """MuJoCo's data, of which a view shows some."""

    qpos: Array
    qvel: Array
    site_xpos: Array
    site_xmat: Array
    sensordata: Array
    mocap_pos: Array
    qfrc_bias: Array
    qfrc_passive: Array


@dataclass(frozen=True, slots=True, eq=False)
class View:
    """Live arrays of one simulation; of n simulations each has one more axis, (n, ...), in front.

    Attributes:
        qpos: (nq,) positions of the joints.
        qvel: (nv,) velocities of the joints.
        site_xpos: (nsite, 3) positions of the sites [m].
        site_xmat: (nsite, 9) their rotation matrices.
        sensordata: (nsensordata,) readings of the sensors.
        mocap_pos: (nmocap, 3) positions of the mocap bodies [m].
        qfrc_bias: (nv,) forces of gravity and motion.
        qfrc_passive: (nv,) forces of springs and dampers.
    """

    qpos: Array
    qvel: Array
    site_xpos: Array
    site_xmat: Array
    sensordata: Array
    mocap_pos: Array
    qfrc_bias: Array
    qfrc_passive: Array

    @classmethod
    def of(cls, data: HasFields) -> View:
        """The view of one simulation, or of those of a batch, whose matrices have two axes."""
        site_xmat = data.site_xmat.reshape(*data.site_xpos.shape[:-1], 9)
        return cls(*(site_xmat if name == "site_xmat" else getattr(data, name) for name in cls.__slots__))

    def row(self, index: int) -> View:
        """The view of one of n simulations."""
        return View(*(getattr(self, name)[index] for name in self.__slots__))


def rows(indices: NDArray[np.intp]) -> Rows:
    """The same indices as a slice if they are consecutive, which reads faster."""
    first = int(indices[0])
    consecutive = np.array_equal(indices, np.arange(first, first + len(indices)))
    return slice(first, first + len(indices)) if consecutive else indices


def ids(physics: Physics, elements: Elements) -> NDArray[np.intp]:
    """The numbers of elements of a scene, (k,)."""
    return np.array(physics.bind(elements).element_ids, dtype=np.intp)


def length(vectors: Array) -> Array:
    """Lengths (...) of vectors (..., 3)."""
    return np.asarray(np.sqrt(np.vecdot(vectors, vectors)))


def picked(array: Array, indices: NDArray[np.intp]) -> Array:
    """Rows of (..., m, 3) by indices (..., k): the same for every simulation, or different ones."""
    if array.ndim == 2 or indices.ndim == 1:
        return np.asarray(array[..., indices, :])
    return np.take_along_axis(array, indices[..., None], axis=-2)
