"""Contact on meshes: how often hulls and convex parts see some that the triangles do not have, and what they cost.

Run `python -m benchmarks.shapes ARM.urdf[:TIP] ... --package-dirs FOLDER`. The triangles are held against each other by
coal, pair by pair. Pairs that touch in every configuration that is looked at count for nobody.
"""

from __future__ import annotations

import argparse
import time
import xml.etree.ElementTree as ET
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from jacokin import IKSolver, Robot, Tracker, load_robot, plan_motion
from jacokin.arrays import Array
from jacokin.model import Box, Scene
from jacokin.model.contact import Contact, self_contact
from jacokin.model.descriptions import mjcf
from jacokin.model.descriptions.meshes import find_mesh, read_mesh_file
from jacokin.model.descriptions.shapes import mesh_scale
from jacokin.model.mujoco_twin import PART, tested_pairs, with_shapes

ROWS = 2000  # random configurations
VELOCITY, ACCELERATION = 1.0, 3.0  # [rad/s], [rad/s^2]


class Triangles:
    """The collision meshes of a URDF as they are; other shapes are left out."""

    def __init__(self, robot: Robot) -> None:
        """Read the meshes, and which pairs of shapes count."""
        source, path = robot.source, robot.source.path
        assert isinstance(source.content, str)
        self._robot = robot
        self._shapes: dict[str, tuple[int, pin.SE3, Any]] = {}
        model, frames = with_shapes(robot).model, robot.pin_model.frames
        geoms = {geom: mjcf.geom_name(model, geom) for geom in range(model.ngeom)}
        bodies: dict[str, list[int]] = {}
        for geom in geoms:
            bodies.setdefault(mjcf.body_name(model, int(model.geom_bodyid[geom])), []).append(geom)
        carriers: dict[int, int] = {}
        for link in ET.fromstring(source.content).iter("link"):
            name = link.get("name", "")
            if name not in robot.frames:
                continue
            frame = frames[robot.frame_id(name)]
            for geom, collision in zip(bodies.get(name, []), link.findall("collision"), strict=False):
                mesh = collision.find("geometry/mesh")
                if mesh is None:
                    continue
                file = read_mesh_file(find_mesh(mesh.get("filename", ""), path, source.package_dirs), path)
                shape = coal.BVHModelOBBRSS()
                shape.beginModel(len(file.faces), len(file.vertices))
                shape.addVertices(file.vertices * mesh_scale(mesh))
                shape.addTriangles(file.faces.astype(np.int32))
                shape.endModel()
                carriers[geom] = int(frame.parentJoint)
                self._shapes[geoms[geom]] = carriers[geom], frame.placement * _origin(collision), shape
        self.pairs = [(geoms[a], geoms[b]) for a, b in tested_pairs(model, carriers)]
        self._data = robot.pin_model.createData()

    def touching(self, q: Array) -> set[frozenset[str]]:
        """Pairs of names whose triangles meet at a configuration (dof,) [rad]."""
        pin.forwardKinematics(self._robot.pin_model, self._data, q)
        placed = {name: self._data.oMi[joint] * T for name, (joint, T, _) in self._shapes.items()}
        return {frozenset(pair) for pair in self.pairs if self._touch(*pair, placed)}

    def _touch(self, a: str, b: str, placed: dict[str, pin.SE3]) -> bool:
        places = [coal.Transform3s(placed[name].rotation, placed[name].translation) for name in (a, b)]
        request, result = coal.CollisionRequest(), coal.CollisionResult()
        return bool(coal.collide(self._shapes[a][2], places[0], self._shapes[b][2], places[1], request, result))


def _origin(element: ET.Element) -> pin.SE3:
    origin = element.find("origin")
    xyz, rpy = (
        [float(word) for word in ("0 0 0" if origin is None else origin.get(key, "0 0 0")).split()]
        for key in ("xyz", "rpy")
    )
    return pin.SE3(pin.rpy.rpyToMatrix(np.array(rpy)), np.array(xyz))


