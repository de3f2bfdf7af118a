"""The entry point: the self-motions of a target as intervals of the parameter, or one point. Read this file first.

straight_wrist   where the outer axes of the wrist may be one line: found by themselves
gaps         where configurations exist between two slices only: one more slice
slices       all configurations at some values of the parameter, in closed form
graph        which points of neighbouring slices belong together; in doubt `follow` walks along the curve
arcs         pieces of the curves along which the parameter rises, from fold to fold
limit_cuts   what is left of them within the joint limits
census       whether they are all that there is
nearest      the one point that is nearest to a seed, without the rest
members      members for a first look, at values of the parameter and about where curves end
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.self_motion.arcs import Arcs, assemble, has_short_loop, make_arcs
from jacokin.kernels.self_motion.census import Census, make_census, take_census
from jacokin.kernels.self_motion.follow import between, where_joint_is
from jacokin.kernels.self_motion.gaps import Loops, add_loops, add_windows, insert_slice, make_loops
from jacokin.kernels.self_motion.graph import Graph, join, make_graph
from jacokin.kernels.self_motion.limit_cuts import Cuts, cut, make_cuts
from jacokin.kernels.self_motion.members import scatter
from jacokin.kernels.self_motion.nearest import Nearest, make_nearest, search_arcs, search_run
from jacokin.kernels.self_motion.slices import (
    Quarters,
    SevenJoints,
    SixJoints,
    Slices,
    fill_slices,
    make_quarters,
    make_seven_joints,
    make_six_joints,
    make_slices,
    measure_quarters,
)
from jacokin.kernels.self_motion.straight_wrist import (
    Straight,
    find_straight_seven,
    find_straight_six,
    make_straight,
)
from jacokin.kernels.self_motion.sweep import SweepWork, sweep

#: What to do: find the intervals; find a point at a share of a chord; find a point where the parameter has a value;
#: find the member nearest to the seed; find the nearest one on the first nodes of the arcs; solve at the slices alone;
#: fill the nodes with members at the slices and guesses between them.
FIND_INTERVALS, FIND_AT_SHARE, FIND_AT_PARAMETER, FIND_NEAREST, FIND_NEAREST_ON_RUN, FILL_SLICES, SCATTER = range(7)

# What callers choose the slices by.

#: [rad] where they begin: no structured pose has a fold or a limit just there, nor a window in the gap before it.
FIRST_SLICE = -math.pi + 1.2345
#: [rad] values nearer to each other are solved at once.
SAME_SLICE = 1e-5


class CurveWork(NamedTuple):
    """What a call reads and writes; one set for each thread."""

    options: NDArray[np.int64]  # (4,) task, index of the parameter, number of slices, 1 if they close the circle
    counts: NDArray[np.int64]  # (4,) intervals, sides that were not linked, points that were lost, limits not found
    chain: Array  # (8, 3, 4) placements between seven joints that turn about z
    T: Array  # (4, 4) target
    six: SixJoints
    seven: SevenJoints
    slices: Slices
    graph: Graph
    arcs: Arcs
    cuts: Cuts
    chord: Array  # (2, 14) nodes between which a point is asked for
    at: Array  # (1,) share of the chord, or value of the parameter
    x: Array  # (7,) the point
    nearest: Nearest
    loops: Loops
    quarters: Quarters
    straight: Straight
    census: Census


def make_curve_work() -> CurveWork:
    """Fresh arrays."""
    return CurveWork(
        np.zeros(4, np.int64),
        np.zeros(4, np.int64),
        np.zeros((8, 3, 4)),
        np.eye(4),
        make_six_joints(),
        make_seven_joints(),
        make_slices(),
        make_graph(),
        make_arcs(),
        make_cuts(),
        np.zeros((2, 14)),
        np.zeros(1),
        np.zeros(7),
        make_nearest(),
        make_loops(),
        make_quarters(),
        make_straight(),
        make_census(),
    )


def run_curves(work: CurveWork) -> int:
    """Do what work.options[0] asks for; returns the number of intervals or rows, or 1 if the point was found, else 0.

    A nearest point is in work.nearest; 0 where a curve was lost or the wrist may be straight: others may be nearer.
    """
    chain, T, walk = work.chain, work.T, work.graph.walk
    task, parameter, n, closed = work.options[0], work.options[1], work.options[2], work.options[3] > 0
    if task == FIND_AT_SHARE:
        return 1 if between(chain, T, work.chord[0], work.chord[1], work.at[0], work.x, walk) else 0
    if task == FIND_AT_PARAMETER:
        share = where_joint_is(chain, T, work.chord[0], work.chord[1], parameter, work.at[0], work.x, walk)
        return 1 if share >= 0.0 else 0
    if task == FIND_NEAREST_ON_RUN:
        return 1 if search_run(chain, T, work.arcs.nodes, n, work.nearest, walk) else 0
    if task == FILL_SLICES:
        work.counts[2] = fill_slices(chain, T, parameter, n, work.slices, work.six, work.seven, walk)
        return 1
    if task == SCATTER:
        work.counts[2] = fill_slices(chain, T, parameter, n, work.slices, work.six, work.seven, walk)
        return scatter(parameter, n, closed, work.slices, work.cuts.limits, work.graph, work.arcs.nodes)
    if parameter != 6:
        straight = find_straight_seven(chain, T, work.seven, work.straight)
    else:
        straight = find_straight_six(T, work.six, work.straight)
    if task == FIND_NEAREST and straight > 0:  # its members may be nearer
        return 0
    if task == FIND_NEAREST and parameter != 6:
        sweeping = SweepWork(chain, T, work.seven, work.slices, work.graph.traced, work.nearest, walk)
        return 1 if sweep(sweeping) else 0
    if parameter != 6:
        n = add_windows(chain, work.seven, T, n, work.slices)
    elif unpack_arm(work.six.arm).six.scale == 0.0:  # F is that of an arm built like a Jaco
        n = add_loops(T, n, closed, work.slices, work.six, work.loops)
    if task == FIND_NEAREST:
        draw(work, n)
        if has_short_loop(work.arcs, parameter):  # its neighbours may be nearer
            return 0
        return 1 if search_arcs(chain, T, work.arcs, work.nearest, walk) else 0
    for attempt in range(2):
        draw(work, n)
        found = cut(chain, T, work.arcs, work.cuts, walk)
        missing, uncut = take_census(
            chain, T, parameter, n, closed, work.six, work.seven, work.slices, work.arcs, work.cuts, found, work.census
        )
        work.counts[0], work.counts[3] = found, work.cuts.lost[0] + uncut
        if missing == 0:
            break
        if attempt > 0:
            work.counts[1] += missing
            break
        for k in range(missing):
            n = insert_slice(work.slices, n, work.census.missing[k])
    measure_quarters(chain, T, n, work.slices, work.quarters, walk)
    return int(work.counts[0])


def draw(work: CurveWork, n: int) -> None:
    """Draw the curves through n slices: fill work.arcs."""
    chain, T, parameter, closed = work.chain, work.T, work.options[1], work.options[3] > 0
    work.counts[2] = fill_slices(chain, T, parameter, n, work.slices, work.six, work.seven, work.graph.walk)
    made, work.counts[1] = join(chain, T, n, closed, parameter, work.seven, work.slices, work.graph)
    assemble(n, closed, parameter, made, work.slices, work.graph, work.arcs)
