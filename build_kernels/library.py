"""`build`: the library of kernels beside `jacokin.kernels.library`, which loads it. `build_for`: other machines.

The kernels of `jacokin.kernels.entries` become object files, those that share most of their code one for all of them
(`GROUPS`). One process translates Python; others, a process each, make machine code of what is translated. Object files
are kept in the clone's ``build`` folder under a name that changes with all they depend on, so that only what was
changed is compiled again. `linking` makes a library of them.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import importlib.metadata
import importlib.util
import itertools
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TypeAlias

from build_kernels import c_library, linking
from build_kernels.linking import BuildError
from build_kernels.targets import HERE, TARGETS, WIDE_KERNELS, Target
from build_kernels.universal import universal
from jacokin.kernels import library
from jacokin.kernels.entries import ENTRIES, Entry

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "jacokin"
KEPT = ROOT / "build" / "kernels"
TARGET = PACKAGE / "kernels" / library.PATH.name
#: Where the libraries of other machines go, each in a folder with the machine's name.
OTHERS = ROOT / "build" / "targets"
#: Where those with all kernels go, for wheels.
WHOLE = ROOT / "build" / "wheels"
#: The kernels of the C library, which is what other machines get.
C_ENTRIES = tuple(entry for entry in ENTRIES if entry.run.__name__ in c_library.KERNELS)
#: Kernels that share most of their code: in one object file it is once.
GROUPS = (
    ("solve_targets", "rank_labellings", "solve_clear_targets", "solve_set"),
    ("run_contact", "find_near_points", "run_free_motion", "check_between", "run_tick", "try_reach"),
)
#: Kernels of one object file.
Group: TypeAlias = tuple[Entry, ...]
#: Libraries for several machines at once, by name.
UNIVERSAL = {"macos": ("aarch64-macos", "x86_64-macos")}
#: What the machine code depends on, apart from the sources.
COMPILERS = ("numba", "llvmlite", "numpy")
#: What all kernels take.
DURATION = "All of them take 2 to 4 minutes of processor time, 1 to 3 minutes on two cores"
DURATION_ELSEWHERE = "Those of the C library take 1 to 2 minutes of processor time for each machine, all twice as long"
#: The terminal that a program was started from, whatever became of its output.
TERMINAL = Path("/dev/tty")
#: Modules that are made machine code at a time, while others are translated: each takes up to 0.3 GB of memory.
JOBS = min(2, os.cpu_count() or 1)
_IMPORT = re.compile(r"^from (jacokin\.kernels\.[\w.]+) import", re.MULTILINE)


def build(target: Path = TARGET, kept: Path = KEPT) -> Path:
    """Make the library of this machine, and return where it is.

    Args:
        target: the file to write.
        kept: folder of the object files of earlier builds.

    Raises:
        BuildError: a kernel does not compile, there is nothing to compile or link with, or a folder cannot be written.
    """
    if not linking.linkers():
        raise BuildError(linking.NO_LINKER)
    _make([(HERE, target)], ENTRIES, kept)
    return target


def build_for(
    names: Sequence[str], folder: Path = OTHERS, kept: Path = KEPT, *, entries: Sequence[Entry] = C_ENTRIES
) -> list[Path]:
    """Make libraries of other machines, and return where they are: ``folder/name/library``.

    Args:
        names: of `TARGETS` and `UNIVERSAL`.
        folder: made where it is not there.
        kept: as for `build`.
        entries: the kernels in it; all of them for a wheel.

    Raises:
        BuildError: as `build`; an unknown name.
    """
    if unknown := [name for name in names if name not in (*TARGETS, *UNIVERSAL)]:
        raise BuildError(f"unknown target {', '.join(unknown)}; known are {', '.join((*TARGETS, *UNIVERSAL))}")
    if importlib.util.find_spec("ziglang") is None:
        raise BuildError(linking.NO_ZIG)
    parts = {part: TARGETS[part] for name in names for part in UNIVERSAL.get(name, (name,))}
    places = {name: folder / name / target.library for name, target in parts.items()}
    for place in places.values():
        try:
            place.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise BuildError(f"{place.parent}: {error.strerror}") from None
    _make([(parts[name], place) for name, place in places.items()], entries, kept)
    for name in names:
        if several := UNIVERSAL.get(name):
            places[name] = folder / name / places[several[0]].name
            places[name].parent.mkdir(exist_ok=True)
            places[name].write_bytes(universal([places[part].read_bytes() for part in several]))
    return [places[name] for name in names]


def _described(targets: Sequence[Target], entries: Sequence[Entry]) -> str:
    """What is compiled, and how long that takes."""
    if HERE in targets:
        return f"{len(entries)} kernels. {DURATION}"
    names = ", ".join(target.name for target in targets)
    return f"{len(entries)} kernels for {names}. {DURATION_ELSEWHERE}"


def _make(libraries: Sequence[tuple[Target, Path]], entries: Sequence[Entry], kept: Path) -> None:
    """Compile what is missing, and link."""
    start = time.perf_counter()
    try:
        kept.mkdir(parents=True, exist_ok=True)
        for folder in (kept, *(place.parent for _, place in libraries)):
            with tempfile.TemporaryFile(dir=folder):
                pass
    except OSError as error:
        where = error.filename or kept
        raise BuildError(f"{where}: {error.strerror}; build in a copy of the clone that can be written") from None
    wide = {target: target.wide for target, _ in libraries}
    twice: list[Group] = [(entry,) for entry in entries if entry.run.__name__ in WIDE_KERNELS]
    objects = {each: {group: object_of(group, kept, each) for group in twice} for each in wide.values() if each}
    objects |= {target: {each: object_of(each, kept, target) for each in groups(entries)} for target, _ in libraries}
    _compile_missing(objects, entries, start)

    def link(target: Target, place: Path) -> None:
        files = [*objects[target].values(), *objects.get(wide[target] or target, {}).values()]
        linking.link([*dict.fromkeys(files), *c_library.sources(target)], place, target, entries)
        tell(f"{place}: built in {time.perf_counter() - start:.0f} s")

    with ThreadPoolExecutor(JOBS) as pool:
        for each in [pool.submit(link, *library) for library in libraries]:
            each.result()
    remove_unused(kept, [file for files in objects.values() for file in files.values()])


def groups(entries: Sequence[Entry]) -> list[Group]:
    """Kernels by object file, in order."""
    found: dict[object, list[Entry]] = {}
    for entry in entries:
        name = entry.run.__name__
        found.setdefault(next((group for group in GROUPS if name in group), name), []).append(entry)
    return [tuple(group) for group in found.values()]


def _names(group: Group) -> list[str]:
    return [entry.run.__name__ for entry in group]


def _compile_missing(objects: dict[Target, dict[Group, Path]], entries: Sequence[Entry], start: float) -> None:
    """Compile what is not kept from an earlier build: each group once, for all targets."""
    missing: dict[Group, dict[Target, Path]] = {}
    for target, files in objects.items():
        for group, file in files.items():
            if not file.exists():
                missing.setdefault(group, {})[target] = file
    if not missing:
        return
    count = len({entry for group in missing for entry in group})
    tell(f"jacokin: compiling {count} of {_described(list(objects), entries)}, with up to 1 GB of memory")
    done, whole = itertools.count(1), sum(map(len, missing.values()))

    def make(group: Group, module: Path, files: dict[Target, Path]) -> None:
        emit_objects(group, module, files)
        for target in files:
            what = f"{', '.join(_names(group))}{f' for {target.name}' if target.name else ''}"
            tell(f"jacokin: {next(done)} of {whole}, {what}, after {time.perf_counter() - start:.0f} s")

    with tempfile.TemporaryDirectory() as folder, ThreadPoolExecutor(JOBS) as pool:
        modules = translated(list(missing), Path(folder))
        working = [
            pool.submit(make, group, module, files)
            for group, module in modules
            for files in by_processor(missing[group])
        ]
        for each in working:
            each.result()


def translated(chosen: Sequence[Group], folder: Path) -> Iterator[tuple[Group, Path]]:
    """Translate kernels in one process; each group with its module in a file of a folder, as soon as that is there.

    Raises:
        BuildError: one of them cannot be translated.
    """
    names = [",".join(_names(group)) for group in chosen]
    command = [sys.executable, "-m", "build_kernels.compiling", str(folder), *names]
    with subprocess.Popen(
        command, cwd=ROOT, env=compiler_environment(), stdout=subprocess.PIPE, encoding="utf-8"
    ) as process:
        assert process.stdout is not None  # a pipe
        for group, name in zip(chosen, names, strict=True):
            if process.stdout.readline().strip() != name:
                raise BuildError(f"{name} does not compile, see above")
            yield group, folder / f"{name}.bc"


def remove_unused(kept: Path, used: Iterable[Path]) -> None:
    """Remove object files that no build has used for a week: another Python, or another branch, may use the others."""
    for file in used:
        os.utime(file)
    for file in kept.glob("*.o"):
        with contextlib.suppress(FileNotFoundError):  # a build beside this one was quicker
            # Object files of earlier builds are kept for a week after their last use [s].
            if time.time() - file.stat().st_mtime > 7 * 86400.0:
                file.unlink()


def build_or_exit(names: Sequence[str] = (), *, whole: bool = False) -> list[Path]:
    """Make the library of this machine, or those of others, with all kernels or for C, or end with one sentence."""
    folder, entries = (WHOLE, ENTRIES) if whole else (OTHERS, C_ENTRIES)
    try:
        return build_for(names, folder, entries=entries) if names else [build()]
    except BuildError as error:
        raise SystemExit(f"jacokin cannot be built: {error}") from None


def tell(text: str) -> None:
    """Say what takes long on stdout, and to who sits before the terminal: pip shows nothing of a build unless by -v."""
    print(text, flush=True)
    if not sys.stdout.isatty():
        with contextlib.suppress(OSError), TERMINAL.open("w", encoding="utf-8") as terminal:
            terminal.write(f"\r{text}\n")


def by_processor(files: dict[Target, Path]) -> list[dict[Target, Path]]:
    """The files of targets, those with the same processor together."""
    found: dict[object, dict[Target, Path]] = {}
    for target, file in files.items():
        found.setdefault(target.processor, {})[target] = file
    return list(found.values())


def emit_objects(group: Group, module: Path, files: dict[Target, Path]) -> None:
    """Make machine code of the module of a group, for targets with the same processor.

    Raises:
        BuildError: it does not compile.
    """
    unfinished = {target: file.with_suffix(f".{os.getpid()}") for target, file in files.items()}
    words = [word for target, file in unfinished.items() for word in (target.name, str(file))]
    command = [sys.executable, "-m", "build_kernels.emitting", str(module), *words]
    done = subprocess.run(command, cwd=ROOT, env=compiler_environment(), check=False)
    if done.returncode != 0:
        raise BuildError(f"{', '.join(_names(group))} does not compile, see above")
    for target, file in unfinished.items():
        file.replace(files[target])


def compiler_environment() -> dict[str, str]:
    """The environment without options of numba, which may change machine code; packages are found as here."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    return {**kept, "PYTHONPATH": os.pathsep.join(place for place in sys.path if place)}


