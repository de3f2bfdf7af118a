"""`to_mujoco`: the same arm in MuJoCo, for mink and for contact.

The twin has the joints of a `Robot` and nothing else that moves, from the robot's own Pinocchio numbers, so that a URDF
and an MJCF give the same one. It is kinematic: masses are placeholders. Its shapes are those of the description, which
MuJoCo compiles too: `with_shapes` and `with_masses`.
"""

from __future__ import annotations

import itertools
import xml.etree.ElementTree as ET
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

import mujoco
import numpy as np
import pinocchio as pin

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, ShapeError
from jacokin.model import checks, poses
from jacokin.model.descriptions import bundled, chain, mjcf, urdf
from jacokin.model.descriptions.convex_parts import convex_parts
from jacokin.model.descriptions.meshes import TriangleMesh
from jacokin.model.descriptions.shapes import Shape, ShapesOfLinks, add_solid, prepare_shapes
from jacokin.model.kinematics import axis_of
from jacokin.model.robot import Robot, Source, checked_robot

BASE_BODY = "jacokin_base"
FARTHEST = 1e6  # [m] that a shape is away from its joint
PART = ", part "  # between the name of a shape and the number of a part of it
HULLS = ("meshes collide as their convex hulls, which may touch where they do not; decompose=True takes convex parts",)
MESH_GEOM = int(mujoco.mjtGeom.mjGEOM_MESH)
# Off the joint's axes and turned, or MuJoCo's compiler marks the body for shortcuts that its true numbers forbid.
PLACEHOLDER = """<inertial><origin xyz="0.1 0.2 0.3" rpy="0.3 0.2 0.1"/><mass value="1"/>
<inertia ixx="3" iyy="4" izz="5" ixy="0" ixz="0" iyz="0"/></inertial>"""


def to_mujoco(robot: Robot, *, geometry: bool = False) -> mujoco.MjModel:
    """Compile the kinematic twin of a robot.

    Args:
        robot: the arm.
        geometry: True to carry the collision shapes of the description, fingers locked at `robot.finger_angle`.

    Returns:
        A model with nq == nv == robot.dof, joints in the robot's order and named as there, one body a link, and a
        site for every name in `robot.frames`. The world of the model is the robot's base.

    Raises:
        InvalidInputError: `robot` is not a Robot, `geometry` neither True nor False.
        ShapeError: `geometry` and the description's shapes cannot be loaded.
    """
    spec = to_spec(checked_robot("robot", robot), geometry=checks.flag("geometry", geometry))
    return compile_spec(spec, robot)


def compile_spec(spec: mujoco.MjSpec, robot: Robot) -> mujoco.MjModel:
    """The twin of a robot, compiled.

    Raises:
        ShapeError: MuJoCo cannot compile its shapes.
    """
    try:
        return spec.compile()
    except mjcf.MUJOCO_ERRORS as error:
        raise ShapeError(f"{robot.source.path}: MuJoCo cannot load these shapes: {error}") from error


def to_spec(robot: Robot, *, geometry: bool = False, finger_angle: float | None = None) -> mujoco.MjSpec:
    """The twin of a robot before it is compiled: scene geometry can still be added.

    Args:
        robot: the arm.
        geometry: True for its collision shapes, too, and the pairs of them that MuJoCo would test for contact.
        finger_angle: angle of the joints off the arm [rad]; None for the one the robot was loaded with.

    Raises:
        InvalidInputError: a finger angle that no joint off the arm can take.
        ShapeError: a mesh is not found, or the shapes cannot be loaded.
    """
    model = robot.pin_model
    spec = mujoco.MjSpec()
    spec.modelname = robot.name
    spec.compiler.degree = False
    spec.compiler.autolimits = False
    carriers = [spec.worldbody.add_body(name=BASE_BODY)]
    for index in range(1, model.njoints):
        placement = model.jointPlacements[index]
        body = carriers[model.parents[index]].add_body(
            name=body_of_joint(index),
            pos=placement.translation,
            quat=poses.quaternion(placement.rotation),
        )
        # Kinematics needs no mass; MuJoCo refuses moving bodies without one.
        body.mass, body.inertia, body.explicitinertial = 1.0, np.ones(3), True
        _add_joint(body, robot, index)
        carriers.append(body)
    for name in robot.frames:
        frame = model.frames[robot.frame_id(name)]
        carriers[frame.parentJoint].add_site(
            name=name, pos=frame.placement.translation, quat=poses.quaternion(frame.placement.rotation)
        )
    if not geometry:
        return spec
    source = with_shapes(robot).model
    shapes, pairs = shapes_of_description(robot, finger_angle)
    colours = {mjcf.geom_name(source, geom): rgba_of(source, geom) for geom in range(source.ngeom)}
    for shape in shapes:
        if shape.kind == "mesh":
            spec.add_mesh(name=shape.name, uservert=shape.vertices.ravel())
        added = add_solid(carriers[shape.joint], shape)
        added.rgba, added.mass = colours[shape.name.rsplit(PART, 1)[0]], 0.0
    for a, b in pairs:
        first, second = shapes[a].name, shapes[b].name
        spec.add_pair(name=f"{first}~{second}", geomname1=first, geomname2=second)
    return spec


