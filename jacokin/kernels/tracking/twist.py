"""A tick along a twist: in its direction, never faster than asked, and slower where the joints cannot follow.

The tool moves along the twist with a part s of its speed, the largest from 0 to 1 with which every joint keeps its
velocity, can still stop before its limit and before what is near, and the joints' path bends no more than acceleration
limits allow. Towards a singular pose, where a joint would have to turn ever faster, s goes to zero: the arm slows down
and stops there. Where a new twist asks for another velocity, the old twist goes over into it in a straight line, as
fast as the joints may accelerate.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.contact.arm import HINGE
from jacokin.kernels.tracking.inverse import (
    EXACT,
    SIX,
    Inverse,
    damping_leaving,
    decompose,
    fill_bend,
    make_inverse,
    multiply,
    part_left,
    smooth_damping,
    solve_damped,
)
from jacokin.kernels.tracking.limits import CHANGE, EASY, STEP, TINY, braking_speed
from jacokin.kernels.tracking.reach import ReachWork
from jacokin.kernels.tracking.tasks import LINK, axis_of, fill_columns, origin_of, place_joints
from jacokin.kernels.tracking.tick import TIME_STEP, TickWork
from jacokin.kernels.tracking.watch import watch
from jacokin.kernels.vector import Vec, cross, minus, mix

#: Part of the twist that may be given away where the joints could not follow it otherwise.
ASIDE = 0.01
#: Halvings of the range of damping in which no more is given away than needed.
HALVINGS = 5
#: Steps to how far the damping may be from the one before.
DAMPING_TURNS = 12
#: Part of the acceleration limits with which more of a twist is followed again, or another part of it given away.
GENTLE = 0.25
#: Part of its way in a tick by which the joints' path may bend towards a singular pose.
BENT = 0.1
#: A smaller part of a twist towards a singular pose is none, as joints would turn fast for next to nothing; up to twice
#: as much fades to that.
CREEPING = 5e-2
#: Part of the acceleration limits that the bend of the joints' path may use.
BENDING = 0.5
#: Damping, and part of the tick's room, with which the tool is brought back to the line.
SETTLING, SETTLED = 1e-5, 0.5
#: Damping that tells motions which move the tool from those that hardly do.
IDLE = 1e-6
#: Part of a twist by which the tool may be faster than asked, to make up for what a tick left undone.
HURRY = 5e-3
#: What holds the arm back: nothing, a joint's velocity, its upper or lower limit, what is near, a singular pose, a
#: joint's acceleration.
NOTHING, VELOCITY, UPPER_LIMIT, LOWER_LIMIT, NEARNESS, SINGULARITY, GENTLENESS = range(7)


class TwistWork(NamedTuple):
    """What a tick along a twist reads and writes."""

    weights: Array  # (6,) of what the tool moves and turns by, against each other [1/m, 1/rad]
    twist: Array  # (6,) that is asked for, at the tool in base axes [m/s, rad/s]
    line: Array  # (6,) that was followed over the last tick
    off: Array  # (6,) from the tool to where it was to be [m, rad]
    aside: Array  # (dof,) displacement that joints are to make as well, which does not move the tool [rad]
    damping: Array  # (1,) with which the tick before gave some of its twist away, 0 for none; filled
    cause: NDArray[np.int64]  # (2,) filled: what holds the arm back, and which joint of it
    part: Array  # (1,) of the twist that was followed in it, 0 for none; filled with what can be followed
    followed: Array  # (6,) filled: the twist over this tick
    late: Array  # (6,) filled: how far the tool is behind its line, and stays [m, rad]
    wanted: Array  # (6,) filled: what is asked for in this tick, weighted
    inverse: Inverse  # of the tool's weighted Jacobian
    turn: Array  # (6 dof,) to work in, as all that follow
    found: Array  # (dof,)
    tried: Array  # (dof,)
    bend: Array  # (dof,)
    start: Array  # (dof,)
    settling: Array  # (dof,)
    planned: Array  # (dof,)
    idle: Array  # (dof,)
    known: Array  # (dof,)


def make_twist_work(dof: int = 0) -> TwistWork:
    """Fresh arrays for so many joints."""
    return TwistWork(
        np.zeros(SIX),
        np.zeros(SIX),
        np.zeros(SIX),
        np.zeros(SIX),
        np.zeros(dof),
        np.zeros(1),
        np.zeros(2, np.int64),
        np.zeros(1),
        np.zeros(SIX),
        np.zeros(SIX),
        np.zeros(SIX),
        make_inverse(dof),
        np.zeros(SIX * dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
        np.zeros(dof),
    )


def follow_twist(tick: TickWork, reach: ReachWork, work: TwistWork) -> None:
    """Fill the displacement of a tick whose bounds and inequalities are there; its one task is for the tool's pose."""
    dof, dt, inverse, limits = len(tick.q), tick.numbers[TIME_STEP], work.inverse, tick.limits
    rest, start, settling, planned = inverse.rest, work.start, work.settling, work.planned
    place_joints(tick.arm, tick.q)
    fill_columns(tick.arm, tick.tasks.integers[0, LINK], tool_of(tick), tick.columns)
    along, square = 0.0, 0.0
    for i in range(SIX):
        for j in range(dof):
            inverse.jacobian[i * dof + j] = work.weights[i] * tick.columns[j, i]
        work.wanted[i] = work.weights[i] * work.twist[i] * dt
        along += work.weights[i] * work.off[i] * work.wanted[i]
        square += work.wanted[i] * work.wanted[i]
    decompose(inverse)
    # What is missing along the twist is not made up for: that would be faster than asked.
    size = max(math.sqrt(square), TINY)
    behind = max(along / size - HURRY * size, 0.0) / size
    for i in range(SIX):
        work.late[i] = behind * work.wanted[i] / work.weights[i]
        rest[i] = work.weights[i] * (work.off[i] - work.late[i])
    solve_damped(inverse, rest, SETTLING, settling)
    settled = 1.0
    for j in range(dof):
        settled = min(settled, limits[j, STEP] / max(abs(settling[j]), TINY))
    for i in range(SIX):
        rest[i] = work.weights[i] * work.line[i] * dt
    solve_damped(inverse, rest, min(smooth_damping(inverse), max(work.damping[0], EXACT)), start)
    find_fastest(tick, reach, work, size)
    for j in range(dof):
        settling[j] *= SETTLED * settled
        planned[j] = work.part[0] * work.found[j] - start[j]
        start[j] += settling[j] + work.aside[j]
    low, high = tick.bounds[:dof], tick.bounds[dof:]
    share, slowed = largest_share(start, planned, low, high), 1.0
    for j in range(dof):
        planned[j] = start[j] + share * planned[j]
        slowed = min(slowed, limits[j, CHANGE] / max(abs(tick.v[j] * dt), TINY))
    # What joints cannot accelerate to would turn the tool aside: then all of them brake together.
    for j in range(dof):
        start[j] = tick.v[j] * dt * (1.0 - slowed)
        planned[j] -= start[j]
    share = largest_share(start, planned, low, high)
    for j in range(dof):
        tick.step[j] = min(max(start[j] + share * planned[j], low[j]), high[j])
        planned[j] = tick.step[j] - share * settling[j]
    multiply(inverse.jacobian, planned, work.followed)
    for i in range(SIX):
        work.followed[i] /= work.weights[i] * dt


