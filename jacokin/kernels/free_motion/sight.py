"""What sees whether configurations and the straight motions between them are clear: contact and sweeps."""

from __future__ import annotations

import math
from typing import NamedTuple

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import place_links
from jacokin.kernels.contact.motion import await_all, is_clear, look_at
from jacokin.kernels.contact.run import ContactNumber, ContactWork, counts_of
from jacokin.kernels.contact.shapes import LINK
from jacokin.kernels.contact.sweep import STEPS, TOUCHES_THERE, Part, Sweep, sweep_part, touch_rows
from jacokin.kernels.contact.touching import find_touching

LOOKS = 6.0  # [1/rad] places of a motion that seems clear, where it comes near to something
SWEPT = 0.3  # [rad] motions on which the joints turn less in sum are not swept
MOST_SWEPT = 8.0  # [rad] in sum, by one sweep
#: What is known of a motion that was looked at in some places.
IS_BLOCKED, SEEMS_CLEAR, IS_CERTAIN = range(3)


class Sight(NamedTuple):
    """Contact of an arm, and places on its motions."""

    contact: ContactWork
    sweep: Sweep


def is_free(sight: Sight, q: Array) -> bool:
    """Whether motions may pass a configuration (dof,); if not, the pair is left in `contact.course`."""
    contact = sight.contact
    counts = counts_of(contact)
    place_links(contact.geometry.arm, counts.dof, counts.groups, q, contact.places)
    return not is_near(contact)


def is_near(contact: ContactWork) -> bool:
    """Whether something is too near where all is placed for a motion to be certified; then the pair is left, too."""
    course, numbers = contact.course, contact.numbers
    margin = numbers[ContactNumber.MARGIN_KEPT] + numbers[ContactNumber.SLACK]
    counts = counts_of(contact)
    if find_touching(contact.geometry, counts, contact.places, contact.hits, margin, -math.inf, False):
        course.pair[0], course.pair[1] = contact.hits.pairs[0, 0], contact.hits.pairs[0, 1]
        return True
    return False


def is_blocked_midway(sight: Sight, start: Array) -> bool:
    """Whether something is too near in the middle of the motion whose step is set."""
    contact = sight.contact
    look_at(contact.geometry, counts_of(contact), contact.places, contact.course, start, 0.5)
    return is_near(contact)


def look_along(sight: Sight, start: Array, end: Array) -> int:
    """Whether a straight motion between free configurations is clear wherever it is looked at, or certainly.

    It is swept, and looked at where a sweep finds something near. Where it finds nothing, `moves_clear` is certain.
    """
    contact, longest = sight.contact, 0.0
    course, counts = contact.course, counts_of(contact)
    turned = set_step(sight, start, end)
    for j in range(counts.dof):
        longest = max(longest, abs(course.step[j]))
    if longest * LOOKS < 1.0:
        return SEEMS_CLEAR
    if is_blocked_midway(sight, start):
        return IS_BLOCKED
    margin = contact.numbers[ContactNumber.MARGIN_KEPT] + contact.numbers[ContactNumber.SLACK]
    sweeps, known = math.ceil(turned / MOST_SWEPT), IS_CERTAIN
    for k in range(sweeps):
        waiting = sweep_along(sight, start, k / sweeps, (k + 1) / sweeps, margin)
        if waiting == TOUCHES_THERE:
            return IS_BLOCKED
        for part in range(waiting):
            known = SEEMS_CLEAR
            low, high = course.waiting[part, 0], course.waiting[part, 1]
            looks = 1 + int((high - low) * longest * LOOKS)
            for i in range(looks):
                at = low + (high - low) * (i + 0.5) / looks
                look_at(contact.geometry, counts, contact.places, course, start, at)
                first, last = course.spans[part, 0], course.spans[part, 1]
                if touch_rows(contact.geometry, contact.places, contact.hits, course.near, first, last, margin):
                    course.pair[0], course.pair[1] = contact.hits.pairs[0, 0], contact.hits.pairs[0, 1]
                    return IS_BLOCKED
    return known


