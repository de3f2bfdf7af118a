"""From measurements to the arm that made them: simulated arms whose truth is known."""

from __future__ import annotations

import math
import pickle
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import Robot
from jacokin.calibration import Calibration, Measurements, Prior, calibrate
from jacokin.errors import InvalidInputError, ModelError, UnknownNameError
from tests.calibration.simulated import NOISE, Array, arm_of, bound, hidden_arm, mean_error, poses_of, positions_of


def seen_positions(arm: Robot, count: int, seed: int, noise: float = NOISE) -> tuple[Array, Array]:
    rng = np.random.default_rng(seed)
    q = arm.sample(rng, count)
    return q, positions_of(arm, q) + rng.normal(0.0, noise, (count, 3))


@pytest.fixture(scope="module")
def found(robot: Robot) -> Calibration:
    q, seen = seen_positions(hidden_arm(robot, 1), 30, 1)
    return calibrate(robot, Measurements(q, positions=seen, sigma=NOISE))


def test_thirty_positions_give_the_arm_to_a_fraction_of_a_millimetre(robot: Robot, found: Calibration) -> None:
    arm = hidden_arm(robot, 1)
    q, _ = seen_positions(arm, 30, 1)
    assert mean_error(arm, robot) > 3e-3
    assert mean_error(arm, found.robot) < 1.4 * bound(robot, q)
    assert abs(found.expected_error / bound(robot, q) - 1.0) < 0.1
    assert 0.7 < found.noise < 1.3
    assert found.p_value > 1e-3
    assert not found.rejected
    assert found.robot.calibration == found.measured_arm
    assert "30 of 30 measurements" in str(found)
    assert repr(found) == "Calibration('j2n6s300', 36 parameters, 30 measurements)"
    assert "calibrated" in repr(found.robot)


def test_the_file_gives_the_arm_that_was_found(found: Calibration, tmp_path: Path) -> None:
    found.save(tmp_path / "my_arm.toml")
    read = jacokin.load_robot("j2n6s300", calibration=tmp_path / "my_arm.toml")
    q = read.home
    assert read.forward_kinematics(q).homogeneous.tobytes() == found.robot.forward_kinematics(q).homogeneous.tobytes()
    np.testing.assert_allclose(
        found.forward_kinematics(q).homogeneous, read.forward_kinematics(q).homogeneous, atol=1e-14
    )
    assert read.calibration is not None
    facts = dict(read.calibration.facts)
    assert facts["measurements"] == 30
    assert facts["expected_error [m]"] == found.expected_error
    found.write_urdf(tmp_path / "my_arm.urdf")
    found.write_mjcf(tmp_path / "my_arm.xml")
    for name in ("my_arm.urdf", "my_arm.xml"):
        base = None if name.endswith("urdf") else "link_base"
        written = jacokin.load_robot(tmp_path / name, base=base, tip="end_effector")
        np.testing.assert_allclose(
            written.forward_kinematics(q).homogeneous, read.forward_kinematics(q).homogeneous, atol=1e-12
        )


def test_the_arm_is_loaded_as_the_described_one_was() -> None:
    robot = jacokin.load_robot(
        limits={"joint_2": (1.0, 5.0)}, finger_angle=0.5, velocity_limit=0.3, decompose=True, locked={"finger_1": 0.3}
    )
    q, seen = seen_positions(robot, 5, 1)
    source = calibrate(robot, Measurements(q, positions=seen, sigma=NOISE), ["offset"]).robot.source
    assert replace(source, calibration=None) == robot.source


def test_what_was_found_is_pickled(robot: Robot, found: Calibration) -> None:
    copied = pickle.loads(pickle.dumps(found))
    assert dict(copied.parameters) == dict(found.parameters)
    assert copied.measured_arm == found.measured_arm
    assert np.array_equal(copied.covariance, found.covariance)
    assert copied.forward_kinematics(robot.home) == found.forward_kinematics(robot.home)