def tool_of(tick: TickWork) -> Vec:
    """Where the tool is [m]."""
    return origin_of(tick.arm.frames, tick.tasks.integers[0, LINK], tick.tasks.numbers[0])


def largest_share(start: Array, change: Array, low: Array, high: Array) -> float:
    """The largest share from 0 to 1 of a change that keeps start + share * change within bounds, all (dof,)."""
    share = 1.0
    for j in range(len(start)):
        if abs(change[j]) > TINY:
            share = min(share, ((high[j] if change[j] > 0.0 else low[j]) - start[j]) / change[j])
    return max(share, 0.0)


def find_fastest(tick: TickWork, reach: ReachWork, work: TwistWork, size: float) -> None:
    """Find the displacement of a whole twist of some size, and the largest part of it that keeps every limit.

    Where the joints cannot follow exactly, a little of the twist is given away, no more than needed. As long as the arm
    moves on, the damping that does it changes little from tick to tick, and the part grows gently. The arm is slower by
    the part of the twist in which joints cannot lead at all.
    """
    before, part = work.damping[0], work.part[0]
    work.damping[0], work.part[0] = 0.0, -1.0
    if not any_of(work.wanted):
        for j in range(len(work.found)):
            work.found[j] = 0.0
        work.part[0], work.cause[0], work.cause[1] = 1.0, NOTHING, 0
        return
    find_damping(tick, reach, work, size, before if part > 0.0 else 0.0, part)
    led = max(1.0 - part_left(work.inverse, work.wanted) / size, 0.0)
    if led < work.part[0]:
        work.part[0], work.cause[0], work.cause[1] = led, SINGULARITY, 0
    if part > 0.0:
        for j in range(len(work.found)):
            gentle = part + GENTLE * tick.limits[j, CHANGE] / max(abs(work.found[j]), TINY)
            if gentle < work.part[0]:
                work.part[0], work.cause[0], work.cause[1] = gentle, GENTLENESS, j


