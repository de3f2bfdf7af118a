"""`Mesh` and `ModelFile`: props of your own, from a file with a mesh or an MJCF file."""

from __future__ import annotations

import functools
import importlib.util
import logging
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from jacokin.arrays import Array
from jacokin.errors import InvalidInputError, ModelError, shown
from jacokin.model import checks
from jacokin.model.descriptions.meshes import read_mesh_file
from jacokin.mujoco_bridge.entity import check_name, new_spec
from jacokin.mujoco_bridge.props.primitive import DENSITY, HIDDEN_GROUP, FreeProp, refused_attributes
from jacokin.mujoco_bridge.workspaces import SITE_GROUP

HULL = "convex hull"
MOST_PARTS = 32
LONGEST = 10.0  # [m] of what may stand around an arm that reaches 1 m; a cup in millimetres is longer
_SITE = "origin"
_SITE_SIZE = 1e-3  # [m]

_log = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True, eq=False)
class MeshPart:
    """A mesh and the convex parts that stand for it where it touches.

    Attributes:
        vertices: (n, 3) of the mesh [m].
        faces: (k, 3) triangles.
        is_closed: whether the faces enclose a volume, from which mass and inertia follow.
        volume: [m^3] enclosed, or of the parts if it is not closed.
        parts: vertices (m, 3) of each convex part [m].
        method: how the parts were found: "CoACD", "V-HACD" or "convex hull".
    """

    vertices: Array
    faces: NDArray[np.int32]
    is_closed: bool
    volume: float
    parts: tuple[Array, ...]
    method: str


class Mesh(FreeProp):
    """A rigid thing whose shape is that of a mesh: it is drawn, and weighs, as the mesh, and touches as convex parts.

    Attributes:
        shape: the mesh and its parts.
    """

    def _build(
        self,
        path: str | Path,
        mass: float | None = None,
        rgba: ArrayLike = (0.8, 0.3, 0.2, 1.0),
        name: str | None = None,
        *,
        density: float | None = None,
        scale: float = 1.0,
        decomposed: bool = True,
        **geom_options: Any,
    ) -> None:
        """Build the thing.

        MuJoCo lets meshes touch as their convex hulls, which close the opening of a mug. A mesh that is not convex is
        therefore decomposed into convex parts: by CoACD if that is installed (``pip install coacd``), else by V-HACD.
        Where neither is there, its hull touches, and a warning says so; ``prop.shape.method`` tells.

        Args:
            path: a .stl, .obj, .dae, .ply, .off, .glb or .gltf file, with z upwards; of these only .dae has a unit.
            mass: [kg]; None for that of the density. Give one of the two.
            rgba: colour, 0..1.
            name: replaces the name of the file in the names of its elements.
            density: [kg/m^3]; None for that of water where there is no mass.
            scale: of the lengths in the file, 0.001 for millimetres.
            decomposed: False lets the hull touch.
            geom_options: attributes of the geoms that touch, as `mujoco.MjSpec` has them: ``friction``, ``solref``, ...

        Raises:
            InvalidInputError: no mesh can be read there, it is longer than 10 m, mass and density are both given, or
                another argument is malformed.
        """
        if mass is not None and density is not None:
            raise InvalidInputError("give mass or density, not both")
        file = checks.path("path", path).absolute()
        factor, is_decomposed = checks.positive("scale", scale), checks.flag("decomposed", decomposed)
        colour = checks.vector("rgba", rgba, 4, "0..1")
        if not file.is_file():
            raise InvalidInputError(f"path: there is no file {file}")
        self.shape = shape = _load(file, file.stat().st_mtime_ns, factor, is_decomposed)
        weight = checks.positive("density", DENSITY if density is None else density, "kg/m^3") * shape.volume
        if mass is not None:
            weight = checks.positive("mass", mass, "kg")
        spec = self._mjcf_root = new_spec(file.stem, name)
        drawn = spec.add_mesh(name="mesh", uservert=shape.vertices.ravel(), userface=shape.faces.ravel())
        drawn.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_EXACT
        if not shape.is_closed:
            drawn.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL
        world = spec.worldbody
        world.add_geom(
            name="drawn",
            type=mujoco.mjtGeom.mjGEOM_MESH,
            meshname="mesh",
            mass=weight if shape.is_closed else 0.0,
            rgba=colour,
            contype=0,
            conaffinity=0,
        )
        for number, part in enumerate(shape.parts):
            spec.add_mesh(name=f"part_{number}", uservert=part.ravel())
            share = {"mass": 0.0} if shape.is_closed else {"density": weight / shape.volume}
            options = {"group": HIDDEN_GROUP, "rgba": colour, **share, **geom_options}
            try:
                world.add_geom(
                    name=f"part_{number}", type=mujoco.mjtGeom.mjGEOM_MESH, meshname=f"part_{number}", **options
                )
            except (TypeError, ValueError) as error:
                raise refused_attributes(geom_options, error) from error
        self._add_sensors(world.add_site(name=_SITE, size=[_SITE_SIZE] * 3, group=SITE_GROUP))
        self._add_vertices()


