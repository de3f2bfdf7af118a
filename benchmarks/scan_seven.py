"""All configurations of a seven-joint Jaco at given values of joint 3, by textbook subproblems in NumPy.

Written apart from the package's closed form, to be held against it: products of exponentials about the axes at q = 0
that Pinocchio gives, and Paden and Kahan's subproblems (Murray, Li, Sastry: A Mathematical Introduction to Robotic
Manipulation, 1994, chapter 3.3), for many values of joint 3 at a time.
"""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from jacokin import Robot
from jacokin.arrays import Array


class Scan:
    """The axes of one arm at q = 0, and what its poses are reached with."""

    def __init__(self, robot: Robot, frame: str | None = None) -> None:
        """Take axes and points from Pinocchio."""
        zero = np.zeros(robot.dof)
        self._home = robot.forward_kinematics(zero, frame or robot.default_frame).homogeneous
        model = robot.pin_model
        data = model.createData()
        pin.forwardKinematics(model, data, zero)
        placements = [data.oMi[i + 1] for i in range(7)]
        self._axes = np.array([placement.rotation[:, 2] for placement in placements])
        self._points = np.array([placement.translation for placement in placements])
        self._shoulder = _meeting(self._points[0], self._axes[0], self._points[1], self._axes[1])
        self._wrist = _meeting(self._points[4], self._axes[4], self._points[5], self._axes[5])

    def configurations(self, T: Array, q3: Array) -> Array:
        """Joint angles (n, 8, 7) in [-pi, pi] [rad] that reach T (4, 4) with joint 3 at q3 (n,); nan where none."""
        n = len(q3)
        G = T @ np.linalg.inv(self._home)
        w, meet, W = self._axes, self._shoulder, self._wrist
        reached = G[:3, :3] @ W + G[:3, 3]
        found = np.full((n, 8, 7), np.nan)
        R3 = _rotations(w[2], q3)
        seen = self._points[2] + np.einsum("nji,j->ni", R3, meet - self._points[2])  # the shoulder before joint 3 turns
        with np.errstate(invalid="ignore"):
            for a, q4 in enumerate(_to_distance(w[3], self._points[3], W, seen, float(np.linalg.norm(reached - meet)))):
                R4 = _rotations(w[3], q4)
                X = self._points[3] + np.einsum("nij,j->ni", R4, W - self._points[3])
                X = self._points[2] + np.einsum("nij,nj->ni", R3, X - self._points[2])
                goal = np.broadcast_to(reached - meet, X.shape)
                for b, (q1, q2) in enumerate(_two_turns(w[0], w[1], X - meet, goal)):
                    R = _rotations(w[0], q1) @ _rotations(w[1], q2) @ R3 @ R4
                    rest = np.einsum("nji,jk->nik", R, G[:3, :3])
                    start = np.broadcast_to(w[6], X.shape)
                    for c, (q5, q6) in enumerate(_two_turns(w[4], w[5], start, rest @ w[6])):
                        left = np.einsum("nji,njk->nik", _rotations(w[4], q5) @ _rotations(w[5], q6), rest)
                        side = _square_to(w[6])
                        q7 = _turn(w[6], np.broadcast_to(side, X.shape), left @ side)
                        row = 4 * a + 2 * b + c
                        found[:, row] = np.column_stack([q1, q2, q3, q4, q5, q6, q7])
        found[np.isnan(found).any(axis=2)] = np.nan
        return found


def within_limits(robot: Robot, q: Array, slack: float = 0.0) -> NDArray[np.bool_]:
    """Which configurations (..., 7) have a copy within the limits of the arm."""
    limited = ~robot.unlimited
    lower, upper = robot.lower[limited], robot.upper[limited]
    apart = np.abs((q[..., limited] - 0.5 * (lower + upper) + np.pi) % (2.0 * np.pi) - np.pi)
    inside: NDArray[np.bool_] = np.asarray((apart <= 0.5 * (upper - lower) + slack).all(axis=-1))
    return inside


def distances(robot: Robot, q: Array, seed: Array) -> Array:
    """Distances (...) of configurations (..., 7) within the limits from a seed (7,), circular on unlimited joints."""
    middle = seed.copy()
    limited = ~robot.unlimited
    middle[limited] = 0.5 * (robot.lower[limited] + robot.upper[limited])
    copies = (q - middle + np.pi) % (2.0 * np.pi) - np.pi + middle
    apart: Array = np.linalg.norm(copies - seed, axis=-1)
    return apart


def _meeting(p: Array, u: Array, q: Array, v: Array) -> Array:
    """The point nearest to two lines."""
    s, t = np.linalg.lstsq(np.column_stack([u, -v]), q - p, rcond=None)[0]
    middle: Array = 0.5 * (p + s * u + q + t * v)
    return middle


def _square_to(axis: Array) -> Array:
    """A unit vector square to another."""
    v = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    side: Array = v / np.linalg.norm(v)
    return side


def _rotations(axis: Array, angles: Array) -> Array:
    """Rotations (n, 3, 3) about an axis (3,) (Rodrigues)."""
    K = pin.skew(axis)
    s, c = np.sin(angles)[:, None, None], np.cos(angles)[:, None, None]
    turned: Array = np.eye(3) + s * K + (1.0 - c) * (K @ K)
    return turned


def _turn(axis: Array, start: Array, end: Array) -> Array:
    """Angles (n,) about an axis that bring directions (n, 3) to others (subproblem 1)."""
    u = start - (start @ axis)[:, None] * axis
    v = end - (end @ axis)[:, None] * axis
    angle: Array = np.arctan2(np.cross(u, v) @ axis, np.einsum("ni,ni->n", u, v))
    return angle


def _two_turns(first: Array, second: Array, start: Array, end: Array) -> list[tuple[Array, Array]]:
    """Both pairs of angles about axes that meet in the origin, second axis first (subproblem 2)."""
    g = float(first @ second)
    a, b = end @ first, start @ second
    alpha, beta = (g * b - a) / (g * g - 1.0), (g * a - b) / (g * g - 1.0)
    normal = np.cross(first, second)
    square = np.einsum("ni,ni->n", start, start) - alpha**2 - beta**2 - 2.0 * alpha * beta * g
    gamma = np.sqrt(square / float(normal @ normal))
    pairs = []
    for sign in (1.0, -1.0):
        z = alpha[:, None] * first + beta[:, None] * second + sign * gamma[:, None] * normal
        pairs.append((_turn(first, z, end), _turn(second, start, z)))
    return pairs


def _to_distance(axis: Array, point: Array, start: Array, goals: Array, distance: float) -> list[Array]:
    """Both angles about an axis that bring a point to a distance from goals (n, 3) (subproblem 3)."""
    u, v = start - point, goals - point
    along = (u @ axis) - v @ axis
    u, v = u - (u @ axis) * axis, v - (v @ axis)[:, None] * axis
    square = distance**2 - along**2
    between = np.arctan2(np.cross(u, v) @ axis, v @ u)
    nu, nv = np.linalg.norm(u), np.linalg.norm(v, axis=1)
    half = np.arccos((nu**2 + nv**2 - square) / (2.0 * nu * nv))
    return [between + half, between - half]
