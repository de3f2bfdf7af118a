"""From a planned joint path to ticks, measured: the result of `plan_path`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.targets import TargetPose
from jacokin.model import checks
from jacokin.motion import lines, timing
from jacokin.motion.planning.manifold import Curve, Manifold
from jacokin.motion.trajectory import PathResult, describe_jump

if TYPE_CHECKING:
    from jacokin.ik.solver import IKSolver

SPEED_ROUNDING = 1e-9  # [rad/s] of positions subtracted and divided by a step
ATTEMPTS = 24  # to find a pace whose ticks are all within the limits
LESS = 0.9  # of the limits is used at the next attempt
EASED, LEAST_EASED = 0.97, 0.5  # of its speed is left to a part of the path, beside the excess and at least
ACCELERATION_ROUNDING = 1e-6  # relative
CORNER = 0.2  # [rad/s] a joint's speed changes by more than this between two lines: a corner


@dataclass(frozen=True, slots=True)
class Settings:
    """How a path is run through.

    Attributes:
        dt: control step [s].
        slow: True to slow down where joints cannot follow.
        velocity: (dof,) limits [rad/s].
        acceleration: (dof,) limits [rad/s^2], or None.
    """

    dt: float
    slow: bool
    velocity: Array
    acceleration: Array | None


class Planned:
    """Writes results."""

    def __init__(
        self, solver: IKSolver, manifold: Manifold, times: Array, settings: Settings, begin: str = "the seed"
    ) -> None:
        """Take what was asked for; `times` (lines,) at the given speed [s], `begin` where the arm is taken to be."""
        self._solver, self._manifold, self._times, self._settings = solver, manifold, times, settings
        self._path, self._begin = manifold.path, begin

    def nowhere(self, q: Array, near: Array, reason: str, note: str) -> PathResult:
        """A path that does not begin: the arm stays where it is nearest to the first pose."""
        u = self._path.ticks(self._times, self._settings.dt)
        parameter = np.full(self._path.lines + 1, np.nan)
        x = self._manifold.points(q[None], self._path.target(0.0))
        return self._measured(u, np.tile(x, (len(u), 1)), parameter, -1.0, near, reason, note)

    def result(self, curve: Curve, reached: float, near: Array, reason: str, note: str) -> PathResult:
        """The ticks along a joint path; beyond its end the arm stays there."""
        if self._settings.slow and len(curve.u) > 1:
            ticks = self._slow(curve)
        else:
            ticks = self._path.ticks(self._times, self._settings.dt)
        parameter = self._at_waypoints(curve, reached)
        if reached == self._path.lines:
            return self._measured(ticks, curve.at(ticks)[0], parameter, reached, near, reason, note)
        if self._settings.slow:
            rest = self._path.ticks(self._times, self._settings.dt)
            ticks = np.concatenate([ticks, rest[rest > reached]])
        inside = ticks <= reached
        x = np.tile(curve.x[-1], (len(ticks), 1))
        x[inside] = curve.at(ticks[inside])[0] if len(curve.u) > 1 else curve.x[0]
        return self._measured(ticks, x, parameter, reached, near, reason, note)

    def _at_waypoints(self, curve: Curve, reached: float) -> Array:
        """The parameter (lines + 1,) at the waypoints that are reached; nan at others, and where there is none."""
        parameter = np.full(self._path.lines + 1, np.nan)
        if not self._manifold.has_families:
            return parameter
        passed = np.arange(int(reached) + 1, dtype=np.float64)
        x = curve.at(passed)[0] if len(curve.u) > 1 else curve.x
        parameter[: len(passed)] = self._manifold.parameter(x)
        if self._path.free:
            parameter[: len(passed)] = self._path.free_angle(parameter[: len(passed)])
        return parameter

    def _slow(self, curve: Curve) -> Array:
        """Places of the ticks at a pace that every joint can follow."""
        settings = self._settings
        u, q = curve.u, curve.q
        line = np.clip(0.5 * (u[:-1] + u[1:]), 0.0, None).astype(np.intp)
        least = np.maximum(np.diff(u) * self._times[line], 1e-12)
        part, top_speed = timing.PATH_SPEED_USED, np.full(len(u) - 1, np.inf)
        ticks = u
        for _ in range(ATTEMPTS):
            if settings.acceleration is None:
                schedule = timing.within_speed(u, q, least, settings.velocity, part)
            else:
                velocity, acceleration = part * settings.velocity, timing.ACCELERATION_USED * settings.acceleration
                stops = self._corners(u, q, least)
                schedule = timing.within_acceleration(u, q, least, velocity, acceleration, stops, top_speed)
            times = np.asarray(np.bincount(line, np.diff(schedule.t)), dtype=np.float64)
            lines.check_ticks(times, settings.dt)
            ticks = schedule.ticks(settings.dt)
            there = curve.at(ticks)[0][:, : self._manifold.dof]
            v = np.diff(there, axis=0) / settings.dt
            fast = float((np.abs(v) / settings.velocity).max())
            if fast > 1.0:
                part *= min(LESS, 1.0 / fast) if fast > 1.05 else 1.0 / fast - 1e-6
            hard = self._hard(v)
            if fast <= 1.0 and (hard <= 1.0).all():
                break
            if schedule.speed is None:
                continue
            speed, slower = np.maximum(schedule.speed[:-1], schedule.speed[1:]), top_speed.copy()
            for tick in np.flatnonzero(hard > 1.0).tolist():  # slower where ticks gain or lose speed too quickly
                near = (u[1:] >= ticks[max(tick - 1, 0)]) & (u[:-1] <= ticks[min(tick + 1, len(ticks) - 1)])
                slower[near] = np.minimum(slower[near], max(LEAST_EASED, EASED / hard[tick]) * speed[near].max())
            top_speed = slower
        return ticks

    def _hard(self, v: Array) -> Array:
        """Acceleration at ticks (n,) as a part of its limit, for velocities (n - 1, dof) [rad/s] from rest to rest."""
        if self._settings.acceleration is None:
            return np.zeros(len(v) + 1)
        still = np.zeros((1, v.shape[1]))
        change = np.diff(np.vstack([still, v, still]), axis=0) / self._settings.dt
        return np.asarray((np.abs(change) / self._settings.acceleration).max(axis=1))

    def _corners(self, u: Array, q: Array, least: Array) -> NDArray[np.bool_]:
        """(n,) True at both ends, and where the joints' velocities change suddenly from one line to the next."""
        assert self._settings.acceleration is not None
        v = np.diff(q, axis=0) / least[:, None]
        jump = np.abs(np.diff(v, axis=0)) - 0.5 * (least[:-1] + least[1:])[:, None] * self._settings.acceleration
        sudden = (jump > 0.1 * self._settings.acceleration * self._settings.dt).any(axis=1)
        stops = np.zeros(len(u), dtype=np.bool_)
        stops[1:-1] = sudden & (u[1:-1] == np.round(u[1:-1]))
        stops[[0, -1]] = True
        return stops

    def _measured(
        self, u: Array, x: Array, parameter: Array, reached: float, near: Array, reason: str, note: str
    ) -> PathResult:
        """Every row measured by Pinocchio, against limits, and for contact."""
        settings, robot, verifier = self._settings, self._solver.robot, self._solver.verifier
        wanted, q = self._manifold.poses(u, x), x[:, : self._manifold.dof]
        errors = np.array(
            [verifier.measure(row, TargetPose(T, position_only=False)) for row, T in zip(q, wanted, strict=True)]
        )
        v = np.zeros_like(q)
        v[1:] = np.diff(q, axis=0) / settings.dt
        off = (errors[:, 0] > verifier.options.position_tolerance) | (
            errors[:, 1] > verifier.options.orientation_tolerance
        )
        fast = np.abs(v) > settings.velocity + SPEED_ROUNDING
        hard = np.zeros_like(fast)
        if settings.acceleration is not None:
            hard[1:] = np.abs(np.diff(v, axis=0)) > settings.acceleration * settings.dt * (1.0 + ACCELERATION_ROUNDING)
        status, limiting = [], []
        for row in range(len(q)):
            names = [f"{robot.joint_names[j]} velocity" for j in np.flatnonzero(fast[row])]
            names += [f"{robot.joint_names[j]} acceleration" for j in np.flatnonzero(hard[row])]
            held = off[row] or u[row] > reached
            status.append("HELD" if held else "LIMITED" if names else "OK")
            limiting.append("; ".join(names) if names else reason if held else "")
        clearance = self._clearance(q)
        segment = np.clip(np.ceil(u).astype(np.intp) - 1, 0, self._path.lines - 1)
        segment.setflags(write=False)
        away = np.abs(q[0] - near)
        jump = describe_jump(robot.joint_names, away, self._begin)
        words = [reason or self._sentence(v, fast, status), jump, note]
        return PathResult(
            joint_names=robot.joint_names,
            t=checks.read_only(np.arange(len(q)) * settings.dt),
            q=checks.read_only(q),
            v=checks.read_only(v),
            position_error=checks.read_only(errors[:, 0]),
            orientation_error=checks.read_only(errors[:, 1]),
            status=tuple(status),
            limiting=tuple(limiting),
            segment=segment,
            clearance=clearance,
            lower=robot.lower,
            upper=robot.upper,
            velocity_limit=checks.read_only(settings.velocity),
            parameter=checks.read_only(parameter),
            message="; ".join(word for word in words if word),
            start_distance=float(away.max()),
        )

    def _clearance(self, q: Array) -> Array:
        verifier = self._solver.verifier
        if not verifier.looks_for_contact:
            return checks.read_only(np.full(len(q), np.nan))
        return checks.read_only(verifier.distances(q))

    def _sentence(self, v: Array, fast: NDArray[np.bool_], status: list[str]) -> str:
        if all(word == "OK" for word in status):
            return "on the path throughout"
        ticks = np.flatnonzero(fast.any(axis=1))
        if ticks.size:
            names = ", ".join(self._solver.robot.joint_names[j] for j in np.flatnonzero(fast.any(axis=0)))
            excess = float((np.abs(v) / self._settings.velocity).max()) - 1.0
            return (
                f"{names} cannot follow at this speed on {ticks.size} of {len(fast)} ticks, first at "
                f"{ticks[0] * self._settings.dt:.6g} s, too fast by up to {100.0 * excess:.3g} %; timing='slow' slows "
                "down there"
            )
        if "LIMITED" in status:
            return f"joints would accelerate too much at {status.index('LIMITED') * self._settings.dt:.6g} s"
        return "a tick misses the path"
