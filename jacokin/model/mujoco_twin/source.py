"""A robot's own description in MuJoCo, everything movable still movable. Files are not read again, meshes aside."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import mujoco
import numpy as np

from jacokin.arrays import Array
from jacokin.errors import ModelError
from jacokin.model import poses
from jacokin.model.descriptions import bundled, meshes, mjcf, urdf
from jacokin.model.robot import Robot
from jacokin.model.source import Source

# Off the joint's axes and turned, or MuJoCo's compiler marks the body for shortcuts that its true numbers forbid.
PLACEHOLDER = """<inertial><origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/><mass value="1"/>
<inertia ixx="3" iyy="4" izz="5" ixy="0" ixz="0" iyz="0"/></inertial>"""


def with_shapes(robot: Robot) -> mujoco.MjModel:
    """The description with its shapes; the masses of a URDF are placeholders.

    Raises:
        ModelError: a mesh is not found, or MuJoCo cannot load the shapes.
    """
    source = robot.source
    if not isinstance(source.content, str):
        return _mjcf(source)
    tree = ET.fromstring(source.content)
    for link in tree.findall("link"):
        _replace_inertial(link)
        for visual in link.findall("visual"):
            link.remove(visual)
    return _compile(tree, meshes.embedded(tree, source.path, source.package_dirs), source)


def with_masses(robot: Robot) -> mujoco.MjModel:
    """The description with its masses; a URDF without its shapes.

    MuJoCo refuses moving links without mass, and inertias that no body has (larger than the sum of the other two).
    Such links are compiled with placeholders that are replaced by the numbers of the file.

    Raises:
        ModelError: MuJoCo cannot load the description.
    """
    source = robot.source
    if not isinstance(source.content, str):
        return _mjcf(source)
    tree = ET.fromstring(urdf.kinematic_text(ET.fromstring(source.content)))
    replaced: dict[str, ET.Element | None] = {}
    for link in tree.findall("link"):
        inertial = link.find("inertial")
        if inertial is None or not _accepted(inertial):
            replaced[link.get("name", "")] = inertial
            _replace_inertial(link)
    model = _compile(tree, {}, source)
    for name, inertial in replaced.items():
        _write_inertial(model, model.body(name).id, inertial)
    return model


def _mjcf(source: Source) -> mujoco.MjModel:
    if source.bundled is not None:
        return mjcf.compile_mjcf(bundled.urdf_folder() / f"{source.bundled}.xml")
    if source.content is None:
        raise ModelError(f"{source.path}: this arm was taken from a scene and has no description of its own")
    return source.content


def _compile(tree: ET.Element, assets: dict[str, bytes], source: Source) -> mujoco.MjModel:
    """A URDF in MuJoCo with all its links."""
    for element in list(tree):
        if element.tag not in (*urdf.KINEMATIC_TAGS, "material"):
            tree.remove(element)
    try:
        spec = mujoco.MjSpec.from_string(ET.tostring(tree, encoding="unicode"), assets=assets)
        spec.compiler.fusestatic = False
        return spec.compile()
    except mjcf.MUJOCO_ERRORS as error:
        raise ModelError(f"{source.path}: MuJoCo cannot load this URDF: {error}") from error


def _replace_inertial(link: ET.Element) -> None:
    for inertial in link.findall("inertial"):
        link.remove(inertial)
    link.append(ET.fromstring(PLACEHOLDER))


def _tensor(inertial: ET.Element) -> Array:
    """(3, 3) inertia about the centre of mass, in the axes of the inertial frame [kg m^2]."""
    inertia = inertial.find("inertia")
    assert inertia is not None  # of a checked URDF
    xx, xy, xz, yy, yz, zz = (float(inertia.get(key, "")) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"))
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _mass(inertial: ET.Element) -> float:
    mass = inertial.find("mass")
    assert mass is not None  # of a checked URDF
    return float(mass.get("value", ""))


def _accepted(inertial: ET.Element) -> bool:
    """Whether MuJoCo takes a link's mass and inertia."""
    least, middle, most = np.linalg.eigvalsh(_tensor(inertial))
    return bool(_mass(inertial) >= mujoco.mjMINVAL and least >= mujoco.mjMINVAL and least + middle >= most)


def _write_inertial(model: mujoco.MjModel, body: int, inertial: ET.Element | None) -> None:
    """Put the numbers of the file into a compiled body."""
    model.body_mass[body] = 0.0 if inertial is None else _mass(inertial)
    model.body_inertia[body] = 0.0
    if inertial is None:
        return
    origin = inertial.find("origin")
    position, rpy = (
        np.array([float(part) for part in ("0 0 0" if origin is None else origin.get(key, "0 0 0")).split()])
        for key in ("xyz", "rpy")
    )
    moments, axes = np.linalg.eigh(_tensor(inertial))
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    model.body_inertia[body] = moments
    model.body_ipos[body] = position
    model.body_iquat[body] = poses.quaternion(poses.rotation_from_rpy(rpy) @ axes)