def body_of_joint(joint: int) -> str:
    """Name of the twin's body that Pinocchio's joint (by number, 0 for the base) moves."""
    return f"jacokin_body_{joint}" if joint else BASE_BODY


def _add_joint(body: mujoco.MjsBody, robot: Robot, index: int) -> None:
    """The joint that moves a body, about (or along) the axis Pinocchio has."""
    axis = axis_of(robot.pin_model, index)
    limited = bool(np.isfinite(robot.lower[index - 1]) or np.isfinite(robot.upper[index - 1]))
    # MuJoCo wants a finite range; one side may be open.
    low, high = np.clip((robot.lower[index - 1], robot.upper[index - 1]), -1e6, 1e6)
    if not low < high:  # a locked joint: MuJoCo wants some room, answers are clamped to the robot's own limits
        low, high = low - 1e-9, high + 1e-9
    body.add_joint(
        name=robot.joint_names[index - 1],
        type=mujoco.mjtJoint.mjJNT_SLIDE if axis.slides else mujoco.mjtJoint.mjJNT_HINGE,
        axis=axis.direction,
        limited=mujoco.mjtLimited.mjLIMITED_TRUE if limited else mujoco.mjtLimited.mjLIMITED_FALSE,
        range=(low, high) if limited else (0.0, 0.0),
    )


def shapes_of_description(robot: Robot, finger_angle: float | None = None) -> ShapesOfLinks:
    """The collision shapes of the arm in the order of the joints that carry them, and the pairs that MuJoCo would test.

    Meshes have their vertices, and collide as their convex hulls. Arguments and errors as of `to_spec`.
    """
    source = with_shapes(robot).model
    model = robot.pin_model
    fingers = None if finger_angle is None else _JointsOffArm(source, robot, finger_angle)
    names = set(robot.frames)
    found: list[tuple[Shape, int]] = []
    for geom in range(source.ngeom):
        body = int(source.geom_bodyid[geom])
        link = mjcf.body_name(source, body)
        if link not in names or body == 0 or not (source.geom_contype[geom] or source.geom_conaffinity[geom]):
            continue
        frame = model.frames[robot.frame_id(link)]
        T_carrier_link = frame.placement if fingers is None else fingers.placement(body, frame.parentJoint)
        shape = _shape(source, geom, int(frame.parentJoint))
        shape = shape._replace(placement=T_carrier_link * shape.placement)
        _check_place(shape)
        found += [(part, geom) for part in _parts(robot, shape, source, geom)]
    found.sort(key=lambda each: each[0].joint)  # as MuJoCo numbers them in the twin of the arm
    numbers: dict[int, list[int]] = {}
    for index, (_, geom) in enumerate(found):
        numbers.setdefault(geom, []).append(index)
    pairs = tested_pairs(source, {geom: shape.joint for shape, geom in found})
    each = [pair for a, b in pairs for pair in itertools.product(numbers[a], numbers[b])]
    return ShapesOfLinks([shape for shape, _ in found], each)


