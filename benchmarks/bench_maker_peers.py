"""Planners of the comparison on MotionBenchMaker's problems, each as its own documentation runs it.

Each has a world to build and a motion to plan; what it needs is imported when it is asked for.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import pinocchio as pin

from benchmarks.bench_maker import JOINTS, BenchProblem, Solid
from jacokin import IKSolver, Robot, plan_motion
from jacokin.arrays import Array
from jacokin.ik import Box, Capsule, Obstacle, Scene, Sphere
from jacokin.model.contact import Contact
from jacokin.motion.free_motion.plan_motion import search_of

STEP = 0.05  # [rad] of those who look for contact in places: sscbirrt's and roboplan's own choice


class Planner(Protocol):
    """What is measured."""

    def build(self, problem: BenchProblem) -> None:
        """Build the world of a problem."""

    def plan(self, problem: BenchProblem, limit: float) -> Array | None:
        """Configurations (n, 6) from start to goal [rad], shortened; None for no way within the limit [s]."""


def to_scene(solids: tuple[Solid, ...]) -> Scene:
    """A scene of jacokin's."""
    return Scene([_to_obstacle(solid) for solid in solids])


def _to_obstacle(solid: Solid) -> Obstacle:
    place = pin.SE3(solid.place[:3, :3], solid.place[:3, 3])
    if solid.kind == "box":
        return Box(solid.name, 2.0 * np.array(solid.size), place)
    if solid.kind == "sphere":
        return Sphere(solid.name, solid.size[0], place.translation)
    return Capsule(solid.name, solid.size[0], solid.size[1], place)


class Jacokin:
    """`plan_motion`, the timed motion with all rows included."""

    def __init__(self, robot: Robot, ways: int) -> None:
        """Look for so many ways."""
        self._empty, self._ways = IKSolver(robot), ways
        self.solver = self._empty
        self.duration = 0.0

    def build(self, problem: BenchProblem) -> None:
        """The scene."""
        self.solver = self._empty.in_scene(to_scene(problem.solids))

    def plan(self, problem: BenchProblem, limit: float) -> Array | None:
        """The rows."""
        motion = plan_motion(self.solver, problem.start, problem.goal, time_limit=limit, ways=self._ways)
        self.duration = motion.duration
        return motion.q if motion.success else None


class Vamp:
    """RRT-Connect and simplification, with the settings of ``scripts/evaluate_mbm.py``."""

    def __init__(self) -> None:
        """Configure it as its scripts do."""
        import vamp

        self._vamp = vamp
        self._module, self._plan, self._settings, self._simple = vamp.configure_robot_and_planner_with_kwargs(
            "ur5", "rrtc"
        )
        self._sampler = self._module.halton()
        self.world: Any = None

    def build(self, problem: BenchProblem) -> None:
        """The environment."""
        self.world = to_vamp(self._vamp, problem.solids)

    def plan(self, problem: BenchProblem, limit: float) -> Array | None:
        """Its way; it has no limit of time."""
        del limit
        self._sampler.reset()
        found = self._plan(problem.start, problem.goal, self.world, self._settings, self._sampler)
        if not found.solved:
            return None
        path = self._module.simplify(found.path, self.world, self._simple, self._sampler).path
        return np.asarray(path.numpy(), dtype=np.float64)


def to_vamp(vamp: Any, solids: tuple[Solid, ...]) -> Any:
    """An environment of VAMP's."""
    world = vamp.Environment()
    for solid in solids:
        place, centre = solid.place[:3, :3], solid.place[:3, 3].tolist()
        turns = pin.rpy.matrixToRpy(place).tolist()
        if solid.kind == "box":
            world.add_cuboid(vamp.Cuboid(centre, turns, list(solid.size)))
        elif solid.kind == "sphere":
            world.add_sphere(vamp.Sphere(centre, solid.size[0]))
        else:
            world.add_capsule(vamp.Cylinder(centre, turns, solid.size[0], solid.size[1]))
    return world


