"""The nodes of the arm: a mesh for each part, a batch of meshes for its ghosts, and what touches."""

from __future__ import annotations

import numpy as np
import viser
from numpy.typing import NDArray

from jacokin.viewer.drawing.meshes import Mesh
from jacokin.viewer.drawing.parts import Part
from jacokin.viewer.view import Places

Colour = tuple[int, int, int]

ARM: Colour = (205, 211, 219)
TOUCHING: Colour = (232, 137, 12)
GHOST: Colour = (77, 171, 247)
GHOST_OPACITY = 0.25
SWELL = 0.002  # [m] by which a shape that touches is drawn larger, to stand out of the part that it belongs to


class Arm:
    """One arm that is solid and many that are not, drawn by the same parts."""

    def __init__(self, scene: viser.SceneApi, parts: tuple[Part, ...], shapes: tuple[Part, ...]) -> None:
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

    def dress(self, parts: tuple[Part, ...]) -> None:
        """Draw the arm by other parts, in place of those before."""
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
            mesh = swollen(self._shapes[name])
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


def swollen(mesh: Mesh) -> Mesh:
    """A convex mesh with every vertex farther from its middle by the same length."""
    middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
    away = mesh.vertices - middle
    lengths = np.linalg.norm(away, axis=1, keepdims=True)
    return Mesh((middle + away * (1.0 + SWELL / np.maximum(lengths, SWELL))).astype(np.float32), mesh.faces)
