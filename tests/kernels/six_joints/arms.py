"""Arms of many structures from Denavit-Hartenberg numbers, and every configuration of one by brute force."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.ik.closed_form import ClosedForm

H = np.pi / 2
_rng = np.random.default_rng(7)
#: a [m], d [m], alpha [rad], one for each joint; makers' data sheets, rounded where they differ.
ARMS: dict[str, tuple[list[float], list[float], list[float]]] = {
    "generic": ([*_rng.uniform(0.1, 0.5, 6)], [*_rng.uniform(0.1, 0.5, 6)], [*_rng.uniform(-2.8, 2.8, 6)]),
    "puma": ([0, 0.4318, 0.0203, 0, 0, 0], [0.6718, 0, 0.15005, 0.4318, 0, 0.056], [H, 0, -H, H, -H, 0]),
    "industrial": ([0.15, 0.6, 0.12, 0, 0, 0], [0.45, 0, 0, 0.62, 0, 0.1], [-H, 0, -H, H, -H, 0]),
    "ur5": ([0, -0.425, -0.39225, 0, 0, 0], [0.089159, 0, 0, 0.10915, 0.09465, 0.0823], [H, 0, 0, H, -H, 0]),
    "crx": ([0, 0.54, 0, 0, 0, 0], [0.245, 0, 0, 0.54, 0.15, 0.16], [-H, np.pi, -H, H, -H, 0]),
    "gen3 lite": ([0, 0.28, 0, 0, 0, 0], [0.2433, 0.03, 0.02, 0.245, 0.057, 0.235], [H, np.pi, H, H, H, 0]),
    "xarm6": ([0, 0.28949, 0.0775, 0, 0.076, 0], [0.267, 0, 0, 0.3425, 0, 0.097], [-H, 0, -H, H, -H, 0]),
    "offset wrist": ([0.05, 0.4, 0.03, 0.02, 0.07, 0], [0.3, 0.1, 0.05, 0.35, 0.08, 0.1], [H, 0, H, -H, H, 0]),
}


def chain_of_arm(name: str) -> Array:
    """(7, 3, 4) placements of an arm in `ARMS`."""
    return chain_of_numbers(*ARMS[name])


def chain_of_numbers(a: list[float], d: list[float], alpha: list[float]) -> Array:
    """(7, 3, 4) placements by Denavit-Hartenberg numbers [m], [m], [rad]."""
    chain = np.zeros((7, 3, 4))
    chain[0, :, :3] = np.eye(3)
    for i in range(6):
        chain[i + 1, :, :3] = pin.exp3(np.array([alpha[i], 0.0, 0.0]))
        chain[i + 1, :, 3] = a[i], 0.0, d[i]
    return chain


def perturbed(chain: Array, sigma: float, seed: int = 0) -> Array:
    """Every placement moved at random by about sigma [rad], [m]."""
    rng = np.random.default_rng(seed)
    moved = chain.copy()
    for i in range(7):
        moved[i, :, :3] = moved[i, :, :3] @ pin.exp3(sigma * rng.normal(size=3))
        moved[i, :, 3] += sigma * rng.normal(size=3)
    return moved


def form_of(chain: Array) -> ClosedForm:
    """Its solver, without limits."""
    model = pin.Model()
    for i in range(6):
        model.addJoint(i, pin.JointModelRZ(), pin.SE3(chain[i, :, :3], chain[i, :, 3]), f"joint_{i + 1}")
    tool = pin.Frame("tool", 6, 0, pin.SE3(chain[6, :, :3], chain[6, :, 3]), pin.FrameType.OP_FRAME)
    return ClosedForm(model, model.addFrame(tool), None, np.full(6, -np.inf), np.full(6, np.inf))


def poses_and_jacobians(chain: Array, q: Array) -> tuple[Array, Array]:
    """Poses (n, 4, 4) and Jacobians (n, 6, 6), linear part first, in the base, of configurations (n, 6)."""
    n = len(q)
    T = np.broadcast_to(np.eye(4), (n, 4, 4)).copy()
    points, axes = np.empty((6, n, 3)), np.empty((6, n, 3))
    for i in range(7):
        link = np.eye(4)
        link[:3] = chain[i]
        T = T @ link
        if i < 6:
            points[i], axes[i] = T[:, :3, 3], T[:, :3, 2]
            turn = np.broadcast_to(np.eye(4), (n, 4, 4)).copy()
            turn[:, 0, 0] = turn[:, 1, 1] = np.cos(q[:, i])
            turn[:, 1, 0], turn[:, 0, 1] = np.sin(q[:, i]), -np.sin(q[:, i])
            T = T @ turn
    linear = np.cross(axes, T[None, :, :3, 3] - points)
    return T, np.moveaxis(np.concatenate([linear, axes], axis=2), 0, 2)


def pose_at(chain: Array, q: Array) -> Array:
    """(4, 4) of a configuration (6,)."""
    return np.ascontiguousarray(poses_and_jacobians(chain, q[None])[0][0])


def round_angles(rng: np.random.Generator, count: int, smallest: float) -> Array:
    """Configurations of multiples of 90, 30 and 45 degrees, each fourth moved by 10^smallest to 1e-3 rad."""
    step = np.resize([np.pi / 2, np.pi / 6, np.pi / 4], count)[:, None]
    q: Array = np.round(rng.uniform(-np.pi, np.pi, (count, 6)) / step) * step
    q[3::4] += 10.0 ** rng.uniform(smallest, -3.0, (len(q[3::4]), 1)) * rng.normal(size=(len(q[3::4]), 6))
    return q


def smallest_singular_value(chain: Array, q: Array) -> float:
    """Of the Jacobian at q (6,) [m and rad]."""
    return float(np.linalg.svd(poses_and_jacobians(chain, q[None])[1][0], compute_uv=False)[-1])


def brute_force(chain: Array, T: Array, starts: int = 2000, seed: int = 0) -> Array:
    """Configurations (k, 6) that Newton's method finds from random starts."""
    q = np.random.default_rng(seed).uniform(-np.pi, np.pi, (starts, 6))
    for _ in range(40):
        reached, J = poses_and_jacobians(chain, q)
        turn = 0.5 * sum(np.cross(reached[:, :3, i], T[:3, i]) for i in range(3))
        rest = np.concatenate([T[:3, 3] - reached[:, :3, 3], turn], axis=1)
        J += 1e-14 * np.eye(6)
        step = np.linalg.solve(J, rest[..., None])[..., 0]
        q += step * np.minimum(1.0, 0.7 / np.maximum(np.abs(step).max(axis=1, keepdims=True), 1e-300))
    reached, _ = poses_and_jacobians(chain, q)
    good = np.abs(reached - T).max(axis=(1, 2)) < 1e-10
    found: list[Array] = []
    for row in q[good]:
        if all(distance(row, other) > 1e-5 for other in found):
            found.append(row)
    return np.array(found).reshape(-1, 6)


def distance(a: Array, b: Array) -> float:
    """The largest difference of two configurations on the circle [rad]."""
    return float(np.abs((a - b + np.pi) % (2.0 * np.pi) - np.pi).max())


def missing(chain: Array, rows: Array, others: Array) -> list[Array]:
    """Regular rows (k, 6) that are not among others (n, 6)."""
    return [
        row
        for row in rows
        if smallest_singular_value(chain, row) > 1e-3 and not any(distance(row, other) < 1e-6 for other in others)
    ]


def lost(chain: Array, found: Array, T: Array, *, starts: int = 2000, seed: int = 0) -> list[Array]:
    """Regular configurations that brute force knows and that are not among those found (k, 6)."""
    return missing(chain, brute_force(chain, T, starts, seed), found)