class _VampChecker:
    """VAMP's contact, for others."""

    def __init__(self) -> None:
        self._vamp = Vamp()
        from vamp import ur5

        self._ur5 = ur5

    def build(self, problem: BenchProblem) -> None:
        self._vamp.build(problem)

    def touches(self, q: list[float]) -> bool:
        return not self._ur5.validate(q, self._vamp.world)

    def is_clear(self, a: list[float], b: list[float]) -> bool:
        path = self._ur5.Path()  # `validate_motion` looks at eight places of a motion, however long it is
        path.append(a)
        path.append(b)
        return bool(path.validate(self._vamp.world))


class _Certified:
    """jacokin's contact, for others."""

    def __init__(self, robot: Robot) -> None:
        self._empty = IKSolver(robot)
        self.contact: Contact = self._contact_of(self._empty)

    def _contact_of(self, solver: IKSolver) -> Contact:
        return search_of(solver).contact

    def build(self, problem: BenchProblem) -> None:
        self.contact = self._contact_of(self._empty.in_scene(to_scene(problem.solids)))

    def touches(self, q: list[float]) -> bool:
        return self.contact.touches(np.array(q))

    def is_clear(self, a: list[float], b: list[float]) -> bool:
        return self.contact.in_the_way(np.array(a), np.array(b)) is None


class Ompl:
    """OMPL's RRT-Connect and its path simplifier, with a checker of others that it calls in Python."""

    def __init__(self, checker: _VampChecker | _Certified) -> None:
        """Take what looks for contact."""
        from ompl import base, geometric, util

        util.setLogLevel(util.LOG_NONE)
        util.RNG.setSeed(1)
        self._base, self._geometric, self._checker = base, geometric, checker
        space, bounds = base.RealVectorStateSpace(len(JOINTS)), base.RealVectorBounds(len(JOINTS))
        bounds.setLow(-np.pi)
        bounds.setHigh(np.pi)
        space.setBounds(bounds)

        def listed(state: Any) -> list[float]:
            return [state[0], state[1], state[2], state[3], state[4], state[5]]

        class Validator(base.MotionValidator):  # type: ignore[misc]  # OMPL has no types
            """Asks the checker."""

            def checkMotion(self, a: Any, b: Any, *_: Any) -> bool:
                return checker.is_clear(listed(a), listed(b))

        self._about = base.SpaceInformation(space)
        self._about.setStateValidityChecker(lambda state: not checker.touches(listed(state)))
        self._about.setMotionValidator(Validator(self._about))
        self._about.setup()
        self._space, self._listed = space, listed

    def build(self, problem: BenchProblem) -> None:
        """That of the checker."""
        self._checker.build(problem)

    def plan(self, problem: BenchProblem, limit: float) -> Array | None:
        """Its way."""
        asked = self._base.ProblemDefinition(self._about)
        start, goal = self._state(problem.start), self._state(problem.goal)
        asked.setStartAndGoalStates(start, goal)
        planner = self._geometric.RRTConnect(self._about)
        planner.setProblemDefinition(asked)
        planner.setup()
        planner.solve(limit)
        if not asked.hasExactSolution():
            return None
        path = asked.getSolutionPath()
        self._geometric.PathSimplifier(self._about).simplifyMax(path)
        return np.array([self._listed(state) for state in path.getStates()])

    def _state(self, q: Array) -> Any:
        made = self._space.allocState()
        for joint, value in enumerate(q.tolist()):
            made[joint] = value
        return made


class Sscbirrt:
    """CBiRRT and its smoothing, with jacokin's contact at configurations."""

    def __init__(self, robot: Robot) -> None:
        """Limits of the robot."""
        from sscbirrt import CBiRRT, CBiRRTConfig

        self._planner, self._config, self._checker = CBiRRT, CBiRRTConfig, _Certified(robot)
        self._robot = robot
        self.dof, self.joint_limits = robot.dof, (robot.lower, robot.upper)

    def build(self, problem: BenchProblem) -> None:
        """That of the checker."""
        self._checker.build(problem)

    def forward_kinematics(self, q: Array) -> Array:
        """Not needed for goals that are configurations."""
        return np.asarray(self._robot.forward_kinematics(q).homogeneous)

    def is_valid(self, q: Array) -> bool:
        """Whether nothing touches."""
        return not self._checker.contact.touches(np.asarray(q, dtype=np.float64))

    def plan(self, problem: BenchProblem, limit: float) -> Array | None:
        """Its way."""
        found = self._planner(self, None, self, self._config(timeout=limit)).plan(problem.start, [problem.goal], seed=0)
        return None if found is None else np.array(found)


