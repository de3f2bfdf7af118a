"""`ReachabilityMap`: what fraction of orientations is reached where, and the nearest pose that is reached."""

from __future__ import annotations

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array, seal
from jacokin.errors import InvalidInputError
from jacokin.ik.solver import IKSolver
from jacokin.ik.targets import checked_batch
from jacokin.model import checks, poses
from jacokin.model.loading import load_robot
from jacokin.model.robot import Robot, fingerprint
from jacokin.model.scene import Scene, checked_scene
from jacokin.reachability.pictures import draw, outline_arm, outline_scene
from jacokin.reachability.samples import NOWHERE, Grid, Orientations, Samples, turn_about_z


class ReachabilityMap:
    """A map. Arrays are read-only, and have one number for each cell of the grid, [x, y, z].

    Attributes:
        folder: where it is kept.
        recipe: everything it depends on, as in recipe.json.
        samples: the poses that were tried, and which of them stands for a given one.
        counts: (positions, orientations) configurations within the limits at each sample, 0 where none; without those
            in contact, unless the map ignores contact.
        margins: (positions, orientations) largest distance to the nearest limit [rad] at each sample, NaN where none.
        touching: (positions, orientations) configurations within the limits that are left out for contact.
        bound: contact apart, the tool is never farther than this [m] from a position that is reached with some
            orientation; how it is derived, and when it holds, is in `bound`. None where the orientations do not cover
            all.
    """

    def __init__(
        self,
        folder: Path,
        recipe: dict[str, Any],  # Any: JSON
        samples: Samples,
        found: tuple[NDArray[np.uint8], NDArray[np.float16], NDArray[np.uint8]],
        robot: Robot | None,
        *,
        bound: float | None = None,
        scene: Scene | None = None,
    ) -> None:
        """Take what `load` has read; `found` are counts, margins and touching."""
        self.folder = folder
        self.recipe = recipe
        self.samples = samples
        counts, margins, touching = found
        self.counts = checks.sealed(counts)
        self.margins = checks.sealed(margins)
        self.touching = checks.sealed(touching)
        self.bound = bound
        self._robot, self._scene = robot, scene

    def __setstate__(self, state: dict[str, object]) -> None:
        """Unpickled arrays are writable until told otherwise."""
        self.__dict__.update(state)
        seal(tuple(state.values()))

    def __repr__(self) -> str:
        """Robot, grid and orientations."""
        name = self.recipe["robot"]["name"]
        return f"ReachabilityMap({name!r}, {self.grid!r}, {self.orientations.name})"

    @property
    def grid(self) -> Grid:
        """The box in space that it covers."""
        return self.samples.grid

    @property
    def orientations(self) -> Orientations:
        """Those that were tried at each position."""
        return self.samples.orientations

    @property
    def robot(self) -> Robot:
        """The robot.

        Raises:
            InvalidInputError: it is not a bundled robot without changes, and the map was loaded without it.
        """
        if self._robot is None:
            name = self.recipe["robot"]["bundled"]
            if name is None:
                raise InvalidInputError(f"{self.folder}: load the map with robot=, it is not a bundled one")
            try:
                self._robot = check_same_robot(self.folder, self.recipe, load_robot(name))
            except InvalidInputError as error:
                raise InvalidInputError(f"{error}: load the map with robot=, as it was built") from error
        return self._robot

    @cached_property
    def solver(self) -> IKSolver:
        """The solver of the map: robot, frame, tool, and what counts as contact.

        Raises:
            InvalidInputError: the map was loaded without its robot, which is not bundled, or without its scene.
        """
        if self.recipe["scene"] is not None and self._scene is None:
            raise InvalidInputError(f"{self.folder}: load the map with scene=, the one that it was built with")
        return IKSolver(
            self.robot,
            self.recipe["frame"],
            tool=self.recipe["tool"],
            collision=self.recipe["collision"],
            scene=self._scene,
            clearance=self.recipe.get("clearance", 0.0),
        )

    @cached_property
    def fraction(self) -> Array:
        """(nx, ny, nz) fraction of the orientations that are reached, 0 to 1; in contact does not count."""
        return self._spread((self.counts > 0).mean(axis=1))

    @cached_property
    def fraction_ignoring_contact(self) -> Array:
        """(nx, ny, nz) fraction of the orientations that are reached, in contact or not."""
        return self._spread(((self.counts > 0) | (self.touching > 0)).mean(axis=1))

    @cached_property
    def branches(self) -> Array:
        """(nx, ny, nz) mean number of configurations (of curves: intervals), over all orientations."""
        return self._spread(self.counts.mean(axis=1))

    @cached_property
    def margin(self) -> Array:
        """(nx, ny, nz) largest distance to the nearest limit [rad] of any orientation; NaN where none is reached."""
        largest = np.where(np.isnan(self.margins), -np.inf, self.margins).max(axis=1).astype(np.float64)
        return self._spread(np.where(self.counts.any(axis=1), largest, np.nan))

    def dexterity(self, position: ArrayLike) -> float:
        """Fraction of the orientations that are reached in the cell of a position (3,) [m]; 0 where `covers` is False.

        Raises:
            InvalidInputError: `position` malformed.
        """
        cell = int(self.samples.cell_of(checks.vector("position", position, 3, "m")[None])[0])
        return 0.0 if cell == NOWHERE else float((self.counts[cell] > 0).mean())

    def covers(self, position: ArrayLike) -> bool:
        """Whether the map knows of a position (3,) [m]: it is within the grid, or comes from there by joint 1.

        Raises:
            InvalidInputError: `position` malformed.
        """
        return int(self.samples.cell_of(checks.vector("position", position, 3, "m")[None])[0]) != NOWHERE

    def reached(self, targets: Array) -> NDArray[np.bool_]:
        """(n,) whether the sample nearest to each pose (n, 4, 4) is reached: quick, and right up to the spacing.

        Raises:
            InvalidInputError: `targets` malformed.
        """
        return self.count_at(checked_poses(targets)) > 0

    def count_at(self, targets: Array) -> NDArray[np.uint8]:
        """(n,) configurations within the limits at the sample that stands for each checked pose (n, 4, 4)."""
        positions, rotations = targets[:, :3, 3], targets[:, :3, :3]
        cells = self.samples.cell_of(positions)
        found = self.counts[np.maximum(cells, 0), self.samples.orientation_of(rotations, positions)]
        return np.where(cells == NOWHERE, np.uint8(0), found)

    def nearest_reachable(self, pose: pin.SE3 | ArrayLike) -> pin.SE3:
        """The pose of the map nearest to a given one that is reached: distance in m, plus 0.1 times the angle in rad.

        Raises:
            InvalidInputError: `pose` malformed, or nothing is reached anywhere.
        """
        wanted = poses.checked_pose(pose, "pose")
        position, rotation = wanted.translation, wanted.rotation
        angle, symmetries = 0.0, self.samples.symmetries
        if symmetries.turns:  # the nearest pose that comes from a sample by turning is in the same half plane
            angle = float(np.arctan2(position[1], position[0]))
            position = np.array([np.hypot(position[0], position[1]), 0.0, position[2]])
            rotation = turn_about_z(-angle) @ rotation
        away = np.linalg.norm(self.samples.position(np.arange(self.samples.positions)) - position, axis=1)
        # A radian counts as 10 cm, as for closest configurations.
        aside = 0.1 * np.arccos(np.clip(self.samples.cosines(rotation[None])[0], -1.0, 1.0))
        best, where = np.inf, (0, 0)
        for cell in np.argsort(away):
            if away[cell] >= best:
                break
            costs = np.where(self.counts[cell] > 0, aside, np.inf)
            nearest = int(np.argmin(costs))
            if away[cell] + costs[nearest] < best:
                best, where = float(away[cell] + costs[nearest]), (int(cell), nearest)
        if not np.isfinite(best):
            raise InvalidInputError(f"{self.folder}: no pose of this map is reached")
        found = self.orientations.rotations[where[1]]
        if symmetries.tool_axis is not None:
            found = _rolled(found, rotation, symmetries.tool_axis)
        turn = turn_about_z(angle)
        nearest = pin.SE3(turn @ found, turn @ self.samples.position(np.array([where[0]]))[0])
        return nearest if self.orientations.axes is None else self._member(nearest, where[1], turn @ rotation)

    def _member(self, pose: pin.SE3, index: int, wanted: Array) -> pin.SE3:
        """Of the poses that come from turning an orientation, one that is reached, near to a rotation (3, 3)."""
        target = self.orientations.free_axis(index, pose)

        def away(q: Array) -> float:
            return float(np.linalg.norm(self.solver.verifier.tool_pose(q).rotation - wanted))

        result = self.solver.solve(target, closest=False, prefer=away).raise_for_status()
        assert result.parameter is not None
        return target.at(result.parameter)

    def plot(self, path: str | Path, *, scene: Scene | None = None) -> None:
        """Draw the map, with the arm at home where the robot is there.

        Slices and a view in space as .png, .svg or .pdf, that view turning as .apng or .gif, and a page as .html.

        Args:
            path: where to, which also tells the format.
            scene: obstacles to draw, in the base; None for those that the map was loaded with.

        Raises:
            MissingExtraError: matplotlib is not installed.
            InvalidInputError: another ending, or the file cannot be written.
        """
        robot = self.recipe["robot"]["name"]
        if scene is not None and self.recipe["scene"] is None:
            robot += ", obstacles not counted"
        title = f"{robot}, frame {self.recipe['frame']}: {self.orientations.name}"
        try:
            arm = [outline_arm(self.robot, self.robot.home)]
        except InvalidInputError:  # another robot than a bundled one, and not given
            arm = []
        shown = self._scene if scene is None else checked_scene("scene", scene)
        draw(path, self.grid, self.fraction, robot, title, arm, [] if shown is None else outline_scene(shown))

    def _spread(self, values: Array) -> Array:
        """Numbers of positions as numbers of the cells of the grid."""
        if not self.samples.symmetries.turns:
            return checks.read_only(values.reshape(self.grid.shape))
        x, y = np.meshgrid(self.grid.axis(0), self.grid.axis(1), indexing="ij")
        radius = np.minimum(np.hypot(x, y) / self.grid.spacing, self.samples.shape[0] - 1).astype(np.int_)
        return checks.read_only(values.reshape(self.samples.shape)[radius])


