"""Run by `test_window` in a process with a display: an episode in a window is the same as one without.

Arguments: "close", or "leave" to end the program with the window open.
"""

from __future__ import annotations

import sys

import gymnasium
import numpy as np

import jacokin.tasks


def main() -> None:
    """Take the same steps in both."""
    gymnasium.register_envs(jacokin.tasks)
    seen = gymnasium.make("jacokin/ReachSite-v0", render_mode="human")
    plain = gymnasium.make("jacokin/ReachSite-v0")
    for environment in (seen, plain):
        environment.reset(seed=3)
        environment.action_space.seed(4)
    for _ in range(30):
        one, other = (environment.step(environment.action_space.sample()) for environment in (seen, plain))
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1] == other[1]
    if sys.argv[1] == "close":
        seen.close()
    print("done")


if __name__ == "__main__":
    main()
