"""Whether anything touches while controllers go from row to row of a motion.

Between two rows an acceleration a leaves the straight line by at most a dt^2 / 8, and the spline leaves its control
points by a dt^2 / 6. Where all of that is less than the slack that certified motions keep free, there is nothing to
look at. Elsewhere some steps are certified by one chord, which they leave by at most the square of their number times
as much; one by one where that is near something.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.run import NOTHING, ContactNumber, ContactWork, make_contact_work, stays_clear
from jacokin.kernels.contact.touching import Geometry
from jacokin.kernels.motion_rows import BetweenWork, look_between, make_between_work

AT_ONCE = 4  # steps by one chord
NONE = -1


class CheckWork(NamedTuple):
    """What a call reads and writes; one set for each thread."""

    between: BetweenWork
    contact: ContactWork
    beyond: NDArray[np.int64]  # (1,) filled in: how many steps could pass a limit


def make_check_work(geometry: Geometry = NOTHING, rows: int = 0) -> CheckWork:
    """Fresh work arrays for a geometry and so many rows."""
    dof = len(geometry.arm.joint_kinds)
    return CheckWork(make_between_work(dof, rows), make_contact_work(geometry, 1 if dof else 0), np.zeros(1, np.int64))


def check_between(work: CheckWork) -> int:
    """The first step on which something could touch that does not at its rows, or `NONE`; and what `look_between` does.

    The pair is left in `contact.course`. What is near at a row itself is being left, or landed at: that was looked at
    closely.
    """
    between, contact = work.between, work.contact
    work.beyond[0] = look_between(between)
    dof, last, reach, q = between.counts[0], between.counts[1] - 1, between.reach, between.q
    step, near, slack = 0, 0, contact.numbers[ContactNumber.SLACK]  # one by one until `near`
    while step < last:
        if 3.0 * reach[step] <= slack:
            step += 1
            continue
        end, most = step + 1 if step < near else min(step + AT_ONCE, last), 0.0
        for k in range(step, end):
            most = max(most, reach[k])
        extra = most if end == step + 1 else most * ((end - step) ** 2 + 1)
        first, then = q[step * dof : (step + 1) * dof], q[end * dof : (end + 1) * dof]
        if stays_clear(contact, first, then, extra):
            step = end
        elif end > step + 1:
            near = end
        elif rests_clear(contact, first) and rests_clear(contact, then):
            return step
        else:
            step = end
    return NONE


def rests_clear(contact: ContactWork, q: Array) -> bool:
    """Whether nothing is near at a configuration (dof,)."""
    return stays_clear(contact, q, q, 0.0)
