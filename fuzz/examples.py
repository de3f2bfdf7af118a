"""One good value for each parameter name, and one instance of each public class that has methods."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import mujoco
import numpy as np

import jacokin
from jacokin import ik, model, motion, mujoco_bridge, reachability, runner, tasks, twin
from jacokin.mujoco_bridge import observations, robots

HOME = (4.8046852, 2.92482, 1.002, 4.2031852, 1.4458, 1.3233)  # [rad] of the j2n6s300


@dataclass(frozen=True, slots=True)
class Examples:
    """Good values by parameter name, or ``function.parameter`` for one function, and instances by class."""

    values: Mapping[str, object]
    instances: Mapping[str, object]


def build(folder: Path) -> Examples:
    """Everything anew; files go to a folder."""
    robot = jacokin.load_robot()
    target = robot.forward_kinematics(HOME)
    near = robot.forward_kinematics(np.add(HOME, 0.05))
    solver = jacokin.IKSolver(robot, collision="ignore")
    scene = ik.Scene([ik.Floor(-0.2)])
    path = motion.track_path(robot, [target, near], speed=0.5, angular_speed=1.0, seed=HOME)
    arm = robots.make_arm(observations.PERFECT_FEATURES)
    hand = robots.make_hand(observations.PERFECT_FEATURES)
    arm.attach(hand)
    arena = mujoco_bridge.Arena()
    arena.attach(arm, position=robots.ARM_OFFSET)
    prop = mujoco_bridge.Primitive(name="cube")
    arena.add_free_entity(prop)
    physics = mujoco_bridge.Physics.from_entity(arena)
    arm.set_home(physics)
    csv = folder / "targets.csv"
    csv.write_text("x,y,z,qw,qx,qy,qz\n0.3,-0.2,0.4,0,0.7071,0.7071,0\n", encoding="utf-8")
    cloud = folder / "cloud.ply"
    ik.PointCloud("cloud", [[0.4, 0.1, 0.2]]).save(cloud)
    observable = mujoco_bridge.Observable(lambda physics: physics.data.qpos)
    environment, gym = tasks.load("lift_brick", seed=0), tasks.TaskEnv("reach_site", goal=True)
    environment.reset()
    gym.reset(seed=0)
    simulated = twin.SimulatedArm()
    driver = twin.KinovaDriver(simulated)
    controller = twin.TrajectoryController(simulated, robot.joint_names)
    rows = np.add(HOME, [[0.0], [0.1]])
    planned = runner.PlannedMotion(robot, [0.0, 5.0], rows)
    grid = reachability.Grid((0.3, -0.1, 0.3), (0.5, 0.1, 0.5), 0.1)
    randomization = tasks.Randomization(mass=1.1, latency=mujoco_bridge.distributions.Uniform(0.0, 0.1))
    values = {
        "robot": robot,
        "robot_a": robot,
        "robot_b": robot,
        "q": HOME,
        "q_from": HOME,
        "q_to": np.add(HOME, 0.1),
        "v": np.zeros(6),
        "seed": HOME,
        "seeds": HOME,
        "target": target,
        "targets": [target, near],
        "waypoints": [target, near],
        "pose": target,
        "position": (0.3, -0.2, 0.4),
        "rotation": target.rotation,
        "frame": "end_effector",
        "joint": "joint_1",
        "direction": (0.0, 0.0, -1.0),
        "axis": (0.0, 0.0, 1.0),
        "lower": (0.1, -0.3, 0.1),
        "upper": (0.4, 0.3, 0.6),
        "size": (0.1, 0.1, 0.1),
        "name": "thing",
        "radius": 0.05,
        "length": 0.2,
        "points": np.array([[0.4, 0.1, 0.2], [0.4, 0.2, 0.2]]),
        "depth": np.full((4, 6), 0.8),
        "intrinsics": (10.0, 10.0, 2.5, 1.5),
        "T_base_camera": target,
        "Robot.without_own_points.scene": scene,
        "PointCloud.load.path": cloud,
        "height": -0.2,
        "samples": 3,
        "rng": np.random.default_rng(0),
        "random_state": np.random.RandomState(0),
        "path": csv,
        "result": path,
        "collision": "reject",
        "physics": physics,
        "arm": arm,
        "hand": hand,
        "root": arena,
        "entity": prop,
        "parent": arena,
        "site": hand.tool_center_point,
        "target_pos": (0.2, 0.2, 0.3),
        "target_quat": mujoco_bridge.DOWN_QUATERNION,
        "quat_wxyz": (1.0, 0.0, 0.0, 0.0),
        "quaternion": mujoco_bridge.DOWN_QUATERNION,
        "close_factors": (0.1, 0.2, 0.3),
        "positions": HOME,
        "velocity": np.zeros(3),
        "twist": np.zeros(6),
        "sin_cos": np.tile([0.0, 1.0], (6, 1)),
        "raw": lambda physics: physics.data.qpos,
        "observables": {"qpos": observable},
        "mjcf_model": mujoco.MjSpec.from_string(
            "<mujoco><worldbody><body name='b'><geom size='.1'/></body></worldbody></mujoco>"
        ),
        "model": physics.model,
        "kind": "qpos",
        "elements": list(arm.joints),
        "dof": 6,
        "n": 1,
        "nstep": 1,
        "action": np.zeros(9),
        "achieved_goal": np.zeros(3),
        "desired_goal": np.zeros(3),
        "observation": environment.reset().observation,
        "randomization": randomization,
        "task": "reach_site",
        "task_or_name": "reach_site",
        "load.name": "reach_site",
        "Environment.name": "reach_site",
        "expert.name": "lift_brick",
        "names.tag": "features",
        "options": None,
        "tasks.load.name": "reach_site",
        "build.grid": grid,
        "build.orientations": 3,
        "folder": folder / "map",
        "map": reachability.bundled(),
        "load.folder": reachability.bundled().folder,
        "spacing": 0.1,
        "quats_wxyz": [[0.0, 1.0, 0.0, 0.0]],
        "serve.port": 0,
        "driver": driver,
        "motion": planned,
        "names": robot.joint_names,
        "trajectory": motion.move_joints(robot, HOME, np.add(HOME, 0.1), dt=0.1),
        "KinovaDriver.arm": simulated,
        "TrajectoryController.arm": simulated,
        "PlannedMotion.time": [0.0, 5.0],
        "PlannedMotion.q": rows,
        "Runner.step.time": 0.0,
        "Runner.step.measured": runner.Measured(np.array(HOME)),
    }
    instances: dict[str, object] = {
        "Robot": robot,
        "IKSolver": solver,
        "IKResult": solver.solve(target),
        "Tracker": jacokin.Tracker(robot, q=HOME, scene=scene),
        "Trajectory": path,
        "SelfContact": model.SelfContact(robot),
        "CrossCheckReport": jacokin.crosscheck(robot, samples=2),
        "Arena": arena,
        "JacoArm": arm,
        "JacoHand": hand,
        "Primitive": prop,
        "Physics": physics,
        "Observable": observable,
        "Observables": arm.observables,
        "Updater": mujoco_bridge.Updater({"qpos": observable}),
        "Environment": environment,
        "Expert": tasks.expert("lift_brick"),
        "PointCloud": ik.PointCloud("cloud", [[0.4, 0.1, 0.2]]),
        "Grid": grid,
        "Orientations": reachability.Orientations.down(2),
        "Randomization": randomization,
        "ReachabilityMap": reachability.bundled(),
        "TaskEnv": gym,
        "SimulatedArm": simulated,
        "KinovaDriver": driver,
        "TrajectoryController": controller,
        "PlannedMotion": planned,
        "Runner": runner.Runner(robot, planned),
        "TwinLink": runner.TwinLink(driver),
    }
    return Examples(values, instances)
