"""`python build.py [FOLDER]`: make what the npm package holds beside its sources, here or in a folder.

The WebAssembly is compiled by this clone, `python -m build_kernels --target wasm32`; the solver files are those of
`jacokin export-c`, one base64 text each in `robots.js`, so that nothing but the WebAssembly is fetched.
"""

from __future__ import annotations

import base64
import json
import shutil
import subprocess
import sys
from pathlib import Path

import ziglang

import jacokin
from jacokin.ik import IKSolver
from jacokin.ik.c_library import solver_file
from jacokin.model.descriptions import bundled

HERE = Path(__file__).resolve().parent
CLONE = HERE.parents[1]
WASM = CLONE / "build" / "targets" / "wasm32" / "jacokin.wasm"
#: Licences of the C library of which parts are in the WebAssembly.
LICENSES = ("libc/musl/COPYRIGHT", "libc/wasi/LICENSE-MIT")
HEAD = "// Written by build.py: what `jacokin export-c` writes for each arm, as base64.\n"


def main(folder: Path = HERE) -> None:
    """Compile, and write to a folder what npm packs."""
    done = subprocess.run([sys.executable, "-m", "build_kernels", "--target", "wasm32"], cwd=CLONE, check=False)
    if done.returncode != 0:
        raise SystemExit(done.returncode)
    shutil.copyfile(WASM, folder / WASM.name)
    for name in ("LICENSE", "NOTICE"):
        shutil.copyfile(CLONE / name, folder / name)
    texts = [(Path(ziglang.__file__).parent / "lib" / name).read_text(encoding="utf-8") for name in LICENSES]
    (folder / "LICENSE-libc").write_text("\n\n".join(texts), encoding="utf-8")
    files = {
        name: base64.b64encode(solver_file(IKSolver(jacokin.load_robot(name), collision="ignore"))).decode()
        for name in bundled.NAMES
    }
    (folder / "robots.js").write_text(f"{HEAD}export const robots = {json.dumps(files, indent=2)};\n", encoding="ascii")


if __name__ == "__main__":
    main(*map(Path, sys.argv[1:]))