def _check_place(shape: Shape) -> None:
    """Refuse a shape so far away that no distance to it has any digits.

    Raises:
        ShapeError: it is.
    """
    x, y, z = shape.placement.translation
    if not max(abs(x), abs(y), abs(z)) <= FARTHEST:
        at = f"({x:.3g}, {y:.3g}, {z:.3g}) m of its joint"
        raise ShapeError(f"shape {shape.name!r} is at {at}: not finite, or beyond {FARTHEST:g} m")


def _parts(robot: Robot, shape: Shape, source: mujoco.MjModel, geom: int) -> list[Shape]:
    """A shape of the source as it collides: a mesh in its convex parts, where that is asked for."""
    if shape.kind != "mesh" or not robot.source.decompose:
        return [shape]
    parts = robot.once(_parts_of_meshes, carried=True)[int(source.geom_dataid[geom])]
    if len(parts) == 1:
        return [shape._replace(vertices=parts[0])]
    return [shape._replace(name=f"{shape.name}{PART}{k}", vertices=part) for k, part in enumerate(parts, start=1)]


def _parts_of_meshes(robot: Robot) -> dict[int, list[Array]]:
    """For each mesh the corners (n, 3) of its convex parts, in the frame of its geoms [m]."""
    described, found = with_shapes(robot), dict[int, list[Array]]()
    model = described.model
    collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
    for mesh in np.unique(model.geom_dataid[(model.geom_type == MESH_GEOM) & collides]).tolist():
        T_file_geom = mjcf.placement(model.mesh_quat[mesh], model.mesh_pos[mesh])  # MuJoCo takes its principal axes
        given = described.meshes.get(_file_name(model, mesh))
        if given is None:
            first = int(model.mesh_faceadr[mesh])
            faces = np.array(model.mesh_face[first : first + int(model.mesh_facenum[mesh])], dtype=np.int64)
            given = TriangleMesh(mesh_vertices(model, mesh) @ T_file_geom.rotation.T + T_file_geom.translation, faces)
        found[mesh] = [(part - T_file_geom.translation) @ T_file_geom.rotation for part in convex_parts(given)]
    return found


def _file_name(model: mujoco.MjModel, mesh: int) -> str:
    """Of a mesh, as MuJoCo was given it."""
    first = int(model.mesh_pathadr[mesh])
    return str(bytes(model.paths[first:]).split(b"\0", 1)[0].decode(errors="replace")) if first >= 0 else ""


def shapes_of_twin(model: mujoco.MjModel) -> list[Shape]:
    """The shapes of a compiled twin, and of what was added to it, in the order of its geoms."""
    joints = [max((j + 1 for j in mjcf.joints_above(model, int(body))), default=0) for body in model.geom_bodyid]
    return [_shape(model, geom, joint) for geom, joint in enumerate(joints)]


def shape_through_mujoco(name: str, add_to: Callable[[mujoco.MjsBody], None]) -> Shape:
    """A shape that adds itself to a body, in the frame of that body.

    Raises:
        ShapeError: MuJoCo cannot compile it, or it adds none of its name.
    """
    spec = mujoco.MjSpec()
    try:
        add_to(spec.worldbody)
        found = {shape.name: shape for shape in shapes_of_twin(spec.compile())}
    except mjcf.MUJOCO_ERRORS as error:
        raise ShapeError(f"MuJoCo cannot load the shape {name!r}: {error}") from error
    if name not in found:
        raise ShapeError(f"the shape {name!r} adds no geom of its name")
    return found[name]


def _shape(model: mujoco.MjModel, geom: int, joint: int) -> Shape:
    """One geom, in the frame of its body."""
    kind = mujoco.mjtGeom(model.geom_type[geom])
    shape = Shape(
        name=mjcf.geom_name(model, geom),
        kind=kind.name.removeprefix("mjGEOM_").lower(),
        size=np.array(model.geom_size[geom]),
        joint=joint,
        placement=mjcf.placement(model.geom_quat[geom], model.geom_pos[geom]),
    )
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        shape = shape._replace(vertices=mesh_vertices(model, int(model.geom_dataid[geom])))
    return shape


def shapes_of_links(robot: Robot) -> dict[str, frozenset[str]]:
    """Names of the shapes of each link, with those of links behind it that no joint of the arm separates from it."""
    return robot.once(_shapes_of_links, carried=True)


