"""The peers: pinned packages, and the virtual environment they run in, made on first use."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / ".venv-bench"

SHARED = "peers"  # the environment that peers share whose versions agree with each other
# What several of them build on, held at one version for all of them.
SHARED_PINS = (
    "daqp==0.11.0",
    "mujoco==4.0.0",
    "mujoco-core==4.0.0",
    "mujoco-studio==4.0.0",
    "numpy==2.4.6",
    "pin==4.1.0",
    "qpsolvers==4.13.0",
    "scipy==1.17.1",
)

REASON_LENGTH = 200  # characters of pip's complaint that go to the table


@dataclass(frozen=True, slots=True)
class Peer:
    """One solver of the comparison."""

    name: str
    """Short name, for `--peers`."""
    title: str
    """What is called, for the table."""
    module: str
    """File in benchmarks/peers."""
    packages: tuple[str, ...] = ()
    """Pinned requirements; none for jacokin, which runs in this interpreter."""
    environment: str = SHARED
    """Folder under .venv-bench. A peer that needs other versions than the shared ones gets its own."""
    variant: str = ""
    """Which call of the module, where it has several."""
    all_branches: bool = False
    """True when the call returns every branch, not one answer."""


PEERS = (
    Peer("solve_all", "jacokin `solve_all`", "jacokin_arm", variant="solve_all", all_branches=True),
    Peer("solve", "jacokin `solve`", "jacokin_arm", variant="solve"),
    Peer("qp", 'jacokin `solve`, method="qp"', "jacokin_arm", variant="qp"),
    Peer("ssik", "ssik `jaco2_ik.solve`", "ssik_solver", ("ssik==8.2.0",), variant="jaco2_ik", all_branches=True),
    Peer("rtb", "roboticstoolbox `ik_LM`", "toolbox_lm", ("roboticstoolbox-python==1.5.0",)),
    Peer("pytracik", "pytracik `ik`", "trac", ("pytracik==0.0.3",)),
    Peer("mink", "mink loop, 20 restarts", "mink_loop", ("mink==1.3.0", "daqp==0.11.0")),
    Peer("pink", "pink loop, 20 restarts", "pink_loop", ("pin-pink==4.4.0", "daqp==0.11.0")),
    Peer("dm_control", "dm_control `set_site_to_xpos`", "dm_control_arm", ("dm_control==1.0.50",)),
)


class InstallError(Exception):
    """A peer's packages could not be installed; the text is pip's reason."""


def interpreter(peer: Peer) -> Path:
    """The Python that has the peer installed; makes the environment when needed.

    Raises:
        InstallError: the packages cannot be installed here.
    """
    if not peer.packages:
        return Path(sys.executable)
    folder = FOLDER / peer.environment
    python = folder / "bin" / "python"
    installed = folder / f"{peer.name}.installed"
    pins = SHARED_PINS if peer.environment == SHARED else ()
    wanted = "\n".join((*peer.packages, *pins)) + "\n"
    if installed.is_file() and installed.read_text() == wanted:
        return python
    if not python.exists():
        _run([sys.executable, "-m", "venv", str(folder)])
    print(f"installing {' '.join(peer.packages)} into {folder.relative_to(ROOT)} ...", flush=True)
    constraints = folder / "constraints.txt"
    constraints.write_text("\n".join(pins) + "\n")
    _run([str(python), "-m", "pip", "install", "--quiet", "--constraint", str(constraints), *peer.packages])
    installed.write_text(wanted)
    return python


def _run(command: list[str]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=900.0, check=False)  # [s]
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InstallError(f"not installed: {error}"[:REASON_LENGTH]) from None
    if done.returncode:
        lines = [line.strip() for line in done.stderr.splitlines() if line.strip() and not line.startswith("WARNING")]
        errors = [line for line in lines if line.lower().startswith("error")] or lines or [f"exit {done.returncode}"]
        raise InstallError(f"not installed: {errors[-1]}"[:REASON_LENGTH])
