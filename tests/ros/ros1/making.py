"""Messages of ROS 1 that Debian does not package, made from their fields."""

from __future__ import annotations

from typing import Any

from genpy.dynamic import generate_dynamic


def make(package: str, texts: dict[str, str], used: tuple[Any, ...] = ()) -> dict[str, Any]:
    """The classes of messages of a package; `used` are classes of other packages that they are made of."""
    parts = [f"MSG: {package}/{name}\n{text}" for name, text in texts.items()]
    for each in used:
        parts += [f"MSG: {each._type}\n{each._full_text.split(RULE)[0]}"]
    made: dict[str, Any] = {}
    for name, text in texts.items():
        made[name] = generate_dynamic(f"{package}/{name}", f"\n{RULE}\n".join([text, *parts]))[f"{package}/{name}"]
    return made


RULE = "=" * 80
