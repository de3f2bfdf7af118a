"""Write docs/robot.md from the tables in urdf/: every number of the robots, its source and its doubt.

python -m docs.robot_page        # in the root of the repository
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jacokin.model import DEFAULT_ROBOT, NAMES
from jacokin.model.descriptions import bundled
from jacokin.mujoco_bridge.arena import CONTACT_OPTIONS

PAGE = Path(__file__).resolve().with_name("robot.md")

Row = Mapping[str, Any]


def page() -> str:
    """The whole page as Markdown."""
    numbers = bundled.robot_table()
    parts = [
        "<!-- Written by docs/robot_page.py from the tables urdf/*.toml. Edit those, not this page. -->",
        "# The robots in numbers",
        "The numbers of the bundled robots with unit, source and doubt, as `urdf/*.toml` have them. Poses are in the "
        "frame of the parent, with `pi/3` and the like exact.",
        "## Sources",
        grid(("letter", "what it is"), ((key, text) for key, text in numbers["sources"].items())),
        *_variants(numbers),
        *_limits(),
        *_chains(numbers),
        *_frames(numbers),
        *_hands(numbers),
        *_grip(),
        *_poses(numbers),
        *_dynamics(numbers),
        *_masses(numbers),
        *_contacts(numbers),
        *_shapes(),
        *_arena(numbers),
    ]
    return "\n\n".join(parts) + "\n"


def grid(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """A Markdown table of the columns that are not empty; a `|` inside a cell is not expected."""
    cells = [[str(cell) for cell in row] for row in rows]
    shown = [column for column in range(len(head)) if any(row[column] for row in cells)]
    lines = [head, ["---"] * len(head), *cells]
    return "\n".join("| " + " | ".join(line[column] for column in shown) + " |" for line in lines)


def value(number: object) -> str:
    """A number as the table has it; lists without brackets."""
    if isinstance(number, list | tuple):
        return ", ".join(value(item) for item in number)
    if isinstance(number, float) and number.is_integer():
        return str(int(number))
    return str(number)


def numbers_in(row: Row, field: str) -> str:
    """A field of a row, or nothing."""
    return value(row[field]) if field in row else ""


def listed(names: Iterable[str]) -> str:
    """Names with commas; three or more that differ by consecutive digits at their end as a range."""
    runs: list[list[str]] = []
    for name in names:
        last = runs[-1][-1] if runs else ""
        follows = last[:-1] == name[:-1] and last[-1:].isdigit() and name[-1:].isdigit()
        if follows and int(name[-1]) == int(last[-1]) + 1:
            runs[-1].append(name)
        else:
            runs.append([name])
    return ", ".join(f"{run[0]} to {run[-1][-1]}" if len(run) > 2 else ", ".join(run) for run in runs)


def origin(row: Row) -> str:
    """Source and doubt of a section as a sentence."""
    doubt = f" Doubt: {row['doubt']}." if "doubt" in row else ""
    return f"Source: {row['source']}.{doubt}"


def rotation(row: Row) -> str:
    """The orientation of a row, in the notation of its source."""
    return f"wxyz {value(row['quat_wxyz'])}" if "quat_wxyz" in row else numbers_in(row, "rpy")


#: An owner's report, which no document of Kinova's confirms.
JOINT_5 = (
    "An owner reports that joint 5 of a real `j2n6s300`, unlimited here, stops at 65° and 295° ([kinova-ros, issue "
    "444](https://github.com/Kinovarobotics/kinova-ros/issues/444)). If yours does, say so: "
    '`load_robot(limits={"joint_5": (math.radians(65), math.radians(295))})`, or `--limit joint_5=1.1345,5.1487` [rad].'
)


def _variants(numbers: Row) -> list[str]:
    shown: dict[str, str] = {}

    def row(name: str) -> tuple[str, ...]:
        variant = bundled.variant(name)
        home = value(variant["home"])
        first = shown.setdefault(home, name)
        home = home if first == name else f"as `{first}`"
        return f"`{name}`", variant["arm"], variant["hand"].replace("_", " "), home

    doubts = dict[str, list[str]]()
    for name in NAMES:
        if doubt := bundled.variant(name).get("doubt"):
            doubts.setdefault(doubt, []).append(f"`{name}`")
    return [
        "## Robots",
        f"`{DEFAULT_ROBOT}` is the default. A name reads: `j2` Jaco generation 2, `m1` Mico; `n` non-spherical, "
        "`s` spherical wrist; `6` or `7` joints; `s` service; `300` three fingers, `200` two. The `gen3` has seven "
        "joints.",
        grid(("name", "arm", "hand", "home [rad]"), map(row, NAMES)),
        f"Every home is within the limits and free of self-contact. {origin(numbers['variants'][DEFAULT_ROBOT])}",
        "\n".join(f"- {', '.join(names)}: {doubt}." for doubt, names in doubts.items()),
    ]


def _bound(row: Row, side: str) -> str:
    key = f"{side}_deg"
    if side in row:
        return f"{value(row[side])} rad"
    return f"{row[key]}°" if key in row else "none"


def _velocity(row: Row) -> str:
    return value(row["velocity_deg"]) if "velocity_deg" in row else f"{math.degrees(row['velocity']):.3f}"


def _limits() -> list[str]:
    joints: dict[tuple[str, ...], dict[str, list[str]]] = {}
    for name in NAMES:
        arm = bundled.variant(name)["arm"]
        for joint, numbers in bundled.arm_joints(name).items():
            row = (_bound(numbers, "lower"), _bound(numbers, "upper"), _velocity(numbers), value(numbers["effort"]))
            of_arm = joints.setdefault(row, {}).setdefault(arm, [])
            of_arm += [] if joint in of_arm else [joint]
    return [
        "## Limits",
        "What the URDF says [K, G], in degrees or radians as it does; `robot.effort_limit` returns these efforts. The "
        "datasheet [S] and the user guide [U] state [other torques](#joint-dynamics-and-actuators).",
        grid(
            ("joints", "lower", "upper", "velocity [°/s]", "effort [N m]"),
            (("; ".join(f"{arm}: {listed(each)}" for arm, each in of.items()), *row) for row, of in joints.items()),
        ),
        JOINT_5,
    ]


def _chains(numbers: Row) -> list[str]:
    parts = [
        "## Joint frames",
        "Every joint turns about +z of its own frame, and leads to the link of its number. `robot.acceleration_limit` "
        f"is the acceleration here; of Jacos and Micos {value(numbers['actuators']['large']['acceleration'])} rad/s².",
    ]
    shown: dict[tuple[str, ...], str] = {}
    for arm in numbers["arms"]:
        rows = bundled.section(numbers["arms"], arm)
        joints = [
            (
                key,
                value(row["xyz"]),
                rotation(row),
                numbers_in(row, "acceleration"),
            )
            for key, row in rows.items()
            if key.startswith("joint_")
        ]
        own = [row for row in joints if shown.setdefault(row, arm) == arm]
        parts += [
            f"### {arm}",
            grid(("joint", "xyz [m]", "rpy [rad]", "acceleration [rad/s²]"), own),
            " ".join([*_alike(joints, shown, arm), origin(rows)]),
        ]
    return parts


def _alike(rows: Iterable[tuple[str, ...]], shown: Mapping[tuple[str, ...], str], name: str) -> list[str]:
    """A sentence on the rows that are another's, of which `shown` has the names; nothing where there are none."""
    alike: dict[str, list[str]] = {}
    for row in rows:
        alike.setdefault(shown[row], []).append(row[0])
    others = [f"{listed(keys)} as of `{other}`" for other, keys in alike.items() if other != name]
    return [f"Also {'; '.join(others)}."] if others else []


