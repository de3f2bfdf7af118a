"""`Disturbance`: noise and mistakes that a script has to mend, so that a learner sees how."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.tasks.experts.driver import CLOSE, ArmDriver, Script
from jacokin.tasks.task import CONTROL_TIMESTEP

FINGERS = 3
SIZE = 9  # joints and fingers
CORRELATION = 0.2  # [s] for which noise keeps its direction: white noise would average out before the arm moves
MISTAKE_TIME = 0.4  # [s] that a mistake lasts
MISTAKE_SPEED = 0.5  # of the velocity limits, at most
MISTAKES_UNTIL = 4.0  # [s] from the start of an episode, which leaves time to mend them


@dataclass(frozen=True, slots=True)
class Disturbance:
    """What is done to the actions of a script.

    Attributes:
        noise: (9,) standard deviations of what is added to the velocities of joints and fingers [rad/s]; it forgets
            its direction within 0.2 s.
        mistakes: how many times in the first 4 s of an episode the arm moves somewhere for 0.4 s, at up to half its
            speed, with fingers that may open; the script then begins anew from there.
        seed: of the random numbers.
    """

    noise: tuple[float, ...]
    mistakes: int
    seed: int

    @classmethod
    def of(cls, noise: ArrayLike, mistakes: int, rng: np.random.Generator | None) -> Disturbance | None:
        """Of checked arguments of `expert`; None where nothing is disturbed.

        Raises:
            InvalidInputError: impossible ones.
        """
        values = checks.array("noise", noise, f"a number or {SIZE}")
        if values.size != 1 and values.shape != (SIZE,):
            raise InvalidInputError(f"noise must be one number or {SIZE}, got shape {values.shape}")
        if not np.isfinite(values).all() or (values < 0.0).any():
            raise checks.refusal("noise", "finite and not negative", noise, "rad/s")
        count = checks.whole_number("mistakes", mistakes)
        random_state = checks.generator("rng", np.random.default_rng(0) if rng is None else rng)
        if not values.any() and not count:
            return None
        each = tuple(np.broadcast_to(values.ravel(), SIZE).tolist())
        return cls(each, count, int(random_state.integers(2**32)))

    def disturbed(
        self, script: Callable[[ArmDriver], Script], arm: ArmDriver, random_state: np.random.Generator
    ) -> Script:
        """The actions of a script with noise and mistakes, within the limits of the actuators."""
        limit = np.append(arm.robot.velocity_limit, np.full(FINGERS, CLOSE))
        deviation = np.array(self.noise)
        kept = np.exp(-CONTROL_TIMESTEP / CORRELATION)
        last = round(MISTAKES_UNTIL / CONTROL_TIMESTEP)
        mistakes = set(random_state.integers(1, last, self.mistakes).tolist())
        noise, step, going = deviation * random_state.normal(size=len(deviation)), 0, script(arm)
        wrong, until = np.zeros(0), 0
        while True:
            if step in mistakes:
                wrong, until = self._mistake(limit, random_state), step + round(MISTAKE_TIME / CONTROL_TIMESTEP)
            elif until and step == until:
                going = script(arm)
            action = wrong if step < until else next(going, None)
            if action is None:
                return
            if action.shape != limit.shape:
                raise InvalidInputError(f"an expert of actions of shape {action.shape} cannot be disturbed")
            yield np.clip(action + noise, -limit, limit)
            noise = kept * noise + np.sqrt(1.0 - kept**2) * deviation * random_state.normal(size=len(deviation))
            step += 1

    @staticmethod
    def _mistake(limit: Array, random_state: np.random.Generator) -> Array:
        wrong = MISTAKE_SPEED * limit * random_state.uniform(-1.0, 1.0, len(limit))
        opens = random_state.uniform() < 0.5
        wrong[-FINGERS:] = -MISTAKE_SPEED * limit[-FINGERS:] if opens else 0.0
        return np.asarray(wrong)
