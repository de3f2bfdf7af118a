"""Maps that leave out contact: against solving every pose with the same options."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import jacokin
from jacokin import FreeAxis, IKSolver, Robot
from jacokin.errors import InvalidInputError
from jacokin.ik import Box, Floor, Scene
from jacokin.model import SelfContact
from jacokin.reachability import Grid, Orientations, build, bundled, load

GRID = Grid([-0.6, -0.4, 0.0], [0.6, 0.4, 0.8], 0.4)


@pytest.fixture
def obstacles() -> Scene:
    return Scene([Box("table", size=[0.5, 0.6, 0.04], pose=[0.45, 0.0, 0.2]), Floor(-0.05)])


@pytest.mark.parametrize("with_scene", [False, True])
def test_every_pose_agrees_with_the_solver(robot: Robot, tmp_path: Path, obstacles: Scene, with_scene: bool) -> None:
    scene = obstacles if with_scene else None
    reach = build(
        IKSolver(robot, collision="reject", scene=scene),
        folder=tmp_path / "map",
        grid=GRID,
        orientations=Orientations.even(15),
    )
    assert reach is not None
    # The base and obstacles do not turn with joint 1, nor are fingers the same all around the last axis.
    assert not reach.samples.symmetries.turns
    assert reach.samples.symmetries.tool_axis is None
    assert reach.recipe["symmetries"]["joint 1"] is None
    targets = reach.samples.targets(np.arange(reach.samples.positions)).reshape(-1, 4, 4)
    counts = reach.counts.ravel()
    solver = IKSolver(robot, collision="reject", scene=scene)
    success = solver.solve_batch(targets, closest=False).success
    np.testing.assert_array_equal(success, counts > 0)
    # By hand: the branches of a solver that does not look, and whether each touches.
    looking = IKSolver(robot, collision="report", scene=scene)
    free = 0
    for target, count in zip(targets[::7], counts[::7], strict=True):
        branches = IKSolver(robot, collision="ignore").solve_all(target)
        within = [q for q, good in zip(branches.q, branches.within_limits, strict=True) if good]
        assert sum(not looking.verifier.touching(q) for q in within) == count
        free += len(within) - count
    assert free > 0 or not with_scene  # some are in contact
    assert 0.02 < (counts > 0).mean() < 0.9


@pytest.mark.parametrize("name", ["j2n6s300", "j2s6s200"])
def test_samples_of_a_map_with_symmetry_count_what_is_clear(name: str, tmp_path: Path) -> None:
    """Against all branches of each sample, and the contact of each."""
    robot = jacokin.load_robot(name)
    reach = build(robot, folder=tmp_path / "map", grid=Grid([-0.6, -0.6, -0.3], [0.6, 0.6, 0.6], 0.15), orientations=12)
    assert reach is not None
    assert reach.samples.symmetries.turns
    assert reach.recipe["collision"] == "prefer"
    targets = reach.samples.targets(np.arange(reach.samples.positions)).reshape(-1, 4, 4)
    solver, contact = IKSolver(robot, collision="ignore"), SelfContact(robot)
    seen = 0
    for target, count, touching, margin in zip(
        targets, reach.counts.ravel(), reach.touching.ravel(), reach.margins.ravel(), strict=True
    ):
        rows = solver.solve_all(target).q_within_limits
        clear = np.array([not contact.touching(q) for q in rows], dtype=np.bool_)
        assert (clear.sum(), (~clear).sum()) == (count, touching)
        if count:
            limit = np.minimum(rows[clear] - robot.lower, robot.upper - rows[clear]).min()
            assert margin >= limit - 1e-2
        seen += int(touching)
    assert seen > 10
    bare = build(IKSolver(robot, collision="ignore"), folder=tmp_path / "bare", grid=reach.grid, orientations=12)
    assert bare is not None
    np.testing.assert_array_equal(bare.fraction, reach.fraction_ignoring_contact)
    np.testing.assert_array_equal(bare.fraction, bare.fraction_ignoring_contact)


def test_the_column_of_the_arm_is_dark() -> None:
    """Of every bundled six-joint arm: cells inside the lower half of its base."""
    for name in ("j2n6s300", "j2s6s300", "m1n6s200"):
        reach = bundled(name)
        cell = reach.grid.axis(2)
        inside = (cell > 0.07) & (cell < 0.25)
        middle = reach.grid.shape[0] // 2
        assert (reach.fraction[middle, middle, inside] == 0.0).all()
        assert (reach.fraction_ignoring_contact[middle, middle, inside] > 0.5).all()
        assert (reach.fraction <= reach.fraction_ignoring_contact).all()


def test_a_map_with_symmetry_is_for_the_arm_alone(robot: Robot, tmp_path: Path, obstacles: Scene) -> None:
    with pytest.raises(InvalidInputError, match="collision must be 'reject' for a map with obstacles"):
        build(IKSolver(robot, collision="prefer", scene=obstacles), folder=tmp_path / "map", grid=GRID, orientations=4)


def test_obstacles_take_away_and_never_add(robot: Robot, tmp_path: Path, obstacles: Scene) -> None:
    counts = []
    for name, collision, scene in (("a", "ignore", None), ("b", "reject", None), ("c", "reject", obstacles)):
        found = build(
            IKSolver(robot, collision=collision, scene=scene),
            folder=tmp_path / name,
            grid=GRID,
            orientations=Orientations.even(10),
            use_symmetry=False,
        )
        assert found is not None
        counts.append(found.counts)
    assert (counts[0] >= counts[1]).all()
    assert (counts[1] >= counts[2]).all()
    assert counts[0].sum() > counts[1].sum() > counts[2].sum()


def test_a_map_with_a_scene_is_loaded_with_it(robot: Robot, tmp_path: Path, obstacles: Scene) -> None:
    folder = tmp_path / "map"
    options = {"grid": Grid([0.2, -0.2, 0.2], [0.6, 0.2, 0.6], 0.2), "orientations": 6}
    build(IKSolver(robot, collision="reject", scene=obstacles), folder=folder, **options)  # type: ignore[arg-type]  # mixed kinds
    assert load(folder, scene=obstacles).solver.verifier.options.collision == "reject"
    with pytest.raises(InvalidInputError, match="load the map with scene="):
        _ = load(folder).solver
    with pytest.raises(InvalidInputError, match="other obstacles"):
        load(folder, scene=Scene([Floor(0.0)]))
    with pytest.raises(InvalidInputError, match="differs in scene"):
        build(IKSolver(robot, collision="reject"), folder=folder, **options)  # type: ignore[arg-type]


@pytest.mark.slow
def test_families_leave_out_members_in_contact(
    bundled: Callable[[str], Robot], robot: Robot, tmp_path: Path, obstacles: Scene
) -> None:
    """Intervals with a member that is free of contact, among some of each: what is reached is reached by solving."""
    grid = Grid([0.1, -0.3, 0.1], [0.7, 0.3, 0.7], 0.3)
    seven = bundled("j2s7s300")
    level = FreeAxis(jacokin.pose([0, 0, 0], approach=[1.0, 0.0, 0.0]).pose, axis=(0.0, 1.0, 0.0))
    for arm, sets in ((seven, Orientations.even(6)), (robot, Orientations.free([level, level]))):
        counts = []
        for number, scene in enumerate((None, obstacles)):
            found = build(
                IKSolver(arm, collision="ignore" if scene is None else "reject", scene=scene),
                folder=tmp_path / f"{arm.dof} {number}",
                grid=grid,
                orientations=sets,
                use_symmetry=False,
            )
            assert found is not None
            counts.append(found.counts)
        assert (counts[0] >= counts[1]).all()
        assert counts[0].sum() > counts[1].sum() > 0
        assert found is not None
        targets = found.samples.targets(np.arange(found.samples.positions))
        solver = IKSolver(arm, collision="reject", scene=obstacles)
        agree = []
        for matrix, count in zip(targets.reshape(-1, 4, 4), counts[1].ravel(), strict=True):
            target = FreeAxis(matrix, axis=level.axis) if arm is robot else matrix
            agree.append(solver.solve(target, closest=False).success == (count > 0))
        assert np.mean(agree) > 0.97
