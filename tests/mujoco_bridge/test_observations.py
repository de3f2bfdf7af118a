"""The predefined settings, and how they become options."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from jacokin.errors import InvalidInputError
from jacokin.mujoco_bridge.observations import (
    FREEPROP_OBSERVABLES,
    JACO_ARM_OBSERVABLES,
    JACO_HAND_OBSERVABLES,
    PERFECT_FEATURES,
    VISION,
    CameraObservableSpec,
    ObservableNames,
    ObservableSpec,
    ObservationSettings,
    make_options,
    symmetric_log,
)


def test_fields_in_the_order_of_the_interface() -> None:
    options = ("enabled", "update_interval", "buffer_size", "delay", "aggregator", "corruptor")
    assert ObservableSpec._fields == options
    assert CameraObservableSpec._fields == ("height", "width", *options)
    assert ObservationSettings._fields == ("proprio", "ftt", "prop_pose", "camera")
    assert ObservableNames._fields == ("proprio", "ftt", "prop_pose", "camera")
    assert ObservableNames() == ((), (), (), ())


@pytest.mark.parametrize(
    ("settings", "enabled"),
    [(PERFECT_FEATURES, (True, True, True, False)), (VISION, (True, True, False, True))],
)
def test_settings(settings: ObservationSettings, enabled: tuple[bool, ...]) -> None:
    assert tuple(spec.enabled for spec in settings) == enabled
    for name, spec in settings._asdict().items():
        assert (spec.update_interval, spec.buffer_size, spec.delay, spec.aggregator) == (1, 1, 0, None)
        assert spec.corruptor is (symmetric_log if name == "ftt" else None)
    assert (settings.camera.height, settings.camera.width) == (84, 84)


def test_make_options_nests_the_options_of_each_name() -> None:
    options = make_options(PERFECT_FEATURES, JACO_ARM_OBSERVABLES)
    assert list(options) == ["joints_pos", "joints_vel", "joints_torque"]
    assert options["joints_vel"] == PERFECT_FEATURES.proprio._asdict()
    assert options["joints_torque"] == PERFECT_FEATURES.ftt._asdict()
    assert list(make_options(VISION, JACO_HAND_OBSERVABLES)) == [
        "joints_pos",
        "joints_vel",
        "pinch_site_pos",
        "pinch_site_rmat",
    ]
    prop = make_options(VISION, FREEPROP_OBSERVABLES)
    assert list(prop) == ["position", "orientation", "linear_velocity", "angular_velocity"]
    assert not prop["position"]["enabled"]
    own = PERFECT_FEATURES._replace(proprio=PERFECT_FEATURES.proprio._replace(delay=3))
    assert make_options(own, JACO_ARM_OBSERVABLES)["joints_pos"]["delay"] == 3
    assert make_options(own, ObservableNames(camera=("eye",)))["eye"]["height"] == 84


def test_symmetric_log() -> None:
    np.testing.assert_allclose(symmetric_log([0.0, np.e - 1, 1 - np.e, 99.0]), [0, 1, -1, np.log(100.0)])
    x = np.linspace(-300.0, 300.0, 101)
    np.testing.assert_array_equal(symmetric_log(x), -symmetric_log(-x, random_state=None))
    np.testing.assert_allclose(np.sign(x) * np.expm1(np.abs(symmetric_log(x))), x, rtol=1e-13)
    assert symmetric_log(1e-300) == 1e-300  # no cancellation at small values
    wrong: Any
    for wrong in ("daqp", 1j, 10**400, [np.ma.masked], object()):
        with pytest.raises(InvalidInputError, match="value must be numbers"):
            symmetric_log(wrong)