def test_results_repeat(robot: Robot, found: Calibration) -> None:
    q, seen = seen_positions(hidden_arm(robot, 1), 30, 1)
    again = calibrate(robot, Measurements(q, positions=seen, sigma=NOISE))
    assert again.measured_arm == found.measured_arm
    assert again.covariance.tobytes() == found.covariance.tobytes()


def test_the_estimate_is_the_most_probable_one(robot: Robot, found: Calibration) -> None:
    """Its gradient is zero: residuals by Pinocchio, differences by hand, plain least squares."""
    q, seen = seen_positions(hidden_arm(robot, 1), 30, 1)
    plain = calibrate(robot, Measurements(q, positions=seen, sigma=NOISE), loss="none")
    numbers = arm_of(plain.measured_arm)

    def cost(numbers: Array) -> float:
        from tests.calibration.simulated import PRIOR, _joint
        from tests.model.measured_arms import measured_arm

        arm = jacokin.load_robot(calibration=measured_arm(robot, [_joint(row) for row in numbers]))
        return float(np.sum(((positions_of(arm, q) - seen) / NOISE) ** 2) + np.sum((numbers.ravel() / PRIOR) ** 2))

    least = cost(numbers)
    rng = np.random.default_rng(0)
    for _ in range(20):
        step = rng.normal(size=numbers.shape) * 1e-6
        assert cost(numbers + step) > least - 1e-9
    assert cost(numbers) < cost(arm_of(hidden_arm(robot, 1).calibration))  # type: ignore[arg-type]  # a calibrated arm


def test_gross_errors_are_left_out_and_named(robot: Robot) -> None:
    arm = hidden_arm(robot, 2)
    q, seen = seen_positions(arm, 40, 2)
    clean = calibrate(robot, Measurements(q, positions=seen, sigma=NOISE))
    rng = np.random.default_rng(3)
    bad = np.sort(rng.choice(40, 4, replace=False))
    away = rng.normal(size=(4, 3))
    seen[bad] += 0.05 * away / np.linalg.norm(away, axis=1)[:, None]
    found = calibrate(robot, Measurements(q, positions=seen, sigma=NOISE))
    assert [each.row for each in found.rejected] == bad.tolist()
    assert "mm from where the other rows have it" in str(found.rejected[0])
    assert mean_error(arm, found.robot) < 1.2 * mean_error(arm, clean.robot)


def test_rows_that_are_not_numbers_or_in_other_units_are_named(robot: Robot) -> None:
    arm = hidden_arm(robot, 4)
    q, seen = seen_positions(arm, 30, 4)
    clean = calibrate(robot, Measurements(q[2:], positions=seen[2:], sigma=NOISE))
    seen[0] = np.nan
    seen[1] *= 1000.0
    found = calibrate(robot, Measurements(q, positions=seen, sigma=NOISE))
    reasons = {each.row: each.reason for each in found.rejected}
    assert reasons[0] == "is not finite, or beyond 1e6"
    assert reasons[1].endswith("another unit?")
    assert math.isclose(found.expected_error, clean.expected_error, rel_tol=0.05)
    assert math.isnan(found.residuals[0])


def test_wrong_units_are_refused(robot: Robot) -> None:
    q, seen = seen_positions(hidden_arm(robot, 4), 30, 4)
    with pytest.raises(InvalidInputError, match="they look like millimetres"):
        calibrate(robot, Measurements(q, positions=1000.0 * seen, sigma=NOISE))
    with pytest.raises(
        InvalidInputError, match=r"measurements\[0\]: joint angles must be in radians and look like degrees"
    ):
        calibrate(robot, Measurements(np.degrees(q), positions=seen, sigma=NOISE))
    with pytest.raises(InvalidInputError, match="another frame, base or unit"):
        calibrate(robot, Measurements(q, positions=seen + 0.4, sigma=NOISE))


