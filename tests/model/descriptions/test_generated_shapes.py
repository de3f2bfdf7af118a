"""Our description beside the one dm_control ships: same numbers, and primitives that contain its meshes."""

from __future__ import annotations

import importlib.util
import math
import re
from pathlib import Path

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from jacokin.arrays import Array
from jacokin.model.descriptions import bundled
from tests.optional import needs_dm_control

FOLDER = Path(__file__).resolve().parents[3] / "urdf"
# The other description writes quaternions with six digits: 8e-7 rad and 3e-8 m at the wrist.
SIX_DIGITS = 2e-6
MOST_FALSE_CONTACTS = 0.015  # of configurations
# What the table of shapes promises, less what lies between samples [m].
LEAST_DEPTH = 0.9e-4


def mjcf(name: str) -> mujoco.MjModel:
    return mujoco.MjModel.from_xml_path(str(FOLDER / f"{name}.xml"))


@pytest.fixture(scope="module")
def meshes() -> mujoco.MjModel:
    """dm_control's arm with its hand, read from its files without importing it."""
    needs_dm_control()
    spec = importlib.util.find_spec("dm_control")
    assert spec is not None
    assert spec.submodule_search_locations is not None
    folder = Path(spec.submodule_search_locations[0]) / "third_party" / "kinova"
    arm = mujoco.MjSpec.from_file(str(folder / "jaco_arm.xml"))
    hand = mujoco.MjSpec.from_file(str(folder / "jaco_hand.xml"))
    arm.attach(hand, prefix="hand:", site=arm.site("wristsite"))
    return arm.compile()


def our_name(body: str) -> str:
    """Our name of one of dm_control's bodies."""
    return re.sub(r"^b_", "link_", body.removeprefix("hand:"))


def random_within_limits(model: mujoco.MjModel, count: int, seed: int) -> Array:
    """Configurations uniform within the limits, free joints in [-pi, pi], fingers at 0.5 rad."""
    limited = model.jnt_limited[:6, None] == 1
    low, high = np.where(limited, model.jnt_range[:6], [-math.pi, math.pi]).T
    arm = np.random.default_rng(seed).uniform(low, high, (count, 6))
    return np.hstack([arm, np.full((count, model.nq - 6), 0.5)])


def touching(model: mujoco.MjModel, configurations: Array) -> NDArray[np.bool_]:
    data = mujoco.MjData(model)
    out = np.zeros(len(configurations), dtype=bool)
    for i, q in enumerate(configurations):
        data.qpos[:] = q
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_collision(model, data)
        out[i] = data.ncon > 0
    return out


def test_no_mesh_contact_is_missed_and_few_are_invented(meshes: mujoco.MjModel) -> None:
    ours = mjcf("j2n6s300")
    q = random_within_limits(ours, 4000, seed=20)
    true, seen = touching(meshes, q), touching(ours, q)
    assert 0.04 < true.mean() < 0.07
    assert not (true & ~seen).any()
    assert (seen & ~true).mean() <= MOST_FALSE_CONTACTS


@pytest.mark.slow
def test_no_mesh_contact_is_missed_over_many(meshes: mujoco.MjModel) -> None:
    ours = mjcf("j2n6s300")
    q = random_within_limits(ours, 40_000, seed=21)
    true, seen = touching(meshes, q), touching(ours, q)
    assert not (true & ~seen).any()
    assert (seen & ~true).mean() <= MOST_FALSE_CONTACTS


def test_primitives_cover_the_hulls(meshes: mujoco.MjModel) -> None:
    """Every point of every mesh's convex hull lies inside a primitive of the same body, 0.1 mm deep or more."""
    ours = mjcf("j2n6s300")
    rng = np.random.default_rng(23)
    for g in np.flatnonzero(meshes.geom_type == mujoco.mjtGeom.mjGEOM_MESH):
        mesh = meshes.geom_dataid[g]
        first = meshes.mesh_vertadr[mesh]
        vertices = meshes.mesh_vert[first : first + meshes.mesh_vertnum[mesh]].astype(float)
        points = surface_points(vertices, 20_000, rng) @ rotation(meshes.geom_quat[g]).T + meshes.geom_pos[g]
        body = ours.body(our_name(meshes.body(meshes.geom_bodyid[g]).name)).id
        shapes = np.flatnonzero(ours.geom_bodyid == body)
        depth = np.max([-signed_distance(ours, int(shape), points) for shape in shapes], axis=0)
        assert depth.min() > LEAST_DEPTH, meshes.geom(g).name


def rotation(quat_wxyz: Array) -> Array:
    out = np.zeros(9)
    mujoco.mju_quat2Mat(out, quat_wxyz)
    return out.reshape(3, 3)


