"""F(x; p), the one equation of six joints, along the parameter p by which their target turns about an axis.

All sines and cosines of a target that turns are of first degree in those of p, so that F is a trigonometric polynomial
in p as well, of degree 8 as in x, and a few values of p tell it at all others, with exact derivatives. Of an arm of any
structure it is one once the rows of the equations are polynomials (`scale_of`), and may have a factor that does not
depend on x.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import ArmConstants, pose_of, unpack_arm
from jacokin.kernels.closed_form.resultant import DEGREE, fourier_of_F
from jacokin.kernels.limits import TURN
from jacokin.kernels.six_joints.characteristic import Determinant, fourier_of_determinant, make_determinant
from jacokin.kernels.six_joints.elbow_offset import fill_product, offset_arm_of
from jacokin.kernels.six_joints.equations import (
    Equations,
    area_of_columns,
    make_equations,
    turned_back_by,
    write_equations,
)
from jacokin.kernels.six_joints.loop import Form, fill_links
from jacokin.kernels.six_joints.planar_arm import fill_polynomial, noise_of_polynomial, planar_arm_of
from jacokin.kernels.six_joints.spherical_wrist import fill_both_turns, fill_quartic, reach_of
from jacokin.kernels.solution_set.slices import SixJoints, turn_target
from jacokin.kernels.tolerances import DISTINCT, UNCERTAIN
from jacokin.kernels.trigonometry import sin_cos
from jacokin.kernels.vector import dot

#: Waves of F in p at most: of a Jaco, spherical wrists and planar arms; and by the link of an arm of any structure that
#: has the target in it, from L_1 to L_6.
FEW_WAVES, MOST_WAVES = 8, 12
WAVES_OF_LINK = (10, FEW_WAVES, FEW_WAVES, MOST_WAVES, MOST_WAVES, FEW_WAVES)
#: Numbers of F at one value of p: of cosines and sines of x, and one apart.
NUMBERS = 2 * DEGREE + 3
#: F may be much smaller at some p than at others, and is known here to its noise everywhere: less than so many times
#: that is worth determinants at p itself.
WELL_KNOWN = 1e8
#: [rad] of the parameter, for slopes and bends of determinants.
ASIDE = 1e-4


class Surface(NamedTuple):
    """F at every p, and at the last one asked for."""

    table: Array  # (25, 19) parts of 1, cos p, sin p, cos 2 p, ... of cosine, then sine, then apart
    noise: Array  # (1,) of the values of that, the root mean square of the samples'
    waves: NDArray[np.int64]  # (2,) waves in p, and whether the last F is from the table
    row: Array  # (19,) the table's numbers at one p
    cosine: Array  # (9,) F at p
    sine: Array  # (9,)
    samples: Array  # (2, 16) values of F, see `fourier_of_F`
    apart: Array  # (3,) of F of a spherical wrist, see `fill_both_turns`; its first and second derivative by p
    powers: Array  # (3, 17, 2) coefficients in z = exp(i x) of F, and of its first and second derivative by p
    equations: Equations
    determinant: Determinant


def make_surface() -> Surface:
    """Fresh arrays."""
    return Surface(
        np.zeros((2 * MOST_WAVES + 1, NUMBERS)),
        np.zeros(1),
        np.zeros(2, np.int64),
        np.zeros(NUMBERS),
        np.zeros(DEGREE + 1),
        np.zeros(DEGREE + 1),
        np.zeros((2, 2 * DEGREE)),
        np.zeros(3),
        np.zeros((3, 2 * DEGREE + 1, 2)),
        make_equations(),
        make_determinant(),
    )


def fill_surface(k: ArmConstants, six: SixJoints, F: Surface) -> None:
    """Fill the table of a target from as many values of p as it has rows."""
    F.waves[0] = WAVES_OF_LINK[link_of_target(k.six.own)] if has_any_structure(k) else FEW_WAVES
    size, total = 2 * F.waves[0] + 1, 0.0
    for i in range(size):
        for j in range(NUMBERS):
            F.table[i, j] = 0.0
    for n in range(size):
        noise = fill_sample(k, six, F, TURN * n / size)
        total += noise * noise
        for m in range(F.waves[0] + 1):
            s, c = sin_cos(TURN * (m * n % size) / size)
            c, s = (1.0 if m == 0 else 2.0) * c / size, 2.0 * s / size
            for j in range(NUMBERS):
                if m > 0:
                    F.table[2 * m - 1, j] += c * F.row[j]
                    F.table[2 * m, j] += s * F.row[j]
                else:
                    F.table[0, j] += c * F.row[j]
    F.noise[0] = math.sqrt(total / size)


def has_any_structure(k: ArmConstants) -> bool:
    """Whether F of an arm is a determinant: of others, it comes in closed form."""
    return bool(k.six.scale > 0.0 and k.six.form in (Form.GENERAL, Form.PARALLEL_AXES))


def solutions_of_root(k: ArmConstants) -> int:
    """How many solutions go with each root of F, of those that it tells of."""
    return 2 if k.six.form in (Form.SPHERICAL_WRIST, Form.PLANAR_ARM) else 1


def fill_sample(k: ArmConstants, six: SixJoints, F: Surface, p: float) -> float:
    """Fill row with F(x; p), from the target; returns the noise of its values."""
    noise, scale, apart = 0.0, 1.0, 0.0
    turn_target(six.T, six.axis, p, six.turned)
    if k.six.form == Form.SPHERICAL_WRIST:
        fill_links(six.chain, six.turned, k.six.scale, k.six.form_labelling, F.equations.links)
        reach = reach_of(k.six, F.equations.links)
        if abs(reach.cross) < DISTINCT:
            noise, apart = fill_both_turns(reach, F.cosine, F.sine)
        else:
            _, _, noise = fill_quartic(reach, F.cosine, F.sine)
    elif k.six.form == Form.PLANAR_ARM:
        fill_links(six.chain, six.turned, k.six.scale, k.six.form_labelling, F.equations.links)
        size = fill_polynomial(planar_arm_of(F.equations.links), F.cosine, F.sine)
        noise = noise_of_polynomial(k.six, size)
    elif k.six.form == Form.ELBOW_OFFSET:
        fill_links(six.chain, six.turned, k.six.scale, k.six.form_labelling, F.equations.links)
        size = fill_product(offset_arm_of(F.equations.links), F.cosine, F.sine)
        noise = noise_of_polynomial(k.six, size)
    elif k.six.scale == 0.0:
        noise = fourier_of_F(k, pose_of(six.arm, k, six.turned), F.cosine, F.sine, F.samples)
    else:
        noise = fill_determinant(k, six, F, p, k.six.own)
        scale = scale_of(F.equations)
    for n in range(DEGREE + 1):
        F.row[n], F.row[DEGREE + 1 + n] = scale * F.cosine[n], scale * F.sine[n]
    F.row[NUMBERS - 1] = apart
    return scale * noise


def link_of_target(labelling: int) -> int:
    """The index of the link of a labelling that has the target in it."""
    return (5 - labelling) % 6 if labelling < 6 else labelling - 6


def scale_of(e: Equations) -> float:
    """What makes a determinant of the equations, whose rows are unit vectors, one of rows that are polynomials.

    Four rows are orthogonal to two real columns, and their minors are as long as what these span. Two are the real and
    imaginary part of a vector that `square_of_null` tells. Each row is in the determinant twice.
    """
    _, area = area_of_columns(e)
    square = square_of_null(e)
    return area * square * square


def square_of_null(e: Equations) -> float:
    """The square of the length of a complex vector (4,) orthogonal to the columns of theta_2, a polynomial.

    For all theta_1, p lies on a sphere and l is a tangent of it: h (p - c).(p - c) + 2 g u.(p - c) is constant, with u
    along axis 1, c a point of it, and h and g the numbers x + i y of both. The x + i y of its gradient is h p, without
    a constant, so that the condition on l times the x + i y of p, minus that on p times that of l, is one on P, L, M
    and K. It is of first degree in the target, where minors of the columns are of third.
    """
    first, last = e.links[0], e.links[5]
    u, w = (first[2, 0], first[2, 1], first[2, 2]), (last[2, 0], last[2, 1], last[2, 2])
    c = turned_back_by(first, (-first[0, 3], -first[1, 3], -first[2, 3]))
    t = turned_back_by(last, (-last[0, 3], -last[1, 3], -last[2, 3]))
    along_p, along_l = 2.0 * w[2], 2.0 * dot(t, w)
    rest_g, rest_h = 2.0 * (t[2] + dot(u, c)), dot(t, t) - dot(c, c)
    total = 0.0
    for i in range(2):  # real and imaginary parts
        g, h = c[i], u[i]
        values = (along_p * g + along_l * h, rest_g * g + rest_h * h, 2.0 * (g * u[2] - h * c[2]), h)
        for value in values:
            total += value * value
    return total


def fill_F(k: ArmConstants, six: SixJoints, F: Surface, p: float, labelling: int) -> float:
    """Fill cosine and sine with the coefficients of F(x; p), up to a positive factor; returns the noise of its values.

    In the way that suits the arm, or in a labelling of its joints as those of any arm; -1 for the former. Of a
    spherical wrist, F is then about where the wrist is, of a planar arm about joint 6: each root goes with two
    solutions.
    """
    F.waves[1] = 0
    if labelling < 0:
        F.apart[0] = fill_waves(F, p, 0)
        if not has_any_structure(k) or size_of(F.cosine, F.sine) > WELL_KNOWN * F.noise[0]:
            F.waves[1] = 1
            return float(F.noise[0])
    return fill_at(k, six, F, p, labelling)


def fill_at(k: ArmConstants, six: SixJoints, F: Surface, p: float, labelling: int) -> float:
    """Fill cosine and sine with the coefficients of F(x; p) from determinants at p; returns the noise of its values."""
    if labelling < 0:
        return fill_determinant(k, six, F, p, k.six.own)
    return fill_determinant(unpack_arm(six.general), six, F, p, labelling)


def fill_determinant(k: ArmConstants, six: SixJoints, F: Surface, p: float, labelling: int) -> float:
    """Fill cosine and sine with the coefficients of F(x; p) of an arm in a labelling; returns their noise."""
    fill_equations(k, six, F, p, labelling)
    return fourier_of_determinant(F.equations, F.determinant, F.cosine, F.sine)[0]


def fill_equations(k: ArmConstants, six: SixJoints, F: Surface, p: float, labelling: int) -> None:
    """Fill the equations of an arm in a labelling, -1 for its own, at a value of the parameter."""
    turn_target(six.T, six.axis, p, six.turned)
    fill_links(six.chain, six.turned, k.six.scale, labelling if labelling >= 0 else k.six.own, F.equations.links)
    write_equations(F.equations)


def fill_waves(F: Surface, p: float, order: int) -> float:
    """Fill cosine and sine with the coefficients of F(x; p), or of its derivative of an order by p, from the table.

    Returns:
        The same of what `fill_both_turns` tells.
    """
    row = F.row
    s1, c1 = sin_cos(p)
    c, s = 1.0, 0.0
    for j in range(NUMBERS):
        row[j] = F.table[0, j] if order == 0 else 0.0
    for m in range(1, F.waves[0] + 1):
        c, s = c * c1 - s * s1, s * c1 + c * s1
        a, b = c, s  # of cos(m p) and sin(m p): their derivatives
        if order == 1:
            a, b = -m * s, m * c
        elif order == 2:
            a, b = -m * m * c, -m * m * s
        for j in range(NUMBERS):
            row[j] += a * F.table[2 * m - 1, j] + b * F.table[2 * m, j]
    for j in range(DEGREE + 1):
        F.cosine[j], F.sine[j] = row[j], row[DEGREE + 1 + j]
    return float(row[NUMBERS - 1])


def fill_rates(k: ArmConstants, six: SixJoints, F: Surface, p: float, labelling: int, noise: float) -> float:
    """Fill powers with F at p, of which the cosines and sines are at hand, and its derivatives by p.

    Returns:
        The noise of the second derivative, from that of F.
    """
    powers = F.powers
    if F.waves[1] > 0:
        for order in range(2, -1, -1):
            F.apart[order] = fill_waves(F, p, order)
            fill_powers(F, order)
        return float(F.waves[0] * F.waves[0] * noise)
    F.apart[0] = 0.0
    fill_powers(F, 0)
    fill_at(k, six, F, p - ASIDE, labelling)
    fill_powers(F, 1)
    fill_at(k, six, F, p + ASIDE, labelling)
    fill_powers(F, 2)
    for m in range(2 * DEGREE + 1):
        for i in range(2):
            now, low, high = powers[0, m, i], powers[1, m, i], powers[2, m, i]
            powers[1, m, i], powers[2, m, i] = 0.5 * (high - low) / ASIDE, (high - 2.0 * now + low) / ASIDE**2
    return 4.0 * noise / ASIDE**2


def fill_powers(F: Surface, row: int) -> None:
    """Fill a row with the coefficients of z^8 F, of which the cosines and sines are at hand."""
    powers = F.powers[row]
    powers[DEGREE, 0], powers[DEGREE, 1] = F.cosine[0], 0.0
    for m in range(1, DEGREE + 1):
        powers[DEGREE + m, 0], powers[DEGREE + m, 1] = 0.5 * F.cosine[m], -0.5 * F.sine[m]
        powers[DEGREE - m, 0], powers[DEGREE - m, 1] = 0.5 * F.cosine[m], 0.5 * F.sine[m]


def size_at(k: ArmConstants, six: SixJoints, F: Surface, p: float) -> float:
    """An upper bound of the values of F(x; p), as large beside those at other p as the table has them; 0 in noise."""
    fill_waves(F, p, 0)
    noise = F.noise[0]
    if not size_of(F.cosine, F.sine) > WELL_KNOWN * noise:
        noise = fill_sample(k, six, F, p)
    size = size_of(F.row[: DEGREE + 1], F.row[DEGREE + 1 : NUMBERS - 1])
    return size if size > UNCERTAIN * noise else 0.0


def size_of(cosine: Array, sine: Array) -> float:
    """An upper bound of the values of F."""
    total = 0.0
    for n in range(DEGREE + 1):
        total += abs(cosine[n]) + abs(sine[n])
    return total
