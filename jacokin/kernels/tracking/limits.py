"""How far each joint may go in a tick: position, velocity and acceleration limits.

A joint is only ever as fast as it can still stop before its limit, braking as hard as its acceleration limit allows. So
there is always a displacement that keeps all three, whatever was asked for: to go on braking. The joints do not couple.
"""

from __future__ import annotations

import math

from jacokin.arrays import Array

#: Columns of a joint: its limits [rad]; the largest displacement of a tick, and by how much it may change from one to
#: the next [rad], at most and in catching up with a target; the acceleration [rad/s^2]; how far from a limit it does
#: not bind [rad]; 1 where the acceleration is limited at all.
LOWER, UPPER, STEP, CHANGE, CATCHING, ACCELERATION, CLEAR_OF, LIMITED, LIMIT_NUMBERS = range(9)
#: What a joint runs into: nothing, its upper or lower limit, its velocity limit; and added to it, its acceleration's.
FREE, AT_UPPER, AT_LOWER, AT_SPEED, AT_ACCELERATION = 0, 1, 2, 3, 4
#: Of the velocity limit's step: a displacement this near to a bound lies on it.
AT_BOUND = 1e-6
#: Part of the acceleration limit with which an approach brakes; the rest is for what curvature adds.
EASY = 0.8
#: Instead of dividing by zero.
TINY = 1e-200


def braking_speed(distance: float, deceleration: float, dt: float) -> float:
    """Largest speed [rad/s] over the coming tick from which a joint can still stop within a distance.

    A joint that moves at u a dt this tick and brakes by a dt every tick after travels
    a dt^2 (u (n + 1) - n (n + 1) / 2) in all, n = floor(u). This is the inverse, exact in discrete time; the usual
    sqrt(2 a d) overshoots by up to half a tick.

    Args:
        distance: free travel [rad], >= 0; inf for no end.
        deceleration: [rad/s^2].
        dt: control step [s].
    """
    change = deceleration * dt
    x = distance / (change * dt)
    n = math.floor(0.5 * math.sqrt(1.0 + 8.0 * min(x, 1e15)) - 0.5)
    return (x / (n + 1.0) + 0.5 * n) * change


def braking_way(speed: float, ticks: float) -> float:
    """How far a joint goes in some ticks of braking, in what each of them takes from its displacement.

    A joint whose displacement was u of these moves by u - 1 in the first tick, by u - 2 in the next, and so on.
    """
    n = min(float(math.floor(speed)), ticks)
    return speed * n - 0.5 * n * (n + 1.0)


def stopping_part(distance: float) -> float:
    """The part of a distance, from 0 to 1, in the coming tick, after which a joint can still stop at its end easily.

    Args:
        distance: in what a tick of braking takes from a displacement, > 0. Longer ones give smaller parts.
    """
    if distance <= 1.0:
        return 1.0
    easy = 1.0 + (distance - 1.0) / EASY  # the last tick may brake as hard as it can
    ticks = math.floor(0.5 * math.sqrt(1.0 + 8.0 * min(easy, 1e15)) - 0.5)
    return 1.0 / (ticks + 1.0) + 0.5 * ticks / easy


def fill_room(limits: Array, q: Array, low: Array, high: Array) -> None:
    """Fill the least and largest displacement (dof,) [rad] to the limits; a joint past one may only come back."""
    for j in range(len(q)):
        low[j] = min(limits[j, LOWER] - q[j], 0.0)
        high[j] = max(limits[j, UPPER] - q[j], 0.0)


