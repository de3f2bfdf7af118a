"""Props of one shape: sizes, masses, sensors, and what is refused."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import mujoco
import numpy as np
import pytest

from jacokin.errors import InvalidInputError, UnknownNameError
from jacokin.mujoco_bridge import Arena, BoxProp, Physics, Primitive, large_box, observations

EXACT = 1e-12
# Volume of each shape [m^3], by the formulas of geometry.
SHAPES: list[tuple[str, tuple[float, ...], float]] = [
    ("box", (0.1, 0.2, 0.3), 8 * 0.1 * 0.2 * 0.3),
    ("sphere", (0.2,), 4 / 3 * math.pi * 0.2**3),
    ("cylinder", (0.1, 0.3), math.pi * 0.1**2 * 0.6),
    ("capsule", (0.1, 0.3), math.pi * 0.1**2 * 0.6 + 4 / 3 * math.pi * 0.1**3),
    ("ellipsoid", (0.1, 0.2, 0.3), 4 / 3 * math.pi * 0.1 * 0.2 * 0.3),
]


def free(prop: Primitive, **where: Any) -> Physics:
    arena = Arena()
    arena.add_free_entity(prop, **where)
    return Physics.from_entity(arena)


@pytest.mark.parametrize(("shape", "size", "volume"), SHAPES)
def test_a_shape_has_its_size_and_the_mass_of_its_density(shape: str, size: tuple[float, ...], volume: float) -> None:
    prop = Primitive(shape, size)
    physics = free(prop)
    np.testing.assert_allclose(physics.bind(prop.geom).size[: len(size)], size)
    assert physics.bind(prop.root_body).mass[0] == pytest.approx(1000.0 * volume)
    light = Primitive(shape, size, density=10.0)
    assert free(light).bind(light.root_body).mass[0] == pytest.approx(10.0 * volume)
    given = Primitive(shape, size, mass=0.7, density=10.0)
    assert free(given).bind(given.root_body).mass[0] == pytest.approx(0.7)


@pytest.mark.parametrize(
    ("attribute", "value"),
    [("pos", (1.0, 2.0, 3.0)), ("quat", (0.6, 0.0, 0.8, 0.0)), ("friction", (0.9, 0.01, 0.001)), ("condim", 6)],
)
def test_attributes_of_the_geom_are_passed_on(attribute: str, value: Any) -> None:
    prop = Primitive("box", name="block", **{attribute: value})
    physics = free(prop)
    np.testing.assert_allclose(getattr(physics.bind(prop.geom), attribute), value)
    assert (prop.name, prop.geom.name) == ("block", "block/geom")


def test_sensors_are_those_of_the_world() -> None:
    options = observations.make_options(observations.PERFECT_FEATURES, observations.FREEPROP_OBSERVABLES)
    prop = Primitive("sphere", (0.03,), pos=(0.0, 0.0, 0.1), observable_options=options)
    physics = free(prop, position=(0.1, 0.2, 1.0))
    assert [sensor.name for sensor in prop.sensors.values()] == [
        f"primitive/{name}" for name in ("position", "orientation", "linear_velocity", "angular_velocity")
    ]
    np.testing.assert_allclose(physics.bind(prop.position).sensordata, (0.1, 0.2, 1.1), atol=EXACT)
    np.testing.assert_allclose(prop.observables.position(physics), (0.1, 0.2, 1.1), atol=EXACT)
    prop.set_pose(physics, quaternion=(0.0, 1.0, 0.0, 0.0))
    np.testing.assert_allclose(physics.bind(prop.orientation).sensordata, (0.0, 1.0, 0.0, 0.0), atol=EXACT)
    prop.set_velocity(physics, velocity=(0.5, 0.0, 0.0))
    np.testing.assert_allclose(physics.bind(prop.linear_velocity).sensordata, (0.5, 0.0, 0.0), atol=EXACT)
    prop.set_velocity(physics, angular_velocity=(0.0, 2.0, 0.0))
    np.testing.assert_allclose(physics.bind(prop.angular_velocity).sensordata, (0.0, -2.0, 0.0), atol=EXACT)
    assert all(each.enabled for each in prop.observables.as_dict().values())


def test_a_box_has_a_site_at_each_corner() -> None:
    box = BoxProp((0.1, 0.2, 0.3), mass=1.0)
    physics = free(box, position=(0.0, 0.0, 1.0))
    corners = physics.bind(box.vertices).xpos
    assert {tuple(np.round(corner, 12)) for corner in corners} == {
        (x, y, 1.0 + z) for x in (-0.1, 0.1) for y in (-0.2, 0.2) for z in (-0.3, 0.3)
    }
    box.set_pose(physics, quaternion=(math.sqrt(0.5), math.sqrt(0.5), 0.0, 0.0))  # lies on its side
    assert physics.bind(box.vertices).xpos[:, 2].min() == pytest.approx(0.8)
    assert [site.group for site in box.vertices] == [3] * 8
    assert large_box(name="crate").name == "crate"
    crate = large_box()
    physics = free(crate)
    np.testing.assert_array_equal(physics.bind(crate.geom).size, (0.09, 0.09, 0.09))
    assert physics.bind(crate.root_body).mass[0] == pytest.approx(1.3)


def test_what_is_not_a_shape() -> None:
    with pytest.raises(UnknownNameError, match="ellipsoid"):
        Primitive("cube")
    wrong: Callable[[], Any]
    for wrong, words in (
        (lambda: Primitive("box", (0.1,)), "size"),
        (lambda: Primitive("box", (0.1, 0.0, 0.1)), "positive lengths"),
        (lambda: Primitive(mass=0.0), "mass must be a positive number"),
        (lambda: Primitive(density=np.nan), "density"),
        (lambda: Primitive(frictoin=1.0), r"\{'frictoin': 1\.0\}"),
        (lambda: Primitive(pos=(0.0, 1.0)), "pos"),
    ):
        with pytest.raises(InvalidInputError, match=words):
            wrong()
    assert mujoco.mjtGeom.mjGEOM_BOX == Primitive().geom.type
