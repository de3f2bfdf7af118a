"""The example that carries a cup: planned without contact, done by contact."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from tests.scripts import load_script

EXAMPLE = Path(__file__).parents[2] / "examples" / "carry_cup.py"


@pytest.mark.slow
def test_the_cup_stands_where_it_was_to_stand(capsys: pytest.CaptureFixture[str]) -> None:
    module = load_script(EXAMPLE)
    kitchen = module.Kitchen()
    module.carry(kitchen)
    x, y, z = kitchen.cup_position()
    np.testing.assert_allclose([x, y], module.TO, atol=0.03)
    assert z == pytest.approx(0.5 * module.CUP[2], abs=2e-3)  # upright, on the floor
    assert "straight down to the place" in capsys.readouterr().out