def moves_clear(sight: Sight, start: Array, end: Array, extra: float) -> bool:
    """Whether a straight motion is clear with so much more margin [m]; if not, the pair is left in `contact.course`.

    It is swept, and certified where a sweep finds something near.
    """
    contact = sight.contact
    geometry, course, counts = contact.geometry, contact.course, counts_of(contact)
    margin = contact.numbers[ContactNumber.MARGIN_KEPT] + extra
    margins = margin, margin + contact.numbers[ContactNumber.SLACK]
    turned, sweeps = set_step(sight, start, end), 1
    if turned > SWEPT:
        sweeps = math.ceil(turned / MOST_SWEPT)
    for k in range(sweeps):
        if turned > SWEPT:
            waiting = sweep_along(sight, start, k / sweeps, (k + 1) / sweeps, margins[1])
            if waiting == TOUCHES_THERE:
                return False
        else:
            waiting = await_all(geometry, counts, course)
        if not is_clear(geometry, counts, contact.places, contact.finder, course, start, margins, waiting):
            return False
    return True


def near_on_curve(sight: Sight, start: Array) -> tuple[float, float]:
    """Between which t something comes near on start + t step + t^2 bend, from 0 to 1, both of which are set.

    The first is not smaller than the second where nothing does, and negative where something touches.
    """
    contact, low, high = sight.contact, 1.0, 0.0
    course, turned = contact.course, 0.0
    for j in range(counts_of(contact).dof):
        turned += abs(course.step[j]) + abs(sight.sweep.bend[j])
    margin = contact.numbers[ContactNumber.MARGIN_KEPT] + contact.numbers[ContactNumber.SLACK]
    sweeps = max(1, math.ceil(turned / MOST_SWEPT))
    for k in range(sweeps):
        waiting = sweep_along(sight, start, k / sweeps, (k + 1) / sweeps, margin)
        if waiting == TOUCHES_THERE:
            return -1.0, 1.0
        for part in range(waiting):
            low, high = min(low, course.waiting[part, 0]), max(high, course.waiting[part, 1])
    return low, high


def set_step(sight: Sight, start: Array, end: Array) -> float:
    """Set the step of a straight motion; returns how far the joints turn on it in sum [rad]."""
    step, turned = sight.contact.course.step, 0.0
    for j in range(counts_of(sight.contact).dof):
        sight.sweep.bend[j] = 0.0
        step[j] = end[j] - start[j]
        turned += abs(step[j])
    return turned


def sweep_along(sight: Sight, start: Array, low: float, high: float, margin: float) -> int:
    """Sweep a part of the motion that is set, and let those parts of it wait where something comes near.

    Returns:
        How many wait; `TOUCHES_THERE` where something touches, and then the pair is left in `contact.course`.
    """
    contact, sweep = sight.contact, sight.sweep
    course, part = contact.course, Part(start, contact.course.step, sweep.bend, low, high)
    counts, hits = counts_of(contact), contact.hits
    end = sweep_part(contact.geometry, counts, contact.places, sweep, part, course.near, hits.last, margin)
    if end == TOUCHES_THERE:
        a, b = sweep.found[0], sweep.found[1]
        course.pair[0], course.pair[1] = a, b
        if contact.geometry.shapes.integers[b, LINK] > counts.dof:
            hits.last[0], hits.last[1], hits.last[2] = a, b, -1
        return TOUCHES_THERE
    size, i, gap = 0, 0, (high - low) / STEPS
    while i < STEPS:
        begin = i
        while i < STEPS and sweep.near[i] == 1:
            i += 1
        if i > begin:
            course.waiting[size, 0], course.waiting[size, 1] = low + gap * begin, low + gap * i
            course.spans[size, 0], course.spans[size, 1] = 0, end
            size += 1
        else:
            i += 1
    return size
