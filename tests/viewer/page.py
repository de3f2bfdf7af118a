"""A page of the viewer as a program: what a browser's tab sends and receives, without drawing."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Protocol

import msgspec
import viser
from websockets.sync.client import connect
from websockets.sync.connection import Connection

from jacokin.viewer import Viewer

PATIENCE = 30.0  # [s]


class _State(Protocol):
    uuid: str


class _Handle(Protocol):
    """A control of viser, whatever its value."""

    @property
    def _impl(self) -> _State: ...


class Page:
    """An open tab."""

    def __init__(self, socket: Connection) -> None:
        self._socket = socket
        self.send(
            "ViewerCameraMessage",
            wxyz=(1.0, 0.0, 0.0, 0.0),
            position=(1.0, 1.0, 1.0),
            fov=1.0,
            near=0.1,
            far=10.0,
            image_height=100,
            image_width=100,
            look_at=(0.0, 0.0, 0.0),
            up_direction=(0.0, 0.0, 1.0),
        )

    def send(self, kind: str, **fields: object) -> None:
        self._socket.send(msgspec.msgpack.encode({"type": kind, **fields}))

    def move_gizmo(self, position: object, wxyz: object = (0.0, 1.0, 0.0, 0.0)) -> None:
        self.send("TransformControlsUpdateMessage", name="/target", wxyz=wxyz, position=position, owner="")

    def set(self, control: _Handle, value: object) -> None:
        self.send("GuiUpdateMessage", uuid=control._impl.uuid, updates={"value": value})


@contextlib.contextmanager
def opened(viewer: Viewer, origin: str | None = None) -> Iterator[Page]:
    """A tab whose page the viewer itself served."""
    address = viewer.url.removeprefix("http://")
    with connect(
        f"ws://{address}",
        origin=origin or viewer.url,  # type: ignore[arg-type]  # a NewType of str
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