class Roboplan:
    """RRT-Connect and shortcuts, with its own contact (coal) on the same spheres."""

    def __init__(self, urdf: Path, srdf: Path) -> None:
        """Load the arm."""
        from roboplan import core, rrt

        self._core, self._names = core, list[str]()
        self._scene = core.Scene("bench", core.loadUrdfSceneDescriptionFromXml(urdf.read_text(), []))
        self._scene.importSrdf(srdf.read_text())
        self._scene.setCollisions("wrist_2_link", "fts_robotside", False)  # touch in all configurations
        self._scene.addGroup("arm", list(JOINTS))
        self._options = rrt.RRTOptions(
            group_name="arm",
            rrt_connect=True,
            fast_return=True,
            max_nodes=100_000,
            collision_check_step_size=STEP,
        )
        self._rrt, self._shortcuts = rrt.RRT, core.PathShortcuttingOptions(group_name="arm", max_step_size=STEP)

    def build(self, problem: BenchProblem) -> None:
        """Geometries, those of before removed; capsules are a cylinder and two spheres."""
        core, scene, colour = self._core, self._scene, np.zeros(4)
        for name in self._names:
            scene.removeGeometry(name)
        self._names = []

        def add(name: str, call: Callable[..., None], shape: Any, place: Array) -> None:
            call(name, "universe", shape, np.asfortranarray(place), colour)
            self._names.append(name)

        for solid in problem.solids:
            if solid.kind == "box":
                add(solid.name, scene.addBoxGeometry, core.Box(*(2.0 * edge for edge in solid.size)), solid.place)
            elif solid.kind == "sphere":
                add(solid.name, scene.addSphereGeometry, core.Sphere(solid.size[0]), solid.place)
            else:
                add(solid.name, scene.addCylinderGeometry, core.Cylinder(*solid.size), solid.place)
                for sign in (-1.0, 1.0):
                    end = solid.place.copy()
                    end[:3, 3] += sign * 0.5 * solid.size[1] * end[:3, 2]
                    add(f"{solid.name}_{sign}", scene.addSphereGeometry, core.Sphere(solid.size[0]), end)
        scene.setCollisions(list(combinations(self._names, 2)), False)

    def plan(self, problem: BenchProblem, limit: float) -> Array | None:
        """Its way."""
        core = self._core
        self._options.max_planning_time = limit
        planner = self._rrt(self._scene, self._options)
        planner.setRngSeed(0)
        ends = [core.JointConfiguration(list(JOINTS), q) for q in (problem.start, problem.goal)]
        try:
            path = planner.plan(*ends)
        except RuntimeError:
            return None
        shorter = core.PathShortcutter(self._scene, self._shortcuts).shortcut(path)
        return np.array(shorter.positions)


#: How each is made of the robot and the files that describe it, and what to install for it.
PLANNERS: dict[str, tuple[Callable[[Robot, Path, Path], Planner], str]] = {
    "jacokin": (lambda robot, *_: Jacokin(robot, 2), ""),
    "jacokin, ways=1": (lambda robot, *_: Jacokin(robot, 1), ""),
    "VAMP RRTC": (lambda *_: Vamp(), "VAMP, from its clone"),
    "OMPL, VAMP's contact": (lambda *_: Ompl(_VampChecker()), "ompl, and VAMP from its clone"),
    "OMPL, jacokin's contact": (lambda robot, *_: Ompl(_Certified(robot)), "ompl"),
    "sscbirrt, jacokin's contact": (lambda robot, *_: Sscbirrt(robot), "sscbirrt"),
    "roboplan": (lambda _, *files: Roboplan(*files), "roboplan"),
}
