"""Complex solutions in two angles, against the roots of F, and where four of those are together."""

from __future__ import annotations

import numpy as np
import pytest

from jacokin.arrays import Array
from jacokin.kernels.closed_form.arm import unpack_arm
from jacokin.kernels.closed_form.resultant import DEGREE
from jacokin.kernels.six_joints.elbow_offset import fill_product, offset_arm_of
from jacokin.kernels.six_joints.loop import fill_links, joint_of
from jacokin.kernels.solution_set.slices import SixJoints, make_six_joints
from jacokin.kernels.solution_set.whole_solutions import NEAR, conditions_of, find_solutions, step_from
from tests.kernels.six_joints.arms import chain_of_arm, form_of, pose_at

#: The joint of an xArm6 that makes axis 5 stand at right angles to the plane of the arm where it is 0.
JOINT_4 = 3


def six_joints(q: Array) -> tuple[SixJoints, Array]:
    """An xArm6 at the pose of a configuration, and all roots of its F (16, 2)."""
    form, six = form_of(chain_of_arm("xarm6")), make_six_joints()
    six.chain[:], six.arm[:], six.T[:], six.axis[:] = form.chain, form.arm, pose_at(form.chain, q), (0.0, 0.6, 0.8)
    links, cosine, sine = np.zeros((6, 3, 4)), np.zeros(DEGREE + 1), np.zeros(DEGREE + 1)
    arm = unpack_arm(form.arm).six
    fill_links(six.chain, six.T, arm.scale, arm.form_labelling, links)
    fill_product(offset_arm_of(links), cosine, sine)
    half = 0.5 * (cosine[1:] + 1j * sine[1:])
    roots = np.roots(np.concatenate([half.conj()[::-1], [cosine[0]], half]))
    return six, np.ascontiguousarray(np.column_stack([roots.real, roots.imag]))


@pytest.mark.parametrize("angle", [None, 0.0, 1e-5, 1e-3])
def test_there_is_one_for_each_root(angle: float | None, rng: np.random.Generator) -> None:
    """Also where four of them share joint 6, as with axis 5 at right angles to the arm's plane."""
    links, found = np.zeros((6, 3, 4)), np.zeros((2 * DEGREE, 4))
    for q in rng.uniform(-np.pi, np.pi, (20, 6)):
        if angle is not None:
            q[JOINT_4] = angle
        six, roots = six_joints(q)
        k = unpack_arm(six.arm)
        conditions = conditions_of(k, six, 0.0, links)
        count = find_solutions(conditions, roots, len(roots), found)
        near = np.abs(np.log(np.hypot(roots[:, 0], roots[:, 1]))) < NEAR
        assert count == near.sum()
        z, zeta = found[:count, 0] + 1j * found[:count, 1], found[:count, 2] + 1j * found[:count, 3]
        for a, b in zip(z.tolist(), zeta.tolist(), strict=True):
            assert step_from(conditions, a, b).length < 1e-9
        joints = [joint_of(k.six.form_labelling, i) for i in (5, 4)]
        own = np.abs(z - np.exp(1j * q[joints[0]])) + np.abs(zeta - np.exp(1j * q[joints[1]]))
        assert own.min() < 1e-8
