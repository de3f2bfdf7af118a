"""Joint torques and mass matrices at many configurations, in the axes of the base.

Sources: Luh, Walker, Paul, On-line computational scheme for mechanical manipulators, J. Dyn. Sys. Meas. Control 102(2),
1980; Walker, Orin, Efficient dynamic computer simulation of robotic mechanisms, same journal 104(3), 1982. Moments are
about the origin of each joint's own frame, so that nothing is lost where an arm stands far from its base.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from jacokin.arrays import Array
from jacokin.kernels.configurations.arm import LANES, Arm, Block, make_arm, make_block, place_joints


class Bodies(NamedTuple):
    """What each joint moves up to the next one."""

    parameters: Array  # (joints, 10) mass [kg], mass times centre (3) [kg m], inertia about the frame xx xy yy xz yz zz
    armature: Array  # (joints,) [kg m^2] or [kg]


class TorqueWork(NamedTuple):
    """Arrays of `find_torques`."""

    arm: Arm
    bodies: Bodies
    q: Array  # (n * joints,) [rad] or [m]
    v: Array  # (n * joints,)
    a: Array  # (n * joints,)
    gravity: Array  # (3,) [m/s^2]
    block: Block
    rates: Array  # (2, LANES) of one joint
    motion: Array  # (9, LANES) of the last body: angular velocity and acceleration, acceleration of its origin
    wrenches: Array  # (joints, 6, LANES) on each body: force [N], then moment about the joint's origin [N m]
    torques: Array  # (n * joints,) written


class MassWork(NamedTuple):
    """Arrays of `find_mass_matrices`."""

    arm: Arm
    bodies: Bodies
    q: Array  # (n * joints,) [rad] or [m]
    block: Block
    moved: Array  # (10, LANES) what a joint moves: mass, mass times centre, inertia, in base axes about its origin
    wrench: Array  # (6, LANES) that accelerates it
    row: Array  # (LANES,) one entry of the matrices
    matrices: Array  # (n * joints * joints,) written


def make_bodies() -> Bodies:
    """Arrays of any length."""
    return Bodies(np.empty((0, 10)), np.empty(0))


def make_torque_work() -> TorqueWork:
    """Arrays of any length."""
    return TorqueWork(
        make_arm(),
        make_bodies(),
        np.empty(0),
        np.empty(0),
        np.empty(0),
        np.empty(3),
        make_block(),
        np.empty((2, LANES)),
        np.empty((9, LANES)),
        np.empty((0, 6, LANES)),
        np.empty(0),
    )


def make_mass_work() -> MassWork:
    """Arrays of any length."""
    return MassWork(
        make_arm(),
        make_bodies(),
        np.empty(0),
        make_block(),
        np.empty((10, LANES)),
        np.empty((6, LANES)),
        np.empty(LANES),
        np.empty(0),
    )


def find_torques(work: TorqueWork) -> int:
    """Write the torques of motions: M(q) a + C(q, v) v + g(q); returns how many."""
    joints = len(work.arm.sliding)
    n = len(work.q) // joints
    for first in range(0, n, LANES):
        place_joints(work.arm, work.q, first, work.block)
        for i in range(LANES):
            for k in range(6):
                work.motion[k, i] = 0.0
            for k in range(3):
                work.motion[6 + k, i] = -work.gravity[k]
        for j in range(joints):
            for i in range(LANES):
                at = min(first + i, n - 1) * joints + j
                work.rates[0, i] = work.v[at]
                work.rates[1, i] = work.a[at]
            carry_along(work.block.places, j, work.motion)
            if work.arm.sliding[j] != 0.0:
                move_sliding(work.block.places, j, work.rates, work.motion)
            else:
                move_turning(work.block.places, j, work.rates, work.motion)
            load_body(work.bodies.parameters, work.block.places, j, work.motion, work.wrenches)
        for j in range(joints - 1, -1, -1):
            row = 0 if work.arm.sliding[j] != 0.0 else 3
            for i in range(min(LANES, n - first)):
                at = (first + i) * joints + j
                work.torques[at] = (
                    work.block.places[j + 1, 6, i] * work.wrenches[j, row, i]
                    + work.block.places[j + 1, 7, i] * work.wrenches[j, row + 1, i]
                    + work.block.places[j + 1, 8, i] * work.wrenches[j, row + 2, i]
                    + work.bodies.armature[j] * work.a[at]
                )
            if j > 0:
                hand_down(work.block.places, j, work.wrenches)
    return n


def carry_along(places: Array, j: int, motion: Array) -> None:
    """Carry the acceleration of the body before joint j from its origin to that of the joint, as if they were one."""
    for i in range(LANES):
        x = places[j + 1, 9, i] - places[j, 9, i]
        y = places[j + 1, 10, i] - places[j, 10, i]
        z = places[j + 1, 11, i] - places[j, 11, i]
        wx, wy, wz = motion[0, i], motion[1, i], motion[2, i]
        ax, ay, az = motion[3, i], motion[4, i], motion[5, i]
        vx, vy, vz = wy * z - wz * y, wz * x - wx * z, wx * y - wy * x
        motion[6, i] += ay * z - az * y + wy * vz - wz * vy
        motion[7, i] += az * x - ax * z + wz * vx - wx * vz
        motion[8, i] += ax * y - ay * x + wx * vy - wy * vx


def move_turning(places: Array, j: int, rates: Array, motion: Array) -> None:
    """Add what joint j, which turns, does."""
    for i in range(LANES):
        x, y, z = places[j + 1, 6, i], places[j + 1, 7, i], places[j + 1, 8, i]
        wx, wy, wz = motion[0, i], motion[1, i], motion[2, i]
        v, a = rates[0, i], rates[1, i]
        motion[3, i] += a * x + v * (wy * z - wz * y)
        motion[4, i] += a * y + v * (wz * x - wx * z)
        motion[5, i] += a * z + v * (wx * y - wy * x)
        motion[0, i] = wx + v * x
        motion[1, i] = wy + v * y
        motion[2, i] = wz + v * z


def move_sliding(places: Array, j: int, rates: Array, motion: Array) -> None:
    """Add what joint j, which slides, does."""
    for i in range(LANES):
        x, y, z = places[j + 1, 6, i], places[j + 1, 7, i], places[j + 1, 8, i]
        wx, wy, wz = motion[0, i], motion[1, i], motion[2, i]
        v, a = 2.0 * rates[0, i], rates[1, i]
        motion[6, i] += a * x + v * (wy * z - wz * y)
        motion[7, i] += a * y + v * (wz * x - wx * z)
        motion[8, i] += a * z + v * (wx * y - wy * x)


def load_body(parameters: Array, places: Array, j: int, motion: Array, wrenches: Array) -> None:
    """Write the wrench that moves body j."""
    m, mx, my, mz = parameters[j, 0], parameters[j, 1], parameters[j, 2], parameters[j, 3]
    xx, xy, yy = parameters[j, 4], parameters[j, 5], parameters[j, 6]
    xz, yz, zz = parameters[j, 7], parameters[j, 8], parameters[j, 9]
    for i in range(LANES):
        r0, r1, r2 = places[j + 1, 0, i], places[j + 1, 1, i], places[j + 1, 2, i]
        r3, r4, r5 = places[j + 1, 3, i], places[j + 1, 4, i], places[j + 1, 5, i]
        r6, r7, r8 = places[j + 1, 6, i], places[j + 1, 7, i], places[j + 1, 8, i]
        wx, wy, wz = motion[0, i], motion[1, i], motion[2, i]
        ax, ay, az = motion[3, i], motion[4, i], motion[5, i]
        bx, by, bz = motion[6, i], motion[7, i], motion[8, i]
        cx, cy, cz = r0 * mx + r3 * my + r6 * mz, r1 * mx + r4 * my + r7 * mz, r2 * mx + r5 * my + r8 * mz
        vx, vy, vz = wy * cz - wz * cy, wz * cx - wx * cz, wx * cy - wy * cx
        wrenches[j, 0, i] = m * bx + (ay * cz - az * cy) + (wy * vz - wz * vy)
        wrenches[j, 1, i] = m * by + (az * cx - ax * cz) + (wz * vx - wx * vz)
        wrenches[j, 2, i] = m * bz + (ax * cy - ay * cx) + (wx * vy - wy * vx)
        # In the body's own axes: angular velocity u and acceleration e.
        ux, uy, uz = r0 * wx + r1 * wy + r2 * wz, r3 * wx + r4 * wy + r5 * wz, r6 * wx + r7 * wy + r8 * wz
        ex, ey, ez = r0 * ax + r1 * ay + r2 * az, r3 * ax + r4 * ay + r5 * az, r6 * ax + r7 * ay + r8 * az
        hx, hy, hz = xx * ux + xy * uy + xz * uz, xy * ux + yy * uy + yz * uz, xz * ux + yz * uy + zz * uz
        nx = xx * ex + xy * ey + xz * ez + (uy * hz - uz * hy)
        ny = xy * ex + yy * ey + yz * ez + (uz * hx - ux * hz)
        nz = xz * ex + yz * ey + zz * ez + (ux * hy - uy * hx)
        wrenches[j, 3, i] = r0 * nx + r3 * ny + r6 * nz + (cy * bz - cz * by)
        wrenches[j, 4, i] = r1 * nx + r4 * ny + r7 * nz + (cz * bx - cx * bz)
        wrenches[j, 5, i] = r2 * nx + r5 * ny + r8 * nz + (cx * by - cy * bx)


def hand_down(places: Array, j: int, wrenches: Array) -> None:
    """Add the wrench on body j to that on the body before, which carries it."""
    for i in range(LANES):
        x = places[j + 1, 9, i] - places[j, 9, i]
        y = places[j + 1, 10, i] - places[j, 10, i]
        z = places[j + 1, 11, i] - places[j, 11, i]
        fx, fy, fz = wrenches[j, 0, i], wrenches[j, 1, i], wrenches[j, 2, i]
        wrenches[j - 1, 0, i] += fx
        wrenches[j - 1, 1, i] += fy
        wrenches[j - 1, 2, i] += fz
        wrenches[j - 1, 3, i] += wrenches[j, 3, i] + (y * fz - z * fy)
        wrenches[j - 1, 4, i] += wrenches[j, 4, i] + (z * fx - x * fz)
        wrenches[j - 1, 5, i] += wrenches[j, 5, i] + (x * fy - y * fx)


def find_mass_matrices(work: MassWork) -> int:
    """Write mass matrices; returns how many."""
    joints = len(work.arm.sliding)
    n = len(work.q) // joints
    for first in range(0, n, LANES):
        place_joints(work.arm, work.q, first, work.block)
        for k in range(10):
            for i in range(LANES):
                work.moved[k, i] = 0.0
        for j in range(joints - 1, -1, -1):
            if j < joints - 1:
                shift(work.block.places, j, work.moved)
            add_body(work.bodies.parameters, work.block.places, j, work.moved)
            accelerate(work.block.places, j, work.arm.sliding[j], work.moved, work.wrench)
            for k in range(j + 1):
                feel(work.block.places, j, k, work.arm.sliding[k], work.wrench, work.row)
                more = work.bodies.armature[j] if k == j else 0.0
                for i in range(min(LANES, n - first)):
                    entry = work.row[i] + more
                    work.matrices[((first + i) * joints + j) * joints + k] = entry
                    work.matrices[((first + i) * joints + k) * joints + j] = entry
    return n


def shift(places: Array, j: int, moved: Array) -> None:
    """Carry what joint j + 1 moves to the origin of joint j."""
    for i in range(LANES):
        x = places[j + 2, 9, i] - places[j + 1, 9, i]
        y = places[j + 2, 10, i] - places[j + 1, 10, i]
        z = places[j + 2, 11, i] - places[j + 1, 11, i]
        m, cx, cy, cz = moved[0, i], moved[1, i], moved[2, i], moved[3, i]
        # The terms of d c^T + c d^T + m d d^T, with halves of m d beside c.
        px, py, pz = cx + 0.5 * m * x, cy + 0.5 * m * y, cz + 0.5 * m * z
        sx, sy, sz = 2.0 * x * px, 2.0 * y * py, 2.0 * z * pz
        moved[4, i] += sy + sz
        moved[5, i] -= x * py + y * px
        moved[6, i] += sx + sz
        moved[7, i] -= x * pz + z * px
        moved[8, i] -= y * pz + z * py
        moved[9, i] += sx + sy
        moved[1, i] = cx + m * x
        moved[2, i] = cy + m * y
        moved[3, i] = cz + m * z


def add_body(parameters: Array, places: Array, j: int, moved: Array) -> None:
    """Add body j to what joint j moves."""
    m, mx, my, mz = parameters[j, 0], parameters[j, 1], parameters[j, 2], parameters[j, 3]
    xx, xy, yy = parameters[j, 4], parameters[j, 5], parameters[j, 6]
    xz, yz, zz = parameters[j, 7], parameters[j, 8], parameters[j, 9]
    for i in range(LANES):
        r0, r1, r2 = places[j + 1, 0, i], places[j + 1, 1, i], places[j + 1, 2, i]
        r3, r4, r5 = places[j + 1, 3, i], places[j + 1, 4, i], places[j + 1, 5, i]
        r6, r7, r8 = places[j + 1, 6, i], places[j + 1, 7, i], places[j + 1, 8, i]
        moved[0, i] += m
        moved[1, i] += r0 * mx + r3 * my + r6 * mz
        moved[2, i] += r1 * mx + r4 * my + r7 * mz
        moved[3, i] += r2 * mx + r5 * my + r8 * mz
        # The rows of rotation times inertia.
        ax, ay, az = r0 * xx + r3 * xy + r6 * xz, r0 * xy + r3 * yy + r6 * yz, r0 * xz + r3 * yz + r6 * zz
        bx, by, bz = r1 * xx + r4 * xy + r7 * xz, r1 * xy + r4 * yy + r7 * yz, r1 * xz + r4 * yz + r7 * zz
        cx, cy, cz = r2 * xx + r5 * xy + r8 * xz, r2 * xy + r5 * yy + r8 * yz, r2 * xz + r5 * yz + r8 * zz
        moved[4, i] += ax * r0 + ay * r3 + az * r6
        moved[5, i] += ax * r1 + ay * r4 + az * r7
        moved[6, i] += bx * r1 + by * r4 + bz * r7
        moved[7, i] += ax * r2 + ay * r5 + az * r8
        moved[8, i] += bx * r2 + by * r5 + bz * r8
        moved[9, i] += cx * r2 + cy * r5 + cz * r8


def accelerate(places: Array, j: int, sliding: float, moved: Array, wrench: Array) -> None:
    """Write the wrench that gives what joint j moves a unit acceleration of that joint."""
    if sliding != 0.0:
        for i in range(LANES):
            x, y, z = places[j + 1, 6, i], places[j + 1, 7, i], places[j + 1, 8, i]
            m, cx, cy, cz = moved[0, i], moved[1, i], moved[2, i], moved[3, i]
            wrench[0, i] = m * x
            wrench[1, i] = m * y
            wrench[2, i] = m * z
            wrench[3, i] = cy * z - cz * y
            wrench[4, i] = cz * x - cx * z
            wrench[5, i] = cx * y - cy * x
        return
    for i in range(LANES):
        x, y, z = places[j + 1, 6, i], places[j + 1, 7, i], places[j + 1, 8, i]
        cx, cy, cz = moved[1, i], moved[2, i], moved[3, i]
        wrench[0, i] = y * cz - z * cy
        wrench[1, i] = z * cx - x * cz
        wrench[2, i] = x * cy - y * cx
        wrench[3, i] = moved[4, i] * x + moved[5, i] * y + moved[7, i] * z
        wrench[4, i] = moved[5, i] * x + moved[6, i] * y + moved[8, i] * z
        wrench[5, i] = moved[7, i] * x + moved[8, i] * y + moved[9, i] * z


def feel(places: Array, j: int, k: int, sliding: float, wrench: Array, row: Array) -> None:
    """Write the part of a wrench at the origin of joint j that joint k exerts."""
    if sliding != 0.0:
        for i in range(LANES):
            row[i] = (
                places[k + 1, 6, i] * wrench[0, i]
                + places[k + 1, 7, i] * wrench[1, i]
                + places[k + 1, 8, i] * wrench[2, i]
            )
        return
    for i in range(LANES):
        x = places[j + 1, 9, i] - places[k + 1, 9, i]
        y = places[j + 1, 10, i] - places[k + 1, 10, i]
        z = places[j + 1, 11, i] - places[k + 1, 11, i]
        fx, fy, fz = wrench[0, i], wrench[1, i], wrench[2, i]
        row[i] = (
            places[k + 1, 6, i] * (wrench[3, i] + (y * fz - z * fy))
            + places[k + 1, 7, i] * (wrench[4, i] + (z * fx - x * fz))
            + places[k + 1, 8, i] * (wrench[5, i] + (x * fy - y * fx))
        )
