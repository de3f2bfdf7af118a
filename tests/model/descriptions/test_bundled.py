"""A new arm is one table; what it lacks is named."""

from __future__ import annotations

import copy
import importlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import jacokin
from jacokin.errors import ModelError, UnknownNameError
from jacokin.model import NAMES
from jacokin.model.descriptions import bundled

ROOT = Path(__file__).resolve().parents[3]
Table = dict[str, Any]

LONG = 0.5  # [m] between joints 2 and 3 of the new arm


def read() -> Table:
    numbers = bundled.read_tables(ROOT / "urdf", *bundled.TABLES)
    return numbers | {"shapes": bundled.read_tables(ROOT / "urdf", "shapes.toml")}


def with_a_new_arm() -> Table:
    """A Jaco whose upper arm is longer: sections for what differs, `like` for the rest."""
    numbers = read()
    numbers["variants"]["x1n6s300"] = numbers["variants"]["j2n6s300"] | {"arm": "x1n6"}
    numbers["arms"]["x1n6"] = {"like": "j2n6", "source": "P", "joint_3": {"xyz": [0.0, -LONG, 0.0]}}
    upper_arm = copy.deepcopy(numbers["shapes"]["j2n6"]["link_2"])
    numbers["shapes"]["x1n6"] = {"like": "j2n6", "source": "P", "link_2": upper_arm}
    mass = copy.deepcopy(numbers["masses"]["j2n6s300"]["link_2"])
    numbers["masses"]["x1n6s300"] = {"like": "j2n6s300", "source": "P", "link_2": mass}
    return numbers


@pytest.fixture
def generator(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT))
    return importlib.import_module("urdf.generate")


def test_the_names_are_those_of_the_table() -> None:
    assert tuple(read()["variants"]) == NAMES
    assert bundled.DEFAULT_ROBOT in NAMES


@pytest.mark.parametrize("page", ["docs/kinematics.md", "jacokin/cli/info.py"])
def test_the_names_stand_where_users_look(page: str) -> None:
    text = (ROOT / page).read_text()
    assert not [name for name in NAMES if name not in text]


def test_a_new_arm_is_one_table(generator: Any, tmp_path: Path, rng: np.random.Generator) -> None:
    numbers = with_a_new_arm()
    importlib.import_module("urdf.checks").check(numbers)
    description = generator.describe(numbers, "x1n6s300")
    urdf, mjcf = tmp_path / "x1n6s300.urdf", tmp_path / "x1n6s300.xml"
    urdf.write_text(generator.urdf_text(description, numbers, generator.HEADER))
    mjcf.write_text(generator.robot_mjcf(description, numbers, generator.HEADER))
    new = jacokin.load_robot(urdf)
    report = jacokin.crosscheck(
        new, jacokin.load_robot(mjcf, base="link_base", tip="end_effector"), samples=20, rng=rng
    )
    assert report.worst("position").value < 1e-12
    straight = [0.0, np.pi, np.pi, 0.0, 0.0, 0.0]
    gained = new.forward_kinematics(straight, "link_3").translation[2]
    gained -= jacokin.load_robot().forward_kinematics(straight, "link_3").translation[2]
    assert gained == pytest.approx(LONG - 0.41)


MISTAKES: dict[str, tuple[Callable[[Table], object], str]] = {
    "shapes too short": (
        lambda t: t["shapes"]["x1n6"].pop("link_2"),
        r"arms.x1n6.joint_3 is at .*shapes.j2n6.link_2: give the link of x1n6 numbers of its own",
    ),
    "masses too short": (lambda t: t["masses"]["x1n6s300"].pop("link_2"), "masses.j2n6s300.link_2: give the link"),
    "no shapes": (lambda t: t["shapes"].pop("x1n6"), "variants.x1n6s300 needs the section shapes.x1n6"),
    "no masses": (lambda t: t["masses"].pop("x1n6s300"), "variants.x1n6s300 needs the section masses.x1n6s300"),
    "no arm": (lambda t: t["arms"].pop("x1n6"), "variants.x1n6s300 needs the section arms.x1n6"),
    "no hand": (lambda t: t["variants"]["x1n6s300"].pop("hand"), "variants.x1n6s300 has no hand"),
    "another hand": (
        lambda t: t["variants"]["x1n6s300"].update(hand="four_finger"),
        "needs the section hands.four_finger: .*three_finger, two_finger",
    ),
    "short home": (lambda t: t["variants"]["x1n6s300"].update(home=[0.0]), "home has 1 angles, arms.x1n6 has 6 joints"),
    "like nothing": (lambda t: t["arms"]["x1n6"].update(like="j3n6"), "needs the section arms.x1n6: .*'j3n6'"),
    "like itself": (lambda t: t["arms"]["x1n6"].update(like="x1n6"), "like each other in a circle: x1n6 -> x1n6"),
    "no limits": (
        lambda t: t["arms"]["x1n6"].update(joint_1={"type": "revolute"}),
        "arms.x1n6.joint_1 has no lower_deg, upper_deg",
    ),
    "no group": (
        lambda t: t["arms"]["x1n6"].update(joint_1={"group": "huge"}),
        "arms.x1n6.joint_1: its group 'huge' has no section",
    ),
}


@pytest.mark.parametrize("case", MISTAKES)
def test_what_a_new_arm_lacks_is_named(case: str, generator: Any) -> None:
    assert generator  # for the path
    numbers = with_a_new_arm()
    change, message = MISTAKES[case]
    change(numbers)
    with pytest.raises(ModelError, match=message):
        importlib.import_module("urdf.checks").check(numbers)


def test_a_section_that_is_missing_lists_those_there_are() -> None:
    with pytest.raises(UnknownNameError, match="'j3n6'.*Did you mean.*Valid: j2n6, j2s6, m1n6"):
        bundled.section(bundled.robot_table()["arms"], "j3n6")
