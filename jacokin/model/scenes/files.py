"""Scenes in files, YAML or JSON: a list of shapes, or a mapping with `obstacles` and `finger_angle`."""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable, Mapping, Sequence
from pathlib import Path

import pinocchio as pin
from numpy.typing import ArrayLike

from jacokin.errors import InvalidInputError, UnknownNameError, shown
from jacokin.model import checks
from jacokin.model.obstacles import Box, Capsule, Cylinder, Floor, Obstacle, Sphere
from jacokin.model.pose_targets import pose

ENDINGS = (".yaml", ".yml", ".json")
LARGEST = 10_000_000  # [byte] of a file
PLACE = ("position", "quat_wxyz", "rpy")
# Keys of each shape beside its name; every one but the orientation and the height is needed.
KEYS = {
    "box": ("size", *PLACE),
    "sphere": ("radius", "position"),
    "capsule": ("radius", "length", *PLACE),
    "cylinder": ("radius", "length", *PLACE),
    "floor": ("height",),
}
OPTIONAL = ("quat_wxyz", "rpy", "height")
ALL_KEYS = ("shape", "name", *dict.fromkeys(key for keys in KEYS.values() for key in keys))


def read(path: str | Path) -> tuple[list[Obstacle], float | None]:
    """The shapes of a file and its finger angle.

    Raises:
        InvalidInputError: no such file, another ending, malformed, or wrong numbers; names the entry.
        UnknownNameError: an unknown shape or key.
    """
    if not isinstance(path, str | Path):
        raise InvalidInputError(f"path must be a file name, got {shown(path)}")
    file = Path(path)
    content = _content(file)
    finger_angle = None
    if isinstance(content, Mapping):
        _check_keys(str(file), content, ("obstacles", "finger_angle"))
        if content.get("finger_angle") is not None:
            finger_angle = checks.number(f"{file}: finger_angle", content["finger_angle"], "rad")
        content = content.get("obstacles", [])
    if not isinstance(content, list):
        raise InvalidInputError(f"{file}: obstacles must be a list of shapes, got {shown(content)}")
    return [_obstacle(f"{file}, obstacle {index}", entry, index) for index, entry in enumerate(content)], finger_angle


def _content(file: Path) -> object:
    """What a file holds, as plain Python."""
    import yaml

    ending = file.suffix.lower()
    if ending not in ENDINGS:
        raise InvalidInputError(f"the file of a scene must end in {' or '.join(ENDINGS)}, got {str(file)!r}")
    try:
        if file.stat().st_size > LARGEST:
            raise InvalidInputError(f"{file} is larger than {LARGEST} bytes: not a scene")
        text = file.read_text(encoding="utf-8")
    except OSError as error:
        raise InvalidInputError(f"cannot read {file}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise InvalidInputError(f"{file}: not a text file: {error}") from error

    class Loader(yaml.SafeLoader):
        """YAML's own takes the last of two equal keys."""

        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, object]:
            _once([(key.value, value) for key, value in node.value if key.tag == "tag:yaml.org,2002:str"])
            return super().construct_mapping(node, deep)

    try:
        if ending == ".json":
            return json.loads(text, object_pairs_hook=_once)
        return yaml.load(text, Loader)
    except InvalidInputError as error:
        raise InvalidInputError(f"{file}: {error}") from error
    except (ValueError, yaml.YAMLError, RecursionError) as error:
        raise InvalidInputError(f"{file}: not a {ending[1:].upper()} file: {error}") from error


def _once(pairs: Sequence[tuple[str, object]]) -> dict[str, object]:
    """A mapping without a key that is given twice.

    Raises:
        InvalidInputError: there is one.
    """
    found = dict(pairs)
    if len(found) < len(pairs):
        keys = [key for key, _ in pairs]
        raise InvalidInputError(f"the key {next(key for key in keys if keys.count(key) > 1)!r} is given twice")
    return found


def _obstacle(where: str, entry: object, index: int) -> Obstacle:
    """One shape.

    Raises:
        InvalidInputError: malformed.
        UnknownNameError: an unknown shape or key.
    """
    if not isinstance(entry, Mapping):
        raise InvalidInputError(f"{where} must be a mapping with the key 'shape', got {shown(entry)}")
    if "shape" not in entry:
        _check_keys(where, entry, ALL_KEYS)
        raise InvalidInputError(f"{where}: needs the key 'shape', one of {', '.join(KEYS)}")
    shape = checks.choice(f"shape in {where}:", entry["shape"], KEYS)
    _check_keys(where, entry, ("shape", "name", *KEYS[shape]))
    missing = [key for key in KEYS[shape] if key not in entry and key not in OPTIONAL]
    if missing:
        raise InvalidInputError(f"{where}: {shape} needs {', '.join(missing)}")
    name = entry.get("name", f"{shape}_{index}")
    if not isinstance(name, str) or not name:
        raise InvalidInputError(f"{where}: name must be a word, got {shown(name)}")
    try:
        return _BUILD[shape](name, entry)
    except InvalidInputError as error:
        raise InvalidInputError(f"{where}: {error}") from error


def _check_keys(where: str, entry: Mapping[object, object], known: tuple[str, ...]) -> None:
    for key in entry:
        if key not in known:
            raise UnknownNameError(f"key in {where}:", key, known)


def _pose(entry: Mapping[str, ArrayLike]) -> pin.SE3:
    return pose(entry["position"], quat_wxyz=entry.get("quat_wxyz"), rpy=entry.get("rpy"))


def _round(kind: type[Capsule] | type[Cylinder]) -> Callable[[str, Mapping[str, ArrayLike]], Obstacle]:
    return lambda name, entry: kind(name, entry["radius"], entry["length"], _pose(entry))  # type: ignore[arg-type]  # checked there


_BUILD: dict[str, Callable[[str, Mapping[str, ArrayLike]], Obstacle]] = {
    "box": lambda name, entry: Box(name, entry["size"], _pose(entry)),
    "sphere": lambda name, entry: Sphere(name, entry["radius"], entry["position"]),  # type: ignore[arg-type]  # checked there
    "capsule": _round(Capsule),
    "cylinder": _round(Cylinder),
    "floor": lambda name, entry: Floor(entry.get("height", 0.0), name),  # type: ignore[arg-type]  # checked there
}
