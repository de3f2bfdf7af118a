"""Negative numbers are values, never options."""

from __future__ import annotations

import pytest

from jacokin.cli import argv


@pytest.mark.parametrize(
    ("given", "prepared"),
    [
        (["fk", "-1.2", "3"], ["fk", " -1.2", " 3"]),
        (["--seed", "-1", "2e-3", "--json"], ["--seed", " -1 2e-3", "--json"]),
        (["--seed", "1 2 3", "4"], ["--seed", "1 2 3", " 4"]),
        (["--seed"], ["--seed", " "]),
        (["-h", "--frame", "-x"], ["-h", "--frame", "-x"]),
        (["--seed", "1", "--position", "-.5", "-inf"], ["--seed", " 1", "--position", " -.5", " -inf"]),
    ],
)
def test_numbers_are_never_taken_for_options(given: list[str], prepared: list[str]) -> None:
    assert argv.prepared(given) == prepared
