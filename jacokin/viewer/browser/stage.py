"""`Stage`: the three-dimensional scene in the browser, with the arm, its ghosts and the gizmo.

`Props`: what stands around the arm of a task, drawn where the simulation has it.
"""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np
import pinocchio as pin
import viser
from numpy.typing import NDArray

from jacokin.arrays import Array
from jacokin.ik.results import Status
from jacokin.ik.solver import IKSolver
from jacokin.model import poses
from jacokin.model.mujoco_twin import rgba_of
from jacokin.model.scene import Scene
from jacokin.viewer.browser.controls import add_batch
from jacokin.viewer.contents import Contents
from jacokin.viewer.drawing import (
    ArmPart,
    Colour,
    Triangles,
    build_obstacles,
    build_sticks,
    merge,
    move,
    read_geom,
    read_site,
    sphere,
    to_colour,
)
from jacokin.viewer.inspector import Inspector
from jacokin.viewer.view import ShownPlaces, View

if TYPE_CHECKING:
    import viser

    from jacokin.tasks import TaskEnv


TOUCHING: Colour = (232, 137, 12)
GHOST: Colour = (34, 139, 230)
TINT = 0.45  # how much of a colour that says something is left on the darkest part of the arm
SWELL = 0.002  # [m] by which a shape that touches is drawn larger, and one of a ghost smaller
DATASHEET: Colour = (214, 51, 132)  # the described arm beside a calibrated one
COMMANDED: Colour = (18, 184, 134)  # where the arm of a log was to be
CLOSEST: Colour = (240, 190, 80)  # not at the target
OUTSIDE: Colour = (224, 49, 49)
OBSTACLE: Colour = (150, 140, 120)
ELLIPSOID: Colour = (132, 94, 247)
FLAT = 1e-3  # [m] least semi-axis drawn
SAME_PLACE = 1e-5  # [m], and of the cosine of half an angle
START: Colour = (47, 158, 68)
PATH: Colour = (24, 100, 171)
GIZMO = "/target"


