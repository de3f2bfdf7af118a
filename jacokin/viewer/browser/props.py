"""`Props`: what stands around the arm of a task, drawn in the viewer's page where the simulation has it."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

from jacokin.viewer.drawing import read_geom, read_site, rgba_of, to_colour

if TYPE_CHECKING:
    import viser

    from jacokin.tasks import TaskEnv

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
