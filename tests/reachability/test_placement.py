"""Places for the base: bounds, and scenes that stand in the world."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

import jacokin
from jacokin import IKSolver, Robot
from jacokin.arrays import Array
from jacokin.errors import InvalidInputError
from jacokin.model import Box, Floor, Scene
from jacokin.reachability import Grid, build, bundled, place_base
from jacokin.reachability.folder import count_reaching, count_with_rows, usable_rows
from jacokin.reachability.placement import _Measured, _Refinement

BENCH = Box("bench", [0.8, 0.8, 0.4], [0.2, 0.0, 0.2])  # from -0.2 to 0.6 m in x, 0.4 m high
ON_BENCH = [jacokin.pose([x, y, 0.5], down=True) for x in (0.2, 0.4) for y in (-0.15, 0.15)]


def in_base(obstacle: Box, T_world_base: pin.SE3) -> Box:
    assert isinstance(obstacle.pose, pin.SE3)
    return Box(obstacle.name, obstacle.size, T_world_base.inverse() * obstacle.pose)


@pytest.mark.parametrize("collision", ["prefer", "ignore"])
@pytest.mark.parametrize("name", ["j2n6s300", "gen3"])
def test_what_reaches_many_targets_is_what_reaches_each(name: str, collision: str, rng: np.random.Generator) -> None:
    """Counted together, with the configurations that count; and one target at a time."""
    robot = jacokin.load_robot(name)
    solver, far = IKSolver(robot, collision=collision), jacokin.pose((9.0, 0.0, 0.0), down=True)
    targets = np.array([each.homogeneous for each in (*map(robot.forward_kinematics, robot.sample(rng, 6)), far)])
    found, rows_of = count_with_rows(solver, targets)
    alone = count_reaching(solver, targets)
    for together, apart in zip(found, alone, strict=True):
        np.testing.assert_array_equal(together, apart)
    assert 0 < np.count_nonzero(found.counts) < len(targets)
    for number in np.flatnonzero(found.counts).tolist():
        for together, apart in zip(rows_of(number), usable_rows(solver, targets[number]), strict=True):
            np.testing.assert_array_equal(together, apart)


def test_places_that_cannot_be_better_are_not_looked_at_closely(monkeypatch: pytest.MonkeyPatch) -> None:
    """Most places are worse by one of the targets that are hardest at the place beside them: few are solved there."""
    wide = [jacokin.pose([x, y, 0.5], down=True) for x in np.linspace(-0.4, 0.8, 6) for y in np.linspace(-0.5, 0.5, 6)]

    def places(targets: list[pin.SE3]) -> list[tuple[float, ...]]:
        found = place_base(bundled(), targets, x=(-0.3, 0.1), y=(-0.1, 0.1), heights=[0.0], count=2)
        return [(place.reached, place.margin, *place.success, *place.pose.translation) for place in found]

    looked, solved = _Refinement._measure, list[int]()

    def counted(self: _Refinement, at: Array, yaw: float, numbers: NDArray[np.int_]) -> _Measured:
        solved.append(len(at) * len(numbers))
        return looked(self, at, yaw, numbers)

    monkeypatch.setattr(_Refinement, "_measure", counted)
    quick = [places(targets) for targets in (ON_BENCH, wide)]
    few = sum(solved)
    solved.clear()

    def best_of_all(self: _Refinement, at: Array, yaw: float, than: _Measured) -> tuple[Array, _Measured] | None:
        seen = counted(self, at, yaw, np.arange(len(self.targets)))
        index = max(range(len(at)), key=seen.scores.__getitem__)
        return (at[index], seen.of([index])) if seen.scores[index] > than.scores[0] else None

    monkeypatch.setattr(_Refinement, "_best", best_of_all)
    assert quick == [places(targets) for targets in (ON_BENCH, wide)]
    assert few < 0.2 * sum(solved)
    assert quick[1][0][0] < len(wide)


@pytest.mark.slow
def test_a_scene_stands_in_the_world_and_the_base_not_inside_it(robot: Robot) -> None:
    scene = Scene([BENCH, Floor(0.0)])
    # Without the scene one of the best two, which mirror each other, is inside.
    ahead, behind = sorted(
        place_base(bundled(), ON_BENCH, heights=[0.0], count=2), key=lambda best: -best.pose.translation[0]
    )
    assert behind.margin == pytest.approx(ahead.margin, abs=1e-9)
    assert behind.reached == 4
    assert not behind.touching.any()
    assert np.abs(behind.pose.translation[:2] - [0.2, 0.0]).max() < 0.4
    for best in place_base(bundled(), ON_BENCH, scene=scene, heights=[0.0], count=3):
        x, y, _ = best.pose.translation
        assert abs(x - 0.2) > 0.4 + 0.04 or abs(y) > 0.4 + 0.04  # the base has a radius of 4 cm
        # A solver with the same obstacles, where they stand in this base, says the same.
        solver = IKSolver(robot, scene=Scene([in_base(BENCH, best.pose), Floor(0.0)]), collision="reject")
        reached = [solver.solve(best.pose.inverse() * target, closest=False).success for target in ON_BENCH]
        assert reached == best.success.tolist()
        assert best.reached == sum(reached)
        assert not (best.success & best.touching).any()
        assert best.reached == 2  # the best of a grid of 10 cm around the bench, too
    on_top = place_base(bundled(), ON_BENCH, scene=scene, heights=[0.4], x=(0.0, 0.6))
    assert on_top[0].reached == 4  # the base may stand on it


def test_targets_that_only_contact_hinders_are_told(robot: Robot) -> None:
    target = jacokin.pose([0.5, 0.1, 0.3], down=True)
    around = Box("around", [0.14, 0.14, 0.14], [0.5, 0.1, 0.3])
    best = place_base(bundled(), [target], scene=Scene([around]), x=(0.0, 0.0), y=(0.0, 0.0), heights=[0.0])[0]
    assert best.pose.translation.tolist() == [0.0, 0.0, 0.0]
    assert (best.success.tolist(), best.touching.tolist()) == ([False], [True])
    assert IKSolver(robot).solve(target).success


def test_no_place_is_left_where_obstacles_fill_the_bounds() -> None:
    block = Box("block", [1.0, 1.0, 1.0], [0.0, 0.0, 0.0])
    area = (-0.2, 0.2)
    assert place_base(bundled(), ON_BENCH, scene=Scene([block]), heights=[0.0], x=area, y=area) == ()


@pytest.mark.parametrize("name", ["j2n6s300", "j2s7s300"])
def test_bounds_hold(name: str) -> None:
    targets = ON_BENCH[: 4 if name == "j2n6s300" else 1]
    x, y = (0.05, 0.10), (-0.3, -0.2)
    places = place_base(bundled(name), targets, x=x, y=y, heights=[0.1])
    assert places[0].reached == len(targets)
    for each in places:
        assert x[0] <= each.pose.translation[0] <= x[1]
        assert y[0] <= each.pose.translation[1] <= y[1]


@pytest.mark.slow
def test_bounds_hold_for_a_base_that_is_turned(tmp_path: Path) -> None:
    robot = jacokin.load_robot(limits={"joint_1": (0.0, 5.0)})  # so the map has no symmetry, and yaws are tried
    reach = build(robot, folder=tmp_path, grid=Grid.around(robot, 0.3), orientations=8)
    assert reach is not None
    for each in place_base(reach, ON_BENCH, x=(0.5, 0.6), y=(0.5, 0.6), heights=[0.0]):
        assert (each.pose.translation[:2] >= 0.5).all()
        assert (each.pose.translation[:2] <= 0.6).all()
        seen = [each.pose.inverse() * target for target in ON_BENCH]
        assert IKSolver(robot).solve_batch(seen, closest=False).success.tolist() == each.success.tolist()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ({"x": (0.3, 0.1)}, "x must be from where and to where"),
        ({"y": 3}, "y must have shape"),
        ({"x": (0.0, np.nan)}, "x must be"),
        ({"scene": "bench.yaml"}, "scene must be a Scene"),
    ],
)
def test_mistakes_are_named(words: dict[str, object], message: str) -> None:
    with pytest.raises(InvalidInputError, match=message):
        place_base(bundled(), ON_BENCH, **words)  # type: ignore[arg-type]  # wrong on purpose
