"""Contact on the collision shapes of a description."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import jacokin
import jacokin.model
from tests.robot_files import urdf_text


def test_own_urdf_shapes_are_checked_for_contact(tmp_path: Path, rng: np.random.Generator) -> None:
    from jacokin.model import SelfContact

    path = tmp_path / "mine.urdf"
    path.write_text(urdf_text())
    mine, bundled = SelfContact(jacokin.load_robot(path, finger_angle=0.15)), SelfContact(jacokin.load_robot())
    hits = 0
    for q in jacokin.load_robot().sample(rng, 300):
        # A URDF cannot exclude pairs, so it may report more; never less.
        theirs = {frozenset(pair) for pair in bundled.touching(q)}
        assert theirs <= {frozenset(pair) for pair in mine.touching(q)}
        hits += bool(theirs)
    assert hits > 5
    own = jacokin.load_robot(path)
    assert mine.touching(own.home) == []
