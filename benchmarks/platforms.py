"""First answers and calls of the C library on other machines, as far as they are run here: emulated, or in Node.

python -m benchmarks.platforms [--robot j2n6s300] [--poses 2000]

A first answer is a new process that loads a solver's file and solves one pose, the process included. Machines that
are not installed are left out by name. An emulator translates what it runs: its times are no machine's.
"""

from __future__ import annotations

import argparse
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

import jacokin
from benchmarks import report
from benchmarks.environments import ROOT
from jacokin.ik import IKSolver, export_c
from jacokin.kernels import library

SOURCE = Path(__file__).with_name("c_calls.c")
ROUNDS = 5
ARM_LIBRARIES = "/usr/aarch64-linux-gnu"
#: Title, target of `export_c`, target of zig, what is linked, and what runs it.
MACHINES = (
    ("C, Linux x86-64", None, None, library.PATH.name, ()),
    ("C, Linux AArch64, emulated by qemu", "linux-aarch64", "aarch64-linux-gnu.2.17", "libjacokin.so",
     ("qemu-aarch64", "-L", ARM_LIBRARIES)),
    ("C, Windows x86-64, by Wine", "windows", "x86_64-windows-gnu", "jacokin.lib", ("wine",)),
)  # fmt: skip
SCRIPT = """
import { readFileSync } from "node:fs";
import { load } from "PACKAGE/jacokin.js";
const solver = await load("ROBOT");
const bytes = readFileSync(process.argv[2]);
const poses = new Float64Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.length));
const n = poses.length / 16, best = [Infinity, Infinity];
for (let round = 0; round < Number(process.argv[3]); round++)
  [solver.nearest, solver.all].forEach((call, which) => {
    const start = performance.now();
    for (let i = 0; i < n; i++) call.call(solver, poses.subarray(16 * i, 16 * i + 16), solver.home);
    best[which] = Math.min(best[which], (performance.now() - start) / n);
  });
console.log(...best.map((milliseconds) => milliseconds / 1e3));
"""


def measure(command: list[str], poses: Path, one: Path) -> tuple[str, str, str]:
    """A first answer, and a pose's nearest and all branches."""
    firsts = []
    for _ in range(ROUNDS):
        start = time.perf_counter()
        subprocess.run([*command, str(one), "1"], capture_output=True, check=True)
        firsts.append(time.perf_counter() - start)
    done = subprocess.run([*command, str(poses), str(ROUNDS)], capture_output=True, text=True, check=True)
    nearest, every = map(float, done.stdout.split())
    return report.seconds(min(firsts)), report.seconds(nearest), report.seconds(every)


def compiled(folder: Path, solver: IKSolver, target: str | None, zig: str | None, linked: str) -> Path:
    """A program for a machine, beside its library and the solver's file."""
    export_c(solver, folder, target=target)
    program = folder / "lib" / "calls.exe"
    words = [sys.executable, "-P", "-m", "ziglang", "cc", "-O2", *(("-target", zig) if zig else ())]
    words += [f"-I{folder / 'include'}", str(SOURCE), str(folder / "lib" / linked), "-lm", "-o", str(program)]
    words += [] if target == "windows" else [f"-Wl,-rpath,{folder / 'lib'}"]
    subprocess.run(words, check=True)
    return program


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robot", default="j2n6s300", help="of six joints")
    parser.add_argument("--poses", type=int, default=2000)
    options = parser.parse_args()
    robot, rng = jacokin.load_robot(options.robot), np.random.default_rng(0)
    solver = IKSolver(robot, collision="ignore")
    targets = np.array([robot.forward_kinematics(q).homogeneous for q in robot.sample(rng, options.poses)])
    rows = []
    with tempfile.TemporaryDirectory() as made:
        poses, one = Path(made) / "poses.f64", Path(made) / "one.f64"
        targets.tofile(poses)
        targets[:1].tofile(one)
        for title, target, zig, linked, runner in MACHINES:
            if runner and shutil.which(runner[0]) is None:
                print(f"{title}: {runner[0]} is not installed")
                continue
            folder = Path(made) / (target or "here")
            program = compiled(folder, solver, target, zig, linked)
            command = [*runner, str(program), str(folder / f"{options.robot}.jacokin")]
            rows.append((title, *measure(command, poses, one)))
        if shutil.which("node") is None:
            print("WebAssembly: node is not installed")
        else:
            package = Path(made) / "package"
            shutil.copytree(ROOT / "integrations" / "web", package)
            subprocess.run([sys.executable, ROOT / "integrations" / "web" / "build.py", package], check=True)
            script = Path(made) / "calls.mjs"
            script.write_text(SCRIPT.replace("PACKAGE", str(package)).replace("ROBOT", options.robot))
            rows.append(("WebAssembly, Node", *measure(["node", str(script)], poses, one)))
    print(report.table(["", "first answer", "nearest", "all branches"], rows))


if __name__ == "__main__":
    main()
