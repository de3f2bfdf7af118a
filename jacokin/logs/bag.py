"""`open_bag`: topics and messages of a .bag, .mcap or .db3 file, within bounds. Nothing else imports rosbags.

Types of messages are those of ROS and of this module, not what a file says of them; of the state of a controller, whose
fields differ between versions of ROS 2, the file's list of fields is taken.
"""

from __future__ import annotations

import bz2
import io
import re
import struct
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jacokin.errors import InvalidInputError, UnknownNameError, needed
from jacokin.files import HELD, LOG, open_bytes, parsing

if TYPE_CHECKING:
    from rosbags.interfaces import Connection
    from rosbags.rosbag1 import Reader as Reader1
    from rosbags.rosbag2 import Reader as Reader2
    from rosbags.typesys.store import Typestore

ENDINGS = (".bag", ".mcap", ".db3")
NOT_A_LOG = "is not a recording of ROS that can be read"
UNPACKED = 200_000_000  # [byte] of a chunk, which recorders close at about 1e6, or after a message that is larger
CHUNK, FOOTER = 0x06, 0x02  # records of MCAP

CONTROLLER_STATE = "control_msgs/msg/JointTrajectoryControllerState"
FIELD = re.compile(r"(std_msgs/Header|Header|string\[\]|trajectory_msgs/(?:MultiDOF)?JointTrajectoryPoint)\s+([a-z_]+)")
JOINTS = "".join(f"float32 joint{joint}\n" for joint in range(1, 8))
TOLERANCES = "control_msgs/JointTolerance[] path_tolerance\ncontrol_msgs/JointTolerance[] goal_tolerance\n"
#: Messages of packages that rosbags does not know: kinova_msgs (commit 924781d), and control_msgs 1.5 of ROS 1.
TEXTS = {
    "kinova_msgs/msg/JointAngles": JOINTS,
    "control_msgs/msg/JointTolerance": "string name\nfloat64 position\nfloat64 velocity\nfloat64 acceleration\n",
    "control_msgs/msg/FollowJointTrajectoryGoal": (
        f"trajectory_msgs/JointTrajectory trajectory\n{TOLERANCES}duration goal_time_tolerance\n"
    ),
    "control_msgs/msg/FollowJointTrajectoryActionGoal": (
        "Header header\nactionlib_msgs/GoalID goal_id\ncontrol_msgs/FollowJointTrajectoryGoal goal\n"
    ),
}


@dataclass(frozen=True, slots=True)
class Topic:
    """What a recording has of a topic."""

    name: str
    type: str
    """Of its messages, as "sensor_msgs/msg/JointState", of ROS 1 too."""
    count: int
    """Of its messages."""

    def __str__(self) -> str:
        """Name, type and count."""
        return f"{self.name} ({self.type}, {self.count})"


class Bag:
    """An open recording.

    Attributes:
        topics: by name, in order.
        start: when the first message was received [ns].
    """

    def __init__(self, path: Path, reader: Reader1 | Reader2, *, is_ros1: bool) -> None:
        """Read what there is of each topic.

        Raises:
            InvalidInputError: a topic has messages of several types.
        """
        self._path, self._reader, self._is_ros1 = path, reader, is_ros1
        self.start = int(reader.start_time)
        topics: dict[str, Topic] = {}
        for each in reader.connections:
            before = topics.get(each.topic)
            if before is not None and before.type != each.msgtype:
                raise InvalidInputError(f"{path}: {each.topic} has messages of {before.type} and of {each.msgtype}")
            count = each.msgcount + (0 if before is None else before.count)
            topics[each.topic] = Topic(each.topic, each.msgtype, count)
        self.topics: Mapping[str, Topic] = {name: topics[name] for name in sorted(topics)}

    def messages(self, name: str) -> Iterator[tuple[int, Any]]:
        """The messages of a topic, and when each was received [ns].

        Raises:
            UnknownNameError: no such topic; lists those that are there.
            InvalidInputError: messages that cannot be read, or too many.
        """
        if name not in self.topics:
            raise UnknownNameError("topic", name, self.topics)
        connections = [each for each in self._reader.connections if each.topic == name]
        store = self._typestore(connections)
        read: Callable[[bytes, str], object] = store.deserialize_ros1 if self._is_ros1 else store.deserialize_cdr
        for number, (connection, received, data) in enumerate(self._reader.messages(connections=connections)):
            if number >= HELD:
                raise InvalidInputError(f"{self._path}: {name} has more than {HELD} messages")
            yield received, read(data, connection.msgtype)

    def _typestore(self, connections: list[Connection]) -> Typestore:
        """What the messages of some connections are made of.

        Raises:
            InvalidInputError: of a type that is not known, or that has other fields here.
        """
        from rosbags.typesys import Stores, get_types_from_msg, get_typestore

        store, kind = get_typestore(Stores.ROS1_NOETIC if self._is_ros1 else Stores.ROS2_HUMBLE), connections[0].msgtype
        texts = {name: text for name, text in TEXTS.items() if self._is_ros1 or name.startswith("kinova_msgs")}
        if kind == CONTROLLER_STATE:
            texts[kind] = self._controller_fields(connections[0])
        for name, text in texts.items():
            if name not in store.fielddefs:
                store.register(get_types_from_msg(text, name))
        if kind not in store.fielddefs:
            raise InvalidInputError(f"{self._path}: messages of {kind} are not read")
        if self._is_ros1:
            digest = store.generate_msgdef(kind)[1]
            if any(each.digest not in (digest, "*") for each in connections):
                raise InvalidInputError(f"{self._path}: its messages of {kind} have other fields than those of ROS")
        return store

    def _controller_fields(self, connection: Connection) -> str:
        """The fields of a controller's state, as the file lists them.

        Raises:
            InvalidInputError: it does not, or lists others.
        """
        text = connection.msgdef.data[:100_000].split("=" * 80)[0]  # characters at most
        lines = [line.partition("#")[0].strip() for line in text.splitlines()]
        fields = [FIELD.fullmatch(line) for line in lines if line]
        if not fields or not all(fields):
            raise InvalidInputError(f"{self._path}: does not say what its messages of {CONTROLLER_STATE} are made of")
        return "".join(f"{field[1]} {field[2]}\n" for field in fields if field is not None)


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """A recording; whatever goes wrong in the block is an error in the file.

    Raises:
        InvalidInputError: cannot be read, too large, damaged, not closed, or of another kind.
        MissingExtraError: rosbags is not installed.
    """
    with needed("rosbags", "logs"):
        import rosbags.rosbag1
        import rosbags.rosbag2
    if path.suffix not in ENDINGS:
        inside = sorted(file.name for file in path.iterdir() if file.suffix in ENDINGS) if path.is_dir() else []
        advice = f"; in this folder {'are' if len(inside) > 1 else 'is'} {', '.join(inside)}" if inside else ""
        raise InvalidInputError(f"{path}: a recording of ROS ends in {', '.join(ENDINGS)}{advice}")
    with parsing(path, NOT_A_LOG), open_bytes(path) as file:
        if file.seek(0, io.SEEK_END) > LOG:
            raise InvalidInputError(f"{path}: is larger than the {LOG} bytes that are read of a recording")
        if path.suffix == ".bag":
            with rosbags.rosbag1.Reader(path) as first:
                _check_bag(file, first)
                yield Bag(path, first, is_ros1=True)
            return
        if path.suffix == ".db3" and re.search("[?#%]", str(path)):  # which SQLite would take for parts of an address
            raise InvalidInputError(f"{path}: is not read as long as ?, # or % are in its name")
        chunks = _mcap_chunks(file) if path.suffix == ".mcap" else {}
        with rosbags.rosbag2.Reader(path) as second:
            _check_index(second, chunks)
            yield Bag(path, second, is_ros1=False)


