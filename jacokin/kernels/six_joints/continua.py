"""Continua of branches, where joints turn against each other: found from everywhere, and one member of each kept."""

from __future__ import annotations

import math

from jacokin.kernels.branches import (
    FAMILY,
    BranchWork,
    PoseQuery,
    add_branch,
    copy_row,
    jacobian_determinant,
)
from jacokin.kernels.chain import Newton, errors, least_squares, linearise, normal_equations, solve_normal
from jacokin.kernels.limits import TURN
from jacokin.kernels.tolerances import CONTINUUM_CLOSURE, SINGULAR_DETERMINANT

#: Configurations spread over all angles that are brought to the target, steps of each at most, and members of continua
#: that are kept of what they lead to.
SPREAD, DESCENT_STEPS, MEMBERS = 48, 40, 8
#: The positive root of x^8 = x + 1: shifts by its powers spread places evenly over so many angles (Roberts, 2018).
EVEN = 1.0969815577985598
#: What `FAMILY` is of a branch: on its own, the member of a continuum that is at the seed's angle, or of one that ends
#: before it.
ALONE, AT_SEED, ENDS = 0.0, 1.0, 2.0
#: Steps from a member of a continuum to the seed's angle, of least squares in each, the shortest [rad].
WALK, WALK_STEPS, SHORTEST_WALK = 16, 3, 0.02


def add_from_everywhere(query: PoseQuery, branches: BranchWork) -> None:
    """Add the branches that configurations spread over all angles are brought to, and some members of continua."""
    newton, members = branches.newton, 0
    for n in range(SPREAD):
        for j in range(6):
            newton.q[j] = spread_angle(n, j)
        if descend(query, newton):
            kind = kind_at_seed(query, branches)
            members += kind != ALONE
            if kind == ALONE or members <= MEMBERS:
                add_branch(query, branches, kind)


def spread_angle(n: int, j: int) -> float:
    """The angle of joint j in configuration n of some spread over all angles of up to seven joints [rad]."""
    turns = (n + 1) / EVEN ** (j + 1)
    return TURN * (turns - math.floor(turns) - 0.5)


def descend(query: PoseQuery, newton: Newton) -> bool:
    """Bring newton.q to where it reaches the target, by least squares; False where that does not succeed.

    Damped by the square of what is missing (Levenberg and Marquardt; Yamashita and Fukushima, 2001), with which the
    number of digits doubles at continua, too.
    """
    q, system, normal = newton.q, newton.system, newton.normal
    for j in range(6):
        newton.held[j] = 0.0
    for _ in range(DESCENT_STEPS):
        linearise(query.chain, query.T, q, system)
        square = 0.0
        for i in range(6):
            square += system[i, 6] * system[i, 6]
        if square <= CONTINUUM_CLOSURE * CONTINUUM_CLOSURE:
            position, orientation = errors(query.chain, query.T, q)
            return bool(max(position, orientation) <= CONTINUUM_CLOSURE)
        normal_equations(system, newton.held, normal)
        for i in range(6):
            normal[i, i] += square
        if not solve_normal(normal):
            return False
        for j in range(6):
            q[j] += normal[j, 6]
    return False


def settle_continua(query: PoseQuery, branches: BranchWork) -> None:
    """Of each continuum of branches keep the member at the seed's angle; where it ends before, those that are there."""
    rows, newton = branches.rows, branches.newton
    i = 0
    while i < branches.filled[0]:
        for j in range(6):
            newton.q[j] = rows[i, j]
        kind = kind_at_seed(query, branches) if rows[i, FAMILY] == ALONE else ALONE
        if kind == ALONE:
            i += 1
            continue
        branches.filled[0] -= 1
        copy_row(rows[branches.filled[0]], rows[i])
        add_branch(query, branches, kind)
        i = 0


def kind_at_seed(query: PoseQuery, branches: BranchWork) -> float:
    """What newton.q is, and `FAMILY` is to be; if a member of a continuum, it is moved along to the seed's angle.

    One joint is moved on its own, and the others follow; then those that still can be, as continua may cross, or more
    than one joint may be free.
    """
    newton, kind = branches.newton, ALONE
    if abs(jacobian_determinant(query.chain, query.T, newton)) > SINGULAR_DETERMINANT:
        return kind
    for j in range(6):
        newton.held[j] = 0.0
    for joint in range(6):
        reached = walk_to_seed(query, branches, joint)
        newton.held[joint] = 1.0 if reached > ALONE else 0.0
        kind = max(kind, reached)
    return kind


def walk_to_seed(query: PoseQuery, branches: BranchWork, joint: int) -> float:
    """Move a joint of newton.q to the seed's angle, while those that are not held follow; what newton.q is, if they do.

    Where they cannot at the first step, or later, newton.q is left where it was.
    """
    newton, begin = branches.newton, branches.row
    q = newton.q
    for j in range(6):
        begin[j] = q[j]
    away = query.seed[joint] - begin[joint]
    away -= TURN * math.floor(away / TURN + 0.5)
    step = away / WALK if abs(away) > SHORTEST_WALK else SHORTEST_WALK
    newton.held[joint] = 1.0
    for n in range(WALK):
        q[joint] = begin[joint] + (n + 1) * step
        closed = least_squares(query.chain, query.T, newton, WALK_STEPS)
        position, orientation = errors(query.chain, query.T, q)
        if not closed or max(position, orientation) > CONTINUUM_CLOSURE:
            for j in range(6):
                q[j] = begin[j]
            return ALONE if n == 0 else ENDS
    return AT_SEED