class Stage:
    """Nodes of the scene: arm, ghosts, gizmo, obstacles, the start of motions, the ellipsoid of manipulability."""

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
            contents: the shapes of the arm, which are drawn where they touch, obstacles, and a trajectory.
        """
        self._server = server
        self._inspector = inspector
        described = inspector.robot.described
        self.datasheet = described is not inspector.robot  # whether that arm is drawn, too, at the same joint angles
        self.commanded = True  # whether the arm of a log is drawn where it was to be, too
        self._described = Inspector(IKSolver(described, collision="ignore")) if self.datasheet else inspector
        nodes = server.scene
        self.arm = ArmNodes(nodes, parts, contents.shapes)
        self.gizmo = nodes.add_transform_controls(GIZMO, scale=0.15, depth_test=False)  # [m]
        nodes.add_grid("/grid", width=2.0, height=2.0, cell_size=0.1, section_size=0.5, shadow_opacity=0.2)
        # Lights of our own: the default ones come seconds after the page and slow every picture.
        nodes.configure_environment_map(None)
        nodes.configure_default_lights(enabled=False, cast_shadow=False)
        nodes.add_light_hemisphere("/light/sky", intensity=1.5, sky_color=(255, 255, 255), ground_color=(150, 155, 165))
        nodes.add_light_directional("/light/sun", intensity=2.0, position=(1.0, -1.0, 2.0), cast_shadow=True)
        nodes.add_light_directional("/light/rim", intensity=2.0, position=(-1.0, 0.8, 0.3))
        self._obstacles: dict[str, viser.MeshHandle] = {}
        self._drawn = 0  # obstacles so far
        self.draw_obstacles(contents.setup.scene)
        ball = sphere(1.0)
        self._ellipsoid = nodes.add_mesh_simple(
            "/ellipsoid", ball.vertices, ball.faces, color=ELLIPSOID, opacity=0.35, visible=False, cast_shadow=False
        )
        self._playback = contents.playback
        self.draw_path()
        self._sticks = build_sticks(inspector.robot)
        self._start: viser.MeshHandle | None = None
        self._start_q: Array | None = None
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
        others = view.ghosts if ghosts else view.ghosts[:0]
        places, colours = self._inspector.places([view.q, *view.branches[others]]), self._ghost_colours(view)[others]
        solid = view.feasible[others]
        more = [(self._described, view.q, DATASHEET)] if self.datasheet else []
        if self.commanded and view.commanded is not None:
            more.append((self._inspector, view.commanded, COMMANDED))
        for inspector, q, colour in more:
            pairs = zip(places, inspector.places([q]), strict=True)
            places = ShownPlaces(*(np.concatenate(pair) for pair in pairs))
            colours = np.vstack((colours, np.array(colour, dtype=np.uint8)))
            solid = np.append(solid, True)
        touching = {name for pair in view.arm_touching for name in pair}
        self.arm.place(places, self._colour(view), touching)
        for name, obstacle in self._obstacles.items():
            obstacle.color = TOUCHING if name in touching else OBSTACLE
        self._ellipsoid.visible = ellipsoid
        if ellipsoid:
            self._place_ellipsoid(view.q)
        self.arm.place_ghosts(places, colours, solid)
        if move_gizmo:
            self.place_gizmo(view.gizmo)

    def mark_start(self, q: Array, *, visible: bool) -> None:
        """Draw the arm at (dof,) [rad] by sticks, or nothing."""
        if visible and q is not self._start_q:
            placed = zip(self._sticks, *(rows[0] for rows in self._inspector.places([q])), strict=True)
            mesh = merge(
                [
                    move(part.mesh, poses.pose(position, wxyz))
                    for part, position, wxyz in placed
                    if part.mesh is not None
                ]
            )
            assert mesh is not None
            if self._start is not None:
                self._start.remove()
            self._start = self._server.scene.add_mesh_simple(
                "/start", mesh.vertices, mesh.faces, color=START, opacity=0.5, cast_shadow=False, receive_shadow=False
            )
            self._start_q = q
        if self._start is not None:
            self._start.visible = visible

    def place_gizmo(self, target: pin.SE3) -> None:
        """Bring the gizmo to a pose."""
        self.gizmo.position = target.translation
        self.gizmo.wxyz = poses.quaternion(target.rotation)

    def draw_path(self) -> None:
        """Draw where the trajectory leads the tool, if there is one."""
        if self._playback is None:
            return
        rows = self._playback.rows(1000)
        points = np.array([self._inspector.pose_of(q).translation for q in self._playback.q[rows]])
        lines = np.stack((points[:-1], points[1:]), axis=1)
        self._server.scene.add_line_segments("/path", lines, colors=PATH, thickness=0.006)  # [m]

    def draw_obstacles(self, scene: Scene | None) -> None:
        """Draw the obstacles of a scene instead of those before."""
        before, self._obstacles = self._obstacles, {}
        for name, mesh in ({} if scene is None else build_obstacles(scene)).items():
            node = before.get(name)
            if node is not None and np.array_equal(node.vertices, mesh.vertices):
                self._obstacles[name] = before.pop(name)
                continue
            self._obstacles[name] = self._server.scene.add_mesh_simple(
                f"/scene/{self._drawn}",
                mesh.vertices,
                mesh.faces,
                color=OBSTACLE,
                opacity=0.6,
                flat_shading=True,
                cast_shadow=False,
            )
            self._drawn += 1
        for node in before.values():
            node.remove()

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
        # 0.2 m for 1 m/s of the tool at joint rates of 1 rad/s.
        x, y, z = (max(float(0.2 * length), FLAT) for length in lengths)
        self._ellipsoid.scale = (x, y, z)
        self._ellipsoid.position = self._inspector.pose_of(q).translation
        self._ellipsoid.wxyz = poses.quaternion(directions)

    def _colour(self, view: View) -> Colour | None:
        """The colour over the solid arm; None for its own."""
        if self._inspector.excess(view.q):
            return OUTSIDE
        return None if view.status is Status.OK or view.selected is not None or view.arm_touching else CLOSEST

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
        self._outlines = [merge(list(part.shapes.values())) for part in shapes]
        self._tint: Colour | None = None
        self.solid: dict[int, viser.FrameHandle] = {}
        self._pieces: list[tuple[viser.MeshHandle, Colour]] = []
        self.ghosts: dict[int, viser.BatchedMeshHandle] = {}
        self.wires: dict[int, viser.BatchedMeshHandle] = {}
        self.dress(parts)

    def dress(self, parts: tuple[ArmPart, ...]) -> None:
        """Draw the arm by other parts instead."""
        for node in (*self.solid.values(), *self.ghosts.values(), *self.wires.values()):
            node.remove()
        self.solid, self.ghosts, self.wires, self._pieces = {}, {}, {}, []
        for index, (part, outline) in enumerate(zip(parts, self._outlines, strict=True)):
            if not part.pieces:
                continue
            self.solid[index] = self._scene.add_frame(f"/arm/{index}", show_axes=False)
            for number, piece in enumerate(part.pieces):
                mesh = self._scene.add_mesh_simple(
                    f"/arm/{index}/{number}",
                    piece.mesh.vertices,
                    piece.mesh.faces,
                    color=tinted(piece.colour, self._tint),
                    flat_shading=not piece.smooth,
                    receive_shadow=False,
                )
                self._pieces.append((mesh, piece.colour))
            if index:  # the base is where it is in every branch
                inside = merge([swell(shape, -SWELL) for shape in part.shapes.values()]) or part.mesh
                self.ghosts[index] = self._add_ghosts(f"/ghosts/{index}", inside, 0.22)
                self.wires[index] = self._add_ghosts(f"/wires/{index}", outline or inside, 0.45, wires=True)

    def _add_ghosts(
        self, name: str, mesh: Triangles | None, opacity: float, *, wires: bool = False
    ) -> viser.BatchedMeshHandle:
        """A part of branches that the arm is not at, out of sight."""
        assert mesh is not None
        return add_batch(self._scene, name, mesh, opacity=opacity, wireframe=wires, flat_shading=not wires)

    def place(self, places: ShownPlaces, colour: Colour | None, touching: set[str]) -> None:
        """Bring the solid arm to the first of some places; shapes that touch are drawn over it."""
        for index, node in self.solid.items():
            node.position = places.positions[0, index]
            node.wxyz = places.wxyzs[0, index]
        if colour != self._tint:
            self._tint = colour
            for mesh, own in self._pieces:
                mesh.color = tinted(own, colour)
        for name in touching & self._shapes.keys() - self._touching.keys():
            swollen = swell(self._shapes[name])
            self._touching[name] = self._scene.add_mesh_simple(
                f"/touching/{name}",
                swollen.vertices,
                swollen.faces,
                color=TOUCHING,
                flat_shading=True,
                receive_shadow=False,
            )
        for name, over in self._touching.items():
            over.visible = name in touching
            if over.visible:
                over.position = places.positions[0, self._owners[name]]
                over.wxyz = places.wxyzs[0, self._owners[name]]

    def place_ghosts(self, places: ShownPlaces, colours: NDArray[np.uint8], solid: NDArray[np.bool_]) -> None:
        """Bring the ghosts to all places but the first, in colours (k, 3): solid ones (k,), and nets of wires."""
        apart = self._apart(places)
        for nodes, chosen in ((self.ghosts, solid), (self.wires, ~solid)):
            for index, node in nodes.items():
                drawn = chosen & apart[:, index]
                rows = 1 + np.flatnonzero(drawn)
                if len(rows):
                    # Positions first: they say how many there are, which colours must match.
                    node.batched_positions = places.positions[rows, index]
                    node.batched_wxyzs = places.wxyzs[rows, index]
                    node.batched_colors = colours[drawn]
                node.visible = bool(len(rows))

    @staticmethod
    def _apart(places: ShownPlaces) -> NDArray[np.bool_]:
        """(k, parts) whether parts of ghosts are elsewhere than those of the solid arm, in which they would flicker."""
        moved = np.abs(places.positions[1:] - places.positions[0]).max(axis=2)
        turned = np.abs(np.einsum("kpw,pw->kp", places.wxyzs[1:], places.wxyzs[0]))
        return np.asarray((moved > SAME_PLACE) | (turned < 1.0 - SAME_PLACE))


def tinted(own: Colour, tint: Colour | None) -> Colour:
    """A colour of the arm, or one that says something: as dark beside its neighbours as its own."""
    if tint is None:
        red, green, blue = (max(value, 48) for value in own)  # so that light and shade are seen on it
        return red, green, blue
    share = TINT + (1.0 - TINT) * max(own) / 255.0
    red, green, blue = (round(share * value) for value in tint)
    return red, green, blue


def swell(mesh: Triangles, length: float = SWELL) -> Triangles:
    """A convex mesh with every vertex farther from its middle by the same length [m]."""
    middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    away = mesh.vertices - middle
    lengths = np.linalg.norm(away, axis=1, keepdims=True)
    return Triangles((middle + away * (1.0 + length / np.maximum(lengths, SWELL))).astype(np.float32), mesh.faces)


PERIOD = 0.04  # [s] from one drawing to the next
LARGEST = 5.0  # [m] half the size of a body that is drawn


class Props:
    """Bodies and sites of a task's model that do not belong to the arm."""

    def __init__(self, server: viser.ViserServer, environment: TaskEnv) -> None:
        """Draw them as they are."""
        self._model, self._environment = environment.model, environment
        model = self._model
        self._arm = int(model.body_rootid[model.jnt_bodyid[0]])
        self._base = int(model.body_parentid[model.jnt_bodyid[0]])
        self._scene, self._drawn = server.scene, -np.inf
        self._frames: dict[int, Any] = {}  # viser's handles by the number of the body
        for kind, count in (("geom", model.ngeom), ("site", model.nsite)):
            for number in range(count):
                self._add(kind, number)
        self.show()

    def show(self) -> None:
        """Move them to where they are now; every tick may ask for it, some are drawn."""
        now = time.monotonic()
        if now - self._drawn < PERIOD:
            return
        self._drawn = now
        data = self._environment.data
        R_base_world = data.xmat[self._base].reshape(3, 3).T
        for body, frame in self._frames.items():
            frame.position = R_base_world @ (data.xpos[body] - data.xpos[self._base])
            quat = np.zeros(4)
            mujoco.mju_mat2Quat(quat, (R_base_world @ data.xmat[body].reshape(3, 3)).ravel())
            frame.wxyz = quat

    def _add(self, kind: str, number: int) -> None:
        """Draw a geom or a site, as a part of its body."""
        model = self._model
        body, group = (int(getattr(model, f"{kind}_{what}")[number]) for what in ("bodyid", "group"))
        # MuJoCo's own viewer shows groups 0 to 2.
        if model.body_rootid[body] == self._arm or group > 2:
            return
        rgba, largest = rgba_of(model, number, kind), float(getattr(model, f"{kind}_size")[number].max())
        mesh = read_geom(model, number) if kind == "geom" else read_site(model, number)
        if mesh is None or rgba[3] == 0.0 or largest > LARGEST:
            return
        if body not in self._frames:
            self._frames[body] = self._scene.add_frame(f"/task/{body}", show_axes=False)
        self._scene.add_mesh_simple(
            f"/task/{body}/{kind}_{number}",
            vertices=mesh.vertices,
            faces=mesh.faces,
            color=to_colour(rgba),
            opacity=float(rgba[3]) if rgba[3] < 1.0 else None,
            flat_shading=True,
        )