def _check_bag(file: io.BufferedReader, reader: Reader1) -> None:
    """Refuse chunks of ROS 1 that are larger than any recorder writes.

    Raises:
        ValueError: there is one.
    """
    for chunk in reader.chunks.values():
        file.seek(chunk.datapos)
        _check_packed(file.read(chunk.datasize))


def _mcap_chunks(file: io.BufferedReader) -> Mapping[int, tuple[int, int]]:
    """Where the chunks of an MCAP file begin, and how many bytes each has packed and unpacked.

    Raises:
        ValueError: damaged, or a chunk is larger than any recorder writes.
    """
    found: dict[int, tuple[int, int]] = {}
    position, end = 8, file.seek(0, io.SEEK_END)
    while position < end:
        file.seek(position)
        kind, size = struct.unpack("<BQ", _exactly(file, 9))
        if kind == FOOTER:
            return found
        if size > end - position:
            raise ValueError("it ends within a record: it is cut off, or was not closed (`mcap recover` may mend it)")
        if kind == CHUNK:
            _, _, unpacked, _, name = struct.unpack("<QQQII", _exactly(file, 32))
            file.seek(name, io.SEEK_CUR)
            (packed,) = struct.unpack("<Q", _exactly(file, 8))
            _check_packed(_exactly(file, min(packed, size)), unpacked)
            found[position] = (packed, unpacked)
        position += 9 + size
    raise ValueError("it has no end: it is cut off, or was not closed (`mcap recover` may mend it)")


def _check_index(reader: Reader2, chunks: Mapping[int, tuple[int, int]]) -> None:
    """Compare the index of an MCAP file with its chunks.

    Raises:
        ValueError: it names others.
    """
    for each in getattr(reader.storage, "chunks", ()):
        if chunks.get(each.chunk_start_offset) != (each.compressed_size, each.uncompressed_size):
            raise ValueError("its index does not fit its chunks")


def _exactly(file: io.BufferedReader, size: int) -> bytes:
    content = file.read(size)
    if len(content) < size:
        raise ValueError("it is cut off")
    return content


def _check_packed(packed: bytes, claimed: int = UNPACKED) -> None:
    """Refuse what unpacks to more than it says, or than any recorder writes.

    Raises:
        ValueError: it does.
    """
    import lz4.frame

    if sys.version_info >= (3, 14):
        from compression import zstd
    else:
        from backports import zstd

    makers: Mapping[bytes, Callable[[], Any]] = {
        b"BZh": bz2.BZ2Decompressor,
        b"\x04\x22\x4d\x18": lz4.frame.LZ4FrameDecompressor,
        b"\x28\xb5\x2f\xfd": zstd.ZstdDecompressor,
    }
    most = min(claimed, UNPACKED)
    make = next((make for magic, make in makers.items() if packed.startswith(magic)), None)
    if make is None:
        return
    unpacking = make()
    unpacked = len(unpacking.decompress(packed, max_length=most + 1))
    if unpacked > most or claimed > UNPACKED or not unpacking.eof or unpacking.unused_data:
        raise ValueError(f"a chunk unpacks to more than {most} bytes, or is damaged")