def _shapes_of_links(robot: Robot) -> dict[str, frozenset[str]]:
    source, model = with_shapes(robot).model, robot.pin_model
    joint_of = {link: int(model.frames[robot.frame_id(link)].parentJoint) for link in robot.frames}
    found: dict[str, set[str]] = {}
    for geom in range(source.ngeom):
        if not (source.geom_contype[geom] or source.geom_conaffinity[geom]):
            continue  # drawn only
        body = int(source.geom_bodyid[geom])
        joint = joint_of.get(mjcf.body_name(source, body))
        while body:
            link = mjcf.body_name(source, body)
            if joint is not None and joint_of.get(link) == joint:
                shape = _shape(source, geom, 0)
                found.setdefault(link, set()).update(part.name for part in _parts(robot, shape, source, geom))
            body = int(source.body_parentid[body])
    return {link: frozenset(shapes) for link, shapes in found.items()}


class _JointsOffArm:
    """Where the links of a description are when the joints off the arm stand at another angle."""

    def __init__(self, source: mujoco.MjModel, robot: Robot, angle: float) -> None:
        """Put every joint off the arm where it is locked, else at the angle [rad], clipped into its limits.

        MuJoCo 3 keeps limits of joints that a URDF calls continuous; the description's own hold for what is locked.
        Joints that follow another one are where that has them, and those of a closed loop where the loop is closed.
        """
        self._source, self._robot = source, robot
        self._data = mujoco.MjData(source)
        arm, allowed, held = set(robot.joint_names), list[tuple[float, float, str]](), dict(robot.source.locked)
        following = [rule for rule in robot.source.followers if rule[0] not in held]
        passive = passive_joints(robot)
        limits, places, wanted = dict[str, tuple[float, float]](), dict[str, int](), dict[str, float]()
        for joint in range(source.njnt):
            name = mjcf.joint_name(source, joint)
            if name in arm or name in passive or source.jnt_type[joint] not in mjcf.SCALAR_JOINTS:
                continue
            low, high = source.jnt_range[joint].tolist() if source.jnt_limited[joint] else (-np.inf, np.inf)
            places[name], wanted[name] = int(source.jnt_qposadr[joint]), held.get(name, angle)
            limits[name] = (held[name], held[name]) if name in held else (low, high)
            if all(name != follower for follower, *_ in following):
                slides = source.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE
                allowed.append((low, high, "m" if slides else "rad"))
        if not any(low <= angle <= high for low, high, _ in allowed):
            raise InvalidInputError(f"finger_angle = {angle}: {chain.range_of_fingers(allowed)}")
        moved, ends = list(places.values()), np.array(list(chain.standing(wanted, limits, following).values()))
        if passive:
            # From where the description has the gripper, so that its loops close as there.
            loops, start = mjcf.joint_ids(source, sorted(passive)), self._data.qpos[moved]
            for part in np.linspace(0.0, 1.0, 9)[:-1]:
                self._data.qpos[moved] = start + part * (ends - start)
                _close_loops(source, self._data, loops, steps=2)
        self._data.qpos[moved] = ends
        if passive:
            _close_loops(source, self._data, loops, steps=30)
        mujoco.mj_kinematics(source, self._data)

    def placement(self, body: int, carrier: int) -> pin.SE3:
        """Placement of a link on the link that Pinocchio's joint (by number, 0 for the base) moves."""
        robot, source = self._robot, self._source
        if carrier == 0:
            return robot.pin_model.frames[robot.frame_id(mjcf.body_name(source, body))].placement
        joints = [mjcf.joint_name(source, joint) for joint in range(source.njnt)]
        moved = int(source.jnt_bodyid[joints.index(robot.joint_names[carrier - 1])])
        T_carrier_moved = robot.pin_model.frames[robot.frame_id(mjcf.body_name(source, moved))].placement
        return T_carrier_moved * self._world(moved).inverse() * self._world(body)

    def _world(self, body: int) -> pin.SE3:
        return mjcf.placement(self._data.xquat[body], self._data.xpos[body])


def passive_joints(robot: Robot) -> frozenset[str]:
    """Joints off the arm of an MJCF that only closed loops of its gripper move: those with no actuator and no leader.

    None where nothing moves a loop. A URDF has no loops.
    """
    return robot.once(_passive_joints, carried=True)


