"""Maps of the workspace: against the solver, against forward kinematics, with and without symmetry."""

from __future__ import annotations

import itertools
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import IKSolver, Robot
from jacokin.errors import InvalidInputError
from jacokin.ik import Progress
from jacokin.reachability import Grid, Orientations, ReachabilityMap, build, bundled, load, place_base
from jacokin.reachability.samples import NOWHERE
from tests.model.measured_arms import perturbed
from tests.reachability.poses import random_samples

SPACING = 0.1  # [m]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("maps") / "map"


@pytest.fixture(scope="module")
def reach(robot: Robot, folder: Path) -> ReachabilityMap:
    found = build(IKSolver(robot, collision="ignore"), folder=folder, grid=Grid.around(robot, SPACING), orientations=80)
    assert found is not None
    return found


@pytest.mark.one_quick
@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s300", "m1n6s200"])
def test_a_map_agrees_with_the_solver_on_every_pose(
    name: str, bundled: Callable[[str], Robot], tmp_path: Path, rng: np.random.Generator
) -> None:
    robot = bundled(name)
    reach = build(
        IKSolver(robot, collision="ignore"), folder=tmp_path / "map", grid=Grid.around(robot, 0.15), orientations=40
    )
    assert reach is not None
    assert reach.samples.symmetries.turns
    targets, counts = random_samples(reach, rng, 1000)
    assert 0.1 < (counts > 0).mean() < 0.9
    solver = IKSolver(robot, collision="ignore")
    np.testing.assert_array_equal(solver.solve_batch(targets, closest=False).success, counts > 0)
    np.testing.assert_array_equal(reach.reached(targets), counts > 0)
    for target, count in zip(targets[:100], counts[:100], strict=True):
        assert int(solver.solve_all(target).within_limits.sum()) == count


def test_the_symmetries_give_what_the_full_grid_gives(robot: Robot, tmp_path: Path, reach: ReachabilityMap) -> None:
    grid = Grid([0.2, -0.3, 0.1], [0.6, 0.3, 0.5], 0.2)
    axis = reach.samples.symmetries.tool_axis
    assert axis is not None
    orientations = Orientations.directions(30, axis)
    turning = Orientations(orientations.quats_wxyz)
    full = build(
        IKSolver(robot, collision="ignore"),
        folder=tmp_path / "full",
        grid=grid,
        orientations=turning,
        use_symmetry=False,
    )
    assert full is not None
    assert full.recipe["positions"] == {"axes": "x, y, z", "shape": [2, 3, 2]}
    reduced = build(IKSolver(robot, collision="ignore"), folder=tmp_path / "reduced", grid=grid, orientations=turning)
    assert reduced is not None
    assert "turns freely" in json.loads((tmp_path / "reduced" / "manifest.json").read_text())["symmetries"]["joint 1"]
    # Every sample of the small map, turned to anywhere, is what the solver of the full one says.
    targets, counts = random_samples(reduced, np.random.default_rng(4), 500)
    np.testing.assert_array_equal(full.solver.solve_batch(targets, closest=False).success, counts > 0)
    assert reduced.samples.positions * 2 <= full.samples.positions * 4
    targets, counts = random_samples(full, np.random.default_rng(5), 300)
    np.testing.assert_array_equal(full.solver.solve_batch(targets, closest=False).success, counts > 0)


def test_tools_off_the_last_axis_have_no_roll_to_leave_out(robot: Robot, tmp_path: Path) -> None:
    grid = Grid([0.2, 0.2, 0.2], [0.6, 0.6, 0.6], 0.2)
    reach = build(
        IKSolver(robot, frame="pinchsite", collision="ignore"), folder=tmp_path / "map", grid=grid, orientations=50
    )
    assert reach is not None
    assert reach.samples.symmetries.tool_axis is None
    assert reach.samples.symmetries.turns
    assert "super-Fibonacci" in reach.orientations.name
    targets, counts = random_samples(reach, np.random.default_rng(6), 300)
    solver = IKSolver(robot, "pinchsite", collision="ignore")
    np.testing.assert_array_equal(solver.solve_batch(targets, closest=False).success, counts > 0)


def test_the_tool_of_random_configurations_is_in_cells_that_are_reached(
    reach: ReachabilityMap, robot: Robot, rng: np.random.Generator
) -> None:
    """Within a cell: what is reached at its edge may not be at its centre, by the orientations that were tried."""
    positions = np.array([robot.forward_kinematics(q).translation for q in robot.sample(rng, 3000)])
    cells = reach.samples.cell_of(positions)
    assert (cells != NOWHERE).all()
    reached = reach.samples.position(np.flatnonzero((reach.counts > 0).any(axis=1)))[:, [0, 2]]
    places = np.column_stack([np.hypot(positions[:, 0], positions[:, 1]), positions[:, 2]])
    away = np.linalg.norm(places[:, None] - reached[None], axis=2).min(axis=1)
    assert reach.bound is not None
    assert away.max() <= reach.bound
    assert (away <= np.sqrt(0.5) * SPACING).mean() > 0.98


