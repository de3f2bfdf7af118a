"""A page of the viewer as a program: it sends what a browser's tab sends, and keeps what a tab would draw."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import urlsplit

import msgspec
import numpy as np
import viser
import zstandard
from numpy.typing import NDArray
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from jacokin.viewer import Viewer

PATIENCE = 30.0  # [s]
CAMERA = {
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (1.0, 1.0, 1.0),
    "fov": 1.0,
    "near": 0.1,
    "far": 10.0,
    "image_height": 100,
    "image_width": 100,
    "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}
Json = dict[str, Any]  # Any: what a message holds
PLACE = {"SetPositionMessage": "position", "SetOrientationMessage": "wxyz", "SetSceneNodeVisibilityMessage": "visible"}


@dataclass
class Node:
    """What the scene has under a name."""

    props: Json
    position: tuple[float, ...] = (0.0, 0.0, 0.0)
    wxyz: tuple[float, ...] = (1.0, 0.0, 0.0, 0.0)
    visible: bool = True

    @property
    def positions(self) -> NDArray[np.float32]:
        """(k, 3) of the instances of a mesh; none while it is out of sight."""
        rows: NDArray[np.float32] = self.props["batched_positions"].reshape(-1, 3)
        return rows if self.visible else rows[:0]


@dataclass
class Control:
    """A control of the panel."""

    uuid: str
    kind: str
    props: Json
    value: Any = None  # Any: of a slider, a check box, ...


@dataclass
class Screen:
    """What the server told a page so far."""

    nodes: dict[str, Node] = field(default_factory=dict)
    controls: dict[str, Control] = field(default_factory=dict)
    commands: dict[str, str] = field(default_factory=dict)  # uuid by label
    backlog: int = 0  # messages that the page was sent when it opened
    complete: bool = False  # whether it was sent all of them

    def take(self, message: Json) -> None:
        """Bring the screen up to date."""
        kind = message["type"]
        self.complete |= kind == "ReplayDoneMessage"
        self.backlog += not self.complete
        if kind == "RegisterCommandMessage":
            self.commands[message["props"]["label"]] = message["uuid"]
        elif kind == "GuiRemoveMessage":
            self.controls.pop(message["uuid"], None)
        elif kind == "GuiUpdateMessage" and message["uuid"] in self.controls:
            control = self.controls[message["uuid"]]
            for name, value in message["updates"].items():
                if name == "value":
                    control.value = value
                else:
                    control.props[name] = value
        elif kind.startswith("Gui") and "uuid" in message and "props" in message:
            found = Control(message["uuid"], kind, message["props"], message.get("value"))
            self.controls[found.uuid] = found
        elif kind == "RemoveSceneNodeMessage":
            self.nodes.pop(message["name"], None)
        elif kind == "SceneNodeUpdateMessage" and message["name"] in self.nodes:
            self.nodes[message["name"]].props.update(message["updates"])
        elif kind in PLACE and message["name"] in self.nodes:
            setattr(self.nodes[message["name"]], PLACE[kind], message[PLACE[kind]])
        elif "name" in message and "props" in message:
            self.nodes[message["name"]] = Node(message["props"])


class Page:
    """An open tab."""

    def __init__(self, socket: Connection) -> None:
        self._socket = socket
        self.screen = Screen()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        self.send("ViewerCameraMessage", **CAMERA)
        assert until(lambda: self.screen.complete), "the page was not told what there is"

    def send(self, kind: str, **fields: object) -> None:
        """Send any message."""
        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def move_gizmo(self, position: object, wxyz: object = (0.0, 1.0, 0.0, 0.0)) -> None:
        """Drag the gizmo to a place."""
        self.send("TransformControlsUpdateMessage", name="/target", wxyz=wxyz, position=position, owner="")

    def control(self, label: str) -> Control:
        """The control beside a text."""
        found = [each for each in list(self.screen.controls.values()) if each.props.get("label") == label]
        assert len(found) == 1, f"{len(found)} controls {label!r}"
        return found[0]

    def change(self, label: str, value: object) -> None:
        """Move the control beside a text."""
        control = self.control(label)
        control.value = value
        self.send("GuiUpdateMessage", uuid=control.uuid, updates={"value": value})

    def value(self, label: str) -> Any:  # Any: as of `Control`
        """What the control beside a text says."""
        return self.control(label).value

    def has(self, label: str) -> bool:
        """Whether there is a control beside a text."""
        return any(each.props.get("label") == label for each in list(self.screen.controls.values()))

    def click(self, label: str) -> None:
        """Click on a button."""
        self.send("GuiUpdateMessage", uuid=self.control(label).uuid, updates={"value": True})

    def press(self, command: str) -> None:
        """Press the key of a command."""
        self.send("CommandTriggerMessage", uuid=self.screen.commands[command])

    def node(self, name: str) -> Node:
        """What the scene has under a name."""
        return self.screen.nodes[name]

    def names(self, prefix: str) -> set[str]:
        """The names of nodes that begin so and are in sight, without their beginning."""
        nodes = list(self.screen.nodes.items())
        return {name.removeprefix(prefix) for name, node in nodes if name.startswith(prefix) and node.visible}

    @property
    def text(self) -> str:
        """What the panel says in words."""
        return "\n".join(
            each.props["content"] for each in list(self.screen.controls.values()) if "content" in each.props
        )

    @property
    def ghosts(self) -> int:
        """How many ghosts the scene draws of the part of which it draws most: not those where the arm itself is."""
        drawn: dict[str, int] = {}
        for name, node in list(self.screen.nodes.items()):
            if name.startswith(("/ghosts/", "/wires/")):
                part = name.rpartition("/")[2]
                drawn[part] = drawn.get(part, 0) + len(node.positions)
        return max(drawn.values(), default=0)

    def _read(self) -> None:
        with contextlib.suppress(ConnectionClosed):
            for data in self._socket:
                assert isinstance(data, bytes)
                for message in decode(data):
                    self.screen.take(message)


def decode(data: bytes) -> list[Json]:
    """The messages of a window: packed and compressed, then their arrays, each on a multiple of 8 bytes."""
    size, packed = (int.from_bytes(data[start : start + 8], "little") for start in (0, 8))
    inner = zstandard.ZstdDecompressor().decompress(data[16 : 16 + packed], max_output_size=size)
    window = msgspec.msgpack.decode(inner)
    arrays, start = [], 16 + packed
    for length in window["binaryBufferLengths"]:
        start += -start % 8
        arrays.append(data[start : start + length])
        start += length

    def filled(value: Any) -> Any:  # Any: JSON with arrays
        if isinstance(value, dict):
            if "__binary_index" in value:
                return np.frombuffer(arrays[value["__binary_index"]], dtype=value["dtype"])
            return {key: filled(each) for key, each in value.items()}
        return [filled(each) for each in value] if isinstance(value, list) else value

    return [filled(message) for message in window["messages"]]


def port_of(viewer: Viewer) -> int:
    """The port in a viewer's address."""
    return urlsplit(viewer.url).port or 0


@contextlib.contextmanager
def opened(viewer: Viewer, origin: str | None = None) -> Iterator[Page]:
    """A tab whose page the viewer itself served."""
    with connect(
        viewer.url.replace("http", "ws"),
        origin=origin or viewer.url.split("/?")[0],  # type: ignore[arg-type]  # a NewType of str
        subprotocols=[f"viser-v{viser.__version__}"],  # type: ignore[list-item]  # as above
        max_size=None,
        open_timeout=PATIENCE,
        max_queue=None,  # what is not read must not keep the connection from closing
    ) as socket:
        yield Page(socket)


def until(condition: Callable[[], object], patience: float = PATIENCE) -> bool:
    """Whether a condition comes true in time [s]."""
    end = time.monotonic() + patience
    while not condition():
        if time.monotonic() > end:
            return False
        time.sleep(0.005)
    return True


def repeat(action: Callable[[], object], condition: Callable[[], object], pause: float = 0.05) -> bool:
    """Whether a condition comes true in time while something is done again and again, with pauses [s] between."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        action()
        if until(condition, pause):
            return True
    return False
