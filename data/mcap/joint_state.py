"""`sensor_msgs/msg/JointState` in CDR, a whole array of messages at a time.

CDR (ROS 2's little-endian XCDR1) writes a four-byte header, then the fields in order, each aligned to its
own size counted from after that header; strings carry a length and a NUL, sequences a count. For one joint
and one frame every message of a topic therefore has the same shape, and the numbers stand at fixed offsets:

    header 00 01 00 00 | sec i32 | nanosec u32 | frame_id | name[] | position[] | velocity[] | effort[]

`Layout` holds that shape: the bytes that never change (`template`) and where the numbers go. Writing copies
the template n times and fills the numbers in; reading proves, message by message, that every byte that is
neither a number nor padding equals the template, and only then takes the numbers. Two frames of different
length can give messages of one size, so a size proves nothing.

Source: OMG DDS-XTYPES 1.3, section 7.4 (encoding version 1); ROS 2 common_interfaces, sensor_msgs.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.findings import LogError

FloatArray = NDArray[np.float64]
ByteArray = NDArray[np.uint8]

SCHEMA_NAME: Final = "sensor_msgs/msg/JointState"
SCHEMA: Final = """\
# One joint state: the arrays have the length of name, or are empty.
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
SIGNALS: Final = ("position", "velocity", "effort")
_ENCAPSULATION: Final = b"\x00\x01\x00\x00"  # CDR, little-endian
_STAMP: Final = len(_ENCAPSULATION)


@dataclass(frozen=True)
class Layout:
    """The shape shared by all messages of one topic: what never changes, and where the numbers stand."""

    template: ByteArray  # (size,) a message whose numbers are zero
    fixed: tuple[tuple[int, int], ...]  # stretches of bytes that must equal the template
    frame: str
    names: tuple[str, ...]
    counts: tuple[int, int, int]  # lengths of position, velocity and effort
    places: tuple[int, int, int]  # byte offsets of their first numbers; 0 where empty

    @property
    def size(self) -> int:
        """Bytes in a message."""
        return self.template.size

    def count(self, signal: str) -> int:
        """How many numbers a signal's array holds."""
        return self.counts[SIGNALS.index(signal)]

    def place(self, signal: str) -> int:
        """Byte offset of a signal's first number."""
        return self.places[SIGNALS.index(signal)]


class _Shape:
    """Lays a message out byte by byte, noting which bytes are fixed (neither a number nor padding)."""

    def __init__(self) -> None:
        self.content = bytearray(_ENCAPSULATION)
        self.fixed: list[tuple[int, int]] = [(0, _STAMP)]

    def align(self, size: int) -> None:
        self.content += bytes(-(len(self.content) - _STAMP) % size)

    def keep(self, raw: bytes) -> None:
        self.fixed.append((len(self.content), len(self.content) + len(raw)))
        self.content += raw

    def count(self, value: int) -> None:
        self.align(4)
        self.keep(struct.pack("<I", value))

    def string(self, text: bytes) -> None:
        self.count(len(text) + 1)
        self.keep(text + b"\0")

    def numbers(self, count: int) -> int:
        self.count(count)
        if not count:
            return 0
        self.align(8)
        where = len(self.content)
        self.content += bytes(8 * count)
        return where


def layout(*, frame: str, names: tuple[str, ...], counts: tuple[int, int, int]) -> Layout:
    """Lay out the messages of a frame; `counts` are the lengths of position, velocity and effort."""
    shape = _Shape()
    shape.content += bytes(8)  # the stamp
    shape.string(frame.encode())
    shape.count(len(names))
    for name in names:
        shape.string(name.encode())
    position, velocity, effort = (shape.numbers(count) for count in counts)
    return Layout(
        template=np.frombuffer(bytes(shape.content), np.uint8),
        fixed=tuple(shape.fixed),
        frame=frame,
        names=names,
        counts=counts,
        places=(position, velocity, effort),
    )