def surface_points(vertices: Array, count: int, rng: np.random.Generator) -> Array:
    """Points uniform on the convex hull of the vertices, and the hull's own vertices."""
    hull = ConvexHull(vertices)
    a, b, c = (vertices[hull.simplices[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    pick = rng.choice(len(area), count, p=area / area.sum())
    weights = rng.dirichlet((1.0, 1.0, 1.0), count)
    inside = sum(weights[:, [i]] * corner[pick] for i, corner in enumerate((a, b, c)))
    return np.vstack([inside, vertices[hull.vertices]])


def signed_distance(model: mujoco.MjModel, geom: int, points: Array) -> Array:
    """How far points of a body's frame lie outside a box, cylinder or sphere of that body; inside is negative."""
    local = np.abs((points - model.geom_pos[geom]) @ rotation(model.geom_quat[geom]))
    size = model.geom_size[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_BOX:
        distances = local - size
    elif model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER:
        distances = np.column_stack([np.hypot(local[:, 0], local[:, 1]) - size[0], local[:, 2] - size[1]])
    else:
        distances = np.linalg.norm(local, axis=1, keepdims=True) - size[0]
    largest: Array = distances.max(axis=1)
    return largest


@pytest.mark.parametrize("name", bundled.NAMES)
def test_home_is_within_limits_and_free_of_contact(name: str) -> None:
    home, fingers = bundled.variant(name)["home"], bundled.finger(name)
    model = mjcf(name)
    limited, limits = model.jnt_limited[: len(home)] == 1, model.jnt_range[: len(home)]
    assert (home >= limits[:, 0])[limited].all()
    assert (home <= limits[:, 1])[limited].all()
    # Open, half closed, closed [rad].
    for finger in np.linspace(fingers["lower"], fingers["upper"], 3) if fingers else (0.0,):
        assert not touching(model, np.array([[*home, *[finger] * (model.nq - len(home))]])).any()


def test_hand_alone_closes_without_touching_itself() -> None:
    closing = np.linspace(0.15, 1.35, 50)[:, None] * np.ones(3)
    assert not touching(mjcf("jaco_hand"), closing).any()


def test_same_chain(meshes: mujoco.MjModel) -> None:
    ours = mjcf("j2n6s300")
    a, b = mujoco.MjData(ours), mujoco.MjData(meshes)
    for q in random_within_limits(ours, 100, seed=22):
        a.qpos[:] = b.qpos[:] = q
        mujoco.mj_forward(ours, a)
        mujoco.mj_forward(meshes, b)
        for i in range(1, meshes.nbody):
            name = our_name(meshes.body(i).name)
            np.testing.assert_allclose(a.body(name).xpos, b.xpos[i], atol=SIX_DIGITS, rtol=0)
            np.testing.assert_allclose(a.body(name).xmat, b.xmat[i], atol=SIX_DIGITS, rtol=0)
        for site in ("wristsite", "gripsite", "pinchsite"):
            other = b.site(site if site == "wristsite" else f"hand:{site}")
            np.testing.assert_allclose(a.site(site).xpos, other.xpos, atol=SIX_DIGITS, rtol=0)
            np.testing.assert_allclose(a.site(site).xmat, other.xmat, atol=SIX_DIGITS, rtol=0)


def test_same_masses(meshes: mujoco.MjModel) -> None:
    ours = mjcf("j2n6s300")
    a, b = mujoco.MjData(ours), mujoco.MjData(meshes)
    mujoco.mj_forward(ours, a)
    mujoco.mj_forward(meshes, b)
    for i in range(1, meshes.nbody):
        name = our_name(meshes.body(i).name)
        j = ours.body(name).id
        assert ours.body_mass[j] == pytest.approx(meshes.body_mass[i], rel=1e-6)
        np.testing.assert_allclose(a.xipos[j], b.xipos[i], atol=SIX_DIGITS, rtol=0)
        np.testing.assert_allclose(world_inertia(ours, a, j), world_inertia(meshes, b, i), atol=1e-7, rtol=0)


def world_inertia(model: mujoco.MjModel, data: mujoco.MjData, body: int) -> Array:
    """Inertia of a body about its centre of mass, in world axes [kg m^2]."""
    axes = data.ximat[body].reshape(3, 3)
    inertia: Array = axes @ np.diag(model.body_inertia[body]) @ axes.T
    return inertia


def test_same_joint_dynamics_and_contact_parameters(meshes: mujoco.MjModel) -> None:
    ours = mjcf("j2n6s300")
    for field in ("dof_damping", "dof_armature", "dof_frictionloss"):
        np.testing.assert_array_equal(getattr(ours, field), getattr(meshes, field))
    parameters = ("contype", "conaffinity", "condim", "solref", "solimp", "friction")
    by_body = {our_name(meshes.body(meshes.geom_bodyid[g]).name): g for g in range(meshes.ngeom)}
    for g in range(ours.ngeom):
        other = by_body[ours.body(ours.geom_bodyid[g]).name]
        for field in (f"geom_{parameter}" for parameter in parameters):
            np.testing.assert_array_equal(getattr(ours, field)[g], getattr(meshes, field)[other])


def test_rings_are_the_same(meshes: mujoco.MjModel) -> None:
    ours = mjcf("j2n6s300")
    for i in range(1, 7):
        ring, other = ours.geom(f"link_{i}_ring"), meshes.geom(f"ring_{i}")
        np.testing.assert_array_equal(ring.size, other.size)
        np.testing.assert_allclose(ours.mat_rgba[ring.matid], [[0.7, 0.7, 0.7, 1.0]])