def _frames(numbers: Row) -> list[str]:
    arms = {arm: bundled.section(numbers["arms"], arm) for arm in numbers["arms"]}
    own = {arm: rows for arm, rows in arms.items() if "sites" in rows}
    groups = [("Jacos and Micos", numbers["sites"], "")]
    groups += [(arm, rows["sites"], rows["source"]) for arm, rows in own.items()]
    rows = [
        (
            f"`{name}`",
            robots,
            row["parent"],
            value(row["xyz"]),
            rotation(row),
            row.get("source", source),
            row.get("doubt", ""),
        )
        for robots, sites, source in groups
        for name, row in sites.items()
    ]
    return [
        "## Frames",
        "`frame=` takes every link (`link_base`, `link_1` to `link_6` or `link_7`, `hand`, `link_finger_1` ..., "
        "`link_finger_tip_1` ...) and the frames below: links of the URDF, sites of the MJCF. `link_base` is the base, "
        "`end_effector` the default; that of a Gen3 is the frame whose pose the arm itself reports. `gripsite` and "
        "`pinchsite`, between the fingers, are not in `jaco_arm.xml`, the arm without its hand.",
        grid(("frame", "of", "parent", "xyz [m]", "rpy [rad]", "source", "doubt"), rows),
        "The axes of `hand` are those of the arm's last link; the hand is attached at `wristsite`, whose rotation its "
        f"own mount ({rotation(numbers['hand_mount'])} rad) undoes.",
    ]