@pytest.mark.slow
def test_what_calibrate_refuses(robot: Robot, found: Calibration) -> None:
    q, seen = seen_positions(robot, 5, 4)
    rows = Measurements(q, positions=seen, sigma=NOISE)
    with pytest.raises(InvalidInputError, match="robot is calibrated already"):
        calibrate(found.robot, rows)
    with pytest.raises(UnknownNameError, match="unknown group of parameters 'offsets'"):
        calibrate(robot, rows, parameters=["offsets"])
    with pytest.raises(UnknownNameError, match="unknown loss"):
        calibrate(robot, rows, loss="cauchy")
    with pytest.raises(InvalidInputError, match="measurements must be Measurements"):
        calibrate(robot, [seen])  # type: ignore[list-item]  # a user's mistake
    none = rows.select(np.zeros(5, dtype=bool))
    for empty in ([], none, [rows, none]):
        with pytest.raises(InvalidInputError, match="measurements is empty, or has a set without rows"):
            calibrate(robot, empty)
    with pytest.raises(InvalidInputError, match="must have 6 joint angles"):
        calibrate(robot, Measurements(q[:, :5], positions=seen, sigma=NOISE))
    with pytest.raises(InvalidInputError, match="has no row of finite numbers"):
        calibrate(robot, Measurements(q, positions=seen * np.nan, sigma=NOISE))
    with pytest.raises(InvalidInputError, match="an unknown base needs at least 3"):
        calibrate(robot, Measurements(q[:2], positions=seen[:2], sigma=NOISE, base="unknown"))
    with pytest.raises(InvalidInputError, match="parameters is empty, and neither base nor tool is unknown"):
        calibrate(robot, rows, parameters=[])
    turned = poses_of(robot, q) @ jacokin.pose([0, 0, 0], rpy=[np.pi, 0, 0]).homogeneous
    with pytest.raises(InvalidInputError, match="standard deviations of the prior|times what sigma says"):
        calibrate(robot, Measurements(q, poses=turned, sigma=(1e-3, 1e-3)))
    with pytest.raises(InvalidInputError, match="position must be a positive number"):
        Prior(position=-1.0)
    for wrong in (1e300, 1e4, 1e-13):
        with pytest.raises(InvalidInputError, match=r"axis must be between 1e-12 and 1000 \[rad\], got"):
            Prior(axis=wrong)


@pytest.mark.slow
def test_little_and_odd_data_give_an_answer(robot: Robot) -> None:
    """An instrument without error, a distance of nothing, a row beyond all numbers: no warnings, no NaN."""
    q, seen = seen_positions(hidden_arm(robot, 12), 8, 12)
    huge = seen.copy()
    huge[3] *= 1e200
    for rows in (
        Measurements(q, positions=positions_of(hidden_arm(robot, 12), q), sigma=1e-9),
        Measurements(q, distances=np.zeros(8), points=positions_of(robot, q), sigma=NOISE),
        Measurements(q, positions=huge, sigma=NOISE),
    ):
        found = calibrate(robot, rows)
        assert np.isfinite(found.covariance).all()
        assert (found.covariance.diagonal() >= 0.0).all()
        assert found.robot.calibration == found.measured_arm
        assert str(found)


@pytest.mark.parametrize("contact", ["plane", "point"])
@pytest.mark.parametrize("touches", [0, 1, 2])
def test_a_few_touches_do_no_harm(robot: Robot, contact: str, touches: int) -> None:
    """None of them finite, one, or two of a plane at different heights: they say little, and stand in no one's way."""
    q, seen = seen_positions(hidden_arm(robot, 12), 12, 12)
    rows = (
        q[[0, 0]] + [[0.0] * 6, [*[0.0] * 5, 1.0]] if contact == "point" else q[:2].copy()
    )  # the last joint turns the point
    rows[touches:] = np.nan
    both = [Measurements(q, positions=seen, sigma=NOISE), Measurements(rows, contact=contact, sigma=NOISE)]
    found = calibrate(robot, both)
    assert [(each.set, each.row) for each in found.rejected] == [(1, row) for row in range(touches, 2)]
    assert found.expected_error < 1.05 * calibrate(robot, both[0]).expected_error


