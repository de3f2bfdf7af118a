"""Robot descriptions that tests write to disk."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import jacokin
from jacokin.model import urdf_folder

INCLUDED = """<mujocoinclude>
  <default><default class="arm"><joint damping="0.1" armature="0.3"/></default></default>
</mujocoinclude>"""


# Base posed, include, default classes, frame, reference angle, anchor off the origin, slanted axis, jointless body
# with a site, a branching gripper, a free box, and a second arm's worth of names to trip over.
SCENE = """<mujoco model="scene">
  <compiler angle="radian"/>
  <include file="common.xml"/>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body name="box" pos="1 1 1"><freejoint name="float"/><geom size="0.1"/></body>
    <body name="pedestal" pos="0.3 -0.2 0.5" euler="0.3 0.2 0.1">
      <geom size="0.05"/>
      <site name="mark" pos="0.01 0.02 0.03"/>
      <frame pos="0 0 0.1" euler="0 0.4 0">
        <body name="upper" childclass="arm">
          <joint name="shoulder" axis="0 1 1" pos="0 0.02 0" range="-2 2" limited="true"/>
          <geom type="capsule" fromto="0 0 0 0 0 0.3" size="0.02"/>
          <body name="fore" pos="0 0 0.3">
            <joint name="elbow" axis="0 1 0" ref="0.7" range="-1 1" limited="false"/>
            <geom type="capsule" fromto="0 0 0 0 0 0.2" size="0.02"/>
            <body name="wrist" pos="0 0 0.2">
              <joint name="rail" type="slide" axis="0 0 1" range="0 0.1" limited="true"/>
              <joint name="roll" axis="0 0 1"/>
              <geom size="0.02"/>
              <body name="flange" pos="0 0 0.05" euler="0 1.2 0">
                <geom size="0.01" pos="0.02 0 0"/>
                <site name="tool" pos="0.1 0 0" euler="0.5 0 0"/>
              </body>
              <body name="left">
                <joint name="finger_l" axis="0 0 1" range="0.1 1"/>
                <geom size="0.01"/>
                <site name="pad"/>
              </body>
              <body name="right">
                <joint name="finger_r" axis="0 0 1" range="0.1 1"/>
                <geom size="0.01"/>
              </body>
            </body>
          </body>
        </body>
      </frame>
    </body>
  </worldbody>
</mujoco>"""


def load_text(path: Path, text: str, **options: Any) -> jacokin.Robot:  # Any: those of `load_robot`
    """The robot that a text describes, in a file that is written."""
    path.write_text(text, encoding="utf-8")
    return jacokin.load_robot(path, **options)


def urdf_text() -> str:
    return (urdf_folder() / "j2n6s300.urdf").read_text()


def joint(
    name: str,
    parent: str,
    child: str,
    xyz: Sequence[float],
    *,
    rpy: Sequence[float] = (0.0, 0.0, 0.0),
    kind: str = "revolute",
    axis: Sequence[float] = (0.0, 0.0, 1.0),
    limits: tuple[float, float] = (0.0, 0.0),
    velocity: float = 2.0,
    more: str = "",
) -> str:
    """One joint of a URDF."""
    x, y, z = xyz
    roll, pitch, yaw = rpy
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} {y} {z}" rpy="{roll!r} {pitch!r} {yaw!r}"/><axis xyz="{axis[0]} {axis[1]} {axis[2]}"/>'
        f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="10" velocity="{velocity}"/>{more}</joint>'
    )


def serial_urdf(
    places: Iterable[tuple[Sequence[float], Sequence[float]]],
    limits: Sequence[tuple[float, float] | None],
    *,
    velocity: float = 2.0,
    name: str = "arm",
) -> str:
    """A URDF of one joint after another, `joint_1`, ..., which turn about z, between `link_0`, `link_1`, ...

    Args:
        places: xyz [m] and rpy [rad] of each joint in the link before it.
        limits: of each joint [rad], None for a continuous one; the joints after them are fixed.
        velocity: the limit of all [rad/s].
        name: of the robot.
    """
    parts = ['<link name="link_0"/>']
    for k, (xyz, rpy) in enumerate(places):
        both = limits[k] if k < len(limits) else None
        kind = "fixed" if k >= len(limits) else "continuous" if both is None else "revolute"
        at, link = f"link_{k}", f"link_{k + 1}"
        parts.append(f'<link name="{link}"/>')
        parts.append(
            joint(f"joint_{k + 1}", at, link, xyz, rpy=rpy, kind=kind, limits=both or (0.0, 0.0), velocity=velocity)
        )
    return f'<robot name="{name}">{"".join(parts)}</robot>'


# A UR5's joints, from the parameters that its maker publishes [m].
UR5_JOINTS = [
    ("0 0 0.089159", "0 0 0", "0 0 1"),
    ("0 0.13585 0", "0 1.5707963267948966 0", "0 1 0"),
    ("0 -0.1197 0.425", "0 0 0", "0 1 0"),
    ("0 0 0.39225", "0 1.5707963267948966 0", "0 1 0"),
    ("0 0.093 0", "0 0 0", "0 0 1"),
    ("0 0 0.09465", "0 0 0", "0 1 0"),
]


def ur5_text(shape: str = "", rows: Sequence[tuple[str, str, str]] = UR5_JOINTS, limit: float = 6.283) -> str:
    """A UR5, or an arm of other rows: xyz [m], rpy [rad] and axis of each joint; each link with a shape."""
    links = "".join(f'<link name="l{i}">{shape}</link>' for i in range(len(rows) + 1))
    joints = "".join(
        f'<joint name="q{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        f'<origin xyz="{xyz}" rpy="{rpy}"/><axis xyz="{axis}"/>'
        f'<limit lower="{-limit}" upper="{limit}" effort="1" velocity="1"/></joint>'
        for i, (xyz, rpy, axis) in enumerate(rows)
    )
    return f'<robot name="ur5">{links}{joints}</robot>'


#: Three joints, of which the second slides, about and along axes that are not those of their links.
CRANE = """<robot name="crane">
<link name="base"/><link name="mast"/><link name="slide"/><link name="hook"/>
<joint name="turn" type="continuous"><parent link="base"/><child link="mast"/><axis xyz="0 0 1"/>
  <limit effort="1" velocity="1"/></joint>