def fill_bounds(limits: Array, q: Array, v: Array, dt: float, low: Array, high: Array) -> None:
    """Fill the least and largest displacement (dof,) [rad] by all limits, at `q` after velocities `v` [rad/s].

    Braking as hard as allowed always satisfies them, but for rounding.
    """
    fill_room(limits, q, low, high)
    near = False
    for j in range(len(q)):
        near = near or high[j] < limits[j, CLEAR_OF] or low[j] > -limits[j, CLEAR_OF]
    for j in range(len(q)):
        step, least, most = limits[j, STEP], v[j] * dt - limits[j, CHANGE], v[j] * dt + limits[j, CHANGE]
        if near:
            acceleration = limits[j, ACCELERATION]
            low[j] = max(-min(braking_speed(-low[j], acceleration, dt) * dt, step), low[j])
            high[j] = min(min(braking_speed(high[j], acceleration, dt) * dt, step), high[j])
        else:
            low[j], high[j] = -step, step
        low[j] = min(max(low[j], least), most)
        high[j] = min(max(high[j], least), most)


def take_stride(limits: Array, total: Array, along: Array, nearing: Array, stride: Array) -> None:
    """Fill the part (dof,) [rad] for the coming tick of a displacement on which the arm is to stop.

    All joints take the same part, so that the arm goes straight. It can stop at the end, or go on as `along` does.

    Args:
        limits: of the joints.
        total: (dof,) what is missing to the target at the end of the tick [rad].
        along: (dof,) by how much the target itself moves in a tick [rad].
        nearing: (dof,) how far the end of a joint's way comes towards it, relative to how far the joint goes, >= 0.
        stride: filled.
    """
    dof, part, share = len(total), 1.0, 1.0
    for j in range(dof):
        own = 1.0 / (1.0 + nearing[j])
        distance = own * abs(total[j] - along[j]) / limits[j, CATCHING]
        part = min(part, own * stopping_part(max(distance, TINY)))
    for j in range(dof):
        stride[j] = along[j] + part * (total[j] - along[j])
        share = min(share, limits[j, STEP] / max(abs(stride[j]), TINY))
    for j in range(dof):
        stride[j] *= share


def keep_to_target(limits: Array, v: Array, dt: float, along_change: Array, low: Array, high: Array) -> None:
    """Narrow the bounds (dof,) [rad] of a tick to what catches up with a target, and to how its motion changes.

    So a joint accelerates as hard as it may only where the target itself does, or before a limit.

    Args:
        limits: of the joints.
        v: (dof,) velocities over the last tick [rad/s].
        dt: control step [s].
        along_change: (dof,) by how much the target's own displacement in a tick changes [rad].
        low: least displacement by all limits.
        high: the largest one.
    """
    for j in range(len(v)):
        least = v[j] * dt + min(along_change[j], 0.0) - limits[j, CATCHING]
        most = v[j] * dt + max(along_change[j], 0.0) + limits[j, CATCHING]
        low[j] = min(max(low[j], least), high[j])
        high[j] = max(min(high[j], most), low[j])


def move(limits: Array, q: Array, displacement: Array, after: Array) -> None:
    """Fill the configuration after a displacement; adding may round past a limit."""
    for j in range(len(q)):
        moved = max(q[j] + displacement[j], min(q[j], limits[j, LOWER]))
        after[j] = min(moved, max(q[j], limits[j, UPPER]))


def brake(limits: Array, v: Array, dt: float, displacement: Array) -> None:
    """Fill the displacement (dof,) [rad] of a tick of braking after velocities `v` (dof,) [rad/s]."""
    for j in range(len(v)):
        displacement[j] = math.copysign(max(abs(v[j]) * dt - limits[j, CHANGE], 0.0), v[j])


def limit_reached(limits: Array, j: int, q: float, v: float, before: float, dt: float) -> int:
    """What joint j runs into that goes from q [rad] at v, after a velocity before [rad/s]."""
    displacement, slack = v * dt, AT_BOUND * limits[j, STEP]
    found = FREE
    if displacement >= limits[j, UPPER] - q - slack:
        found = AT_UPPER
    elif displacement <= limits[j, LOWER] - q + slack:
        found = AT_LOWER
    elif abs(displacement) >= limits[j, STEP] - slack:
        found = AT_SPEED
    if limits[j, LIMITED] > 0.0 and abs(v - before) * dt >= limits[j, CATCHING] * (1.0 - AT_BOUND):
        found += AT_ACCELERATION
    return found