@pytest.mark.slow
def test_unknown_base_and_tool(robot: Robot) -> None:
    """A camera somewhere, a marker somewhere on the hand: poses, and positions alone."""
    arm, rng = hidden_arm(robot, 5), np.random.default_rng(5)
    q = arm.sample(rng, 40)
    base, tool = jacokin.pose([1, 2, 0.3], rpy=[0.3, 0.2, 2]), jacokin.pose([0.02, 0.03, 0.05], rpy=[0.3, -0.2, 1])
    true = base.homogeneous @ poses_of(arm, q) @ tool.homogeneous
    noisy = true.copy()
    noisy[:, :3, 3] += rng.normal(0, NOISE, (40, 3))
    for row in range(40):
        noisy[row, :3, :3] = jacokin.pose([0, 0, 0], rpy=rng.normal(0, 1e-3, 3)).rotation @ noisy[row, :3, :3]
    for rows in (
        Measurements(q, poses=noisy, sigma=(NOISE, 1e-3), base="unknown", tool="unknown"),
        Measurements(q, positions=noisy[:, :3, 3], sigma=NOISE, base="unknown", tool="unknown"),
    ):
        found = calibrate(robot, rows)
        assert found.base is not None
        assert not found.rejected
        unseen = arm.sample(rng, 100)
        wanted = (base.homogeneous @ poses_of(arm, unseen) @ tool.homogeneous)[:, :3, 3]
        predicted = [
            (found.base * found.robot.forward_kinematics(row) * found.tools[None]).translation for row in unseen
        ]
        assert np.linalg.norm(predicted - wanted, axis=1).mean() < 1.5 * found.expected_error < 6e-4
        assert np.abs(found.base.translation - base.translation).max() < 0.02


@pytest.mark.slow
def test_mixed_kinds_help_each_other(robot: Robot) -> None:
    """Ten positions, then distances to a fixed point, touches of one point and of one plane as well."""
    arm, rng = hidden_arm(robot, 6), np.random.default_rng(6)
    q = arm.sample(rng, 40)
    seen = positions_of(arm, q)
    sets = [Measurements(q[:10], positions=seen[:10] + rng.normal(0, NOISE, (10, 3)), sigma=NOISE)]
    errors = [calibrate(robot, sets).expected_error]
    corner = np.array([0.5, -0.4, 0.0])
    lengths = np.linalg.norm(seen[10:25] - corner, axis=1) + rng.normal(0, NOISE, 15)
    sets.append(Measurements(q[10:25], distances=lengths, points=corner, sigma=NOISE))
    errors.append(calibrate(robot, sets).expected_error)
    solver = jacokin.IKSolver(arm, collision="ignore")
    touched = []
    for _ in range(30):
        place = np.array([*rng.uniform([-0.5, -0.5], [0.5, -0.3]), 0.2 + rng.normal(0, NOISE)])
        result = solver.solve(jacokin.pose(place, down=True), seed=arm.sample(rng))
        if result.success:
            touched.append(result.q)
    sets.append(Measurements(touched, contact="plane", sigma=NOISE))
    errors.append(calibrate(robot, sets).expected_error)
    point = np.array([0.3, -0.3, 0.3])
    around = [
        solver.solve(jacokin.pose(point + rng.normal(0, NOISE, 3), rpy=rng.uniform(-3, 3, 3)), seed=arm.sample(rng))
        for _ in range(40)
    ]
    held = [result.q for result in around if result.success]
    assert len(held) >= 6
    sets.append(Measurements(held, contact="point", sigma=NOISE))
    found = calibrate(robot, sets)
    errors.append(found.expected_error)
    assert errors == sorted(errors, reverse=True)
    assert errors[3] < 0.8 * errors[0]
    assert mean_error(arm, found.robot) < 2.0 * found.expected_error
    assert not found.rejected
    assert 0.7 < found.noise < 1.3
    assert abs(found.parameters["plane 3.distance"].value) < 0.02