def test_arrays_have_the_shape_of_the_grid_and_the_symmetry_of_the_arm(reach: ReachabilityMap) -> None:
    assert reach.fraction.shape == reach.branches.shape == reach.margin.shape == reach.grid.shape
    for values in (reach.fraction, reach.branches):
        np.testing.assert_array_equal(values, values[::-1])
        np.testing.assert_array_equal(values, values.transpose(1, 0, 2))
    assert np.isnan(reach.margin[reach.fraction == 0.0]).all()
    assert (reach.margin[reach.fraction > 0.0] >= 0.0).all()
    middle = tuple(n // 2 for n in reach.grid.shape)
    assert reach.dexterity(reach.grid.centres()[middle]) == reach.fraction[middle]
    assert reach.dexterity([9.0, 0.0, 0.0]) == 0.0
    assert reach.covers(reach.grid.centres()[middle])
    assert not reach.covers([9.0, 0.0, 0.0])


def test_the_nearest_reachable_pose_is_reached_and_near(
    reach: ReachabilityMap, robot: Robot, rng: np.random.Generator
) -> None:
    solver = IKSolver(robot, collision="ignore")
    for q in robot.sample(rng, 40):
        wanted = robot.forward_kinematics(q)
        found = reach.nearest_reachable(wanted)
        assert solver.solve(found).success
        assert np.linalg.norm(found.translation - wanted.translation) < 2.0 * SPACING
    far = reach.nearest_reachable(jacokin.pose([3.0, 1.0, 0.3], down=True))
    assert solver.solve(far).success
    assert np.arctan2(far.translation[1], far.translation[0]) == pytest.approx(np.arctan2(1.0, 3.0))


def test_shards_together_are_the_map_and_a_damaged_chunk_is_made_again(
    robot: Robot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("jacokin.reachability.folder.POSES_IN_A_CHUNK", 200)
    grid = Grid([0.0, -0.4, 0.0], [0.8, 0.4, 0.8], 0.2)

    def part(folder: str, shard: str | None = None) -> ReachabilityMap | None:
        return build(
            IKSolver(robot, collision="ignore"), folder=tmp_path / folder, grid=grid, orientations=40, shard=shard
        )

    whole = part("whole")
    assert part("parts", "2/3") is None
    assert part("parts", "1/3") is None
    with pytest.raises(InvalidInputError, match="not a complete map"):
        load(tmp_path / "parts")
    together = part("parts", "3/3")
    assert whole is not None
    assert together is not None
    names = [path.name for path in sorted((tmp_path / "whole").iterdir())]
    assert [path.name for path in sorted((tmp_path / "parts").iterdir())] == names
    for name in names:
        assert (tmp_path / "parts" / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    chunk = tmp_path / "parts" / names[1]
    content = chunk.read_bytes()
    chunk.write_bytes(content[:-20])
    with pytest.raises(InvalidInputError, match="is damaged"):
        load(tmp_path / "parts")
    seen: list[Progress] = []
    assert (
        build(
            IKSolver(robot, collision="ignore"),
            folder=tmp_path / "parts",
            grid=grid,
            orientations=40,
            progress=seen.append,
        )
        is not None
    )
    assert len(seen) == 1
    assert chunk.read_bytes() == content


@pytest.mark.usefixtures("reach")
def test_other_maps_and_other_folders_are_refused(robot: Robot, tmp_path: Path, folder: Path) -> None:
    with pytest.raises(InvalidInputError, match="differs in grid.*spacing"):
        build(IKSolver(robot, collision="ignore"), folder=folder, grid=Grid.around(robot, 0.2), orientations=80)
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "precious.txt").write_text("")
    with pytest.raises(InvalidInputError, match="folder with other things in it"):
        build(IKSolver(robot, collision="ignore"), folder=tmp_path / "full")
    with pytest.raises(InvalidInputError, match="is not a map: it has no recipe.json"):
        load(tmp_path)
    other = jacokin.load_robot(limits={"joint_2": (1.0, 5.0)})
    with pytest.raises(InvalidInputError, match="another robot"):
        load(folder, robot=other)


@pytest.mark.parametrize("count", [8, pytest.param(50, marks=pytest.mark.slow)])
def test_the_base_that_targets_were_made_from_is_found(
    count: int, reach: ReachabilityMap, robot: Robot, rng: np.random.Generator
) -> None:
    hidden = jacokin.pose([0.7, -0.3, 0.4], rpy=[0.0, 0.0, 1.0])
    targets = [hidden * robot.forward_kinematics(q) for q in robot.sample(rng, count)]
    places = place_base(reach, targets)
    best = places[0]
    for one, other in itertools.combinations(places, 2):
        assert np.linalg.norm(one.pose.translation - other.pose.translation) > 0.5 * reach.grid.spacing
        assert one.reached >= other.reached
    assert best.reached == count
    seen = [best.pose.inverse() * target for target in targets]
    assert int(IKSolver(robot, collision="ignore").solve_batch(seen, closest=False).success.sum()) == count
    assert best.margin > 0.0
    standing = place_base(reach, targets, heights=[0.4])[0]
    assert standing.pose.translation[2] == 0.4
    assert standing.reached <= count


@pytest.mark.slow
def test_a_small_spot_from_which_all_targets_that_are_clear_are_reached_is_found(robot: Robot) -> None:
    rng = np.random.default_rng(2)
    hidden = jacokin.pose([0.7, -0.3, 0.4], rpy=[0.0, 0.0, 1.0])
    targets = [hidden * robot.forward_kinematics(q) for q in robot.sample(rng, 50)]
    best = place_base(bundled(), targets, heights=[0.4])[0]
    seen = [best.pose.inverse() * target for target in targets]
    reached = IKSolver(robot, collision="reject").solve_batch(seen, closest=False).success
    np.testing.assert_array_equal(best.success, reached)
    assert best.reached == int(reached.sum()) >= 47
    # What is missed for contact alone is named.
    bare = IKSolver(robot, collision="ignore").solve_batch(seen, closest=False).success
    np.testing.assert_array_equal(best.touching, bare & ~reached)
    assert best.touching.any()


@pytest.mark.slow
def test_pictures_and_pages_are_drawn(reach: ReachabilityMap, tmp_path: Path) -> None:
    reach.plot(tmp_path / "map.html")
    page = (tmp_path / "map.html").read_text(encoding="utf-8")
    assert "http" not in page
    assert "80 directions" in page
    pytest.importorskip("matplotlib")
    reach.plot(tmp_path / "map.png")
    assert (tmp_path / "map.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_turning_pictures_show_all_sides(
    reach: ReachabilityMap, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("matplotlib")
    image = pytest.importorskip("PIL.Image")
    monkeypatch.setattr("jacokin.reachability.pictures.VIEWS", 4)
    for name in ("map.apng", "map.gif"):
        reach.plot(tmp_path / name)
        with image.open(tmp_path / name) as picture:
            assert picture.n_frames == 4
            views = []
            for frame in range(4):
                picture.seek(frame)
                views.append(np.asarray(picture.convert("RGB"), dtype=float))
        assert min(np.abs(views[i] - views[j]).mean() for i in range(4) for j in range(i)) > 1.0


def test_even_rotations_are_even() -> None:
    """No rotation is far from the set, and none of it are close together."""
    rng = np.random.default_rng(8)
    quats = Orientations.even(500).quats_wxyz
    random = rng.normal(size=(2000, 4))
    random /= np.linalg.norm(random, axis=1, keepdims=True)
    covering = 2.0 * np.arccos(np.abs(random @ quats.T).max(axis=1).clip(max=1.0))
    others = np.abs(quats @ quats.T) - 2.0 * np.eye(500)
    spacing = 2.0 * np.arccos(others.max(axis=1).clip(max=1.0))
    assert covering.max() < 2.2 * (8.0 * np.pi**2 / 500) ** (1 / 3) / 2.0
    assert spacing.min() > 0.2
    down = Orientations.down(4).rotations
    np.testing.assert_allclose(down[:, :, 2], np.tile([0.0, 0.0, -1.0], (4, 1)), atol=1e-12)
    assert len({tuple(row) for row in down[:, :, 0].round(6).tolist()}) == 4


def test_a_map_of_a_calibrated_arm_counts_its_branches(robot: Robot, tmp_path: Path) -> None:
    arm = perturbed(robot, np.random.default_rng(3))
    grid = Grid((0.1, -0.5, 0.0), (0.7, 0.5, 0.6), 0.2)
    found = build(IKSolver(arm, collision="ignore"), folder=tmp_path / "map", grid=grid, orientations=4)
    assert found is not None
    assert not found.samples.symmetries.turns  # its first axis is not the base's z
    assert "calibrated j2n6s300" in repr(found)
    solver, seen = IKSolver(arm, collision="ignore"), 0
    counts = found.counts.reshape(*grid.shape, -1)
    for cell in np.ndindex(*grid.shape):
        position = [grid.axis(axis)[index] for axis, index in enumerate(cell)]
        for number, quat in enumerate(found.orientations.quats_wxyz):
            wanted = int(solver.solve_all(jacokin.pose(position, quat)).within_limits.sum())
            assert counts[(*cell, number)] == wanted
            seen += wanted
    assert seen > 100
    with pytest.raises(InvalidInputError, match="as it was built"):
        load(tmp_path / "map").robot  # noqa: B018 - a property that raises
    assert load(tmp_path / "map", robot=arm).robot is arm
