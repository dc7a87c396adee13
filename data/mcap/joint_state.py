"""`sensor_msgs/msg/JointState` in CDR, written a whole array of messages at a time.

CDR (ROS 2's little-endian XCDR1) writes a four-byte header, then the fields in order, each aligned to its
own size counted from after that header; strings carry a length and a NUL, sequences a count. For one joint
and one frame every message of a topic therefore has the same shape, and the numbers stand at fixed offsets:

    header 00 01 00 00 | sec i32 | nanosec u32 | frame_id | name[] | position[] | velocity[] | effort[]

`JointStates` holds that shape: the bytes that never change (`template`) and where the numbers go. Writing
copies the template n times and fills the numbers in. `ros_layout` reads such messages, and any others.

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
class JointStates:
    """The shape shared by all messages of one topic: what never changes, and where the numbers stand."""

    template: ByteArray  # (size,) a message whose numbers are zero
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
    """Lays a message out byte by byte."""

    def __init__(self) -> None:
        self.content = bytearray(_ENCAPSULATION)

    def align(self, size: int) -> None:
        self.content += bytes(-(len(self.content) - _STAMP) % size)

    def count(self, value: int) -> None:
        self.align(4)
        self.content += struct.pack("<I", value)

    def string(self, text: bytes) -> None:
        self.count(len(text) + 1)
        self.content += text + b"\0"

    def numbers(self, count: int) -> int:
        self.count(count)
        if not count:
            return 0
        self.align(8)
        where = len(self.content)
        self.content += bytes(8 * count)
        return where


def layout(*, frame: str, names: tuple[str, ...], counts: tuple[int, int, int]) -> JointStates:
    """Lay out the messages of a frame; `counts` are the lengths of position, velocity and effort."""
    shape = _Shape()
    shape.content += bytes(8)  # the stamp
    shape.string(frame.encode())
    shape.count(len(names))
    for name in names:
        shape.string(name.encode())
    position, velocity, effort = (shape.numbers(count) for count in counts)
    return JointStates(
        template=np.frombuffer(bytes(shape.content), np.uint8),
        counts=counts,
        places=(position, velocity, effort),
    )


def encode(shape: JointStates, *, stamp: NDArray[np.int64], signals: dict[str, FloatArray]) -> ByteArray:
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