def find_damping(tick: TickWork, reach: ReachWork, work: TwistWork, size: float, before: float, part: float) -> None:
    """Find the least damping with which all of a twist of some size can be followed, or about the most of it.

    Args:
        tick: whose limits are kept.
        reach: measures what is near.
        work: with the twist.
        size: of the twist.
        before: the damping of the tick before, 0 for none; joints leave what they would do with it gently.
        part: of the twist that was followed then.
    """
    most = damping_leaving(work.inverse, work.wanted, ASIDE * size)
    least = min(smooth_damping(work.inverse), most)
    if before > 0.0:
        before = min(max(before, least), most)
        least = near_damping(tick, work, before, least, part)
    if try_damping(tick, reach, work, least) >= 1.0:
        return
    if before > 0.0:
        most = near_damping(tick, work, before, most, part)
    if try_damping(tick, reach, work, most) < 1.0:
        if least < before < most:
            try_damping(tick, reach, work, before)
        return
    for _ in range(HALVINGS):
        damping = math.sqrt(least * most)
        if try_damping(tick, reach, work, damping) >= 1.0:
            most = damping
        else:
            least = damping


def near_damping(tick: TickWork, work: TwistWork, before: float, end: float, part: float) -> float:
    """The damping that is farthest towards an end at which a part of what joints do changes gently from one before."""
    dof = len(work.tried)
    if before == end:
        return end
    try_answer(tick, work, before)
    for j in range(dof):
        work.known[j] = work.tried[j]
    near, far = before, end
    for turn in range(DAMPING_TURNS):
        damping, fits = end if turn == 0 else math.sqrt(near * far), True
        try_answer(tick, work, damping)
        for j in range(dof):
            fits = fits and part * abs(work.tried[j] - work.known[j]) <= GENTLE * tick.limits[j, CHANGE]
        if not fits:
            far = damping
        elif turn == 0:
            return end
        else:
            near = damping
    return near


def try_damping(tick: TickWork, reach: ReachWork, work: TwistWork, damping: float) -> float:
    """The part of the twist that can be followed with some damping; what does it is taken if none tried does more."""
    try_answer(tick, work, damping)
    part, cause, joint = pace(tick, reach, work)
    if part > work.part[0] or part >= 1.0:
        for j in range(len(work.found)):
            work.found[j] = work.tried[j]
        work.part[0], work.damping[0], work.cause[0], work.cause[1] = part, damping, cause, joint
    return part


def any_of(x: Array) -> bool:
    """Whether a number is not zero."""
    found = False
    for j in range(len(x)):
        found = found or x[j] != 0.0
    return found


def pace(tick: TickWork, reach: ReachWork, work: TwistWork) -> tuple[float, int, int]:
    """The largest part from 0 to 1 of the displacement that is tried that keeps every limit; what limits it, where."""
    dof, limits, direction, ahead, near = len(tick.q), tick.limits, work.tried, work.planned, tick.near
    fast, first, speed, free, braking = 0, 0, math.inf, math.inf, math.inf
    for j in range(dof):
        size = max(abs(direction[j]), TINY)
        room = (tick.room[dof + j] if direction[j] > 0.0 else -tick.room[j]) / size
        if limits[j, STEP] / size < speed:
            fast, speed = j, limits[j, STEP] / size
        if room < free:
            first, free = j, room
        braking = min(braking, EASY * limits[j, CHANGE] / size)  # together: none may have to brake harder than it can
    found = (speed, VELOCITY, fast)
    part = stopping(free, braking)
    if part < found[0]:
        found = (part, UPPER_LIMIT if direction[first] > 0.0 else LOWER_LIMIT, first)
    for j in range(dof):
        ahead[j] = (1.0 + 0.5 / braking) * direction[j]  # as many as it takes to stop after a whole one
    watch(tick, reach, ahead)
    spare = math.inf
    for r in range(near.counts[1]):
        closing = 0.0
        for j in range(dof):
            closing += near.rows[r * dof + j] * direction[j]
        if closing > 0.0:
            spare = min(spare, near.ends[r] / closing)
    part = stopping(spare, braking)
    if part < found[0]:
        found = (part, NEARNESS, 0)
    part = turning_part(tick, work)
    if part < found[0]:
        found = (part, SINGULARITY, 0)
    return found if found[0] < 1.0 else (1.0, NOTHING, 0)


