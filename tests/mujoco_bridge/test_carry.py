"""The example that carries a cup: planned without contact, done by contact."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLE = Path(__file__).parents[2] / "examples" / "carry_cup.py"


@pytest.mark.slow
def test_the_cup_stands_where_it_was_to_stand(capsys: pytest.CaptureFixture[str]) -> None:
    spec = importlib.util.spec_from_file_location("carry_cup", EXAMPLE)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["carry_cup"] = module
    spec.loader.exec_module(module)
    kitchen = module.Kitchen()
    module.carry(kitchen)
    x, y, z = kitchen.cup_position()
    np.testing.assert_allclose([x, y], module.TO, atol=0.03)
    assert z == pytest.approx(0.5 * module.CUP[2], abs=2e-3)  # upright, on the floor
    assert "straight down to the place" in capsys.readouterr().out
