"""Maps of arms of seven joints: each sample has a family, whose intervals are counted."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from jacokin import IKSolver, Robot
from jacokin.reachability import Grid, ReachabilityMap, build, folder, place_base
from jacokin.reachability.folder import count_reaching
from tests.reachability.poses import random_samples


@pytest.fixture(scope="module")
def seven(bundled: Callable[[str], Robot]) -> Robot:
    return bundled("j2s7s300")


@pytest.fixture(scope="module")
def reach(seven: Robot, tmp_path_factory: pytest.TempPathFactory) -> ReachabilityMap:
    found = build(
        IKSolver(seven, collision="ignore"),
        folder=tmp_path_factory.mktemp("seven") / "map",
        grid=Grid.around(seven, 0.3),
        orientations=12,
    )
    assert found is not None
    return found


def slow_from(quick: int, thorough: int) -> pytest.MarkDecorator:
    """Two sizes of a test, the larger one slow."""
    return pytest.mark.parametrize("count", [quick, pytest.param(thorough, marks=pytest.mark.slow)])


@slow_from(30, 80)
def test_poses_of_configurations_are_reached_with_their_margin(
    count: int, seven: Robot, rng: np.random.Generator
) -> None:
    solver, rows = IKSolver(seven, collision="ignore"), seven.sample(rng, count)
    counts, margins, _ = count_reaching(solver, np.array([seven.forward_kinematics(q).homogeneous for q in rows]))
    own = np.minimum(rows - seven.lower, seven.upper - rows).min(axis=1)
    assert (counts > 0).all()
    assert (margins >= own - 1e-9).all()


@pytest.mark.slow
def test_a_map_agrees_with_the_solver(reach: ReachabilityMap, seven: Robot, rng: np.random.Generator) -> None:
    assert reach.samples.symmetries.turns
    assert reach.samples.symmetries.tool_axis is not None
    targets, counts = random_samples(reach, rng, 250)
    assert 0.05 < (counts > 0).mean() < 0.9
    solver = IKSolver(seven, collision="ignore")
    for target, count in zip(targets, counts, strict=True):
        assert len(solver.solve_all(target)) == count
    # Nothing that the map calls unreachable is reached by descents, which know nothing of the closed form.
    descents = IKSolver(seven, method="qp", max_restarts=4, collision="ignore")
    out = targets[counts == 0][:20]
    assert not descents.solve_batch(out, closest=False).success.any()
    np.testing.assert_array_equal(reach.reached(targets), counts > 0)


@pytest.mark.slow
@slow_from(2, 5)
def test_the_symmetries_give_what_the_full_grid_gives(
    count: int, seven: Robot, tmp_path: Path, rng: np.random.Generator
) -> None:
    grid = Grid([0.2, -0.2, 0.2], [0.6, 0.2, 0.6], 0.2)
    full = build(
        IKSolver(seven, collision="ignore"), folder=tmp_path / "map", grid=grid, orientations=count, use_symmetry=False
    )
    assert full is not None
    assert full.recipe["positions"]["axes"] == "x, y, z"
    reduced = build(
        IKSolver(seven, collision="ignore"), folder=tmp_path / "reduced", grid=grid, orientations=full.orientations
    )
    assert reduced is not None
    targets, counts = random_samples(reduced, rng, 7 * count)
    again, *_ = count_reaching(full.solver, targets)
    np.testing.assert_array_equal(again > 0, counts > 0)


@pytest.mark.slow
def test_a_base_is_placed_for_seven_joints(reach: ReachabilityMap, seven: Robot, rng: np.random.Generator) -> None:
    targets = [seven.forward_kinematics(q) for q in seven.sample(rng, 4)]
    best = place_base(reach, targets, heights=[0.0], count=1)[0]
    assert best.reached == len(targets)
    seen = [best.pose.inverse() * target for target in targets]
    assert IKSolver(seven, collision="ignore").solve_batch(seen, closest=False).success.all()


def test_a_build_of_its_own_threads_ends_with_ctrl_c(
    seven: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def slowly(*_: object) -> tuple[int, float, int]:
        time.sleep(2e-3)  # [s] of 10,000 in a chunk
        return 1, 0.1, 0

    monkeypatch.setattr(folder, "_count_intervals", slowly)
    grid = Grid([-1.0, -1.0, 0.0], [1.0, 1.0, 1.0], 0.2)
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    begun = time.monotonic()
    with pytest.raises(KeyboardInterrupt):
        build(seven, folder=tmp_path / "map", grid=grid, orientations=20, use_symmetry=False)
    assert time.monotonic() - begun < 8.0
