"""Messages of ROS 1 that Debian does not package, made from their fields."""

from __future__ import annotations

from typing import Any

from genpy.dynamic import generate_dynamic


def make(package: str, texts: dict[str, str], used: tuple[Any, ...] = ()) -> dict[str, Any]:
    """The classes of messages of a package; `used` are classes of other packages that they are made of."""
    first, *_ = texts  # with it genpy makes all that follow, in one folder, which takes time to remove beside a node
    parts = [texts[first], *(f"MSG: {package}/{name}\n{text}" for name, text in texts.items())]
    parts += [f"MSG: {each._type}\n{each._full_text.split(RULE)[0]}" for each in used]
    made = generate_dynamic(f"{package}/{first}", f"\n{RULE}\n".join(parts))
    return {name: made[f"{package}/{name}"] for name in texts}


RULE = "=" * 80