def stopping(distance: float, braking: float) -> float:
    """Parts of a way in the coming tick after which it can still end in a distance, in such parts."""
    return braking_speed(max(distance, 0.0), braking, 1.0)


def try_answer(tick: TickWork, work: TwistWork, damping: float) -> None:
    """Fill the displacement to be tried for a whole twist with some damping, and by how much it will have changed then.

    Along singular poses that joints are drawn to from both sides, the change has the opposite sign beyond them: of one
    that would lead there and farther, and hardly moves the tool, the displacement takes as much as ends there.
    """
    dof, inverse, direction, bend, again = len(tick.q), work.inverse, work.tried, work.bend, work.planned
    idle = work.idle
    solve_damped(inverse, work.wanted, damping, direction)
    fill_turn(tick, direction, work.weights, work.turn)
    fill_bend(inverse, work.wanted, direction, work.turn, damping, bend)
    multiply(inverse.jacobian, bend, inverse.rest)
    solve_damped(inverse, inverse.rest, IDLE, idle)
    for j in range(dof):
        idle[j] = bend[j] - idle[j]
    fill_turn(tick, idle, work.weights, work.turn)
    fill_bend(inverse, work.wanted, direction, work.turn, damping, again)
    size, back = 0.0, 0.0
    for j in range(dof):
        size += idle[j] * idle[j]
        back -= idle[j] * again[j]
    steep = back / max(size, TINY)
    if steep > 1.0:
        for j in range(dof):
            direction[j] += (steep - 1.0) / (steep * steep) * idle[j]
            bend[j] -= (steep - 1.0) / steep * idle[j]


def turning_part(tick: TickWork, work: TwistWork) -> float:
    """The part of the displacement that is tried with which the joints' path bends no more than they can follow."""
    dof, direction, bend = len(tick.q), work.tried, work.bend
    part, along, way, size = math.inf, 0.0, 0.0, 0.0
    for j in range(dof):
        part = min(part, tick.limits[j, CHANGE] / max(abs(bend[j]), TINY))
        along += bend[j] * direction[j]
        way += direction[j] * direction[j]
        size += bend[j] * bend[j]
    # Towards a singular pose they get ever faster, or ever slower, up to where they would turn round beyond it.
    bent = BENT * math.sqrt(way) / max(math.sqrt(size), TINY) + max(-along, 0.0) / max(size, TINY)
    part = min(math.sqrt(BENDING * part), bent)
    return part if along <= 0.0 else min(part, max(2.0 * (part - CREEPING), 0.0))


def fill_turn(tick: TickWork, x: Array, weights: Array, turn: Array) -> None:
    """Fill by how much the tool's weighted Jacobian (6 dof,) changes with a small displacement (dof,) [rad]."""
    dof, frames, end, link = len(x), tick.arm.frames, tool_of(tick), tick.tasks.integers[0, LINK]
    w, moved, o, tool = (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    for j in range(dof):
        tool = mix(tool, 1.0, (tick.columns[j, 0], tick.columns[j, 1], tick.columns[j, 2]), x[j], tool, 0.0)
    for j in range(dof):
        z, p = axis_of(frames, j + 1, 2), axis_of(frames, j + 1, 3)
        turned, moved = cross(w, z), mix(moved, 1.0, cross(w, minus(p, o)), 1.0, w, 0.0)
        linear, angular = turned, (0.0, 0.0, 0.0)
        if tick.arm.kinds[j] == HINGE:
            linear = mix(cross(turned, minus(end, p)), 1.0, cross(z, minus(tool, moved)), 1.0, z, 0.0)
            angular, w = turned, mix(w, 1.0, z, x[j], z, 0.0)
        else:
            moved = mix(moved, 1.0, z, x[j], z, 0.0)
        o = p
        for i in range(3):
            turn[i * dof + j] = weights[i] * linear[i] if j < link else 0.0
            turn[(i + 3) * dof + j] = weights[i + 3] * angular[i] if j < link else 0.0
