"""Which solutions of neighbouring places of a path follow each other, and at what cost: links between rungs.

Two solutions do when the straight motion between them stays near the path: half way, the tool misses it by little.
"""

from __future__ import annotations

import math
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.chain import BASE, Frame, deviation, moved, place
from jacokin.kernels.configurations.arm import Arm, make_arm
from jacokin.kernels.limits import TURN
from jacokin.kernels.solution_set.slices import turn_target
from jacokin.kernels.vector import norm

#: Where the numbers are: the farthest that a joint moves, and a parameter [rad]; by how much the tool misses the path
#: half way [m], and in orientation [rad]; how much more for squared changes of parameters; the cost of a second
#: times how much too fast a joint is.
LinkNumber = IntEnum("LinkNumber", "FARTHEST FARTHEST_PARAMETER DEVIATION TILT BEND HASTE COUNT", start=0)


class LinkWork(NamedTuple):
    """What a call reads and writes."""

    numbers: Array  # (LinkNumber.COUNT,)
    arm: Arm  # up to the tool
    circular: NDArray[np.int64]  # (width,) 1 for coordinates that are the same after a turn
    parameters: NDArray[np.int64]  # (k,) coordinates that are free where the tool is: of points none, of curves one
    scale: Array  # (dof,) velocity limits [rad/s]
    sizes: NDArray[np.int64]  # (rungs,) solutions of each rung
    x: Array  # (solutions width,) coordinates: the joints, then the free angle if there is one [rad]
    T: Array  # (rungs - 1, 4, 4) the path half way to the next rung
    axis: Array  # (rungs - 1, 3) free axis there
    times: Array  # (rungs - 1,) to the next rung [s]
    made: NDArray[np.int64]  # (rungs - 1,) filled with the number of links to the next rung
    first: NDArray[np.int64]  # (room,) at least every pair; filled with numbers on the rung before
    second: NDArray[np.int64]  # (room,) and on the rung after
    cost: Array  # (room,)
    away: Array  # (width,) to work in
    middle: Array  # (width,)
    goal: Array  # (4, 4)


def make_link_work(
    dof: int = 0, width: int = 0, parameters: int = 0, rungs: int = 0, solutions: int = 0, room: int = 0
) -> LinkWork:
    """Fresh work arrays for an arm, so many coordinates, parameters among them, rungs, solutions and links."""
    lines = max(rungs - 1, 0)
    return LinkWork(
        np.zeros(LinkNumber.COUNT),
        make_arm(),
        np.zeros(width, np.int64),
        np.zeros(parameters, np.int64),
        np.zeros(dof),
        np.zeros(rungs, np.int64),
        np.zeros(solutions * width),
        np.zeros((lines, 4, 4)),
        np.zeros((lines, 3)),
        np.zeros(lines),
        np.zeros(lines, np.int64),
        np.empty(room, np.int64),
        np.empty(room, np.int64),
        np.empty(room),
        np.zeros(width),
        np.zeros(width),
        np.eye(4),
    )


def link_rungs(work: LinkWork) -> int:
    """Link every rung but the first to the one before it; returns how many links there are."""
    width, total, start = len(work.circular), 0, 0
    for i in range(len(work.made)):
        work.made[i] = total
        end = start + work.sizes[i] * width
        for a in range(work.sizes[i]):
            for b in range(work.sizes[i + 1]):
                if not is_near(work, start + a * width, end + b * width) or misses(work, i):
                    continue
                work.first[total], work.second[total], work.cost[total] = a, b, cost_of(work, work.times[i])
                total += 1
        work.made[i] = total - work.made[i]
        start = end
    return total


def is_near(work: LinkWork, a: int, b: int) -> bool:
    """Whether no coordinate moves too far from the solution that begins at x[a] to that at x[b]; fills `away`."""
    width, numbers = len(work.circular), work.numbers
    for parameter in work.parameters:
        if not coordinate_is_near(work, a, b, parameter, numbers[LinkNumber.FARTHEST_PARAMETER]):
            return False
    for j in range(width):
        limit = numbers[LinkNumber.FARTHEST] if j < len(work.scale) else numbers[LinkNumber.FARTHEST_PARAMETER]
        if not coordinate_is_near(work, a, b, j, limit):
            return False
    return True


def coordinate_is_near(work: LinkWork, a: int, b: int, j: int, limit: float) -> bool:
    """Whether coordinate j does not move farther than a limit from x[a] to x[b]; fills away[j]."""
    away = work.x[b + j] - work.x[a + j]
    if work.circular[j] > 0 and abs(away) > limit:
        away -= TURN * math.floor(away / TURN + 0.5)
    work.away[j] = away
    work.middle[j] = work.x[a + j] + 0.5 * away
    return bool(abs(away) <= limit)


def misses(work: LinkWork, i: int) -> bool:
    """Whether the tool is too far from the path half way to the rung after rung i."""
    dof, numbers, goal = len(work.scale), work.numbers, work.T[i]
    x, y, z, p = tool_at(work)
    more = 0.0
    for parameter in work.parameters:
        more += numbers[LinkNumber.BEND] * work.away[parameter] * work.away[parameter]
    square, most = 0.0, numbers[LinkNumber.DEVIATION] + more
    for row in range(3):
        square += (goal[row, 3] - p[row]) * (goal[row, 3] - p[row])
    if square > most * most:
        return True
    if len(work.circular) > dof:
        turn_target(goal, work.axis[i], work.middle[dof], work.goal)
    else:
        for row in range(3):
            for column in range(4):
                work.goal[row, column] = goal[row, column]
    _, turn, _ = deviation(work.goal, x, y, z, p)
    return bool(norm(turn) > numbers[LinkNumber.TILT] + more)


def tool_at(work: LinkWork) -> Frame:
    """Axes and position of the tool at `middle`."""
    arm = work.arm
    x, y, z, p = BASE
    for j in range(len(arm.sliding)):
        x, y, z, p = moved(arm.placements, j, arm.sliding[j] != 0.0, work.middle[j], x, y, z, p)
    return place(arm.placements, len(arm.sliding), x, y, z, p)


def cost_of(work: LinkWork, time: float) -> float:
    """Of the motion `away` in a time [s]: squared joint speeds as parts of their limits, times the time.

    More where the time does not suffice, if the speed is to be kept.
    """
    square, fastest = 0.0, 0.0
    for j in range(len(work.scale)):
        speed = abs(work.away[j]) / work.scale[j] / time
        square += speed * speed
        fastest = max(fastest, speed)
    return time * (square + (work.numbers[LinkNumber.HASTE] * fastest if fastest > 1.0 else 0.0))
