"""`jacokin ik` with a free axis, an approach, a preference, and seven joints."""

from __future__ import annotations

import pytest

from tests.cli.run import Run

PLACE = ("ik", "--position", "0.3", "-0.2", "0.3")


def test_an_approach_leaves_the_roll_free(run: Run) -> None:
    answer = run(*PLACE, "--approach", "1", "0", "0", "--json")
    assert answer.code == 0
    assert isinstance(answer.document["parameter"], float)


def test_the_angle_about_a_free_axis_is_in_the_unit_of_the_user(run: Run) -> None:
    answer = run(*PLACE, "--down", "--free-axis", "0,1,0", "--free-range", "-20", "20", "--degrees", "--json")
    assert answer.code == 0
    assert -20.0 <= answer.document["parameter"] <= 20.0


@pytest.mark.parametrize("robot", ["j2n6s300", "j2s7s300"])
def test_all_intervals(run: Run, robot: str) -> None:
    free = ("--free-axis", "x") if robot == "j2n6s300" else ()
    answer = run("ik", "--position", "0.4", "-0.2", "0.3", "--down", *free, "--all", "--robot", robot, "--json")
    assert answer.code == 0
    found = answer.document
    assert found["complete"]
    assert all(row["start"] <= row["stop"] for row in found["intervals"])
    assert (
        "intervals of the free parameter"
        in run("ik", "--position", "0.4", "-0.2", "0.3", "--down", *free, "--all", "--robot", robot).out
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--free-axis", "x"), "need an orientation"),
        (("--down", "--free-axis", "q"), "--free-axis must be x, y, z or three numbers"),
        (("--down", "--free-axis", "0,0,0"), "must have a direction"),
        (("--down", "--free-range", "0", "1"), "--free-range goes with --free-axis"),
        (("--down", "--free-axis", "x", "--free-range", "1", "0"), "least < largest"),
        (("--down", "--approach", "1", "0", "0"), "--approach is an orientation"),
        (("--down", "--prefer", "widest"), "Valid: nearest, margin, manipulability"),
    ],
)
def test_mistakes(run: Run, options: tuple[str, ...], message: str) -> None:
    answer = run(*PLACE, *options)
    assert answer.code == 2
    assert message in " ".join(answer.err.split())
