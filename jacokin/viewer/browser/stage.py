"""`Stage`: the three-dimensional scene in the browser, with the arm, its ghosts and the gizmo."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import viser
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.results import Status
from jacokin.model import poses
from jacokin.viewer.contents import Contents
from jacokin.viewer.drawing import ArmPart, Mesh, build_obstacles, sphere
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.view import Places, View

Colour = tuple[int, int, int]

ARM: Colour = (205, 211, 219)
TOUCHING: Colour = (232, 137, 12)
GHOST: Colour = (77, 171, 247)
GHOST_OPACITY = 0.25
SWELL = 0.002  # [m] by which a shape that touches is drawn larger, to stand out of the part that it belongs to
CLOSEST: Colour = (240, 190, 80)  # not at the target
OUTSIDE: Colour = (224, 49, 49)
OBSTACLE: Colour = (150, 140, 120)
OBSTACLE_OPACITY = 0.6
ELLIPSOID: Colour = (132, 94, 247)
ELLIPSOID_SCALE = 0.2  # [m] drawn for 1 m/s of the tool at joint rates of 1 rad/s
FLAT = 1e-3  # [m] least semi-axis drawn
GIZMO = "/target"
GIZMO_SIZE = 0.15  # [m]


class Stage:
    """Nodes of the scene: the arm with its ghosts, the gizmo, obstacles, and the ellipsoid of manipulability."""

    def __init__(
        self,
        server: viser.ViserServer,
        inspector: Inspector,
        parts: tuple[ArmPart, ...],
        contents: Contents,
    ) -> None:
        """Add the nodes, out of sight until `show`.

        Args:
            server: viser's.
            inspector: of the robot.
            parts: of the arm, to draw.
            contents: the shapes of the arm, which are drawn where they touch, and obstacles.
        """
        self._server = server
        self._inspector = inspector
        nodes = server.scene
        self.arm = ArmNodes(nodes, parts, contents.shapes)
        self.gizmo = nodes.add_transform_controls(GIZMO, scale=GIZMO_SIZE, depth_test=False)
        nodes.add_grid("/grid", width=2.0, height=2.0, cell_size=0.1, section_size=0.5)
        # Lights of our own, without shadows: the default ones come seconds after the page and slow every picture.
        nodes.configure_environment_map(None)
        nodes.configure_default_lights(enabled=False, cast_shadow=False)
        nodes.add_light_ambient("/light/ambient", intensity=1.0)
        nodes.add_light_directional("/light/front", intensity=2.0, position=(1.0, -1.0, 2.0))
        nodes.add_light_directional("/light/back", intensity=0.7, position=(-1.0, 0.5, 0.5))
        scene = contents.setup.scene
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
            for number, (name, mesh) in enumerate(({} if scene is None else build_obstacles(scene)).items())
        }
        ball = sphere(1.0)
        self._ellipsoid = nodes.add_mesh_simple(
            "/ellipsoid", ball.vertices, ball.faces, color=ELLIPSOID, opacity=0.35, visible=False, cast_shadow=False
        )
        server.initial_camera.position = (1.25, -1.25, 0.95)
        server.initial_camera.look_at = (0.0, 0.0, 0.35)
        server.initial_camera.fov = 0.75  # [rad]

    def show(self, view: View, *, ghosts: bool, ellipsoid: bool, move_gizmo: bool) -> None:
        """Bring every node to a view.

        Args:
            view: what to show.
            ghosts: whether to draw the other branches.
            ellipsoid: whether to draw the ellipsoid of manipulability.
            move_gizmo: False when the view answers a gizmo that somebody holds.
        """
        others = view.ghosts
        places = self._inspector.places([view.q, *view.branches[others]])
        touching = {name for pair in view.arm_touching for name in pair}
        with self._server.atomic():
            self.arm.place(places, self._colour(view), touching)
            for name, obstacle in self._obstacles.items():
                obstacle.color = TOUCHING if name in touching else OBSTACLE
            self._ellipsoid.visible = ellipsoid
            if ellipsoid:
                self._place_ellipsoid(view.q)
            self.arm.place_ghosts(places, self._ghost_colours(view)[others], visible=ghosts)
            if move_gizmo:
                self.place_gizmo(view.gizmo)

    def place_gizmo(self, target: pin.SE3) -> None:
        """Bring the gizmo to a pose."""
        self.gizmo.position = target.translation
        self.gizmo.wxyz = poses.quaternion(target.rotation)

    def show_obstacles(self, visible: bool) -> None:
        """Show or hide the obstacles."""
        for obstacle in self._obstacles.values():
            obstacle.visible = visible

    def target(self) -> pin.SE3:
        """Where the gizmo is.

        Raises:
            InvalidInputError: a client sent what is not a pose.
        """
        return poses.pose(np.array(self.gizmo.position), np.array(self.gizmo.wxyz))

    def _place_ellipsoid(self, q: Array) -> None:
        lengths, directions = self._inspector.ellipsoid(q)
        x, y, z = (max(float(ELLIPSOID_SCALE * length), FLAT) for length in lengths)
        self._ellipsoid.scale = (x, y, z)
        self._ellipsoid.position = self._inspector.pose_of(q).translation
        self._ellipsoid.wxyz = poses.quaternion(directions)

    def _colour(self, view: View) -> Colour:
        """The colour of the solid arm."""
        if self._inspector.excess(view.q):
            return OUTSIDE
        return ARM if view.status is Status.OK or view.selected is not None or view.arm_touching else CLOSEST

    def _ghost_colours(self, view: View) -> NDArray[np.uint8]:
        """(k, 3) the colour of each branch."""
        colours = np.where(view.within[:, None], GHOST, OUTSIDE)
        if view.touching is not None:
            colours[view.within & ~view.feasible] = TOUCHING
        return colours.astype(np.uint8)


class ArmNodes:
    """The solid arm and its ghosts, drawn by the same parts."""

    def __init__(self, scene: viser.SceneApi, parts: tuple[ArmPart, ...], shapes: tuple[ArmPart, ...]) -> None:
        """Add the nodes, out of sight until they are placed.

        Args:
            scene: viser's.
            parts: to draw.
            shapes: parts with the collision shapes that are drawn where they touch.
        """
        self._scene = scene
        self._owners = {name: index for index, part in enumerate(shapes) for name in part.shapes}
        self._shapes = {name: mesh for part in shapes for name, mesh in part.shapes.items()}
        self._touching: dict[str, viser.MeshHandle] = {}
        self.solid: dict[int, viser.MeshHandle] = {}
        self.ghosts: dict[int, viser.BatchedMeshHandle] = {}
        self.dress(parts)

    def dress(self, parts: tuple[ArmPart, ...]) -> None:
        """Draw the arm by other parts instead."""
        for node in (*self.solid.values(), *self.ghosts.values()):
            node.remove()
        self.solid, self.ghosts = {}, {}
        for index, part in enumerate(parts):
            if part.mesh is None:
                continue
            vertices, faces = part.mesh.vertices, part.mesh.faces
            self.solid[index] = self._scene.add_mesh_simple(
                f"/arm/{index}", vertices, faces, color=ARM, flat_shading=True, receive_shadow=False
            )
            if index:  # the base is where it is in every branch
                self.ghosts[index] = self._scene.add_batched_meshes_simple(
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

    def place(self, places: Places, colour: Colour, touching: set[str]) -> None:
        """Bring the solid arm to the first of some places; shapes that touch are drawn over it."""
        for index, node in self.solid.items():
            node.position = places.positions[0, index]
            node.wxyz = places.wxyzs[0, index]
            node.color = colour
        for name in touching & self._shapes.keys() - self._touching.keys():
            mesh = swell(self._shapes[name])
            self._touching[name] = self._scene.add_mesh_simple(
                f"/touching/{name}", mesh.vertices, mesh.faces, color=TOUCHING, flat_shading=True, receive_shadow=False
            )
        for name, node in self._touching.items():
            node.visible = name in touching
            if node.visible:
                node.position = places.positions[0, self._owners[name]]
                node.wxyz = places.wxyzs[0, self._owners[name]]

    def place_ghosts(self, places: Places, colours: NDArray[np.uint8], *, visible: bool) -> None:
        """Bring the ghosts to all places but the first, in colours (k, 3)."""
        visible = visible and bool(len(colours))
        for index, node in self.ghosts.items():
            if visible:
                # Positions first: they say how many there are, which colours must match.
                node.batched_positions = places.positions[1:, index]
                node.batched_wxyzs = places.wxyzs[1:, index]
                node.batched_colors = colours
            node.visible = visible


def swell(mesh: Mesh) -> Mesh:
    """A convex mesh with every vertex farther from its middle by the same length."""
    middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    away = mesh.vertices - middle
    lengths = np.linalg.norm(away, axis=1, keepdims=True)
    return Mesh((middle + away * (1.0 + SWELL / np.maximum(lengths, SWELL))).astype(np.float32), mesh.faces)