def whole(pairs: Sequence[tuple[str, str]]) -> set[frozenset[str]]:
    """Pairs of shapes, of whichever parts."""
    return {frozenset(name.rsplit(PART, 1)[0] for name in pair) for pair in pairs}


def compare(robot: Robot, triangles: Triangles, rows: Array, truth: list[set[frozenset[str]]]) -> str:
    """How often contact on the shapes of a robot is not that of the triangles."""
    start = time.perf_counter()
    contact: Contact = self_contact(robot)
    made = time.perf_counter() - start
    known = {frozenset(pair) for pair in triangles.pairs}
    always = set.intersection(*truth) if truth else set()
    ours = [(whole(contact.touching(q)) & known) - always for q in rows]
    start = time.perf_counter()
    for q in rows:
        contact.touches(q)
    each = (time.perf_counter() - start) / len(rows)
    false = sum(bool(found) and not real - always for found, real in zip(ours, truth, strict=True))
    missed = sum(bool(real - always) and not found for found, real in zip(ours, truth, strict=True))
    lost = sum(len(real - always - found) for found, real in zip(ours, truth, strict=True))
    return (
        f"{len(contact.arm_shapes)} shapes, made in {made:.2g} s, {1e6 * each:.3g} us a configuration; false "
        f"{100 * false / len(rows):.2f} %, missed {missed} of {sum(bool(real - always) for real in truth)} "
        f"(pairs: {lost})"
    )


def costs(robot: Robot) -> str:
    """Milliseconds of what is built for a robot, the second time."""
    boxes = [Box(f"box {i}", [0.1, 0.1, 0.1], [2.0, 0.02 * i, 0.5]) for i in range(1000)]
    solver, goal = IKSolver(robot), robot.home.copy()
    goal[0] += 0.2
    asked: dict[str, Callable[[], object]] = {
        "IKSolver": lambda: IKSolver(robot),
        "in_scene of 10": lambda: solver.in_scene(Scene(boxes[:10])),
        "in_scene of 1,000": lambda: solver.in_scene(Scene(boxes)),
        "Tracker": lambda: Tracker(robot, dt=0.01, collision="reject", velocity_limit=1.0),
        "first plan": lambda: plan_motion(
            IKSolver(robot), robot.home, goal, velocity_limit=VELOCITY, acceleration_limit=ACCELERATION
        ),
    }
    found = []
    for name, ask in asked.items():
        ask()
        times = []
        for _ in range(5):
            start = time.perf_counter()
            ask()
            times.append(time.perf_counter() - start)
        found.append(f"{name} {1e3 * min(times):.2f}")
    return ", ".join(found) + " ms"


def main() -> None:
    """Compare each arm that is named."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("arms", nargs="+", help="URDF files, each with :TIP if its arm does not end by itself")
    parser.add_argument("--package-dirs", nargs="*", default=[], help="folders of packages")
    parser.add_argument("--rows", type=int, default=ROWS, help="random configurations")
    arguments = parser.parse_args()
    for arm in arguments.arms:
        path, _, tip = arm.partition(":")
        given: dict[str, Any] = {"tip": tip or None, "package_dirs": arguments.package_dirs}
        hulls, parts = (load_robot(Path(path), decompose=decompose, **given) for decompose in (False, True))
        triangles, rows = Triangles(hulls), hulls.sample(np.random.default_rng(0), arguments.rows)
        truth = [triangles.touching(q) for q in rows]
        print(f"{hulls.name}: hulls {compare(hulls, triangles, rows, truth)}", flush=True)
        print(f"{hulls.name}: parts {compare(parts, triangles, rows, truth)}", flush=True)
        print(f"{hulls.name}: hulls {costs(hulls)}; parts {costs(parts)}", flush=True)


if __name__ == "__main__":
    main()
