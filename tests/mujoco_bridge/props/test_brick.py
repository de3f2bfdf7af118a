"""Bricks: the geometry of dm_control's, how tightly they hold, hints."""

from __future__ import annotations

import itertools
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge import Arena, Brick, Physics
from jacokin.mujoco_bridge.props import primitive
from tests.optional import needs_dm_control

REFERENCE = Path("entities", "props", "duplo", "duplo2x4.xml")
HEIGHT = 0.0192  # [m] of a brick stacked on another
HOLD = 10.0  # [N] the force that separates two bricks, to which dm_control tunes its stud radii
HOLD_TOLERANCE = 0.5  # [N]
VARIANTS = list(itertools.product((False, True), repeat=2))  # easy_align, flanges


def stacked(**options: Any) -> tuple[Physics, Brick, Brick]:
    """One brick fixed, another free on top of it."""
    # The studs' friction is set for dm_control's options.
    arena, bottom, top = Arena(contact="dm_control"), Brick(name="bottom", **options), Brick(name="top", **options)
    arena.attach(bottom)
    arena.add_free_entity(top, position=(0.0, 0.0, HEIGHT))
    return Physics.from_entity(arena), bottom, top


def separates(physics: Physics, top: Brick, force: float) -> bool:
    """Whether a force [N] lifts the top brick by a millimetre within half a second."""
    state = physics.get_state()
    body = physics.bind(top.root_body)
    start = body.xpos[2]
    try:
        with physics.disable("gravity"):
            body.xfrc_applied[2] = force
            for _ in range(25):
                physics.step(10)
                if body.xpos[2] - start > 1e-3:
                    return True
        return False
    finally:
        physics.set_state(state)


FIELDS = [
    "type",
    "pos",
    "size",
    "quat",
    "contype",
    "conaffinity",
    "condim",
    "friction",
    "solref",
    "solimp",
    "margin",
    "gap",
    "priority",
    "solmix",
]


def geometry(model: mujoco.MjModel) -> list[tuple[float, ...]]:
    """Everything about each geom that matters to collisions, sorted; without those of dm_control that do nothing."""
    geoms = [model.geom(i) for i in range(model.ngeom) if "studcap" not in model.geom(i).name]
    rows = [np.concatenate([np.ravel(getattr(geom, field)) for field in FIELDS]) for geom in geoms]
    return sorted(tuple(np.round(row, 9) + 0.0) for row in rows)


def test_the_geometry_is_that_of_the_reference() -> None:
    needs_dm_control()
    found = find_spec("dm_control")
    assert found is not None
    assert found.origin is not None
    spec = mujoco.MjSpec.from_file(str(Path(found.origin).parent / REFERENCE))
    for geom in spec.geoms:  # what dm_control's class changes in its file for flanges and the usual radius
        if geom.name.startswith("flange"):
            geom.contype = 4
        if geom.name.startswith("stud_"):
            geom.size[0] = 0.004647
    holder = mujoco.MjSpec()
    holder.attach(spec, frame=holder.worldbody.add_body(name="brick").add_frame(), prefix="x")
    holder.body("brick").add_freejoint()
    reference = holder.compile()
    arena, brick = Arena(), Brick()
    arena.add_free_entity(brick)
    physics = Physics.from_entity(arena)
    ground = int(mujoco.mjtGeom.mjGEOM_PLANE)
    own = [row for row in geometry(physics.model) if row[0] != ground]
    assert own == geometry(reference)
    bound = physics.bind(brick.root_body)
    body = reference.body("brick")
    np.testing.assert_allclose(bound.mass, body.mass, rtol=1e-12)
    np.testing.assert_allclose(bound.inertia, body.inertia, rtol=1e-9)
    np.testing.assert_allclose(bound.ipos, body.ipos, atol=1e-12)
    for name in [f"{kind}_{i}{j}" for kind in ("stud", "hole") for i in range(2) for j in range(4)]:
        np.testing.assert_allclose(physics.model.site(f"brick/{name}").pos, reference.site(f"x{name}").pos, atol=1e-12)
    for field in ("pos", "size"):
        np.testing.assert_allclose(
            getattr(physics.bind(brick.bounding_box), field), getattr(reference.site("xbounding_box"), field)
        )


@pytest.mark.parametrize(("easy_align", "flanges"), VARIANTS)
def test_two_bricks_hold_together_with_ten_newtons(easy_align: bool, flanges: bool) -> None:
    physics, _, top = stacked(easy_align=easy_align, flanges=flanges)
    assert not separates(physics, top, HOLD - HOLD_TOLERANCE)
    assert separates(physics, top, HOLD + HOLD_TOLERANCE)


