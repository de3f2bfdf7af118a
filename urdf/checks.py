"""Whether the table describes every robot completely, so that a new arm that is not is refused by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from jacokin.errors import ModelError, UnknownNameError
from jacokin.model.descriptions.bundled import NO_HAND, ancestors, section

VARIANT_FIELDS = ("family", "arm", "hand", "home", "source")
JOINT_FIELDS = ("type", "parent", "child", "xyz", "rpy", "velocity_deg", "effort", "group")
LIMIT_FIELDS = ("lower_deg", "upper_deg")
IN_DEGREES = "_deg"  # fields that may be given in radians as well, without this ending


def check(table: Mapping[str, Any]) -> None:
    """Every robot has its sections, its fields, and links as long as its joints are apart.

    Raises:
        ModelError: names the section, and what it lacks.
    """
    for name, variant in table["variants"].items():
        where = f"variants.{name}"
        _fields(variant, VARIANT_FIELDS, where)
        arm, hand = variant["arm"], variant["hand"]
        wanted_sections = [("arms", arm), ("shapes", arm), ("masses", name)]
        if hand != NO_HAND:
            wanted_sections += [("hands", hand), ("shapes", hand)]
        for group, wanted in wanted_sections:
            try:
                section(table[group], wanted)
            except UnknownNameError as error:
                raise ModelError(f"{where} needs the section {group}.{wanted}: {error}") from error
        joints = _joints(table, arm)
        if len(variant["home"]) != len(joints):
            raise ModelError(f"{where}: home has {len(variant['home'])} angles, arms.{arm} has {len(joints)} joints")
        for joint, row in joints.items():
            _check_joint(table, row, f"arms.{arm}.{joint}", simulated=variant["family"] == "jaco")
            shaped = _given_in(table["shapes"], arm, row["parent"])
            _check_length(table, arm, joint, shaped, f"shapes.{shaped}.{row['parent']}")
            weighed = _given_in(table["masses"], name, row["parent"])
            if weighed is not None:
                source = f"masses.{weighed}.{row['parent']}"
                _check_length(table, arm, joint, table["variants"][weighed]["arm"], source)


def _fields(row: Mapping[str, Any], names: tuple[str, ...], where: str) -> None:
    missing = [name for name in names if name not in row and name.removesuffix(IN_DEGREES) not in row]
    if missing:
        raise ModelError(f"{where} has no {', '.join(missing)}")


def _joints(table: Mapping[str, Any], arm: str) -> dict[str, Mapping[str, Any]]:
    return {key: row for key, row in section(table["arms"], arm).items() if key.startswith("joint_")}


def _check_joint(table: Mapping[str, Any], row: Mapping[str, Any], where: str, *, simulated: bool) -> None:
    _fields(row, JOINT_FIELDS + (LIMIT_FIELDS if row.get("type") == "revolute" else ()), where)
    for group in ("dynamics", "actuators") if simulated else ("dynamics",):
        if row["group"] not in table[group]:
            raise ModelError(f"{where}: its group {row['group']!r} has no section in [{group}]")


def _given_in(group: Mapping[str, Any], name: str, body: str) -> str | None:
    """The section that gives the numbers of a body: `name`, or one that it is like."""
    return next((ancestor for ancestor in ancestors(group, name) if body in group[ancestor]), None)


def _check_length(table: Mapping[str, Any], arm: str, joint: str, other: str | None, source: str) -> None:
    """A link's shapes and masses are those of an arm whose next joint is as far away."""
    if other is None:
        raise ModelError(f"{source.replace('None', arm)} is missing")
    here, there = _joints(table, arm)[joint]["xyz"], _joints(table, other)[joint]["xyz"]
    if list(here) != list(there):
        raise ModelError(
            f"arms.{arm}.{joint} is at {here} m and arms.{other}.{joint} at {there} m, but both have the link of "
            f"{source}: give the link of {arm} numbers of its own"
        )
