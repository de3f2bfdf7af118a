"""`Props`: what stands around the arm of a task, drawn in the viewer's page where the simulation has it."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import mujoco
import numpy as np

if TYPE_CHECKING:
    import viser

    from jacokin.tasks import TaskEnv

PERIOD = 0.04  # [s] from one drawing to the next
LAST_GROUP = 2  # of geoms and sites that are to be seen, as in MuJoCo's own viewer
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
        body = int(getattr(model, f"{kind}_bodyid")[number])
        group, shape = (int(getattr(model, f"{kind}_{what}")[number]) for what in ("group", "type"))
        if model.body_rootid[body] == self._arm or group > LAST_GROUP:
            return
        rgba, size = getattr(model, f"{kind}_rgba")[number], getattr(model, f"{kind}_size")[number]
        material = int(getattr(model, f"{kind}_matid")[number])
        if material >= 0:
            rgba = model.mat_rgba[material]
        if rgba[3] == 0.0 or size.max() > LARGEST:
            return
        if body not in self._frames:
            self._frames[body] = self._scene.add_frame(f"/task/{body}", show_axes=False)
        look: dict[str, Any] = {
            "color": tuple(float(part) for part in rgba[:3]),
            "opacity": float(rgba[3]) if rgba[3] < 1.0 else None,
            "position": getattr(model, f"{kind}_pos")[number],
            "wxyz": getattr(model, f"{kind}_quat")[number],
        }
        name = f"/task/{body}/{kind}_{number}"
        types = mujoco.mjtGeom
        if shape in (types.mjGEOM_SPHERE, types.mjGEOM_ELLIPSOID):
            x, y, z = (size / size[0]).tolist() if shape == types.mjGEOM_ELLIPSOID else (1.0, 1.0, 1.0)
            self._scene.add_icosphere(name, radius=float(size[0]), scale=(x, y, z), **look)
        elif shape == types.mjGEOM_BOX:
            self._scene.add_box(name, dimensions=2.0 * size, **look)
        elif shape in (types.mjGEOM_CYLINDER, types.mjGEOM_CAPSULE):
            self._scene.add_cylinder(name, radius=float(size[0]), height=2.0 * float(size[1]), **look)
            for end in (-1.0, 1.0) if shape == types.mjGEOM_CAPSULE else ():
                turned = np.zeros(3)
                mujoco.mju_rotVecQuat(turned, np.array([0.0, 0.0, end * size[1]]), look["wxyz"])
                self._scene.add_icosphere(
                    f"{name}_{end:+.0f}", radius=float(size[0]), **{**look, "position": look["position"] + turned}
                )
        elif shape == types.mjGEOM_MESH and kind == "geom":
            mesh = int(model.geom_dataid[number])
            first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
            face, faces = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
            self._scene.add_mesh_simple(
                name,
                vertices=model.mesh_vert[first : first + count],
                faces=model.mesh_face[face : face + faces],
                **look,
            )