def test_contact_alone_needs_no_instrument(robot: Robot) -> None:
    """One plane, touched from many sides, shows more than half of what is off about the heights of its points."""
    arm, rng = hidden_arm(robot, 7), np.random.default_rng(7)
    solver = jacokin.IKSolver(arm, collision="ignore")
    rows: list[Array] = []
    while len(rows) < 40:
        place = np.array([*rng.uniform([-0.6, -0.6], [0.6, 0.6]), 0.15])
        result = solver.solve(jacokin.pose(place, down=True), seed=arm.sample(rng))
        if result.success:
            rows.append(result.q)
    found = calibrate(robot, Measurements(rows, contact="plane", sigma=NOISE))
    assert mean_error(arm, found.robot) < mean_error(arm, robot)
    height = [arm.forward_kinematics(q).translation[2] for q in rows]
    assert np.std(height) < 1e-6
    assert np.std([robot.forward_kinematics(q).translation[2] for q in rows]) > 1e-3
    assert np.std([found.robot.forward_kinematics(q).translation[2] for q in rows]) < 1e-3


@pytest.mark.slow
def test_scales_and_sag_are_found_and_no_robot_is_made_of_them(robot: Robot, tmp_path: Path) -> None:
    rng = np.random.default_rng(8)
    q = robot.sample(rng, 60)
    scale = 1.0 + np.array([0.001, -0.002, 0.002, 0.0, 0.001, 0.0])
    sag = np.array([0.0, 1e-3, 2e-3, 1e-3, 0.0, 0.0])  # [rad/(N m)]
    seen = positions_of(robot, np.array([scale * row - sag * robot.gravity(row) for row in q]))
    rows = Measurements(q, positions=seen + rng.normal(0, 1e-4, seen.shape), sigma=1e-4)
    found = calibrate(robot, rows, ["geometry", "offset", "scale", "compliance"])
    for joint, true in zip(robot.joint_names[:3], scale - 1.0, strict=False):
        estimate = found.parameters[f"{joint}.scale"]
        assert abs(estimate.value - true) < 4.0 * estimate.sigma < 1e-3
    assert found.parameters["joint_2.compliance"].value == pytest.approx(1e-3, abs=3e-4)
    errors = [
        np.linalg.norm(
            found.forward_kinematics(row).translation
            - robot.forward_kinematics(scale * row - sag * robot.gravity(row)).translation
        )
        for row in robot.sample(rng, 50)
    ]
    assert np.mean(errors) < 2e-4
    with pytest.raises(InvalidInputError, match="times what sigma says.*or the arm has what is not estimated"):
        calibrate(robot, rows)
    for refused in (lambda: found.robot, lambda: found.write_urdf(tmp_path / "a.urdf")):
        with pytest.raises(ModelError, match="which no robot of plain joints can hold"):
            refused()
    found.save(tmp_path / "my_arm.toml")
    with pytest.raises(ModelError, match="which no robot of plain joints can hold"):
        jacokin.load_robot(calibration=tmp_path / "my_arm.toml")


@pytest.mark.slow
def test_what_the_model_lacks_is_seen(robot: Robot) -> None:
    """A transmission that is not a plain one: residuals go with its joint, and are too large."""
    arm = hidden_arm(robot, 11)
    rng = np.random.default_rng(11)
    q = arm.sample(rng, 100)
    turned = q.copy()
    turned[:, 1] += 0.002 * np.sin(3.0 * q[:, 1])
    rows = Measurements(q, positions=positions_of(arm, turned) + rng.normal(0, NOISE, (100, 3)), sigma=NOISE)
    found = calibrate(robot, rows)
    assert found.noise > 1.5
    assert any("times what sigma says" in sentence for sentence in found.warnings())
    good = Measurements(q, positions=positions_of(arm, q) + rng.normal(0, NOISE, (100, 3)), sigma=NOISE)
    quiet = calibrate(robot, good)
    assert quiet.warnings() == quiet.unidentified