def _hands(numbers: Row) -> list[str]:
    parts = ["## Fingers", "Each finger turns about +z of its own frame, whose parent is `hand`."]
    for name, hand in numbers["hands"].items():
        rows = ((f, value(hand[f]["xyz"]), rotation(hand[f]), hand[f].get("doubt", "")) for f in hand["fingers"])
        parts += [
            f"### {name.replace('_', ' ').replace('finger', 'fingers')}",
            grid(("finger", "xyz [m]", "orientation", "doubt"), rows),
            origin(hand),
        ]
        if "finger" in hand:
            parts += _finger(hand, hand["source"])
    return [*parts, "### All others", *_finger(numbers)]


def _finger(hand: Row, source: str = "") -> list[str]:
    """Range and tip of the fingers of a hand, or of all that have none of their own."""
    finger, tip = ({"source": source, **hand[name]} for name in ("finger", "finger_tip"))
    return [
        f"Range {finger['lower']} (open) to {finger['upper']} rad (closed), velocity {value(finger['velocity'])} "
        f"rad/s, effort {value(finger['effort'])} N m. {origin(finger)}",
        f"The tip sits at {value(tip['xyz'])} m in its finger, turned by rpy {value(tip['rpy'])} rad, fixed. "
        f"{origin(tip)}",
    ]


def _grip() -> list[str]:
    """The grip force, finger by finger, beside that of D; tests/mujoco_bridge/test_bundled_robots.py measures ours."""
    return [
        "## Grip force",
        "Normal forces on a ball of radius 0.02 m between the finger tips, 0.193 m above the base of the hand, that "
        "slides sideways, with all fingers closing at full torque (1 N m) [N]. The datasheet says 25 N.",
        grid(
            ("hand", "friction", "finger_1", "finger_2", "finger_3", "sum"),
            (
                ("three fingers, here", 1.0, 11.5, 0.3, 12.2, 24.0),
                ("three fingers, D", 1.0, 15.3, 4.3, 9.5, 29.0),
                ("three fingers, here", 0.1, 11.2, 0.5, 11.5, 23.2),
                ("three fingers, D", 0.1, 12.4, 0.0, 12.4, 24.8),
                ("two fingers, here", 1.0, 12.2, 12.2, "", 24.3),
            ),
        ),
        "Fingers 1 and 3 oppose each other; finger 2 closes to its limit next to the ball. D's fingers, convex hulls, "
        "touch the ball at one point each, and with friction it creeps 7 mm until finger 2 wedges it; the boxes here "
        "touch it at two.",
    ]