def checked_poses(targets: ArrayLike) -> Array:
    """Poses (n, 4, 4), rigid.

    Raises:
        InvalidInputError: malformed.
    """
    matrices, position_only, turning = checked_batch(targets)
    if position_only.any() or turning:
        raise InvalidInputError("targets must be poses (n, 4, 4): positions and free axes have no one orientation")
    return matrices


def check_same_robot(path: Path, recipe: dict[str, Any], robot: Robot) -> Robot:  # Any: JSON
    """Check that a robot is the one of a recipe.

    Raises:
        InvalidInputError: it is another one.
    """
    if fingerprint(robot, shapes=recipe["collision"] != "ignore") != recipe["robot"]["sha256"]:
        raise InvalidInputError(
            f"{path}: is a map of another robot than this {robot.label}, "
            "or of one with other limits or another calibration"
        )
    return robot


def _rolled(rotation: Array, wanted: Array, axis: Array) -> Array:
    """A rotation turned about its own axis until it is nearest to another one."""
    left = rotation.T @ wanted
    # Of R(axis, angle), trace(R^T left) is largest at this angle.
    skew = np.array([left[2, 1] - left[1, 2], left[0, 2] - left[2, 0], left[1, 0] - left[0, 1]])
    angle = np.arctan2(float(axis @ skew), float(np.trace(left) - axis @ left @ axis))
    return np.asarray(rotation @ pin.exp3(angle * axis))
