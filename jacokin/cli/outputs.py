"""`keep_apart`: refuse output files that the command reads, also through links."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

from jacokin.errors import InvalidInputError

# Meshes, textures and included files in a URDF or MJCF, and the folders MJCF looks for them in.
_REFERENCE = re.compile(r"""\b(?:file|filename)\s*=\s*["']([^"']+)["']""")
_FOLDER = re.compile(r"""\b(?:meshdir|texturedir|assetdir)\s*=\s*["']([^"']+)["']""")
_SCHEME = re.compile(r"^(?:package|file)://")


def keep_apart(
    outputs: Mapping[str, Path | None], inputs: Mapping[str, str | Path | None], folders: Sequence[Path] = ()
) -> None:
    """Refuse outputs that are inputs, or one file under two options.

    Args:
        outputs: option and file; None where it is not given.
        inputs: option and file, or the name of a bundled robot.
        folders: where packages of robots are looked for.

    Raises:
        InvalidInputError: names the two options.
    """
    written: dict[Path, str] = {}
    for option, output in outputs.items():
        if output is None:
            continue
        other = written.setdefault(_resolved(output), option)
        if other != option:
            raise InvalidInputError(f"{option} and {other} are the same file, {output}")
        if output.is_file():
            _keep_apart(option, output, inputs, folders)


def _keep_apart(option: str, output: Path, inputs: Mapping[str, str | Path | None], packages: Sequence[Path]) -> None:
    for name, given in inputs.items():
        for read in [] if given is None else _read_files(Path(given), packages):
            if output.samefile(read):
                raise InvalidInputError(f"{option} {output} is a file that {name} reads: it would be lost")


def _resolved(path: Path) -> Path:
    try:
        return path.resolve()
    except (OSError, RuntimeError):  # a loop of links, refused when it is opened
        return path


def _read_files(path: Path, packages: Sequence[Path]) -> Iterator[Path]:
    """A file and those that it names, if it is a robot description."""
    seen: set[Path] = set()
    ahead = [path]
    while ahead:
        file = ahead.pop()
        if file in seen or not file.is_file():
            continue
        seen.add(file)
        yield file
        if file.suffix.lower() in (".urdf", ".xml", ".mjcf"):
            text = file.read_text(encoding="utf-8", errors="replace")
            folders = [*packages, path.parent, file.parent, *(path.parent / folder for folder in _FOLDER.findall(text))]
            names = [_SCHEME.sub("", name) for name in _REFERENCE.findall(text)]
            ahead += [folder / name for folder in folders for name in names]
