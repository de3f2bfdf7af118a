"""A step after which the arm comes to rest clear of what is near, and keeps clear on the way.

Bounds change a step joint by joint, and so may take away what kept it clear. Pairs of shapes that are near are measured
where the arm would be if it braked at once, at some places of the way to rest; from there distances change with where
the step leads as they do with any displacement. The least change of the step is found that keeps them.
"""

from __future__ import annotations

from jacokin.arrays import Array
from jacokin.kernels.tracking.aside import PLACES, change_least, look_ahead_of
from jacokin.kernels.tracking.limits import ACCELERATION, EASY, TINY, brake, braking_speed
from jacokin.kernels.tracking.near import CLOSING, LEAVES, fill_change, room_of
from jacokin.kernels.tracking.reach import FORESIGHT, MOVING, NEAR, ReachWork, place_movers
from jacokin.kernels.tracking.tasks import place_joints
from jacokin.kernels.tracking.tick import TIME_STEP, TickWork
from jacokin.kernels.tracking.watch import could_come_near, measure_there, place_there, watch

#: [s] in which a pair that is too near moves apart.
COMING_BACK = 0.05
#: [m/rad] joints that change a distance by less move a pair apart less fast: where they hardly do, it is farthest.
LEVER = 0.1


def turn_aside(tick: TickWork, reach: ReachWork) -> None:
    """Change the step as little as it takes for it, and the way to rest, to lead clear of everything that is near."""
    dof, aside, step = len(tick.q), tick.aside, tick.step
    low, high, braking = tick.bounds[:dof], tick.bounds[dof:], tick.along
    for j in range(dof):
        step[j] = min(max(step[j], low[j]), high[j])
    brake(tick.limits, tick.v, tick.numbers[TIME_STEP], braking)
    look_ahead_of(aside, tick.limits, braking, step)
    for j in range(dof):
        at = (PLACES - 1) * dof + j
        tick.along[j] = max(abs(aside.wanted[at]), abs(aside.braked[at]))
    place_joints(tick.arm, tick.q)
    watch(tick, reach, tick.along)
    add_step(tick)
    if reach.counts[MOVING] == 1:
        place_movers(reach, reach.numbers[FORESIGHT])
    for place in range(1, PLACES):
        if aside.ticks[place] > aside.ticks[place - 1]:
            add_place(tick, reach, place, aside.braked[place * dof : (place + 1) * dof])
    if reach.counts[MOVING] == 1:
        place_movers(reach, 0.0)
    change_least(aside, tick.limits, low, high, step)


def back(missing: float, dt: float) -> float:
    """By how much a pair moves apart in a tick to whose distance something is missing [m]."""
    return missing * min(dt / COMING_BACK, 1.0)


def add_step(tick: TickWork) -> None:
    """Add inequalities for where the step itself leads; what leaves an obstacle goes its way out."""
    near, aside, count, dt = tick.near, tick.aside, 0, tick.numbers[TIME_STEP]
    dof = len(tick.q)
    for r in range(near.counts[3], near.counts[1]):
        for j in range(dof):
            aside.rows[count * dof + j] = near.rows[r * dof + j]
        aside.ends[count] = near.rooms[r]
        count += 1
    for i in range(near.counts[0]):
        if near.integers[i, LEAVES] == 1:
            fill_change(tick.arm, near, i, -1.0, aside.rows, count * dof)
            aside.ends[count] = room_of(near, i)
            count += 1
    for r in range(count):
        missing, hardest, square = -aside.ends[r], TINY, 0.0
        for j in range(dof):
            a = aside.rows[r * dof + j]
            hardest += EASY * tick.limits[j, ACCELERATION] * abs(a)
            square += a * a
        if missing > 0.0:
            part = square / (square + LEVER * LEVER)
            aside.ends[r] = -part * min(back(missing, dt), braking_speed(missing, hardest, dt) * dt)
        aside.place[r] = 0
    aside.size[0] = count


def add_place(tick: TickWork, reach: ReachWork, place: int, braked: Array) -> None:
    """Add inequalities for the pairs that are near, as they would be after some ticks of braking."""
    dof, aside, placed = len(braked), tick.aside, False
    for k in range(reach.counts[NEAR]):
        i = reach.near[k]
        if not could_come_near(reach, i):
            continue
        if not placed:
            place_there(tick, reach, braked)
            placed = True
        if not measure_there(tick, reach, k):
            continue
        tick.there.numbers[0, CLOSING] = 0.0  # it is where it will be
        r, room = aside.size[0], room_of(tick.there, 0)
        fill_change(tick.arm, tick.there, 0, -1.0, aside.rows, r * dof)
        aside.ends[r] = room if room >= 0.0 else -back(-room, tick.numbers[TIME_STEP])
        for j in range(dof):
            aside.ends[r] += aside.rows[r * dof + j] * braked[j]
        aside.place[r] = place
        aside.size[0] += 1
