"""MapSlices of a reachability map: every cell that is reached, where it is, in the colour of its fraction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import reachability
from jacokin.errors import InvalidInputError
from jacokin.viewer import serve
from jacokin.viewer.contents import COLOURS, MapSlices, colour_fractions
from tests.viewer.page import opened


def test_every_cell_that_is_reached_is_in_its_slice() -> None:
    reach = reachability.bundled()
    slices = MapSlices(reach)
    assert np.allclose(slices.heights, reach.grid.centres()[0, 0, :, 2])
    total = 0
    for layer in range(0, len(slices.heights), 5):
        cells = slices.cells(layer)
        assert np.allclose(cells.positions[:, 2], slices.heights[layer], atol=1e-6)
        assert [reach.dexterity(position) for position in cells.positions] == cells.fractions.tolist()
        assert len(cells.positions) == int((reach.fraction[:, :, layer] > 0.0).sum())
        total += len(cells.positions)
    assert total > 1000
    assert slices.layer(slices.heights[3] + 0.4 * reach.grid.spacing) == 3
    assert slices.layer(-99.0) == 0
    assert "end_effector" in slices.caption


def test_colours_go_from_dark_to_bright() -> None:
    shades = colour_fractions(np.linspace(0.0, 1.0, 50)).astype(float)
    assert (np.diff(shades @ [0.2126, 0.7152, 0.0722]) > 0.0).all()  # luminance
    assert np.array_equal(colour_fractions(np.array([0.0, 1.0])), COLOURS[[0, -1]])


def test_a_square_fills_its_cell() -> None:
    reach = reachability.bundled()
    mesh = MapSlices(reach).square()
    assert 0.8 * reach.grid.spacing < np.ptp(mesh.vertices[:, 0]) <= reach.grid.spacing


@pytest.mark.slow
def test_a_map_in_a_folder_and_one_of_another_robot(tmp_path: Path) -> None:
    robot = jacokin.load_robot(limits={"joint_2": (1.0, 5.0)})
    grid = reachability.Grid(lower=[-0.5, -0.5, 0.0], upper=[0.5, 0.5, 0.6], spacing=0.2)
    built = reachability.build(robot, folder=tmp_path / "map", grid=grid, orientations=10)
    for given in (tmp_path / "map", built):
        with serve(robot, reachability=given, port=0) as viewer, opened(viewer) as page:
            slider = page.control("Height [m]").props
            assert (slider["min"], slider["max"]) == pytest.approx((grid.axis(2)[0], grid.axis(2)[-1]))
    with serve(robot, port=0) as viewer, opened(viewer) as page:
        assert not page.has("Height [m]")  # the bundled map is of other limits
    for given in (tmp_path / "map", built):
        with pytest.raises(InvalidInputError, match="is a map of another robot than this j2n6s300"):
            serve(jacokin.load_robot(), reachability=given, port=0)
    with pytest.raises(InvalidInputError, match="nowhere"):
        serve(robot, reachability=tmp_path / "nowhere", port=0)
