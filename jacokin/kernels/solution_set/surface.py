"""F(x; p), the one equation of six joints, along the parameter p by which their target turns about an axis.

All sines and cosines of a target that turns are of first degree in those of p, so that F is a trigonometric polynomial
in p as well: of degree 8 for a Jaco and for spherical wrists, and of degree 18 at most for any arm, once it is made of
minors of the equations (`scale_of`). A few values of p tell it at all others, with exact derivatives.
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
from jacokin.kernels.six_joints.equations import Equations, P, make_equations, still_place, write_equations
from jacokin.kernels.six_joints.loop import Form, fill_links
from jacokin.kernels.six_joints.spherical_wrist import fill_both_turns, fill_quartic, reach_of
from jacokin.kernels.solution_set.slices import SixJoints, turn_target
from jacokin.kernels.tolerances import DISTINCT
from jacokin.kernels.trigonometry import sin_cos

#: Waves of F in p at most, and those of a Jaco and of spherical wrists.
MOST_WAVES, FEW_WAVES = 18, 8
#: Numbers of F at one value of p: of cosines and sines of x, and one apart.
NUMBERS = 2 * DEGREE + 3
#: F may be much smaller at some p than at others, and is known here to its noise everywhere: less than so many times
#: that is worth determinants at p itself.
WELL_KNOWN = 1e8
#: [rad] half the width of windows in which determinants take less time than the table, until F is asked for so often.
NARROW, OFTEN = 0.4, 16
#: [rad] of the parameter, for slopes and bends of determinants.
ASIDE = 1e-4


class Surface(NamedTuple):
    """F at every p, and at the last one asked for."""

    table: Array  # (37, 19) parts of 1, cos p, sin p, cos 2 p, ... of cosine, then sine, then apart
    noise: Array  # (1,) of the values of that, the root mean square of the samples'
    waves: NDArray[np.int64]  # (3,) waves in p, whether the last F is from the table, and how often it was not filled
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
        np.zeros(3, np.int64),
        np.zeros(NUMBERS),
        np.zeros(DEGREE + 1),
        np.zeros(DEGREE + 1),
        np.zeros((2, 2 * DEGREE)),
        np.zeros(3),
        np.zeros((3, 2 * DEGREE + 1, 2)),
        make_equations(),
        make_determinant(),
    )


def begin_surface(k: ArmConstants, six: SixJoints, width: float, F: Surface) -> None:
    """Begin with a target: the table is filled at once, or in a window of half a small width when it is worth it."""
    has_few = k.six.form == Form.SPHERICAL_WRIST or k.six.scale == 0.0
    F.waves[0], F.waves[2], F.noise[0] = FEW_WAVES if has_few else MOST_WAVES, 0, math.inf
    if has_few or width >= NARROW:
        fill_surface(k, six, F)


def fill_surface(k: ArmConstants, six: SixJoints, F: Surface) -> None:
    """Fill the table from as many values of p as it has rows."""
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
    elif k.six.scale == 0.0:
        noise = fourier_of_F(k, pose_of(six.arm, k, six.turned), F.cosine, F.sine, F.samples)
    else:
        noise = fill_determinant(k, six, F, p, k.six.own)
        scale = scale_of(F.equations)
    for n in range(DEGREE + 1):
        F.row[n], F.row[DEGREE + 1 + n] = scale * F.cosine[n], scale * F.sine[n]
    F.row[NUMBERS - 1] = apart
    return scale * noise


def scale_of(e: Equations) -> float:
    """What makes a determinant of the equations one of their minors, which are polynomials in the target.

    Its rows are unit vectors orthogonal to two real columns and to three complex ones, each taken twice: the minors are
    as long as the columns span, and each of the complex ones stands for two rows.
    """
    a, b, ab = 0.0, 0.0, 0.0
    for j in range(6):
        x, y = e.right[0, still_place(j)], e.right[1, still_place(j)]
        a, b, ab = a + x * x, b + y * y, ab + x * y
    square = gram_of_three(e)
    return (a * b - ab * ab) * square * square


def gram_of_three(e: Equations) -> float:
    """The square of what the three complex columns (4,) of theta_2 span: Gram's determinant."""
    g00, g11, g22 = 0.0, 0.0, 0.0
    g01, g02, g12 = 0.0j, 0.0j, 0.0j
    for v in range(4):
        x = complex(e.right[0, P + 3 * v], e.right[0, P + 3 * v + 1])
        y = complex(e.right[1, P + 3 * v], e.right[1, P + 3 * v + 1])
        z = complex(e.right[2, P + 3 * v], e.right[2, P + 3 * v + 1])
        g00 += x.real * x.real + x.imag * x.imag
        g11 += y.real * y.real + y.imag * y.imag
        g22 += z.real * z.real + z.imag * z.imag
        g01 += x * y.conjugate()
        g02 += x * z.conjugate()
        g12 += y * z.conjugate()
    product = 2.0 * (g01 * g12 * g02.conjugate()).real
    return float(g00 * g11 * g22 + product - g00 * abs(g12) ** 2 - g11 * abs(g02) ** 2 - g22 * abs(g01) ** 2)


def fill_F(k: ArmConstants, six: SixJoints, F: Surface, p: float, labelling: int) -> float:
    """Fill cosine and sine with the coefficients of F(x; p), up to a positive factor; returns the noise of its values.

    In the way that suits the arm, or in a labelling of its joints as those of any arm; -1 for the former. Of a
    spherical wrist, F is then about where the wrist is: each root goes with two solutions.
    """
    F.waves[1] = 0
    if labelling < 0 and F.noise[0] == math.inf:
        F.waves[2] += 1
        if F.waves[2] > OFTEN:
            fill_surface(k, six, F)
    if labelling < 0 and F.noise[0] < math.inf:
        F.apart[0] = fill_waves(F, p, 0)
        if F.waves[0] == FEW_WAVES or size_of(F.cosine, F.sine) > WELL_KNOWN * F.noise[0]:
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
    return fourier_of_determinant(F.equations, F.determinant, F.cosine, F.sine)


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


def size_of(cosine: Array, sine: Array) -> float:
    """An upper bound of the values of F."""
    total = 0.0
    for n in range(DEGREE + 1):
        total += abs(cosine[n]) + abs(sine[n])
    return total
