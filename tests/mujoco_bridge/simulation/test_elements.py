"""Bindings of elements other than joints and sites, and writes to frames that MuJoCo has shortcuts for."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from jacokin.errors import InvalidInputError, PhysicsError
from jacokin.mujoco_bridge import ModelWrapperEntity, Physics

EXACT = 1e-12
QUARTER_TURN = (np.sqrt(0.5), 0.0, np.sqrt(0.5), 0.0)  # about y, wxyz


def test_mocap_bodies_have_a_pose_that_is_an_input() -> None:
    spec = mujoco.MjSpec()
    bodies = [spec.worldbody.add_body(pos=(1.0, 2.0, 3.0), mocap=mocap) for mocap in (False, True, True)]
    for body in bodies:
        body.add_geom(size=(0.1, 0.1, 0.1))
    physics = Physics.from_entity(ModelWrapperEntity(spec))
    fixed, one, other = map(physics.bind, bodies)
    np.testing.assert_array_equal(one.mocap_pos, (1.0, 2.0, 3.0))
    one.mocap_pos = (4.0, 5.0, 6.0)
    one.mocap_quat = QUARTER_TURN
    np.testing.assert_array_equal(one.xpos, (4.0, 5.0, 6.0))
    np.testing.assert_array_equal(other.xpos, (1.0, 2.0, 3.0))
    np.testing.assert_array_equal(physics.data.mocap_pos, [(4.0, 5.0, 6.0), (1.0, 2.0, 3.0)])
    assert physics.bind(bodies[1:]).mocap_quat.shape == (2, 4)
    assert fixed.mocap_pos.size == 0


def test_the_world_body_is_a_body() -> None:
    spec = mujoco.MjSpec()
    spec.worldbody.add_body().add_geom(size=(0.1, 0.1, 0.1), mass=10.0)
    physics = Physics.from_entity(ModelWrapperEntity(spec))
    assert physics.bind(spec.worldbody).subtreemass[0] == pytest.approx(10.0)


def test_activations_of_actuators_with_and_without_state() -> None:
    spec = mujoco.MjSpec()
    body = spec.worldbody.add_body()
    body.add_geom(size=(0.1, 0.1, 0.1))
    body.add_joint(name="slide", type=mujoco.mjtJoint.mjJNT_SLIDE)
    actuators = [
        spec.add_actuator(name=f"actuator_{i}", target="slide", trntype=mujoco.mjtTrn.mjTRN_JOINT) for i in range(3)
    ]
    for integrator in (actuators[0], actuators[2]):
        integrator.dyntype = mujoco.mjtDyn.mjDYN_INTEGRATOR
    physics = Physics.from_entity(ModelWrapperEntity(spec))
    everything, stateless = physics.bind(actuators), physics.bind(actuators[1:2])
    assert stateless.act.shape == (0,)
    assert everything.act.shape == everything.act_dot.shape == (2,)
    everything.act = (0.5, 0.25)
    np.testing.assert_array_equal(physics.data.act, (0.5, 0.25))
    physics.bind(actuators[2]).act = 0.75
    np.testing.assert_array_equal(everything.act, (0.5, 0.75))
    everything.ctrl = (1.0, 2.0, 3.0)
    np.testing.assert_array_equal(everything.act_dot, (1.0, 3.0))  # an integrator's rate is its control


def bodies(kind: str) -> tuple[Physics, list[mujoco.MjsBody | mujoco.MjsGeom | mujoco.MjsSite]]:
    spec = mujoco.MjSpec()
    found = []
    for _ in range(2):
        body = spec.worldbody.add_body()
        body.add_joint(type=mujoco.mjtJoint.mjJNT_FREE)
        geom = body.add_geom(type=mujoco.mjtGeom.mjGEOM_ELLIPSOID, size=(0.1, 0.2, 0.3))
        found.append({"body": body, "geom": geom, "site": body.add_site(size=(0.1, 0.1, 0.1))}[kind])
    return Physics.from_entity(ModelWrapperEntity(spec)), found


@pytest.mark.parametrize("kind", ["geom", "site"])
@pytest.mark.parametrize("whole", [True, False])
def test_frames_that_were_their_bodys_may_be_moved_one_by_one(kind: str, whole: bool) -> None:
    physics, elements = bodies(kind)
    first, second = map(physics.bind, elements)
    if whole:
        first.pos = (0.0, 0.0, 0.1)
        first.quat = QUARTER_TURN
    else:
        first.pos[2] = 0.1
        first.quat[:] = QUARTER_TURN
    np.testing.assert_allclose(first.xpos, (0.0, 0.0, 0.1), atol=EXACT)
    np.testing.assert_allclose(first.xmat.reshape(3, 3)[:, 0], (0.0, 0.0, -1.0), atol=EXACT)
    np.testing.assert_allclose(second.xpos, 0.0, atol=EXACT)
    assert (first.sameframe[0], second.sameframe[0]) == (0, 1)


INERTIAL = [("ipos", (0.0, 0.1, 0.05)), ("iquat", QUARTER_TURN)]


@pytest.mark.parametrize(("field", "value"), INERTIAL)
def test_moved_inertial_frames_change_the_mass_matrix(field: str, value: tuple[float, ...]) -> None:
    """As in a model that was compiled with the inertia there."""

    def pendulum(moved: bool) -> tuple[mujoco.MjSpec, mujoco.MjsBody]:
        spec = mujoco.MjSpec()
        link = spec.worldbody.add_body(explicitinertial=True, mass=1.0, inertia=(0.1, 0.2, 0.3))
        link.add_joint(axis=(0.6, 0.0, 0.8))
        bob = link.add_body(pos=(0.0, 0.0, 0.5), explicitinertial=True, mass=2.0, inertia=(0.3, 0.2, 0.1))
        bob.add_joint(axis=(0.0, 1.0, 0.0))
        if moved and field == "ipos":
            bob.ipos = value
        elif moved:
            bob.inertia = (0.1, 0.2, 0.3)  # a quarter turn about y swaps the other two
        return spec, bob

    spec, bob = pendulum(moved=False)
    physics = Physics.from_entity(ModelWrapperEntity(spec))
    before = mass_matrix(physics.model, physics.data)
    setattr(physics.bind(bob), field, value)
    physics.forward()
    wanted = Physics.from_entity(ModelWrapperEntity(pendulum(moved=True)[0]))
    after = mass_matrix(physics.model, physics.data)
    np.testing.assert_allclose(after, mass_matrix(wanted.model, wanted.data), rtol=1e-12)
    assert np.abs(after - before).max() > 1e-3


@pytest.mark.parametrize(("field", "value"), INERTIAL)
def test_inertial_frames_that_mujoco_cannot_move_are_put_back(field: str, value: tuple[float, ...]) -> None:
    """It compiles a diagonal mass matrix for a free body whose inertia is about its own axes."""
    physics, elements = bodies("body")
    bound = physics.bind(elements[1])
    before = getattr(bound, field).copy()
    setattr(bound, field, value)
    with pytest.raises(PhysicsError, match=f"body_{field} of .* cannot be changed in a compiled model"):
        physics.step()
    np.testing.assert_array_equal(getattr(bound, field), before)
    physics.step()


def mass_matrix(model: mujoco.MjModel, data: mujoco.MjData) -> NDArray[np.float64]:
    full = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, full)
    return full


def test_a_binding_is_kept_for_each_order() -> None:
    physics, elements = bodies("site")
    assert physics.bind(elements) is physics.bind(tuple(elements))
    assert physics.bind(elements[::-1]) is not physics.bind(elements)
    with pytest.raises(InvalidInputError, match="one kind, got body and site"):
        physics.bind([elements[0], elements[0].parent])