@pytest.mark.slow
def test_other_arms(rng: np.random.Generator) -> None:
    """Seven joints, and a spherical wrist."""
    for name in ("j2s7s300", "j2s6s200"):
        robot = jacokin.load_robot(name)
        arm = hidden_arm(robot, 10)
        q = arm.sample(rng, 40)
        rows = Measurements(q, positions=positions_of(arm, q) + rng.normal(0, NOISE, (40, 3)), sigma=NOISE)
        found = calibrate(robot, rows)
        assert mean_error(arm, found.robot) < 1.5 * found.expected_error < 7.5e-4


@pytest.mark.slow
def test_the_report_is_one_page(robot: Robot, tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    q, seen = seen_positions(hidden_arm(robot, 1), 20, 1)
    seen[3] += 0.05
    seen[4] = np.nan
    calibrate(robot, Measurements(q, positions=seen, sigma=NOISE, base="unknown")).report(tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text()
    assert page.count("data:image/png;base64,") == 3
    for words in (
        "18 of 20",
        "measurements[0], row 4, is not finite,",
        "joint_3.axis_x",
        "cannot be told apart",
        "in the instru",
    ):
        assert words in page
    assert "http" not in page


def test_rows_of_which_most_do_not_fit_are_refused(robot: Robot) -> None:
    rng = np.random.default_rng(1)
    with pytest.raises(InvalidInputError, match=r"measurements\[0\]: \d+ of 25 rows fit together"):
        calibrate(robot, Measurements(robot.sample(rng, 25), contact="plane", sigma=NOISE))  # points of no plane


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
@pytest.mark.parametrize(("share", "size"), [(0.55, 0.01), (0.7, 0.05), (0.9, 0.05)])
def test_sets_of_which_half_or_more_is_wrong_are_refused(name: str, share: float, size: float) -> None:
    described = jacokin.load_robot(name)
    for seed, count in ((1, 30), (2, 12)):
        q, seen = seen_positions(hidden_arm(described, seed), count, seed)
        rng = np.random.default_rng(seed)
        away = rng.normal(size=(count, 3))[: round(share * count)]
        seen[: len(away)] += size * away / np.linalg.norm(away, axis=1)[:, None]
        with pytest.raises(InvalidInputError, match=REFUSED):
            calibrate(described, Measurements(q, positions=seen, sigma=NOISE))


REFUSED = "times what sigma says|rows fit together|cannot tell that|standard deviations of the prior"


@pytest.mark.slow
def test_what_is_not_where_it_is_said_to_be_is_refused(robot: Robot) -> None:
    """A base 3 cm off passed as known, rotations transposed, rows of another arm: each explained by no usual arm."""
    arm, rng = hidden_arm(robot, 3), np.random.default_rng(3)
    q = arm.sample(rng, 30)
    T = poses_of(arm, q)
    with pytest.raises(InvalidInputError, match=r"of joint_1 would be \d.* standard deviations of the prior"):
        calibrate(robot, Measurements(q, positions=T[:, :3, 3] + [0.03, 0.0, 0.0], sigma=NOISE))
    turned = T.copy()
    turned[:, :3, :3] = np.swapaxes(T[:, :3, :3], 1, 2)
    with pytest.raises(InvalidInputError, match=r"times what sigma says \(positions .*, orientations "):
        calibrate(robot, Measurements(q, poses=turned, sigma=(NOISE, 1e-3)))


@pytest.mark.one_quick
@pytest.mark.parametrize(("factor", "gross"), [(3.0, 0), (2.0, 3), (1.0, 9), (0.3, 0)])
def test_a_sigma_somewhat_wrong_and_a_few_gross_errors_are_accepted(robot: Robot, factor: float, gross: int) -> None:
    """What is expected is then what the residuals say, not what the sigma does."""
    arm = hidden_arm(robot, 14)
    q, seen = seen_positions(arm, 40, 14, noise=factor * NOISE)
    seen[:gross] += 0.05
    found = calibrate(robot, Measurements(q, positions=seen, sigma=NOISE))
    assert {each.row for each in found.rejected} == set(range(gross))
    assert mean_error(arm, found.robot) < 1.8 * found.expected_error
    if factor > 1.0:
        assert any("times what sigma says" in sentence for sentence in found.warnings())


@pytest.mark.slow
def test_intervals_hold_with_a_few_errors_of_five_sigma(robot: Robot) -> None:
    held = []
    for seed in range(6):
        arm = hidden_arm(robot, seed)
        q, seen = seen_positions(arm, 30, seed)
        away = np.random.default_rng(seed).normal(size=(5, 3))
        seen[:5] += 5.0 * NOISE * away / np.linalg.norm(away, axis=1)[:, None]
        found = calibrate(robot, Measurements(q, positions=seen, sigma=NOISE))
        assert arm.calibration is not None
        known = found.fit.identifiability.known / found.model.prior
        missed = known @ (found.fit.x - arm_of(arm.calibration).ravel())
        held += (np.abs(missed) < 1.96 * np.sqrt(np.einsum("ij,jk,ik->i", known, found.covariance, known))).tolist()
    assert np.mean(held) > 0.9


def test_too_few_configurations_are_refused(robot: Robot) -> None:
    q, seen = seen_positions(hidden_arm(robot, 12), 30, 12)
    for rows in (
        Measurements(q[:1], positions=seen[:1], sigma=NOISE),
        Measurements(
            np.repeat(q[:1], 30, axis=0) + 2.0 * np.pi, positions=np.repeat(seen[:1], 30, axis=0), sigma=NOISE
        ),
        Measurements(q[[0, 1] * 15], positions=seen[[0, 1] * 15], sigma=NOISE),
        Measurements(q[:2], contact="plane", sigma=NOISE),
    ):
        with pytest.raises(InvalidInputError, match="configurations? of the arm that differ.*at least 3 are needed"):
            calibrate(robot, rows)
    for sigma in (1e-300, 1e300):
        with pytest.raises(InvalidInputError, match=r"sigma must be between 1e-12 and 1e\+06"):
            Measurements(q, positions=seen, sigma=sigma)


@pytest.mark.slow
def test_hand_eye(robot: Robot) -> None:
    """Only the camera and what it sees are looked for: beside the arm, and on the hand."""
    rng = np.random.default_rng(21)
    q = robot.sample(rng, 15)
    T = poses_of(robot, q)
    base, tool = jacokin.pose([1, 0.4, 0.3], rpy=[0.3, 0.2, 2]), jacokin.pose([0.02, 0.03, 0.05], rpy=[0.3, -0.2, 1])

    def noisy(T: Array) -> Array:
        turns = [jacokin.pose(rng.normal(0, 1e-3, 3), rpy=rng.normal(0, 2e-3, 3)).homogeneous for _ in T]
        return np.asarray(T @ np.array(turns))

    sigma = (1e-3, 2e-3)
    seen = noisy(base.homogeneous @ T @ tool.homogeneous)
    beside = calibrate(robot, Measurements(q, poses=seen, sigma=sigma, base="unknown", tool="unknown"), [])
    camera, board = tool, jacokin.pose([0.5, -0.3, 0.1], rpy=[0.1, 0.2, 0.3])
    on_hand = noisy(np.linalg.inv(T @ camera.homogeneous) @ board.homogeneous)
    rows = Measurements(q, poses=np.linalg.inv(on_hand), sigma=(3e-3, 2e-3), base="unknown", tool="unknown")
    carried = calibrate(robot, rows, parameters=[])
    for found, base_is, tool_is in ((beside, base, tool), (carried, board.inverse(), camera)):
        assert found.base is not None
        for pose, true in ((found.base, base_is), (found.tools[None], tool_is)):
            assert np.linalg.norm(pose.translation - true.translation) < 4e-3
            assert np.abs(pose.rotation - true.rotation).max() < 5e-3
        assert {each.rpartition(".")[0] for each in found.parameters} == {"base", "tool"}
        assert "base in the instrument's frame: position (" in str(found)
        assert "tool in end_effector: position (" in str(found)
