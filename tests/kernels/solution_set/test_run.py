"""The entry point of sets of solutions: what is looked for, and how often."""

from __future__ import annotations

import pytest

from jacokin.kernels.solution_set import run
from jacokin.kernels.solution_set.run import SetWork, make_set_work, solve_set


@pytest.mark.parametrize(
    ("whole", "slack", "looks"), [(True, 0.0, [False]), (False, 0.0, [False, True]), (False, 0.01, [False])]
)
def test_what_was_looked_for_all_round_is_not_looked_for_again(
    monkeypatch: pytest.MonkeyPatch, whole: bool, slack: float, looks: list[bool]
) -> None:
    """Where nothing is within the limits, the whole set is wanted; of an arm that nearly has a structure it is not."""
    asked = []

    def find(work: SetWork, wanted: bool) -> tuple[int, bool]:
        asked.append(wanted)
        return len(asked), whole or wanted

    monkeypatch.setattr(run, "find_curves", find)
    work = make_set_work()
    work.near.seed[:], work.near.slack[0] = 0.0, slack
    assert solve_set(work) == len(looks)
    assert asked == looks
