"""Calls of the kernel of contact."""

from __future__ import annotations

from typing import Any

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.contact.run import ContactInteger, ContactTask, make_contact_work, run_contact
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.library import Call


def least_distances(geometry: Geometry, q: Array, form: Any = Call) -> Any:
    """A call that has found the least distance at each configuration (n, dof): `work.value[:, 0]` [m]."""
    call = form(run_contact, make_contact_work(geometry, len(q)))
    call.work.q[:] = q.ravel()
    call.work.integers[ContactInteger.TASK] = ContactTask.LEAST_DISTANCE
    call.work.integers[ContactInteger.ROWS] = len(q)
    call()
    return call


def measured_pairs(geometry: Geometry, pairs: Array, rows: Array) -> Array:
    """Distance [m], two nearest points and normal (n, pairs, 10) of pairs at each configuration (n, dof)."""
    call, found = Call(run_contact, make_contact_work(geometry, 1, len(pairs))), []
    call.work.given[:], call.work.reach[:] = pairs, np.inf
    call.work.integers[ContactInteger.TASK] = ContactTask.MEASURE_PAIRS
    call.work.integers[ContactInteger.ROWS] = len(pairs)
    for q in rows:
        call.work.q[:] = q
        call()
        found.append(call.work.measured.copy())
    return np.array(found)