def _poses(numbers: Row) -> list[str]:
    parts = [
        "## Published poses",
        "Documented poses of real arms, which a test compares with forward kinematics.",
    ]
    for name, pose in numbers["published"].items():
        angles = f"{value(pose['q_deg'])}°" if "q_deg" in pose else f"{value(pose['q'])} rad"
        turned = f", turned by XYZ Euler angles {value(pose['euler_xyz'])} rad" if "euler_xyz" in pose else ""
        turned += f", turned by rpy {value(pose['rpy_deg'])}°" if "rpy_deg" in pose else ""
        parts.append(
            f"- `{name}` of the `{pose['robot']}`: joints at {angles}, `{pose['frame']}` at {value(pose['xyz'])} m"
            f"{turned}. {origin(pose)}"
        )
    return [*parts[:2], "\n".join(parts[2:])]


def _dynamics(numbers: Row) -> list[str]:
    dynamics = numbers["dynamics"]
    joints = {
        "large": "large: joint_1 to 3, of seven 1 to 4",
        "small": "small: the other three",
        "finger": "fingers",
        "gen3_large": "Gen3: large",
        "gen3_small": "Gen3: small",
        "lite": "Gen3 lite",
        "lite_finger": "Gen3 lite: fingers",
    }
    actuators = {group: row for group in joints if (row := bundled.actuator(group))}
    alike: dict[tuple[str, ...], list[str]] = {}
    for group, title in joints.items():
        numbers_of = (value(dynamics[group][field]) for field in ("damping", "armature", "frictionloss"))
        alike.setdefault((*numbers_of, dynamics[group].get("doubt", "")), []).append(title)
    return [
        "## Joint dynamics and actuators",
        grid(
            ("joints", "damping [N m s/rad]", "armature [kg m²]", "friction loss [N m]", "doubt"),
            (("; ".join(titles), *row) for row, titles in alike.items()),
        ),
        f"{origin(dynamics)} Those of the Gen3 are G's. A URDF cannot carry armature.",
        "The bridge adds actuators to Jacos and Micos; the files in `urdf/` hold none. `kp` is for an arm that takes "
        "positions.",
        grid(
            (
                "joints",
                "kp [N m/rad]",
                "gain kv [N m s/rad]",
                "command",
                "force [N m]",
                "back-driving [N m]",
                "source",
                "doubt",
            ),
            (
                (
                    joints[g],
                    value(row["kp"]) if "kp" in row else "",
                    numbers_in(row, "kv"),
                    _command(row),
                    value(row["force_range"]),
                    numbers_in(row, "back_drive"),
                    row["source"],
                    row["doubt"],
                )
                for g, row in actuators.items()
            ),
        ),
        f"Torque sensors: {numbers['sensors']['arm_joint']}, one per arm joint, three axes, at the joint's frame "
        f"origin in the child body, of what the child exerts on the parent. {origin(numbers['sensors'])}",
    ]


def _command(row: Row) -> str:
    if "ctrl_range" not in row:
        return ""
    turns = [math.degrees(speed) for speed in row["ctrl_range"]]
    whole = [round(turn) for turn in turns]
    if np.allclose(turns, whole, rtol=0.0, atol=1e-9):
        return f"{value(whole)} °/s"
    return f"{value(row['ctrl_range'])} rad/s"


def _masses(numbers: Row) -> list[str]:
    parts = [
        "## Masses",
        "Centres of mass are in the frame of the body; `urdf/*.toml` have the inertias about them. A body that is not "
        "listed has no mass. `link_finger` and `link_finger_tip` stand for each.",
    ]
    shown: dict[tuple[str, ...], str] = {}
    doubted: dict[str, str] = {}
    for name in NAMES:
        masses = bundled.section(numbers["masses"], name)
        bodies = {key: bundled.section(masses, key) for key in masses if isinstance(masses[key], dict)}
        fingers = len(bundled.hand(name).get("fingers", ()))
        total = math.fsum(row["mass"] * (fingers if "finger" in key else 1) for key, row in bodies.items())
        rows = [(key, value(row["mass"]), value(row["com"]), value(row["inertia"])) for key, row in bodies.items()]
        own = [row[:3] for row in rows if shown.setdefault(row, name) == name]
        doubts = [masses["doubt"], *sorted({row["doubt"] for row in bodies.values() if "doubt" in row})]
        first = {doubt: doubted.setdefault(doubt, name) for doubt in doubts}
        said = [f"Doubt: {doubt}." for doubt, other in first.items() if other == name]
        said += [f"Doubts as of `{other}`." for other in dict.fromkeys(first.values()) if other != name]
        parts.append(f"### {name}: {total:.4f} kg")
        if own:
            parts.append(grid(("body", "mass [kg]", "centre of mass [m]"), own))
        parts.append(" ".join([*_alike(rows, shown, name), f"Source: {masses['source']}.", *said]))
    return parts