<joint name="slide" type="prismatic"><parent link="mast"/><child link="slide"/><origin xyz="0.1 0 0" rpy="0 0.3 0"/>
  <axis xyz="0.6 0 0.8"/><limit lower="0" upper="1.5" effort="1" velocity="1"/></joint>
<joint name="tilt" type="revolute"><parent link="slide"/><child link="hook"/><origin xyz="0.1 0 0"/>
  <axis xyz="0 0.6 0.8"/><limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>"""


def skeleton(parts: str) -> str:
    """A URDF of links 5 cm apart.

    Args:
        parts: links in a row: `joint>link`, then limits in brackets; `+link` is fixed to the link before it,
            `|joint>link` is a branch there, and `||joint>link` goes on along the branch. `[low,high]` [rad],
            `{low,high}` for a slide [m], `*` for a continuous joint; +-2.9 rad if not said. `=mass` [kg] at the end.
            `~` stands for a blank in a name.
    """
    links, joints, at, beside = ['<link name="base"/>'], list[str](), "base", ""
    for part in parts.split():
        plain, _, mass = part.partition("=")
        branch, fixed = plain.startswith("|"), plain.startswith("+")
        parent = beside if plain.startswith("||") else at
        kind, limits = "revolute", (-2.9, 2.9)
        for opening, found in (("[", "revolute"), ("{", "prismatic")):
            if opening in plain:
                plain, _, numbers = plain[:-1].partition(opening)
                low, high = map(float, numbers.split(","))
                kind, limits = found, (low, high)
        if plain.endswith("*"):
            kind, plain = "continuous", plain[:-1]
        plain = plain.replace("~", " ")
        joint, link = (f"to_{plain[1:]}", plain[1:]) if fixed else plain.lstrip("|").split(">")
        inertia = 'ixx="1e-3" iyy="1e-3" izz="1e-3" ixy="0" ixz="0" iyz="0"'
        inertial = f'<inertial><mass value="{mass}"/><inertia {inertia}/></inertial>' if mass else ""
        links.append(f'<link name="{link}">{inertial}</link>')
        joints.append(
            f'<joint name="{joint}" type="{"fixed" if fixed else kind}"><parent link="{parent}"/><child link="{link}"/>'
            f'<origin xyz="0 0 0.05"/><axis xyz="0 {len(joints) % 2} {(len(joints) + 1) % 2}"/>'
            f'<limit lower="{limits[0]}" upper="{limits[1]}" effort="1" velocity="1"/></joint>'
        )
        at, beside = at if branch or fixed else link, link if branch else beside
    return f'<robot name="arm">{"".join(links)}{"".join(joints)}</robot>'


TORSO = """<robot name="torso">{links}
  <joint name="lift" type="prismatic"><parent link="floor"/><child link="torso"/><axis xyz="0 0 1"/>
    <limit lower="0" upper="1" effort="1" velocity="1"/></joint>{arms}</robot>"""


def torso_text(arms: dict[str, int]) -> str:
    """Arms of so many turning joints, by their names, on a torso that is lifted."""
    links, joints = ['<link name="floor"/><link name="torso"/>'], []
    for side, count in arms.items():
        parent = "torso"
        for i in range(count):
            child = f"{side}_{i}"
            links.append(f'<link name="{child}"/>')
            joints.append(
                f'<joint name="{child}_joint" type="continuous"><parent link="{parent}"/><child link="{child}"/>'
                '<origin xyz="0.1 0.2 0.3"/><axis xyz="0 1 0"/></joint>'
            )
            parent = child
    return TORSO.format(links="".join(links), arms="".join(joints))