def object_of(group: Group, kept: Path, target: Target) -> Path:
    """Where the object file of a group is kept."""
    words = (_names(group)[0], *([target.name] if target.name else []), object_key(group, target))
    return kept / f"{'-'.join(words)}.o"


def object_key(group: Group, target: Target = HERE) -> str:
    """A name that changes with everything the object file of a group depends on; comments may change.

    Raises:
        BuildError: a package that compiles is not installed.
    """
    digest = hashlib.sha256()
    compilers = (Path(__file__).with_name(f"{name}.py") for name in ("compiling", "passes", "emitting"))
    for file in (*sorted({file for entry in group for file in sources_of(entry)}), *compilers):
        digest.update(ast.dump(ast.parse(file.read_text(encoding="utf-8"))).encode())
    try:
        versions = [importlib.metadata.version(package) for package in COMPILERS]
    except importlib.metadata.PackageNotFoundError as error:
        raise BuildError(f"compiling the kernels takes {error.name}: `pip install -e '.[kernels]'`") from None
    machine = (platform.system(), platform.machine(), *filter(None, (target.triple, target.features)))
    digest.update(repr((_names(group), versions, platform.python_version(), *machine)).encode())
    return digest.hexdigest()[:16]


def sources_of(entry: Entry) -> list[Path]:
    """The module of an entry and those of kernels that it imports, and they in turn."""
    found: set[Path] = set()
    ahead = [entry.run.__module__]
    while ahead:
        file = PACKAGE.joinpath(*ahead.pop().split(".")[1:]).with_suffix(".py")
        if file not in found:
            found.add(file)
            ahead += _IMPORT.findall(file.read_text(encoding="utf-8"))
    return sorted(found)