def _contacts(numbers: Row) -> list[str]:
    contacts = numbers["contacts"]
    arm, finger = contacts["arm"], contacts["finger"]
    pairs = ", ".join(f"`{a}` and `{b}`" for a, b in contacts["exclude_arm"])
    return [
        "## Contacts",
        grid(("parameter", "arm, palm and fingers"), ((key, value(row)) for key, row in arm.items())),
        f"Fingers have condim {finger['condim']} (torsional friction as well). Pairs that never touch: {pairs}; the "
        "hand and each of its fingers; the finger tips among themselves; and, as everywhere in MuJoCo, a body and its "
        f"parent where both can move. {origin(contacts)}",
    ]


def _shapes() -> list[str]:
    shapes = bundled.robot_table("shapes.toml")
    parts = [
        "## Shapes",
        "Boxes, cylinders and spheres, the same in URDF and MJCF, for drawing and for contact; `urdf/shapes.toml` has "
        "their sizes [P]. They cover the measured meshes by at least 0.1 mm, so no contact is missed. Of random "
        "configurations the `gen3` touches itself in 1 %, the `gen3_6dof` in 2 %, the `gen3_lite` in 9 %, the "
        "`j2n6s300` in 6 %; the meshes of the Gen3 arms in 0.3, 0.4 and 1.5 % fewer.",
    ]
    rows, doubts = [], dict[str, list[str]]()
    for group in shapes:
        merged = bundled.section(shapes, group)
        bodies = [key for key in shapes[group] if isinstance(shapes[group][key], dict)]
        count = sum(len(bundled.section(merged, body)["parts"]) for body in bodies)
        like = f"{count} for {listed(bodies)}" if bodies else "none of its own"
        rest = f"; the rest as {shapes[group]['like']}" if "like" in shapes[group] else ""
        part = group.replace("_", " ")
        rows.append((part, f"{like}{rest}"))
        if "doubt" in shapes[group]:
            doubts.setdefault(shapes[group]["doubt"], []).append(part)
    listing = "\n".join(f"- {', '.join(parts)}: {doubt}." for doubt, parts in doubts.items())
    return [*parts, grid(("part", "primitives"), rows), listing]


def _arena(numbers: Row) -> list[str]:
    arena = numbers["arena"]
    rows = [(key, value(row)) for key, row in arena.items() if not isinstance(row, dict) and key != "source"]
    ground = arena["ground"]
    rows += [("arm offset [m]", value(arena["arm_offset"]["xyz"]))]
    rows += [(f"ground {key}", value(row)) for key, row in ground.items() if key != "doubt"]
    return [
        "## Arena",
        "Options that the bridge's `Arena` sets, since a body file cannot. Times in s, "
        "`boundmass` in kg, `boundinertia` in kg m².",
        grid(("option", "value"), rows),
        f"Source: {arena['source']}. Doubt (ground): {ground['doubt']}.",
        "`Arena(contact=...)` is one of these, by default `firm`:",
        grid(
            ("contact", *CONTACT_OPTIONS, "source", "doubt"),
            [
                (name, *(value(row[key]) for key in CONTACT_OPTIONS), row["source"], row.get("doubt", ""))
                for name, row in arena["contacts"].items()
            ],
        ),
    ]


def main() -> None:
    """Write the page."""
    PAGE.write_text(page(), encoding="utf-8")


if __name__ == "__main__":
    main()
