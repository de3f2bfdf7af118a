"""The least change of a step that keeps inequalities of where it leads, some ticks of braking after it.

Of a joint that moves by s in a tick and then brakes it is known where it is after some more ticks: that rises with s.
So all inequalities are ones of s, whose slopes are taken between the step that was wanted and the one that is found.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.tracking.limits import CHANGE, braking_way

#: When to look: after the step itself, and after these parts of the ticks that it takes to come to rest.
PLACES, WHEN = 5, (0.0, 0.06, 0.2, 0.5, 1.0)
#: How often inequalities are looked at in turn, and steps to what one of them takes.
IN_TURN, FORCE_STEPS = 20, 8
#: Rounds of slopes.
SLOPE_ROUNDS = 3
#: Of what a joint may change in a tick: less is rounding.
UNCHANGED = 1e-6
#: [m] by which an end is kept, and by how much it gives way to a force of one [rad/m]: what bounds do not allow is not
#: asked of joints that hardly matter.
HELD, SOFT = 1e-9, 1e-4


class Aside(NamedTuple):
    """Inequalities rows y <= ends of where joints are at some places of the way to rest."""

    size: NDArray[np.int64]  # (1,) inequalities
    ticks: NDArray[np.int64]  # (PLACES,) of braking after the step
    braked: Array  # (PLACES dof,) where the arm would be if it braked at once [rad]
    wanted: Array  # (PLACES dof,) where the step that is wanted leads [rad]
    slopes: Array  # (PLACES dof,) how fast that rises with the step
    place: NDArray[np.int64]  # (room,)
    rows: Array  # (room dof,) [m/rad]
    ends: Array  # (room,) [m]
    forces: Array  # (room,) how much of each is taken from the step
    s: Array  # (dof,) the step, before bounds [rad]


def make_aside(dof: int = 0, room: int = 0) -> Aside:
    """Fresh arrays for so many inequalities."""
    return Aside(
        np.zeros(1, np.int64),
        np.zeros(PLACES, np.int64),
        np.zeros(PLACES * dof),
        np.zeros(PLACES * dof),
        np.zeros(PLACES * dof),
        np.zeros(room, np.int64),
        np.zeros(room * dof),
        np.zeros(room),
        np.zeros(room),
        np.zeros(dof),
    )


def led_to(step: float, change: float, ticks: int) -> float:
    """Where a joint is that moves by a step in a tick and then brakes by a change for some ticks [rad]."""
    return step + math.copysign(change * braking_way(abs(step) / change, float(ticks)), step)


def look_ahead_of(aside: Aside, limits: Array, braking: Array, step: Array) -> None:
    """Fill when to look, and where braking at once and a step lead by then."""
    most, dof = 0.0, len(step)
    for j in range(dof):
        most = max(most, abs(step[j]) / limits[j, CHANGE], abs(braking[j]) / limits[j, CHANGE])
    for k in range(PLACES):
        aside.ticks[k] = math.ceil(WHEN[k] * math.floor(most))
        for j in range(dof):
            change = limits[j, CHANGE]
            aside.braked[k * dof + j] = led_to(braking[j], change, aside.ticks[k])
            aside.wanted[k * dof + j] = led_to(step[j], change, aside.ticks[k])
            aside.slopes[k * dof + j] = min(math.floor(abs(step[j]) / change), float(aside.ticks[k])) + 1.0
    aside.size[0] = 0


def change_least(aside: Aside, limits: Array, low: Array, high: Array, step: Array) -> None:
    """Change a step (dof,) [rad] as little as it takes for all inequalities to hold, where its bounds allow that."""
    s, dof = aside.s, len(step)
    for _ in range(SLOPE_ROUNDS):
        for j in range(dof):
            s[j] = step[j]
        if not keep_all(aside, low, high, step):
            return
        for j in range(dof):
            found, change = min(max(s[j], low[j]), high[j]), limits[j, CHANGE]
            if abs(found - step[j]) > UNCHANGED * change:
                for k in range(PLACES):
                    led = led_to(found, change, aside.ticks[k]) - aside.wanted[k * dof + j]
                    aside.slopes[k * dof + j] = led / (found - step[j])
    for j in range(dof):
        step[j] = min(max(s[j], low[j]), high[j])


def keep_all(aside: Aside, low: Array, high: Array, step: Array) -> bool:
    """Take from s what the inequalities ask for; whether that is anything."""
    dof, changed = len(step), False
    for r in range(aside.size[0]):
        aside.forces[r] = 0.0
    for _ in range(IN_TURN):
        taken = False
        for r in range(aside.size[0]):
            more = force_for(aside, r, low, high, step)
            if more != 0.0:
                taken = True
                aside.forces[r] += more
                for j in range(dof):
                    aside.s[j] -= more * aside.rows[r * dof + j] * aside.slopes[aside.place[r] * dof + j]
        if not taken:
            break
        changed = True
    return changed


def force_for(aside: Aside, r: int, low: Array, high: Array, step: Array) -> float:
    """How much of row r to take from s besides, so that what bounds leave of it keeps the end of that row."""
    more, at, dof = 0.0, aside.place[r] * len(step), len(step)
    for _ in range(FORCE_STEPS):
        over, rises, falls = -aside.ends[r] - SOFT * (aside.forces[r] + more), SOFT, SOFT
        for j in range(dof):
            a, slope = aside.rows[r * dof + j], aside.slopes[at + j]
            s = aside.s[j] - more * a * slope
            over += a * (aside.wanted[at + j] + slope * (min(max(s, low[j]), high[j]) - step[j]))
            square = a * a * slope * slope
            rises += square if (s > low[j] if a > 0.0 else s < high[j]) else 0.0
            falls += square if (s < high[j] if a > 0.0 else s > low[j]) else 0.0
        if abs(over) < HELD or (over < 0.0 and more <= -aside.forces[r]):
            break
        more = max(more + over / (rises if over > 0.0 else falls), -aside.forces[r])
    return more
