"""The three-dimensional scene in the browser: the arm, its ghosts and the gizmo."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
import viser
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.results import Status
from jacokin.model import poses
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.shapes import Part, of_obstacles, sphere
from jacokin.viewer.view import Places, View

if TYPE_CHECKING:
    from jacokin.model.scenes.scene import Scene

Colour = tuple[int, int, int]

ARM: Colour = (205, 211, 219)
CLOSEST: Colour = (240, 190, 80)  # not at the target
OUTSIDE: Colour = (224, 49, 49)
TOUCHING: Colour = (232, 137, 12)
GHOST: Colour = (77, 171, 247)
GHOST_OPACITY = 0.25
OBSTACLE: Colour = (150, 140, 120)
OBSTACLE_OPACITY = 0.6
ELLIPSOID: Colour = (132, 94, 247)
ELLIPSOID_SCALE = 0.2  # [m] drawn for 1 m/s of the tool at joint rates of 1 rad/s
FLAT = 1e-3  # [m] least semi-axis drawn
GIZMO = "/target"
GIZMO_SIZE = 0.15  # [m]


class Stage:
    """Nodes of the scene: for each part of the arm one mesh, and one batch of meshes for its ghosts."""

    def __init__(
        self, server: viser.ViserServer, inspector: Inspector, parts: tuple[Part, ...], scene: Scene | None
    ) -> None:
        """Add the nodes, out of sight until `show`."""
        self._server = server
        self._inspector = inspector
        self._parts = parts
        nodes = server.scene
        self._arm: dict[int, viser.MeshHandle] = {}
        self._ghosts: dict[int, viser.BatchedMeshHandle] = {}
        for index, part in enumerate(parts):
            if part.mesh is None:
                continue
            vertices, faces = part.mesh.vertices, part.mesh.faces
            self._arm[index] = nodes.add_mesh_simple(
                f"/arm/{index}", vertices, faces, color=ARM, flat_shading=True, receive_shadow=False
            )
            if index:  # the base is where it is in every branch
                self._ghosts[index] = nodes.add_batched_meshes_simple(
                    f"/ghosts/{index}",
                    vertices,
                    faces,
                    batched_wxyzs=np.array([[1.0, 0.0, 0.0, 0.0]]),
                    batched_positions=np.zeros((1, 3)),
                    batched_colors=np.array([GHOST], dtype=np.uint8),
                    opacity=GHOST_OPACITY,
                    lod="off",
                    flat_shading=True,
                    cast_shadow=False,
                    receive_shadow=False,
                    visible=False,
                )
        self.gizmo = nodes.add_transform_controls(GIZMO, scale=GIZMO_SIZE, depth_test=False)
        nodes.add_grid("/grid", width=2.0, height=2.0, cell_size=0.1, section_size=0.5)
        # Lights of our own, without shadows: the default ones come seconds after the page and slow every picture.
        nodes.configure_environment_map(None)
        nodes.configure_default_lights(enabled=False, cast_shadow=False)
        nodes.add_light_ambient("/light/ambient", intensity=1.0)
        nodes.add_light_directional("/light/front", intensity=2.0, position=(1.0, -1.0, 2.0))
        nodes.add_light_directional("/light/back", intensity=0.7, position=(-1.0, 0.5, 0.5))
        self._obstacles = {
            name: nodes.add_mesh_simple(
                f"/scene/{number}",
                mesh.vertices,
                mesh.faces,
                color=OBSTACLE,
                opacity=OBSTACLE_OPACITY,
                flat_shading=True,
                cast_shadow=False,
                receive_shadow=False,
            )
            for number, (name, mesh) in enumerate(({} if scene is None else of_obstacles(scene)).items())
        }
        ball = sphere(1.0)
        self._ellipsoid = nodes.add_mesh_simple(
            "/ellipsoid", ball.vertices, ball.faces, color=ELLIPSOID, opacity=0.35, visible=False, cast_shadow=False
        )
        self._show_ghosts = True
        self._show_ellipsoid = False
        server.initial_camera.position = (1.25, -1.25, 0.95)
        server.initial_camera.look_at = (0.0, 0.0, 0.35)
        server.initial_camera.fov = 0.75  # [rad]

    def show(self, view: View, *, move_gizmo: bool) -> None:
        """Bring every node to a view.

        Args:
            view: what to show.
            move_gizmo: False when the view answers a gizmo that somebody holds.
        """
        ghosts = view.ghosts
        places = self._inspector.places([view.q, *view.branches[ghosts]])
        colours = self._colours(view)
        with self._server.atomic():
            for index, node in self._arm.items():
                node.position = places.positions[0, index]
                node.wxyz = places.wxyzs[0, index]
                node.color = colours[index]
            touching = {name for pair in view.arm_touching for name in pair}
            for name, obstacle in self._obstacles.items():
                obstacle.color = TOUCHING if name in touching else OBSTACLE
            self._place_ellipsoid(view.q)
            self._place_ghosts(places, self._ghost_colours(view)[ghosts])
            if move_gizmo:
                self.place_gizmo(view.target if view.turned is None else view.turned.pose)

    def place_gizmo(self, target: pin.SE3) -> None:
        """Bring the gizmo to a pose."""
        self.gizmo.position = target.translation
        self.gizmo.wxyz = poses.quaternion(target.rotation)

    def show_ghosts(self, visible: bool) -> None:
        """Show or hide the ghosts from the next view on."""
        self._show_ghosts = visible

    def show_ellipsoid(self, visible: bool) -> None:
        """Show or hide the ellipsoid of manipulability from the next view on."""
        self._show_ellipsoid = visible

    def target(self) -> tuple[Array, Array]:
        """Position (3,) [m] and quaternion w, x, y, z of the gizmo, as a client sent them: unchecked."""
        return np.array(self.gizmo.position), np.array(self.gizmo.wxyz)

    def _place_ghosts(self, places: Places, colours: NDArray[np.uint8]) -> None:
        visible = bool(len(colours)) and self._show_ghosts
        for index, node in self._ghosts.items():
            if visible:
                # Positions first: they say how many there are, which colours must match.
                node.batched_positions = places.positions[1:, index]
                node.batched_wxyzs = places.wxyzs[1:, index]
                node.batched_colors = colours
            node.visible = visible

    def _place_ellipsoid(self, q: Array) -> None:
        node = self._ellipsoid
        if self._show_ellipsoid:
            lengths, directions = self._inspector.ellipsoid(q)
            x, y, z = (max(float(ELLIPSOID_SCALE * length), FLAT) for length in lengths)
            node.scale = (x, y, z)
            node.position = self._inspector.pose_of(q).translation
            node.wxyz = poses.quaternion(directions)
        node.visible = self._show_ellipsoid

    def _colours(self, view: View) -> list[Colour]:
        """The colour of each part of the solid arm."""
        whole = ARM if view.status is Status.OK or view.selected is not None else CLOSEST
        if self._inspector.excess(view.q):
            whole = OUTSIDE
        touching = {name for pair in view.arm_touching for name in pair}
        return [TOUCHING if touching.intersection(part.shapes) else whole for part in self._parts]

    def _ghost_colours(self, view: View) -> NDArray[np.uint8]:
        """(k, 3) the colour of each branch."""
        colours = np.where(view.within[:, None], GHOST, OUTSIDE)
        if view.touching is not None:
            colours[view.within & ~view.feasible] = TOUCHING
        return colours.astype(np.uint8)