def encode(shape: Layout, *, stamp: NDArray[np.int64], signals: dict[str, FloatArray]) -> ByteArray:
    """Messages (n, size) of one joint.

    Parameters
    ----------
    shape
        From `layout`.
    stamp
        (n,) header stamps [ns].
    signals
        The arrays (n,) of those of position, velocity and effort that the layout holds.
    """
    rows = np.tile(shape.template, (stamp.size, 1))
    seconds, nanoseconds = np.divmod(stamp, 1_000_000_000)
    if np.any(np.abs(seconds) > np.iinfo(np.int32).max):
        raise LogError("a ROS 2 header stamp holds 32-bit seconds; the times of this log do not fit")
    _put(rows, _STAMP, seconds.astype("<i4"))
    _put(rows, _STAMP + 4, nanoseconds.astype("<u4"))
    for signal, values in signals.items():
        if shape.count(signal) != 1:
            raise LogError(f"the message layout has {shape.count(signal)} numbers in {signal}, not 1")
        _put(rows, shape.place(signal), values.astype("<f8"))
    return rows


def _put(rows: ByteArray, offset: int, values: NDArray[np.generic]) -> None:
    width = values.dtype.itemsize
    rows[:, offset : offset + width] = np.ascontiguousarray(values).view(np.uint8).reshape(-1, width)


def recognise(message: bytes) -> Layout | None:
    """The layout that a message has, None when it is not one that can be proved byte by byte."""
    try:
        frame, names, counts = _read_shape(message)
        shape = layout(frame=frame, names=names, counts=counts)
    except (struct.error, UnicodeDecodeError, ValueError):
        return None
    return shape if shape.size == len(message) else None


def _read_shape(message: bytes) -> tuple[str, tuple[str, ...], tuple[int, int, int]]:
    """Frame, joint names and array lengths; ValueError where they do not fit into the message."""
    here = _STAMP + 8

    def count(size: int) -> int:
        nonlocal here
        here += -(here - _STAMP) % 4
        (value,) = struct.unpack_from("<I", message, here)
        here += 4
        if value * size > len(message) - here:
            raise ValueError(f"{value} elements do not fit")
        return int(value)

    def string() -> str:
        nonlocal here
        length = count(1)
        raw = message[here : here + length]
        here += length
        if not raw.endswith(b"\0"):
            raise ValueError("a string without its NUL")
        return raw[:-1].decode()

    def numbers() -> int:
        nonlocal here
        length = count(8)
        if length:
            here += -(here - _STAMP) % 8 + 8 * length
        return length

    frame = string()
    names = tuple(string() for _ in range(count(4)))
    return frame, names, (numbers(), numbers(), numbers())


def matches(shape: Layout, rows: ByteArray) -> NDArray[np.bool_]:
    """For each message of `rows` (n, size), whether every fixed byte is the layout's: (n,)."""
    same = np.ones(rows.shape[0], np.bool_)
    for begin, end in shape.fixed:
        same &= (rows[:, begin:end] == shape.template[begin:end]).all(axis=1)
    return same


def stamps(rows: ByteArray) -> NDArray[np.int64]:
    """Header stamps (n,) [ns] of messages (n, size)."""
    seconds = rows[:, _STAMP : _STAMP + 4].view("<i4").reshape(-1)
    rest = rows[:, _STAMP + 4 : _STAMP + 8].view("<u4").reshape(-1)
    return seconds.astype(np.int64) * 1_000_000_000 + rest.astype(np.int64)


def numbers(rows: ByteArray, place: int) -> FloatArray:
    """The numbers (n,) at byte `place` of messages (n, size)."""
    column: FloatArray = rows[:, place : place + 8].view("<f8").reshape(-1)
    return column


def is_joint_state(name: str, text: str) -> bool:
    """Whether a ros2msg schema is this message's, comments and blank lines aside."""
    return name == SCHEMA_NAME and _definitions(text) == _definitions(SCHEMA)


def _definitions(text: str) -> list[str]:
    lines = (" ".join(line.split("#", 1)[0].split()) for line in text.splitlines())
    return [line for line in lines if line and not line.startswith("===")]