class ModelFile(FreeProp):
    """A thing described by an MJCF file, with joints of its own if it has any. Its origin is that of the file."""

    def _build(self, path: str | Path, name: str | None = None) -> None:
        """Read the thing; a free joint in the file is left out, as `Arena.add_free_entity` adds one, and so are keys.

        Args:
            path: the MJCF file.
            name: replaces the name of the model in the names of its elements.

        Raises:
            InvalidInputError: no file is there, nothing in it collides, or it holds a plane.
            ModelError: MuJoCo cannot read or compile it.
        """
        file = checks.path("path", path).absolute()
        if not file.is_file():
            raise InvalidInputError(f"path: there is no file {file}")
        try:
            spec = mujoco.MjSpec.from_file(str(file))
        except (ValueError, mujoco.FatalError) as error:
            raise ModelError(f"MuJoCo cannot read {file}: {error}") from error
        spec.modelname = check_name(file.stem if name is None else name)
        free = [joint for joint in spec.joints if joint.type == mujoco.mjtJoint.mjJNT_FREE]
        for element in (*free, *spec.keys):
            spec.delete(element)
        self._mjcf_root = spec
        taken = {site.name for site in spec.sites}
        site = _SITE if _SITE not in taken else f"{_SITE}_of_prop"
        self._add_sensors(spec.worldbody.add_site(name=site, size=[_SITE_SIZE] * 3, group=SITE_GROUP))
        self._add_vertices()


@functools.lru_cache(maxsize=32)
def _load(path: Path, changed: int, scale: float, decomposed: bool) -> MeshPart:
    """The mesh in a file; `changed` is when the file was."""
    import trimesh
    from scipy.spatial import QhullError

    try:
        read = read_mesh_file(path, path.parent)
        vertices, faces = read.vertices * scale, read.faces.astype(np.int32)
        mesh = trimesh.Trimesh(vertices, faces)  # merges equal vertices, as .stl has them
        hull = mesh.convex_hull
    except QhullError as error:
        raise InvalidInputError(f"{path}: the mesh has no volume") from error
    except Exception as error:  # of the reader, or where no hull is found
        raise InvalidInputError(f"{path}: no mesh that can be read: {shown(error)}") from error
    if len(faces) == 0 or not np.isfinite(vertices).all() or not hull.volume > 0.0:
        raise InvalidInputError(f"{path}: the mesh has no volume")
    longest = float(np.ptp(vertices, axis=0).max())
    if longest > LONGEST:
        raise InvalidInputError(
            f"{path}: the mesh is {longest:.4g} m long, more than {LONGEST:g} m: a file in millimetres needs "
            "scale=0.001, one in inches scale=0.0254"
        )
    is_closed = bool(mesh.is_watertight and mesh.is_winding_consistent)
    if is_closed and mesh.volume < 0.0:
        mesh.invert()
    volume = float(mesh.volume) if is_closed else np.nan
    parts, method = [hull], HULL
    if decomposed and not volume > 0.98 * hull.volume:  # a mesh that fills as much of it needs no parts
        parts, method = _decompose(mesh, hull)
        if method == HULL:
            _log.warning("%s: touches as its convex hull; pip install coacd finds convex parts", path)
    whole = volume if is_closed else float(sum(part.volume for part in parts))
    points = tuple(np.array(part.vertices, dtype=np.float64) for part in parts)
    return MeshPart(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int32), is_closed, whole, points, method)


def _decompose(mesh: Any, hull: Any) -> tuple[list[Any], str]:  # meshes of trimesh
    """Convex parts of a mesh, each as its hull, and how they were found."""
    import trimesh

    if importlib.util.find_spec("coacd") is not None:
        import coacd

        coacd.set_log_level("error")
        whole = coacd.Mesh(mesh.vertices, mesh.faces)
        # The concavity that is left is CoACD's own default.
        pairs = coacd.run_coacd(whole, threshold=0.05, max_convex_hull=MOST_PARTS, seed=0)
        found, method = [trimesh.Trimesh(*pair) for pair in pairs], "CoACD"
    elif importlib.util.find_spec("vhacdx") is not None:
        # An eighth of V-HACD's own voxels, and four times as fast, for parts as close to a mug.
        pieces = trimesh.decomposition.convex_decomposition(mesh, maxConvexHulls=MOST_PARTS, resolution=50_000)
        found, method = [trimesh.Trimesh(**piece) for piece in pieces], "V-HACD"
    else:
        return [hull], HULL
    return [part.convex_hull for part in found if len(part.vertices) > 3], method
