"""Toy building bricks that click together: studs on top, walls, ribs and tubes inside that hold the studs below.

The geometry is generated from `sizes.toml`. Frames: x along the short side, z up, origin in the middle of the bottom.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.errors import InvalidInputError
from jacokin.model import checks
from jacokin.mujoco_bridge import workspaces
from jacokin.mujoco_bridge.distributions import RandomState
from jacokin.mujoco_bridge.entity import new_spec
from jacokin.mujoco_bridge.observables import MJCFFeature, Observable, observable
from jacokin.mujoco_bridge.props import primitive
from jacokin.mujoco_bridge.props.primitive import HIDDEN_GROUP, FreeProp, FreePropObservables, add_vertex_sites
from jacokin.mujoco_bridge.simulation.physics import Physics

ROWS, COLUMNS = 2, 4  # of studs, along x and y

_BOX = mujoco.mjtGeom.mjGEOM_BOX
_CYLINDER = mujoco.mjtGeom.mjGEOM_CYLINDER

BrickNumbers = Mapping[str, Any]


class Brick(FreeProp):
    """A brick of 2 x 4 studs, observed at the centre of its bounding box."""

    def _build(
        self,
        easy_align: bool = False,
        flanges: bool = True,
        variation: float = 0.0,
        color: ArrayLike = (1.0, 0.0, 0.0),
        name: str | None = None,
        *,
        hint: bool = False,
    ) -> None:
        """Build the brick.

        Args:
            easy_align: studs are round on top, so that bricks align more easily.
            flanges: ribs inside hold the studs, so that bricks click together also when they overlap in part; costs
                more contacts.
            variation: 0 for the usual stud radius, which holds with 10 N; 1 for radii drawn at the start of each
                episode so that the forces spread as those of real bricks do.
            color: (3,) red, green, blue, 0..1.
            name: replaces ``brick`` in the names of its elements.
            hint: translucent and without contacts, to show where a brick is to go.

        Raises:
            InvalidInputError: an argument is malformed.
        """
        row = primitive.load_sizes()["brick"]
        self._is_round = checks.flag("easy_align", easy_align)
        has_flanges = checks.flag("flanges", flanges)
        rgb = checks.vector("color", color, 3, "0..1")
        if not ((rgb >= 0.0) & (rgb <= 1.0)).all():
            raise InvalidInputError(f"color must be in 0..1, got {rgb.tolist()}")
        key = "_".join(word for word, is_set in (("round", self._is_round), ("flanges", has_flanges)) if is_set)
        least, self._radius, largest = row["stud_radius"][key or "plain"]  # [m]
        spread = checks.non_negative("variation", variation)
        self._radii = tuple(self._radius + spread * (bound - self._radius) for bound in (least, largest))
        self._rgba = (*rgb, primitive.load_sizes()["hint"]["alpha"] if checks.flag("hint", hint) else 1.0)
        self._touches = not hint
        self._mjcf_root = new_spec("brick", name)
        self._row: BrickNumbers = row
        if self._touches:
            self._add("hull", _BOX, row["hull"], mass=row["hull"]["mass"], group=HIDDEN_GROUP)
        self._add_walls(row["walls"])
        self._add_flanges(row["flanges"], has_flanges)
        for number, y in enumerate(_lengthwise(COLUMNS - 1)):
            tubes = row["tubes"]
            size = (tubes["radius"], tubes["half_length"], 0.0)
            self._add(f"tube_{number}", _CYLINDER, tubes, (0.0, y, tubes["height"]), size)
        self._stud_geoms = self._add_studs(row["studs"])
        self._add_sites(row)

    def _add_walls(self, row: BrickNumbers) -> None:
        for name in ("x", "y", "inner_x", "inner_y"):
            axis = 0 if name.endswith("x") else 1
            for number, sign in enumerate((-1.0, 1.0)):
                position = np.array(row[name]["xyz"])
                position[axis] *= sign
                self._add(f"wall_{name}{number}", _BOX, {**row, **row[name]}, position)
        self._add("wall_top", _BOX, {**row, **row["top"]})

    def _add_flanges(self, row: BrickNumbers, touch: bool) -> None:
        row = row if touch else {**row, "contype": 0}
        z = row["height"]
        for i, (side, y) in enumerate(itertools.product((-1.0, 1.0), _lengthwise(COLUMNS))):
            self._add(f"flange_x{i}", _BOX, row, (side * row["x"], y, z))
        quarter_turn = (np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5))  # about z, wxyz
        for i, (side, end) in enumerate(itertools.product((-1.0, 1.0), repeat=2)):
            position = (side * row["y_offset"], end * row["y"], z)
            self._add(f"flange_y{i}", _BOX, row, position, quat=quarter_turn)

    def _add_studs(self, row: BrickNumbers) -> list[mujoco.MjsGeom]:
        """Add the studs; returns those whose radius determines the grip."""
        round_row = self._row["round_studs"]
        hidden = {"contype": row["hidden_contype"], "conaffinity": row["hidden_conaffinity"]}
        studs = []
        for i, j in itertools.product(range(ROWS), range(COLUMNS)):
            x, y = _sideways(i), _lengthwise(COLUMNS)[j]
            flat = self._add(
                f"stud_{i}{j}",
                _CYLINDER,
                {**row, **hidden} if self._is_round else row,
                (np.sign(x) * row["x"], y, row["height"]),
                (row["nominal_radius"] if self._is_round else self._radius, row["half_length"], 0.0),
                margin=row["margin"],
                group=HIDDEN_GROUP if self._is_round else 0,
            )
            if not self._is_round:
                studs.append(flat)
                continue
            size = (self._radius, round_row["half_length"], 0.0)
            cap = {"contype": 0, "conaffinity": round_row["conaffinity"]}
            capsule = mujoco.mjtGeom.mjGEOM_CAPSULE
            studs.append(self._add(f"round_stud_{i}{j}", capsule, cap, (x, y, row["height"]), size, mass=0.0))
        return studs

    def _add_sites(self, row: BrickNumbers) -> None:
        world = self._mjcf_root.worldbody
        box, grid = row["bounding_box"], row["stud_sites"]
        self._bounding_box = world.add_site(
            name="bounding_box", type=_BOX, pos=box["xyz"], size=box["half_size"], group=workspaces.SITE_GROUP
        )
        self._studs = np.empty((ROWS, COLUMNS), dtype=object)
        self._holes = np.empty((ROWS, COLUMNS), dtype=object)
        for name, sites, z in (("stud", self._studs, "stud_height"), ("hole", self._holes, "hole_height")):
            for i, j in itertools.product(range(ROWS), range(COLUMNS)):
                sites[i, j] = world.add_site(
                    name=f"{name}_{i}{j}",
                    pos=(_sideways(i), _lengthwise(COLUMNS)[j], grid[z]),
                    size=[grid["site_radius"]] * 3,
                    rgba=workspaces.RED,
                    group=workspaces.SITE_GROUP,
                )
        self._vertices = add_vertex_sites(world, self._bounding_box.pos, self._bounding_box.size)
        self.height_above_lowest = float(self._bounding_box.size[2] - self._bounding_box.pos[2])
        self._add_sensors(self._bounding_box, {**primitive.SENSORS, "force": mujoco.mjtSensor.mjSENS_FORCE})

    def _add(
        self,
        name: str,
        shape: mujoco.mjtGeom,
        row: BrickNumbers,
        position: ArrayLike | None = None,
        size: ArrayLike | None = None,
        **more: Any,
    ) -> mujoco.MjsGeom:
        """Add a geom with the position, size, density and masks of a row of the table, unless given."""
        return self._mjcf_root.worldbody.add_geom(
            name=name,
            type=shape,
            pos=row["xyz"] if position is None else position,
            size=row["half_size"] if size is None else size,
            density=row.get("density", 0.0),
            contype=row["contype"] if self._touches else 0,
            conaffinity=row["conaffinity"] if self._touches else 0,
            friction=(self._row["friction"], 0.005, 0.0001),  # MuJoCo's default torsional and rolling friction [m]
            solref=self._row["solref"],
            solimp=(*self._row["solimp"], 0.5, 2.0),  # MuJoCo's default midpoint and power
            rgba=self._rgba,
            **more,
        )

    def _build_observables(self) -> FreePropObservables:
        return BrickObservables(self)

    def initialize_episode(self, physics: Physics, random_state: RandomState | None) -> None:
        """Draw the radius of the studs, unless it does not vary; masses stay as they are.

        Raises:
            InvalidInputError: no random state to draw from.
        """
        lower, upper = self._radii
        if lower == upper:
            return
        if random_state is None:
            raise InvalidInputError("random_state must not be None for a brick whose studs vary")
        radius = float(random_state.uniform(lower, upper))
        studs = physics.bind(self._stud_geoms)
        half_length = studs.size[0, 1]
        studs.size[:, 0] = radius
        reach = half_length + radius * self._is_round  # a capsule ends in half spheres
        studs.rbound[:] = reach if self._is_round else np.hypot(radius, half_length)
        studs.aabb[:, 3:] = (radius, radius, reach)

    @property
    def disabled_flags(self) -> tuple[str, ...]:
        """The native convex collider, and several contacts per pair of geoms: they make bricks hold four times tighter.

        The radii of the studs are tuned without them, and for MuJoCo 3.17 and 4.0 alike.
        """
        return ("nativeccd", "multiccd")

    @property
    def studs(self) -> NDArray[np.object_]:
        """The sites at the studs, (2, 4)."""
        return self._studs

    @property
    def holes(self) -> NDArray[np.object_]:
        """The sites at the holes below the studs, (2, 4): where the studs of the brick below are."""
        return self._holes

    @property
    def stud_geoms(self) -> Sequence[mujoco.MjsGeom]:
        """The eight geoms of the studs that touch."""
        return self._stud_geoms

    @property
    def bounding_box(self) -> mujoco.MjsSite:
        """The site that encloses the brick."""
        return self._bounding_box

    @property
    def force(self) -> mujoco.MjsSensor:
        """The sensor of the force that the brick exerts on what holds it, (3,) [N]."""
        return self._sensors["force"]


class BrickObservables(FreePropObservables):
    """Pose and velocity of a brick, and the force that it exerts."""

    @observable
    def force(self) -> Observable:
        """Force on what holds the brick, in its axes, (3,) [N]."""
        return MJCFFeature("sensordata", self._entity.force)


def _sideways(row: int) -> float:
    """Position of a row of studs along x [m]."""
    return float((row - (ROWS - 1) / 2.0) * primitive.load_sizes()["brick"]["pitch"])


def _lengthwise(count: int) -> list[float]:
    """Positions of studs, or of what is between them, along y [m]."""
    return [float((i - (count - 1) / 2.0) * primitive.load_sizes()["brick"]["pitch"]) for i in range(count)]
