"""Documents, JSON, YAML and TOML: read within bounds, with no name twice, and of the form that their reader takes.

A form looks like the documents that have it. `str`, `int`, `float`, `bool` and `None` stand for texts, whole numbers,
finite numbers, true or false and null, `object` for anything, a text for itself, `[form]` for a list, `(form, form)`
for either. A dict has the names that there must be; those with a "?" at the end may be left out, and others are
allowed. `{str: form}` has any names.
"""

from __future__ import annotations

import io
import math
from collections import Counter
from collections.abc import Hashable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jacokin.errors import InvalidInputError, shown
from jacokin.files import DOCUMENT, parsing, read_bytes

if TYPE_CHECKING:
    import yaml

# Bounds of what is read, by kind; what is larger is refused by name.
YAML = 1_000_000  # [byte]: 12,000 shapes of a scene, for which Python's reader of YAML takes 8 s
TOML = 250_000  # [byte]: a calibration takes 4,000
TOML_LINE = 1000  # characters: Python's reader takes the square of a dotted key's parts
NODES = 1_000_000  # of a YAML document, each counted wherever an alias repeats it
NUMBER = 1000  # characters of a number in YAML

WORDS: dict[object, str] = {
    str: "a text", int: "a whole number", float: "a finite number", bool: "true or false", None: "null",
}  # fmt: skip


def read_text(path: Path, largest: int = DOCUMENT) -> str:
    """A text in UTF-8, with or without the mark that some programs begin it with.

    Raises:
        InvalidInputError: as `read_bytes`, or it is not in UTF-8.
    """
    content = read_bytes(path, largest)
    with parsing(path, "is not a text file in UTF-8"):
        return io.TextIOWrapper(io.BytesIO(content), "utf-8-sig").read()


def read_json(path: Path, otherwise: str, form: object = object, largest: int = DOCUMENT) -> Any:  # Any: JSON
    """A JSON document of a form, in which no name is given twice.

    Args:
        path: the file.
        otherwise: what the error says of another one, such as "is not a recording".
        form: what it must be.
        largest: bytes that it may have.

    Raises:
        InvalidInputError: as `read_text`, or it is not that; says which name is missing, or what is wrong where.
    """
    text = read_text(path, largest)
    with parsing(path, otherwise):
        return parsed_json(text, form)


def parsed_json(text: object, form: object = object) -> Any:  # Any: JSON
    """The document of some JSON, as of `read_json`; within `parsing`, which names the file.

    Raises:
        ValueError: it is not text, not JSON, or not of this form.
    """
    import json

    if not isinstance(text, str | bytes):
        raise ValueError(f"expected JSON, got {shown(text)}")
    document = json.loads(text, object_pairs_hook=_without_repetition)
    check_form(document, form)
    return document


def check_form(value: object, form: object, place: str = "") -> None:
    """Check what a document holds.

    Args:
        value: the document, or what is at a place in it.
        form: what that must be.
        place: such as "points[3].positions".

    Raises:
        ValueError: it is not; says what is missing, or wrong, and where.
    """
    if isinstance(form, dict) and isinstance(value, dict):
        for name, inner in form.items():
            for each in value if name is str else (name.removesuffix("?"),):
                if each in value:
                    check_form(value[each], inner, f"{place}.{each}".lstrip("."))
                elif each == name:
                    raise ValueError(f"{place or 'it'} lacks {name!r}")
    elif isinstance(form, list) and isinstance(value, list):
        if form != [float] or not _are_numbers(value):
            for index, each in enumerate(value):
                check_form(each, form[0], f"{place}[{index}]")
    elif not any(_has_form(value, each) for each in (form if isinstance(form, tuple) else (form,))):
        raise ValueError(f"{place or 'it'} must be {_in_words(form)}, got {shown(value)}")


def _has_form(value: object, form: object) -> bool:
    """Whether a value is a kind of value, or has a form of which nothing needs to be said."""
    if isinstance(form, type):
        is_plain = form in (bool, object) or not isinstance(value, bool)  # True is a whole number to Python
        return _are_numbers([value]) if form is float else is_plain and isinstance(value, form)
    if form is None or isinstance(form, str):
        return value == form
    try:
        if type(value) is type(form):
            check_form(value, form)
    except ValueError:
        return False
    return type(value) is type(form)


def _are_numbers(values: Sequence[Any]) -> bool:
    """Whether all are finite numbers; a trajectory has millions."""
    try:
        return set(map(type, values)) <= {int, float} and all(map(math.isfinite, values))
    except OverflowError:  # a whole number beyond 1e308
        return False


def _in_words(form: object) -> str:
    if isinstance(form, tuple):
        return " or ".join(map(_in_words, form))
    if isinstance(form, dict):
        names = ", ".join(name for name in form if name is not str and not name.endswith("?"))
        return f"a mapping with {names}" if names else "a mapping"
    return "a list" if isinstance(form, list) else WORDS.get(form, repr(form))


def read_yaml(path: Path, otherwise: str) -> Any:  # Any: YAML
    """A YAML document of plain values; arguments and errors as `read_json`."""
    import yaml

    class Loader(yaml.SafeLoader):
        """YAML without repeated keys: YAML's own takes the last of two equal ones."""

        def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Hashable, object]:
            _without_repetition([(key.value, each) for key, each in node.value if key.tag == "tag:yaml.org,2002:str"])
            return super().construct_mapping(node, deep)

    def size(node: yaml.Node) -> int:
        """How many nodes it stands for, whatever is repeated by an alias; in `sizes`, so that each is counted once."""
        if id(node) in sizes:
            return sizes[id(node)]
        sizes[id(node)] = NODES  # if it is met within itself
        if isinstance(node, yaml.ScalarNode):
            if len(node.value) > NUMBER and not node.tag.endswith(":str"):
                raise ValueError(f"a number of {len(node.value)} characters")
            inner: Iterable[yaml.Node] = ()
        else:
            inner = (each for entry in node.value for each in (entry if isinstance(entry, tuple) else (entry,)))
        sizes[id(node)] = 1 + sum(map(size, inner))
        if sizes[id(node)] > NODES:
            raise ValueError(f"its aliases stand for more than {NODES} values")
        return sizes[id(node)]

    text = read_text(path, YAML)
    sizes: dict[int, int] = {}
    with parsing(path, otherwise):
        loader = Loader(text)
        node = loader.get_single_node()
        if node is None:
            return None
        size(node)
        return loader.construct_document(node)


def read_toml(path: Path, otherwise: str) -> dict[str, Any]:  # Any: TOML
    """A TOML document; arguments and errors as `read_json`."""
    import tomllib

    text = read_text(path, TOML)
    with parsing(path, otherwise):
        longest = max(map(len, text.splitlines()), default=0)
        if longest > TOML_LINE:
            raise ValueError(f"has a line of {longest} characters; at most {TOML_LINE} are read")
        return tomllib.loads(text)


def _without_repetition(pairs: Sequence[tuple[str, object]]) -> dict[str, object]:
    """A mapping of pairs.

    Raises:
        InvalidInputError: a key is given twice.
    """
    found = dict(pairs)
    if len(found) < len(pairs):
        (repeated, _), *_ = Counter(key for key, _ in pairs).most_common(1)
        raise InvalidInputError(f"the key {repeated!r} is given twice")
    return found
