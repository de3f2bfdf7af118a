"""A slice of the reachability map: its controls, and the squares in the scene."""

from __future__ import annotations

import numpy as np
import viser

from jacokin.viewer.browser.controls import Post, from_client
from jacokin.viewer.drawing.slices import COLOURS, Slices

OPACITY = 0.55


class Slicing:
    """The folder "Reachability map" of the panel, and what it draws."""

    def __init__(self, server: viser.ViserServer, slices: Slices, post: Post) -> None:
        """Add the controls, which post "slice"; nothing is drawn before they are used."""
        self._slices = slices
        self._drawn: int | None = None
        gui, heights = server.gui, slices.heights
        with gui.add_folder("Reachability map", expand_by_default=False):
            self._show = gui.add_checkbox("Slice", False, hint="Where the tool gets to, at one height")
            self._show.on_update(from_client(post, "slice"))
            low, high = float(heights[0]), float(heights[-1])
            step = float(heights[1] - heights[0]) if len(heights) > 1 else 1.0
            middle = float(heights[slices.layer(0.5 * (low + high))])
            self._height = gui.add_slider("Height [m]", low, max(high, low + step), step, middle)
            self._height.on_update(from_client(post, "slice"))
            stops = ",".join(f"rgb({red},{green},{blue})" for red, green, blue in COLOURS.tolist())
            gui.add_html(
                f'<div style="font-size:0.8em;padding:0 0.75em">0 to 1: {slices.caption}'
                f'<div style="height:8px;background:linear-gradient(to right,{stops})"></div></div>'
            )
        mesh = slices.square()
        self._node = server.scene.add_batched_meshes_simple(
            "/map",
            mesh.vertices,
            mesh.faces,
            batched_wxyzs=np.array([[1.0, 0.0, 0.0, 0.0]]),
            batched_positions=np.zeros((1, 3)),
            batched_colors=np.zeros((1, 3), dtype=np.uint8),
            opacity=OPACITY,
            lod="off",
            side="double",
            cast_shadow=False,
            receive_shadow=False,
            visible=False,
        )

    def show(self) -> None:
        """Draw what the controls say, whatever a client sent."""
        height = float(self._height.value)
        layer = self._slices.layer(height) if np.isfinite(height) else 0
        cells = self._slices.cells(layer)
        if len(cells.positions) and layer != self._drawn:
            quats = np.zeros((len(cells.positions), 4), dtype=np.float32)
            quats[:, 0] = 1.0
            self._node.batched_positions = cells.positions
            self._node.batched_wxyzs = quats
            self._node.batched_colors = cells.colours
            self._drawn = layer
        self._node.visible = bool(self._show.value) and len(cells.positions) > 0
