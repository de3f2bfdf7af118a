"""What jacokin's own parts cost: beside the bare calls they wrap, in batches, and from a cold start.

python -m benchmarks.costs
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import mink
import numpy as np
import pinocchio as pin

import jacokin
from benchmarks import few_joints, report, six_joints, targets
from jacokin import Robot
from jacokin.arrays import Array
from jacokin.model import to_mujoco

LOOP_TOLERANCE = 1e-8  # [m] and [rad]; the loop stops where jacokin's does
CALLS = 2000  # in a timed block
ROWS = 100_000  # configurations in one array
BLOCKS = 15
BATCH = 20_000  # poses
STARTS = 5  # of each command
LOOKING = "ignore", "prefer"
SOLVED_POSES, CALLS_OF_A_POSE = 300, 20
FIRST_ANSWER = (
    "import jacokin; robot = jacokin.load_robot(); solver = jacokin.IKSolver(robot);"
    "solver.solve(robot.forward_kinematics(robot.home)).raise_for_status()"
)
#: The same with a file, at a pose that is away from every limit and singularity.
OWN_ANSWER = (
    "import sys, jacokin; robot = jacokin.load_robot(sys.argv[1]); solver = jacokin.IKSolver(robot);"
    "solver.solve(robot.forward_kinematics([0.3, -1.2, 1.4, 0.4, 0.9, 0.2])).raise_for_status()"
)
COMMAND = "from jacokin.cli.main import main; main()"


def qp_iteration(robot: Robot) -> tuple[float, float]:
    """Seconds for an iteration of jacokin's QP, everything around it included, and of a bare mink loop.

    The bare loop is what a user writes: limits built once, errors compared, a step, until 1e-8 or 60 iterations, from
    home and then from random starts. Both take the same targets in turns.
    """
    solver = jacokin.IKSolver(robot, method="qp", collision="ignore")
    model = to_mujoco(robot)
    configuration = mink.Configuration(model)
    limits = [mink.ConfigurationLimit(model)]
    task = mink.FrameTask(robot.default_frame, "site", 1.0, 1.0, lm_damping=1e-3)
    rng = np.random.default_rng(3)
    wanted = targets.random_configurations(robot, rng, 150)
    spent = np.zeros(2)
    iterations = np.zeros(2)
    solver.solve(wanted.poses[0])
    for pose in wanted.poses:
        begin = time.perf_counter()
        result = solver.solve(pose, closest=False)
        middle = time.perf_counter()
        task.set_target(mink.SE3.from_matrix(pose))
        count = _bare_loop(configuration, task, limits, robot, rng)
        spent += middle - begin, time.perf_counter() - middle
        iterations += result.iterations, count
    ours, bare = spent / iterations
    return float(ours), float(bare)


def _bare_loop(
    configuration: mink.Configuration,
    task: mink.FrameTask,
    limits: list[mink.ConfigurationLimit],
    robot: Robot,
    rng: np.random.Generator,
) -> int:
    """Iterations of the loop until it is on target."""
    total = 0
    start = robot.home
    while True:
        configuration.update(start)
        for _ in range(60):  # of the bare loop from one start
            error = task.compute_error(configuration)
            if np.linalg.norm(error[:3]) < LOOP_TOLERANCE and np.linalg.norm(error[3:]) < LOOP_TOLERANCE:
                return total
            velocity = mink.solve_ik(configuration, [task], 1.0, "daqp", limits=limits)
            configuration.integrate_inplace(velocity, 1.0)
            total += 1
        start = robot.sample(rng)


def wrappers(robot: Robot) -> list[tuple[str, float, float]]:
    """Name, seconds of a call, seconds of the bare Pinocchio call."""
    model, data, frame = robot.pin_model, robot.pin_model.createData(), robot.frame_id()
    q = np.array(robot.home)

    def bare_forward() -> None:
        pin.forwardKinematics(model, data, q)
        pin.updateFramePlacement(model, data, frame).copy()

    def bare_jacobian() -> None:
        pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)

    def bare_torque() -> None:
        pin.rnea(model, data, q, q, q)

    def bare_mass_matrix() -> None:
        pin.crba(model, data, q)

    return [
        ("`robot.forward_kinematics`", *_in_turns(lambda: robot.forward_kinematics(q), bare_forward)),
        ("`robot.jacobian`", *_in_turns(lambda: robot.jacobian(q), bare_jacobian)),
        ("`robot.inverse_dynamics`", *_in_turns(lambda: robot.inverse_dynamics(q, q, q), bare_torque)),
        ("`robot.mass_matrix`", *_in_turns(lambda: robot.mass_matrix(q), bare_mass_matrix)),
    ]


def rows_at_once(robot: Robot) -> list[tuple[str, float, float]]:
    """Name, seconds for one of many configurations in an array, seconds of the bare Pinocchio call for one."""
    model, data, frame = robot.pin_model, robot.pin_model.createData(), robot.frame_id()
    q = robot.sample(np.random.default_rng(6), ROWS)
    v, a = np.random.default_rng(7).normal(size=(2, *q.shape))
    few = range(0, ROWS, ROWS // CALLS)

    def forward_loop() -> None:
        for i in few:
            pin.forwardKinematics(model, data, q[i])
            pin.updateFramePlacement(model, data, frame)

    def jacobian_loop() -> None:
        for i in few:
            pin.computeFrameJacobian(model, data, q[i], frame, pin.LOCAL_WORLD_ALIGNED)

    def torque_loop() -> None:
        for i in few:
            pin.rnea(model, data, q[i], v[i], a[i])

    def mass_loop() -> None:
        for i in few:
            pin.crba(model, data, q[i])

    calls: dict[str, tuple[Callable[[], object], Callable[[], object]]] = {
        "`robot.forward_kinematics`": (lambda: robot.forward_kinematics(q), forward_loop),
        "`robot.jacobian`": (lambda: robot.jacobian(q), jacobian_loop),
        "`robot.inverse_dynamics`": (lambda: robot.inverse_dynamics(q, v, a), torque_loop),
        "`robot.mass_matrix`": (lambda: robot.mass_matrix(q), mass_loop),
    }
    rows = []
    for name, (ours, bare) in calls.items():
        best = _in_turns(ours, bare, calls=1)
        rows.append((name, best[0] / ROWS, best[1] / len(few)))
    return rows


def _in_turns(first: Callable[[], object], second: Callable[[], object], calls: int = CALLS) -> tuple[float, float]:
    """Seconds of one call of each: the best of blocks in turns, as noise only ever adds."""
    best = [np.inf, np.inf]
    for _ in range(BLOCKS):
        for index, call in enumerate((first, second)):
            begin = time.perf_counter()
            for _ in range(calls):
                call()
            best[index] = min(best[index], (time.perf_counter() - begin) / calls)
    return best[0], best[1]


def solve_parts(robot: Robot) -> list[tuple[str, float, float]]:
    """What a solve is made of: calls, each with more in it than the one before, their seconds, and how much more.

    Medians over poses, of each the best of some calls. The first is a floor: Pinocchio at one configuration.
    """
    solvers = {collision: jacokin.IKSolver(robot, collision=collision) for collision in LOOKING}
    model, data, frame = robot.pin_model, robot.pin_model.createData(), robot.frame_id()
    form, q = solvers["ignore"].closed_form(), np.array(robot.home)
    nearest = form.nearest_branch()
    nearest.seed[:] = q

    def pinocchio(pose: Array) -> None:
        pin.computeFrameJacobian(model, data, q, frame, pin.LOCAL_WORLD_ALIGNED)
        pin.updateFramePlacement(model, data, frame)

    def kernel(pose: Array) -> None:
        nearest.T[:] = pose
        nearest()

    calls: dict[str, Callable[[Array], object]] = {
        "Pinocchio, a Jacobian and a pose: the floor": pinocchio,
        "the kernel: all branches of a pose": kernel,
        "`ClosedForm.solve_all`: their rows": lambda pose: form.solve_all(pose, q),
        "`solve_all`: target and seed checked": solvers["ignore"].solve_all,
    }
    for name, solver in solvers.items():
        calls[f'`solve`, collision="{name}"'] = solver.solve
    poses = targets.random_configurations(robot, np.random.default_rng(5), SOLVED_POSES).poses
    best = np.full((len(calls), len(poses)), np.inf)
    for _ in range(CALLS_OF_A_POSE):
        for row, call in enumerate(calls.values()):
            for column, pose in enumerate(poses):
                begin = time.perf_counter()
                call(pose)
                best[row, column] = min(best[row, column], time.perf_counter() - begin)
    medians = np.median(best, axis=1)
    return list(zip(calls, medians.tolist(), np.diff(medians, prepend=0.0).tolist(), strict=True))


def batch(robot: Robot) -> list[tuple[int, str, float]]:
    """Workers, collision and poses a second of `solve_batch`, the best of some runs."""
    poses = targets.random_configurations(robot, np.random.default_rng(4), BATCH).poses
    solvers = {collision: jacokin.IKSolver(robot, collision=collision) for collision in LOOKING}
    rates = {(workers, collision): 0.0 for workers in (1, 2) for collision in LOOKING}
    for _ in range(3):
        for workers, collision in rates:
            begin = time.perf_counter()
            solvers[collision].solve_batch(poses, workers=workers)
            rate = BATCH / (time.perf_counter() - begin)
            rates[workers, collision] = max(rates[workers, collision], rate)
    return [(workers, collision, rate) for (workers, collision), rate in rates.items()]


def cold_starts() -> list[tuple[str, float]]:
    """Command and wall seconds of a new process, the best of some; bytecode is there."""
    with tempfile.TemporaryDirectory() as folder:
        own = Path(folder, "ur5.urdf")
        own.write_text(few_joints.urdf_of(_places("UR5")), encoding="utf-8")
        return [(title, _best_start(arguments)) for title, arguments in _commands(str(own))]


def _places(arm: str) -> list[tuple[float, ...]]:
    """Where the joints and the tool of an arm of `six_joints.ARMS` are, as `few_joints.urdf_of` takes them."""
    return [(0.0,) * 6, *((a, 0.0, d, alpha, 0.0, 0.0) for a, d, alpha in zip(*six_joints.ARMS[arm], strict=True))]


def _commands(own: str) -> list[tuple[str, list[str]]]:
    """What the rows are called, and the program and its arguments."""
    return [
        ("jacokin --help", [COMMAND, "--help"]),
        ("jacokin fk ...", [COMMAND, "fk", "4.8", "2.92", "1.0", "4.2", "1.45", "1.32"]),
        ("jacokin ik ... (one pose)", [COMMAND, "ik", "--position", "0.3", "-0.2", "0.5", "--down"]),
        ("jacokin ik ... --method qp", [COMMAND, "ik", "--position", "0.3", "-0.2", "0.5", "--down", "--method", "qp"]),
        ("the first answer: load_robot, IKSolver, solve", [FIRST_ANSWER]),
        ("the first answer of a UR5 from a URDF without shapes", [OWN_ANSWER, own]),
        ("python -c 'import pinocchio, numpy.random'", ["import pinocchio, numpy.random"]),
        ("python -c 'import jacokin'", ["import jacokin"]),
        ("python -c 'pass'", ["pass"]),
    ]


def _best_start(arguments: list[str]) -> float:
    best = np.inf
    for _ in range(STARTS):
        begin = time.perf_counter()
        subprocess.run([sys.executable, "-P", "-c", *arguments], check=True, capture_output=True)
        best = min(best, time.perf_counter() - begin)
    return best


def section(robot: Robot) -> report.Section:
    """The part of the page on costs."""
    ours, bare = qp_iteration(robot)
    rows = [("one QP iteration, beside a bare mink loop", ours, bare), *wrappers(robot)]
    calls = [(name, report.seconds(a), report.seconds(b), report.seconds(a - b), f"{a / b:.2f}") for name, a, b in rows]
    many = [
        (name, report.seconds(a), report.seconds(b), f"{b / a:.1f}", f"{1.0 / a:,.0f}")
        for name, a, b in rows_at_once(robot)
    ]
    solves = [(name, report.seconds(each), report.seconds(more)) for name, each, more in solve_parts(robot)]
    rates = [(f"{workers}", f'"{collision}"', f"{rate:,.0f}") for workers, collision, rate in batch(robot)]
    starts = [(f"`{title}`", report.seconds(value)) for title, value in cold_starts()]
    parts = [
        report.table(("call", "jacokin", "bare", "difference", "ratio"), calls),
        f"{ROWS:,} configurations in one array, each:",
        report.table(("call", "jacokin", "bare call for one", "ratio", "a second"), many),
        "What a solve is made of, on random poses:",
        report.table(("call", "jacokin", "more than the line above"), solves),
        f"`solve_batch` on {BATCH:,} random poses, one result for each:",
        report.table(("workers", "collision", "poses a second"), rates),
        "A new process, wall time, with bytecode on disk:",
        report.table(("command", "time"), starts),
    ]
    return report.Section("Costs", "\n\n".join(parts))


if __name__ == "__main__":
    print(section(jacokin.load_robot()).body)