def test_forces_vary_with_the_radius_of_the_studs() -> None:
    physics, bottom, top = stacked(variation=1.0)
    radii = []
    for seed in range(20):
        rng = np.random.RandomState(seed)
        for brick in (bottom, top):
            brick.initialize_episode(physics, rng)
        radii.append(physics.bind(bottom.stud_geoms).size[0, 0])
    row = primitive.load_sizes()["brick"]["stud_radius"]["flanges"]
    assert row[0] <= min(radii) < row[1] < max(radii) <= row[2]
    for brick in (bottom, top):
        physics.bind(brick.stud_geoms).size[:, 0] = row[0]
    assert separates(physics, top, HOLD)
    bottom.initialize_episode(physics, np.random.RandomState(int(np.argmax(radii))))
    assert not separates(physics, top, HOLD)
    usual = stacked()
    usual[1].initialize_episode(usual[0], None)  # nothing is drawn
    with pytest.raises(InvalidInputError, match="random_state"):
        bottom.initialize_episode(physics, None)


def test_studs_are_in_holes_when_bricks_are_stacked() -> None:
    physics, bottom, top = stacked()
    physics.step(10)
    studs = physics.bind(list(bottom.studs.ravel())).xpos
    np.testing.assert_allclose(studs, physics.bind(list(top.holes.ravel())).xpos, atol=1e-6)
    assert bottom.studs.shape == bottom.holes.shape == (2, 4)
    # Two flanges and one tube touch each stud, equally hard.
    for geom in bottom.stud_geoms:
        number = physics.bind(geom).element_id
        touching = [i for i, c in enumerate(physics.data.contact) if number in (c.geom1, c.geom2)]
        assert len(touching) == 3
        forces = np.zeros((3, 6))
        for force, contact in zip(forces, touching, strict=True):
            mujoco.mj_contactForce(physics.model, physics.data, contact, force)
        np.testing.assert_allclose(forces[:, 0], forces[0, 0], rtol=0.05)


def test_a_brick_rests_on_the_floor_and_is_observed_at_its_centre() -> None:
    arena, brick = Arena(), Brick(observable_options={"position": {"enabled": True}})
    arena.add_free_entity(brick, position=(0.1, 0.0, 1e-6))
    physics = Physics.from_entity(arena)
    physics.step(200)
    position, _ = brick.get_pose(physics)
    np.testing.assert_allclose(position, (0.1, 0.0, 0.0), atol=5e-4)
    np.testing.assert_allclose(brick.observables.position(physics), position + np.array((0.0, 0.0, 0.0119)), atol=1e-6)
    corners = physics.bind(brick.vertices).xpos
    assert corners.shape == (8, 3)
    np.testing.assert_allclose(corners[:, 2].min(), position[2] - 1e-4, atol=1e-6)
    assert brick.observables.force(physics).shape == (3,)


def test_a_hint_is_translucent_and_touches_nothing() -> None:
    arena, hint, ball = Arena(), Brick(color=(0.0, 1.0, 0.0), hint=True, name="hint"), Brick(name="ball")
    arena.attach(hint)
    arena.add_free_entity(ball, position=(0.0, 0.0, 0.001))
    physics = Physics.from_entity(arena)
    physics.step(100)
    assert abs(ball.get_pose(physics)[0][2]) < 1e-3  # inside the hint, on the floor
    geoms = [geom for geom in arena.mjcf_model.geoms if geom.name.startswith("hint/")]
    bound = physics.bind(geoms)
    np.testing.assert_array_equal(bound.rgba, np.tile((0.0, 1.0, 0.0, 0.75), (len(geoms), 1)))
    assert not bound.contype.any()
    assert not bound.conaffinity.any()
    assert not any(each.enabled for each in hint.observables.as_dict().values())


@pytest.mark.parametrize("color", [(1.0, 0.0, 2.0), (-0.1, 0.0, 0.0), (1.0, 0.0), "red"])
def test_colours_out_of_range_are_refused(color: Any) -> None:
    with pytest.raises(InvalidInputError, match="color"):
        Brick(color=color)


def test_other_arguments_are_checked() -> None:
    with pytest.raises(InvalidInputError, match="variation"):
        Brick(variation=-0.1)
    with pytest.raises(InvalidInputError, match="easy_align"):
        Brick(easy_align="yes")


@pytest.mark.parametrize("count", [3, 6])
def test_a_stack_stays_together_and_needs_no_more_memory(count: int) -> None:
    arena, bricks = Arena(), [Brick(name=f"brick_{i}") for i in range(count)]
    arena.attach(bricks[0])
    for level, brick in enumerate(bricks[1:], 1):
        arena.add_free_entity(brick, position=(0.0, 0.0, level * HEIGHT))
    physics = Physics.from_entity(arena)
    physics.step(100)
    for lower, upper in itertools.pairwise(bricks):
        studs, holes = (physics.bind(list(sites.ravel())).xpos for sites in (lower.studs, upper.holes))
        np.testing.assert_allclose(studs, holes, atol=1e-4)
