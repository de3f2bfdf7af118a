"""What a view says in words."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Status
from jacokin.viewer import Inspector, texts
from tests.viewer.test_inspector import FAR, outside


@pytest.fixture(scope="module")
def inspector() -> Inspector:
    return Inspector(IKSolver(jacokin.load_robot()))


def test_a_reached_target_is_said_with_its_branch(inspector: Inspector) -> None:
    view = inspector.posture(inspector.robot.home)
    assert texts.headline(inspector, view) == "Reached: branch 1 of 8, 8 of them feasible"
    assert texts.advice(view) == ""


def test_a_branch_outside_names_joint_and_amount(inspector: Inspector, rng: np.random.Generator) -> None:
    view = outside(inspector, rng)
    branch = int(np.flatnonzero(~view.within)[0])
    chosen = inspector.choose(view, branch)
    name, amount = inspector.excess(chosen.q)[0]
    said = texts.headline(inspector, chosen)
    assert f"branch {branch + 1} of {len(view.branches)} is outside the limits" in said
    assert f"{name} by {amount:.3f} rad ({math.degrees(amount):.1f} deg)" in said
    assert f"{name} by {amount:.3f} rad" in texts.reason(inspector, view, branch)


def test_out_of_reach_the_advice_is_that_of_the_status_with_the_distance(inspector: Inspector) -> None:
    view = inspector.closest(inspector.at(FAR, inspector.robot.home))
    assert texts.headline(inspector, view).startswith("Unreachable: ")
    assert texts.advice(view).startswith(Status.UNREACHABLE.value)
    assert f"{1e3 * view.errors[0]:.1f} mm" in texts.advice(view)


def test_bars_stand_where_the_joint_is_between_its_limits(inspector: Inspector) -> None:
    robot = inspector.robot
    q = np.array(robot.home)
    q[1] = robot.lower[1] + 0.25 * (robot.upper[1] - robot.lower[1])
    bars = texts.bars_html(inspector, q)
    assert bars.count("<tr>") == 6
    assert "margin to limit" in bars
    assert "calc(25.0% - 3px)" in bars
    assert bars.count("no limits") == int(robot.unlimited.sum())
    q[1] = robot.upper[1] + 0.5
    assert ">-0.500<" in texts.bars_html(inspector, q)


@pytest.mark.parametrize("degrees", [False, True])
def test_every_joint_has_its_value_beside_it_also_without_limits(inspector: Inspector, degrees: bool) -> None:
    q = np.array(inspector.robot.home)
    q[0] += 2.0 * np.pi
    bars = texts.bars_html(inspector, q, degrees=degrees)
    assert ("[deg]" in bars) is degrees
    assert ("[rad]" in bars) is not degrees
    for value in inspector.robot.home:
        angle = math.remainder(value, 2.0 * math.pi)
        assert (f">{math.degrees(angle):.1f}<" if degrees else f">{angle:.3f}<") in bars
    margins = inspector.margin(q)
    for margin in margins[np.isfinite(margins)]:
        assert (f">{math.degrees(margin):.1f}<" if degrees else f">{margin:.3f}<") in bars


@pytest.mark.parametrize("colour", [texts.GREEN, texts.RED, texts.ORANGE, texts.GREY])
def test_words_stand_out_from_white(colour: str) -> None:
    """A contrast of 4.5, as the Web Content Accessibility Guidelines 2.1 ask for (1.4.3)."""
    parts = [int(colour[start : start + 2], 16) / 255.0 for start in (1, 3, 5)]
    red, green, blue = (part / 12.92 if part <= 0.03928 else ((part + 0.055) / 1.055) ** 2.4 for part in parts)
    assert 1.05 / (0.2126 * red + 0.7152 * green + 0.0722 * blue + 0.05) >= 4.5


def test_names_of_a_file_are_text_and_not_html(inspector: Inspector) -> None:
    view = replace(inspector.posture(inspector.robot.home), arm_touching=(("<script>", "a&b"),), selected=0)
    shown = texts.status_html(inspector, view)
    assert "<script>" not in shown
    assert "&lt;script&gt; and a&amp;b" in shown