def _passive_joints(robot: Robot) -> frozenset[str]:
    source = with_shapes(robot).model
    couplings = mjcf.couplings(source)
    looped = {joint for each in couplings if each.leader is None for joint in each.joints} - set(robot.joint_names)
    led = {joint for each in couplings if each.leader is not None for joint in each.joints}
    moved = {mjcf.joint_name(source, joint) for joint in mjcf.actuated(source)}
    driving = looped & (led | moved)
    return frozenset(looped - driving if driving else ())


def _close_loops(source: mujoco.MjModel, data: mujoco.MjData, joints: Sequence[int], steps: int) -> None:
    """Move some joints to where the equalities of a model hold, from where they are, by Gauss and Newton.

    Where a loop leaves a joint free, as in fingers that adapt to what they hold, springs and limits decide as they do
    with nothing between the fingers.
    """
    from scipy.optimize import lsq_linear  # only such grippers need it

    stiff = 1e4  # [1/m] of a loop beside its springs, so that these open it by less than a micrometre
    slack = 1e-3  # of a joint that neither a loop nor a spring holds
    dofs, places = source.jnt_dofadr[joints], source.jnt_qposadr[joints]
    unlimited = source.jnt_limited[joints] == 0
    low = np.where(unlimited, -np.inf, source.jnt_range[joints, 0])
    high = np.where(unlimited, np.inf, source.jnt_range[joints, 1])
    springs = np.sqrt(np.array(source.jnt_stiffness[joints], dtype=np.float64).reshape(len(joints), -1)[:, 0])
    rest = source.qpos_spring[places]
    for _ in range(steps):
        residual, jacobian = _equations(source, data)
        at = data.qpos[places]
        matrix = np.vstack([stiff * jacobian[:, dofs], np.diag(springs), slack * np.eye(len(joints))])
        wanted = np.concatenate([-stiff * residual, springs * (rest - at), np.zeros(len(joints))])
        step = lsq_linear(matrix, wanted, (low - at, high - at), method="bvls").x
        data.qpos[places] += step
        if np.abs(step).max() <= 1e-7:  # [rad] or [m]
            break


def _equations(source: mujoco.MjModel, data: mujoco.MjData) -> tuple[Array, Array]:
    """By how much the equalities of a model miss (n,), and their Jacobian (n, nv)."""
    mujoco.mj_kinematics(source, data)
    mujoco.mj_comPos(source, data)
    mujoco.mj_tendon(source, data)
    mujoco.mj_makeConstraint(source, data)
    jacobian = np.zeros((data.nefc, source.nv))
    if mujoco.mj_isSparse(source):
        mujoco.mju_sparse2dense(jacobian, data.efc_J, data.efc_J_rownnz, data.efc_J_rowadr, data.efc_J_colind)
    else:
        jacobian = data.efc_J.reshape(data.nefc, source.nv)
    rows = data.efc_type == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    return data.efc_pos[rows].copy(), jacobian[rows].copy()


def rgba_of(model: mujoco.MjModel, number: int, kind: str = "geom") -> Array:
    """(4,) the colour of a geom or a site in 0..1."""
    material = int(getattr(model, f"{kind}_matid")[number])
    rgba = getattr(model, f"{kind}_rgba")[number] if material < 0 else model.mat_rgba[material]
    return np.array(rgba, dtype=np.float64)


def mesh_vertices(source: mujoco.MjModel, mesh: int) -> Array:
    """(n, 3) vertices of a mesh in the frame of its geom [m]."""
    first = int(source.mesh_vertadr[mesh])
    return np.array(source.mesh_vert[first : first + int(source.mesh_vertnum[mesh])], dtype=np.float64)


def tested_pairs(source: mujoco.MjModel, carrier: Mapping[int, int]) -> list[tuple[int, int]]:
    """Pairs of shapes MuJoCo would test: masks agree, not parent and child, not excluded, and able to move apart."""
    # MuJoCo's signature of an excluded pair: lower body id in the high half.
    excluded = {int(signature) for signature in source.exclude_signature}
    pairs = []
    for first, second in itertools.combinations(sorted(carrier), 2):
        body_a, body_b = int(source.geom_bodyid[first]), int(source.geom_bodyid[second])
        if carrier[first] == carrier[second] or (min(body_a, body_b) << 16) + max(body_a, body_b) in excluded:
            continue
        masks = (source.geom_contype[first] & source.geom_conaffinity[second]) | (
            source.geom_contype[second] & source.geom_conaffinity[first]
        )
        if masks and not _parent_and_child(source, body_a, body_b):
            pairs.append((first, second))
    return pairs


