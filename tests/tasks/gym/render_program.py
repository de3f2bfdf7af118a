"""Run by `test_checks` in a process that can render: the checks of options that need pictures.

Arguments: names of tasks. Prints how many environments were checked.
"""

from __future__ import annotations

import sys
import warnings

from gymnasium.utils.passive_env_checker import env_render_passive_checker

from jacokin.tasks.registry import TASKS
from tests.tasks.gym.checking import RENDER_OPTIONS, check, check_copies, make


def main() -> None:
    """Check all options of all tasks that are named."""
    count = 0
    for task in sys.argv[1:]:
        for options in RENDER_OPTIONS.values():
            if options.get("observations", "features") not in TASKS[task].observations:
                continue
            check(task, options)
            check_copies(task, options)
            if "render_mode" in options:
                environment = make(task, **options).unwrapped
                environment.reset(seed=0)
                env_render_passive_checker(environment)
            count += 1
    print(count)


if __name__ == "__main__":
    warnings.simplefilter("error")
    main()
