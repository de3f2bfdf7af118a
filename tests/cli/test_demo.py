"""The demo: its targets, what it says, and the arm in its picture."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import numpy as np
import pytest

from jacokin.cli.demo import targets_file
from jacokin.ik import read_targets
from tests.cli.run import ENVIRONMENT
from tests.programs import backends, python

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_the_targets_are_those_the_script_writes() -> None:
    rows = runpy.run_path(str(EXAMPLES / "make_targets.py"))["make_targets"]()
    file = read_targets(targets_file())
    assert len(file) == len(rows) == 206
    made = np.array([[float(cell) for cell in row[:7]] for row in rows])
    assert np.allclose(made, file.values, rtol=0.0, atol=1e-12)  # libm may differ in the last digit


@pytest.mark.slow
def test_the_demo_shows_branches_a_motion_and_advice(tmp_path: Path) -> None:
    done = python("-m", "jacokin", "demo", "--output", "out/jaco.png", cwd=tmp_path, environment=ENVIRONMENT)
    assert "8 branches" in done.stdout
    assert done.stdout.count("outside the limits ") == 4
    straight, around = re.findall(r"(\d+) mm (?:deep|clear)", done.stdout)
    assert int(straight) > 50  # [mm]
    assert int(around) >= 1
    assert "UNREACHABLE" in done.stdout
    assert "200 of 206 example poses solved" in done.stdout
    picture = tmp_path / "out" / "jaco.png"
    if set(backends()) & {"egl", "osmesa"}:
        assert picture.read_bytes().startswith(b"\x89PNG")
        assert f"Picture of the motion: {picture}" in done.stdout
    else:
        assert not picture.exists()
        assert "apt install" in done.stdout


@pytest.mark.slow
def test_the_arm_is_in_the_picture(tmp_path: Path) -> None:
    """The pixels MuJoCo attributes to the arm are dark as its links are, light as its rings are, and many."""
    program = (
        "import numpy as np, jacokin\n"
        "from jacokin.cli.picture import render\n"
        "picture, arm = render(jacokin.load_robot().home)\n"
        f"np.savez({str(tmp_path / 'seen.npz')!r}, picture=picture, arm=arm)\n"
    )
    drawing = set(backends()) & {"egl", "osmesa"}
    if not drawing:
        pytest.skip("MuJoCo draws with neither EGL nor OSMesa here")
    python("-c", program, environment={**ENVIRONMENT, "MUJOCO_GL": min(drawing)})
    seen = np.load(tmp_path / "seen.npz")
    picture, arm = seen["picture"], seen["arm"]
    assert picture.shape == (*arm.shape, 3)
    assert 0.02 < arm.mean() < 0.5
    rows, columns = np.nonzero(arm)
    assert rows.min() > 0  # nothing cut off at the border
    assert columns.min() > 0
    assert rows.max() < arm.shape[0] - 1
    assert columns.max() < arm.shape[1] - 1
    brightness = picture[arm].mean(axis=1)
    assert (brightness < 60).mean() > 0.4  # dark links
    assert (brightness > 120).mean() > 0.02  # light rings and fingers
    assert picture[~arm].mean() > 100  # against a light floor