def _parent_and_child(source: mujoco.MjModel, body_a: int, body_b: int) -> bool:
    """Whether a joint joins the two; bodies welded together count as one.

    MuJoCo tests such a pair when one side is welded to the world. A base that overlaps its first link is no
    self-contact, so here it never counts.
    """
    weld_a, weld_b = int(source.body_weldid[body_a]), int(source.body_weldid[body_b])
    parent_a = int(source.body_weldid[source.body_parentid[weld_a]])
    parent_b = int(source.body_weldid[source.body_parentid[weld_b]])
    return weld_a == parent_b or weld_b == parent_a


class DescribedShapes(NamedTuple):
    """A description with its collision shapes, in MuJoCo; the masses of a URDF are placeholders."""

    model: mujoco.MjModel
    notes: tuple[str, ...] = ()
    """Sentences on shapes that were left out, and on meshes whose axes are in doubt."""
    meshes: Mapping[str, TriangleMesh] = MappingProxyType({})
    """Of a URDF, by the names of the files that MuJoCo was given instead: their hulls."""


def with_shapes(robot: Robot) -> DescribedShapes:
    """The description of a robot with its shapes, read once.

    Raises:
        ShapeError: a mesh is not found, or the shapes cannot be loaded.
    """
    return robot.once(_read_shapes)


def _read_shapes(robot: Robot) -> DescribedShapes:
    source = robot.source
    try:
        if not isinstance(source.content, str):
            model = _mjcf(source)
            collides = (model.geom_contype != 0) | (model.geom_conaffinity != 0)
            meshes_collide = bool(((model.geom_type == MESH_GEOM) & collides).any())
            return DescribedShapes(model, HULLS if meshes_collide and not source.decompose else ())
        tree = ET.fromstring(source.content)
        for link in tree.findall("link"):
            _replace_inertial(link)
            for visual in link.findall("visual"):
                link.remove(visual)
        prepared = prepare_shapes(tree, source.path, source.package_dirs)
        meshes, notes = (prepared.meshes, ()) if source.decompose else ({}, HULLS if prepared.meshes else ())
        return DescribedShapes(_compile(tree, prepared.assets, source), (*prepared.notes, *notes), meshes)
    except ModelError as error:
        raise ShapeError(str(error)) from error


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
    bodies = {mjcf.body_name(model, body): body for body in range(model.nbody)}
    for name, inertial in replaced.items():
        _write_inertial(model, bodies[name], inertial)
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
        if element.tag not in urdf.KINEMATIC_TAGS:
            tree.remove(element)
        for limit in element.findall("limit"):
            if limit.get("lower") == limit.get("upper"):  # MuJoCo takes it for none, and would warn on stderr
                element.remove(limit)
    renamed = {mjcf.WORLD: mjcf.WORLD_LINK}
    for way, key in (("link", "name"), ("joint/parent", "link"), ("joint/child", "link")):
        for element in tree.findall(way):
            element.set(key, renamed.get(element.get(key, ""), element.get(key, "")))
    try:
        spec = mujoco.MjSpec.from_string(ET.tostring(tree, encoding="unicode"), assets=assets)
        spec.compiler.fusestatic = False
        links = {link.get("name") for link in tree.findall("link")}
        for pair in () if source.disabled is None else source.disabled.pairs:
            first, second = (renamed.get(name, name) for name in pair)
            if first in links and second in links:
                spec.add_exclude(bodyname1=first, bodyname2=second)
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
    placed = urdf.origin_of(inertial)
    moments, axes = np.linalg.eigh(_tensor(inertial))
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] *= -1.0
    model.body_inertia[body] = moments
    model.body_ipos[body] = placed.translation
    model.body_iquat[body] = poses.quaternion(placed.rotation @ axes)
