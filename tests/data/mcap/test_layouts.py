"""Whole arrays of messages equal the ordinary decoders, bit for bit, whatever the encoding."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Sequence
from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, timestamp_pb2
from google.protobuf.message_factory import GetMessageClass
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.records import Channel, Schema
from mcap_ros2._dynamic import serialize_dynamic

from data.findings import LogError
from data.mcap import protobuf, protobuf_layout, ros1, ros_layout
from data.mcap.columns import read_columns
from data.mcap.decoding import decoder
from data.mcap.field_path import FieldPath, parse_path, resolve
from data.mcap.json_layout import JsonReader
from data.mcap.json_scan import POWERS, nearest
from data.mcap.layout import Layout, Taken, place, take
from data.mcap.records import Damage, _scanned, _stepped, tile
from data.mcap.records import messages as messages_of
from data.mcap.ros_definitions import parse_definition
from data.mcap.stamp import header_stamp
from tests.data import hostile

FINITE = st.floats(allow_nan=False, allow_infinity=False)
WIDTHS = {"int8": 8, "int16": 16, "int32": 32, "int64": 64}


def block_of(messages: Sequence[bytes]) -> tuple[np.ndarray, np.ndarray]:
    """Messages one behind the other, odd bytes between them, and where each begins."""
    begins, raw = [], b"xyz"
    for message in messages:
        begins.append(len(raw))
        raw += message + b"???"
    return np.frombuffer(raw, np.uint8), np.array(begins)


def assert_same(
    layout: Layout, messages: Sequence[bytes], decoded: Sequence[object], paths: Sequence[str]
) -> None:
    """Numbers and stamps of messages that have a layout are those of the ordinary decoder."""
    asked = [parse_path(f"/t:{text}") for text in paths]
    expected = np.array([[resolve(message, path) for message in decoded] for path in asked])
    for compiled in (False, True):
        taken = taken_of(layout, messages, asked, compiled=compiled)
        assert not taken.left.any()
        np.testing.assert_array_equal(taken.values.view(np.int64), expected.view(np.int64))
        assert taken.header.tolist() == [header_stamp(message) for message in decoded]


def taken_of(
    layout: Layout, messages: Sequence[bytes], paths: Sequence[FieldPath] = (), *, compiled: bool
) -> Taken:
    """What is taken of messages by a layout."""
    block, begin = block_of(messages)
    length = np.array([len(message) for message in messages])
    places = [own for path in paths if (own := place(layout, path)) is not None]
    assert len(places) == len(paths)
    taken = Taken.nothing(len(paths), len(messages))
    take(layout, places, block, (begin, length), taken, compiled=compiled)
    return taken


# ROS 2 and ROS 1 ----------------------------------------

DEFINITION = """\
std_msgs/Header header
uint8 MODE_A=1
string label
bool on
float32 small
int8 tiny
pkg/Motor[] motors
float64[] q
uint16[3] raw
int64 count
string[] name
# a comment
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
================================================================================
MSG: pkg/Motor
float64 current
int32[2] pair
"""
TEXT = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=5)
SHAPE = st.tuples(st.integers(0, 3), st.integers(0, 3), TEXT, TEXT)


@st.composite
def ros_messages(draw: st.DrawFn) -> tuple[list[dict[str, Any]], int, int]:
    """Messages of one shape with other numbers, and the lengths of `motors` and `q`."""
    motors, q, label, frame = draw(SHAPE)
    wide = st.integers(-(2**31), 2**31 - 1)
    return (
        [
            {
                "header": {
                    "stamp": {"sec": draw(wide), "nanosec": draw(st.integers(0, 2**32 - 1))},
                    "frame_id": frame,
                },
                "label": label,
                "on": draw(st.booleans()),
                "small": draw(st.floats(width=32)),
                "tiny": draw(st.integers(-128, 127)),
                "motors": [
                    {"current": draw(st.floats()), "pair": [draw(wide), draw(wide)]} for _ in range(motors)
                ],
                "q": [draw(st.floats()) for _ in range(q)],
                "raw": [draw(st.integers(0, 65535)) for _ in range(3)],
                "count": draw(st.integers(-(2**63), 2**63 - 1)),
                "name": [f"joint{k}" for k in range(q)],
            }
            for _ in range(3)
        ],
        motors,
        q,
    )


def ros_paths(motors: int, q: int) -> list[str]:
    found = ["small", "tiny", "count", "raw[0]", "raw[2]", "header.stamp.nanosec"]
    found += [f"q[{k}]" for k in range(q)] + [f"q{{joint{k}}}" for k in range(q)]
    return found + [f"motors[{k}].{end}" for k in range(motors) for end in ("current", "pair[1]")]


ENCODE = serialize_dynamic("pkg/msg/State", DEFINITION)["pkg/msg/State"]
CDR = decoder(
    Channel(id=1, topic="/t", message_encoding="cdr", metadata={}, schema_id=1),
    Schema(id=1, name="pkg/msg/State", encoding="ros2msg", data=DEFINITION.encode()),
)


@settings(max_examples=150, deadline=None)
@given(ros_messages())
def test_cdr_of_any_definition(drawn: tuple[list[dict[str, Any]], int, int]) -> None:
    contents, motors, q = drawn
    messages = [ENCODE(content) for content in contents]
    layout = ros_layout.recognise(parse_definition("pkg/msg/State", DEFINITION, "ros2"), "ros2", messages[0])
    assert layout is not None
    assert_same(layout, messages, [CDR(raw) for raw in messages], ros_paths(motors, q))


def ros1_message(content: dict[str, Any], seq: int) -> bytes:
    """The same message as ROS 1 writes it."""

    def text(value: str) -> bytes:
        return struct.pack("<I", len(value.encode())) + value.encode()

    stamp = content["header"]["stamp"]
    raw = struct.pack("<III", seq, stamp["sec"] % 2**32, stamp["nanosec"]) + text(
        content["header"]["frame_id"]
    )
    raw += text(content["label"]) + struct.pack("<?fb", content["on"], content["small"], content["tiny"])
    raw += struct.pack("<I", len(content["motors"]))
    for motor in content["motors"]:
        raw += struct.pack("<d2i", motor["current"], *motor["pair"])
    raw += struct.pack(f"<I{len(content['q'])}d", len(content["q"]), *content["q"])
    raw += struct.pack("<3Hq", *content["raw"], content["count"]) + struct.pack("<I", len(content["name"]))
    return raw + b"".join(map(text, content["name"]))


ROS1_DEFINITION = DEFINITION.replace("std_msgs/Header header", "Header header").replace(
    "builtin_interfaces/Time stamp", "uint32 seq\ntime stamp"
)


@settings(max_examples=150, deadline=None)
@given(ros_messages())
def test_ros1_of_any_definition(drawn: tuple[list[dict[str, Any]], int, int]) -> None:
    contents, motors, q = drawn
    fields = parse_definition("pkg/State", ROS1_DEFINITION, "ros1")
    messages = [ros1_message(content, k) for k, content in enumerate(contents)]
    decoded = [ros1.decode(fields, raw) for raw in messages]
    assert [own["count"] for own in decoded] == [content["count"] for content in contents]
    assert [own["label"] for own in decoded] == [content["label"] for content in contents]
    layout = ros_layout.recognise(fields, "ros1", messages[0])
    assert layout is not None
    paths = [path.replace("nanosec", "nsecs") for path in ros_paths(motors, q)]
    assert_same(layout, messages, decoded, paths)


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=120), st.sampled_from(["ros1", "ros2"]))
def test_no_bytes_upset_the_ros_layouts(raw: bytes, dialect: Any) -> None:
    definition = DEFINITION if dialect == "ros2" else ROS1_DEFINITION
    fields = parse_definition("pkg/State", definition, dialect)
    assert ros_layout.recognise(fields, dialect, raw[:1]) is None
    layout = ros_layout.recognise(fields, dialect, raw if dialect == "ros1" else b"\0\1\0\0" + raw)
    assert layout is None or layout.size >= len(raw)


def test_every_fixed_byte_of_a_message_is_proved_and_no_other() -> None:
    content = {"q": [1.5], "name": ["a"], "label": "b", "raw": [1, 2, 3], "on": True}
    message = bytearray(ENCODE(content))
    layout = ros_layout.recognise(
        parse_definition("pkg/msg/State", DEFINITION, "ros2"), "ros2", bytes(message)
    )
    assert layout is not None
    for k in range(len(message)):
        mutant = bytearray(message)
        mutant[k] ^= 0x55
        for compiled in (False, True):
            assert taken_of(layout, [bytes(mutant)], compiled=compiled).left[0] == (layout.mask[k] != 0)


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ("pkg/Other x", "uses pkg/Other"),
        ("what", "is no field"),
        ("float64 x\n" * 5000, "more than 1024 fields"),
        ("pkg/State again", "nests more than"),
    ],
)
def test_definitions_that_cannot_be_are_refused_by_name(text: str, why: str) -> None:
    with pytest.raises(LogError, match=why):
        parse_definition("pkg/State", text, "ros2")


# Protobuf ----------------------------------------

KINDS = ("double", "float", "int32", "uint32", "sint32", "int64", "uint64", "sint64", "fixed32", "sfixed64")


def _descriptors() -> descriptor_pb2.FileDescriptorSet:
    file = descriptor_pb2.FileDescriptorProto(name="rig.proto", package="rig", syntax="proto3")
    file.dependency.append("google/protobuf/timestamp.proto")
    motor = file.message_type.add(name="Motor")
    motor.field.add(name="current", number=1, type="TYPE_DOUBLE", label="LABEL_OPTIONAL")
    state = file.message_type.add(name="State")
    for number, kind in enumerate(KINDS, start=1):
        state.field.add(name=kind, number=number, type=f"TYPE_{kind.upper()}", label="LABEL_OPTIONAL")
    state.field.add(name="q", number=20, type="TYPE_DOUBLE", label="LABEL_REPEATED")
    state.field.add(name="name", number=21, type="TYPE_STRING", label="LABEL_REPEATED")
    state.field.add(name="label", number=22, type="TYPE_STRING", label="LABEL_OPTIONAL")
    for name, number, own, label in (
        ("motor", 23, ".rig.Motor", "LABEL_OPTIONAL"),
        ("motors", 24, ".rig.Motor", "LABEL_REPEATED"),
        ("timestamp", 25, ".google.protobuf.Timestamp", "LABEL_OPTIONAL"),
    ):
        state.field.add(name=name, number=number, type="TYPE_MESSAGE", type_name=own, label=label)
    stamp = descriptor_pb2.FileDescriptorProto()
    timestamp_pb2.DESCRIPTOR.CopyToProto(stamp)
    return descriptor_pb2.FileDescriptorSet(file=[file, stamp])  # the importing file first


SET = _descriptors().SerializeToString()
STATE = protobuf.descriptor_of("rig.State", SET)
MESSAGE: Any = GetMessageClass(STATE)


@st.composite
def protobuf_message(draw: st.DrawFn) -> Any:
    bounds = {"int32": 31, "sint32": 31, "int64": 63, "sint64": 63, "sfixed64": 63}
    content: dict[str, Any] = {"double": draw(st.floats()), "float": draw(st.floats(width=32))}
    for kind in KINDS[2:]:
        top = bounds.get(kind)
        limits = (-(2**top), 2**top - 1) if top else (0, 2 ** (32 if "32" in kind else 64) - 1)
        content[kind] = draw(st.integers(*limits) | st.integers(0, 3))
    stamp = {"seconds": draw(st.integers(0, 2**33)), "nanos": draw(st.integers(0, 999_999_999))}
    q = draw(st.lists(st.floats(), max_size=3))
    return MESSAGE(
        **content,
        q=q,
        name=[f"joint{k}" for k in range(len(q))],
        label=draw(TEXT),
        motor={"current": draw(st.floats())},
        motors=[{"current": draw(st.floats())} for _ in range(draw(st.integers(0, 2)))],
        timestamp=stamp,
    )


@settings(max_examples=200, deadline=None)
@given(st.lists(protobuf_message(), min_size=1, max_size=3))
def test_protobuf_of_any_shape(drawn: list[Any]) -> None:
    messages = [own.SerializeToString() for own in drawn]
    decoded = [protobuf.decode(STATE, raw) for raw in messages]
    layout = protobuf_layout.recognise(STATE, messages[0])
    assert layout is not None
    alike = ~taken_of(layout, messages, compiled=False).left
    assert alike[0]
    assert alike.tolist() == (~taken_of(layout, messages, compiled=True).left).tolist()
    same = [raw for raw, own in zip(messages, alike, strict=True) if own]
    paths = [*KINDS, "motor.current", *(f"q[{k}]" for k in range(len(drawn[0].q)))]
    paths += [f"motors[{k}].current" for k in range(len(drawn[0].motors))]
    assert_same(layout, same, [own for own, ok in zip(decoded, alike, strict=True) if ok], paths)
    assert [resolve(decoded[0], parse_path(f"/t:{kind}")) for kind in KINDS] == pytest.approx(
        [getattr(drawn[0], kind) for kind in KINDS], rel=0, abs=0, nan_ok=True
    )


@settings(max_examples=300, deadline=None)
@given(st.binary(max_size=60))
def test_no_bytes_upset_the_protobuf_layout(raw: bytes) -> None:
    layout = protobuf_layout.recognise(STATE, raw)
    assert layout is None or layout.size == len(raw)


def test_a_protobuf_log_is_read_and_what_is_absent_is_no_number() -> None:
    messages = [MESSAGE(double=0.1 * k, int32=k, timestamp={"seconds": 7, "nanos": k}) for k in range(40)]
    content = hostile.file(
        hostile.schema(1, "rig.State", "protobuf", SET),
        hostile.channel(1, 1, "/t", "protobuf"),
        *(hostile.message(1, k, own.SerializeToString()) for k, own in enumerate(messages)),
    )
    raw = np.frombuffer(content, np.uint8)
    read = read_columns(raw, [parse_path("/t:double"), parse_path("/t:int32"), parse_path("/t:sint64")])
    topic = read.topics["/t"]
    assert topic.values["/t:double"].tolist() == [0.1 * k for k in range(40)]
    assert topic.values["/t:int32"].tolist() == list(range(40))
    assert topic.values["/t:sint64"].tolist() == [0.0] * 40
    assert topic.header_time is not None
    assert topic.header_time.tolist() == [7_000_000_000 + k for k in range(40)]
    assert read.decoded_singly == 0
    for path, why in (("/t:motor.current", "no field 'motor'"), ("/t:q[0]", "no element 0")):
        with pytest.raises(LogError, match=why):
            read_columns(raw, [parse_path(path)])


# JSON ----------------------------------------

JSON_NUMBER = FINITE | st.integers(-(2**70), 2**70) | st.integers(-9, 9)


def json_block(messages: Sequence[str]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    block, begin = block_of([message.encode() for message in messages])
    return block, begin, np.array([len(message.encode()) for message in messages])


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.tuples(JSON_NUMBER, JSON_NUMBER, JSON_NUMBER, st.integers(0, 2**34), TEXT), min_size=1, max_size=5
    )
)
def test_json_blocks_equal_pythons_own_parser(drawn: list[tuple[Any, Any, Any, int, str]]) -> None:
    messages = [
        json.dumps(
            {"header": {"stamp": {"sec": sec, "nanosec": 5}, "id": text}, "name": ["a", "b"], "q": [q, x],
             "motor": {"current": i}, "other": {text: [1, {}]}},
            indent=None if sec % 7 else 1,
        )
        for q, x, i, sec, text in drawn
    ]  # fmt: skip
    paths = [parse_path(f"/t:{text}") for text in ("q[0]", "q{b}", "motor.current")]
    taken = JsonReader(paths).read(*json_block(messages))
    read = ~taken.left
    decoded = [json.loads(message) for message in messages]
    own = [message for message, ok in zip(decoded, read, strict=True) if ok]
    for row, path in zip(taken.values, paths, strict=True):
        expected = np.array([resolve(message, path) for message in own])
        np.testing.assert_array_equal(row[read].view(np.int64), expected.view(np.int64))
    assert taken.header[read].tolist() == [header_stamp(message) for message in own]


@settings(max_examples=1000, deadline=None)
@given(FINITE.filter(bool) | st.floats(1e-300, 1e300) | st.floats(1e-3, 1e3))
def test_the_nearest_double_of_a_decimal_is_pythons(value: float) -> None:
    for text in (repr(value), f"{value:.16e}", f"{value:.6e}", f"{value:.17g}"):
        _, digits, exponent = Decimal(text).as_tuple()
        w = int("".join(map(str, digits)))
        assert isinstance(exponent, int)
        if not 0 < w < 10**19:
            continue
        bits = int(nearest(np.uint64(w), exponent, POWERS))
        if bits != 2**64 - 1:  # else one product does not tell
            assert bits == int(np.float64(abs(float(text))).view(np.uint64)), text


def test_nearly_every_double_is_told_by_one_product() -> None:
    generator = np.random.default_rng(1)
    values = np.concatenate([generator.standard_normal(20_000), 10.0 ** generator.uniform(-290, 290, 20_000)])
    messages = [f'{{"q":{value!r}}}' for value in values.tolist()]
    taken = JsonReader([parse_path("/t:q")]).read(*json_block(messages))
    read = ~taken.left
    assert read.mean() > 0.999
    np.testing.assert_array_equal(taken.values[0][read].view(np.int64), values[read].view(np.int64))


@pytest.mark.parametrize(
    "odd",
    ['{"q": [NaN]}', '{"q": []}', '{"q": true}', '{"q": "1"}', "{}", "[1]", '{"q": [1, 2]}', '{"q": null}',
     '{"q": [1]', '{"q": 1}{"q": 2}', '{"q": [1], "": {}}', '{"q": [1], "a.b": 2}', '{"q": [1], "q[0]": 2}',
     '{"q": [1], "s": "\\x"}', '{"header": {"stamp": 12.5}, "q": [1]}',
     '{"header": {"stamp": {}}, "q": [1]}'],
)  # fmt: skip
def test_what_is_unlike_the_others_is_left_to_the_ordinary_decoder(odd: str) -> None:
    taken = JsonReader([parse_path("/t:q")]).read(*json_block(['{"q": [1]}', odd, '{"q": [-2.5]}']))
    assert taken.left.tolist() == [False, True, False]
    assert taken.values[0][~taken.left].tolist() == [1.0, -2.5]


@pytest.mark.parametrize(
    "number", ["-0", "01", "1.", ".5", "1e", "+1", "1e400", "5e-324", "1" * 30, "0x1", "1_0"]
)
def test_odd_numbers_are_left_to_the_ordinary_decoder(number: str) -> None:
    taken = JsonReader([parse_path("/t:q")]).read(*json_block(['{"q": 1}', f'{{"q": {number}}}']))
    assert taken.left.tolist() == [False, True]


def test_equal_keys_are_left_to_the_ordinary_decoder() -> None:
    assert JsonReader([parse_path("/t:q")]).read(*json_block(['{"q": 1, "q": 2}'])).left.all()


A, B = b"\x09" + struct.pack("<d", 1.5), b"\x10\x05"


@pytest.mark.parametrize(("raw", "proved"), [(A, True), (B, True), (A + B, False), (B + A, False)])
def test_of_several_members_of_a_oneof_the_last_counts(raw: bytes, proved: bool) -> None:
    file = descriptor_pb2.FileDescriptorProto(name="one.proto", package="one", syntax="proto3")
    state = file.message_type.add(name="State")
    state.oneof_decl.add(name="either")
    state.field.add(name="a", number=1, type="TYPE_DOUBLE", label="LABEL_OPTIONAL", oneof_index=0)
    state.field.add(name="b", number=2, type="TYPE_INT32", label="LABEL_OPTIONAL", oneof_index=0)
    kind = protobuf.descriptor_of(
        "one.State", descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
    )
    assert (protobuf_layout.recognise(kind, raw) is not None) is proved
    message: Any = GetMessageClass(kind)
    assert message.FromString(raw).WhichOneof("either") == ("a" if raw.endswith(A) else "b")


# Records ----------------------------------------

CONTENT = st.binary(max_size=9) | st.sampled_from([bytes(12), b"\5" + bytes(8), b"\5\1" + bytes(9)])
RECORDS = st.tuples(
    st.integers(0, 20) | st.just(5),
    st.lists(CONTENT, min_size=1, max_size=4),
    st.sampled_from([1, 1, 20, 90]),
)


@settings(max_examples=200, deadline=None)
@given(st.lists(RECORDS, max_size=20), st.binary(max_size=12), st.integers(0, 1000))
def test_the_compiled_scan_finds_what_the_plain_one_finds(
    runs: list[tuple[int, list[bytes], int]], tail: bytes, cut: int
) -> None:
    records = [hostile.record(opcode, own) for opcode, contents, n in runs for own in contents * n]
    raw = b"".join(records) + tail
    raw = raw[: len(raw) - cut] if cut < 20 else raw
    block = np.frombuffer(raw + b"\0", np.uint8)[:-1]
    among = np.ones(256, np.bool_)
    among[[0, 13]] = False
    plain, fast = _stepped(block, 0, among), _scanned(block, 0, among)
    assert plain.end == fast.end
    for name in ("opcode", "begin", "length"):
        assert getattr(plain, name).tolist() == getattr(fast, name).tolist()


@settings(max_examples=200, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.integers(0, 2**16 - 1),
            st.integers(0, 2**32 - 1),
            st.integers(0, 2**63 + 1),
            st.integers(0, 2**63 - 1),
            st.binary(max_size=9),
        ),
        min_size=1,
        max_size=9,
    )
)
def test_the_compiled_prefixes_are_the_plain_ones(drawn: list[tuple[int, int, int, int, bytes]]) -> None:
    raw = b"".join(
        hostile.record(5, struct.pack("<HIQQ", channel, sequence, log, publish) + content)
        for channel, sequence, log, publish, content in drawn
    )
    block = np.frombuffer(raw, np.uint8)
    tiling = tile(block)
    late = [log for _, _, log, _, _ in drawn if log >= 2**63]
    for compiled in (False, True):
        if late:
            with pytest.raises(Damage, match="log time is past 2262"):
                messages_of(block, tiling, compiled=compiled)
            continue
        found = messages_of(block, tiling, compiled=compiled)
        columns = (found.channel, found.sequence, found.log_time, found.publish_time)
        assert [tuple(int(own) for own in row) for row in zip(*columns, strict=True)] == [
            row[:4] for row in drawn
        ]
        contents = [raw[b : b + n] for b, n in zip(found.begin, found.length, strict=True)]
        assert contents == [row[4] for row in drawn]


def test_nan_payloads_and_signed_zeros_survive() -> None:
    bits = np.array([0x7FF8000000000001, 0x8000000000000000, 0xFFF0000000000000], np.uint64)
    messages = [ENCODE({"q": [0.0], "name": ["a"], "raw": [0, 0, 0]}) for _ in bits]
    layout = ros_layout.recognise(parse_definition("pkg/msg/State", DEFINITION, "ros2"), "ros2", messages[0])
    assert layout is not None
    where = place(layout, parse_path("/t:q[0]"))
    assert where is not None
    messages = [
        raw[: where.offset] + struct.pack("<Q", int(own)) + raw[where.offset + 8 :]
        for raw, own in zip(messages, bits, strict=True)
    ]
    for compiled in (False, True):
        taken = taken_of(layout, messages, [parse_path("/t:q[0]")], compiled=compiled)
        assert taken.values[0].view(np.uint64).tolist() == bits.tolist()
    assert math.isnan(resolve(CDR(messages[0]), parse_path("/t:q[0]")))
