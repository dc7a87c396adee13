"""Fast columns equal the ordinary decoder's, whatever the layouts; what is refused says why."""

import json
import struct
from decimal import Decimal

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_ros2._dynamic import generate_dynamic, serialize_dynamic

from data.findings import LogError
from data.mcap import joint_state
from data.mcap.columns import read_columns
from data.mcap.description import describe
from data.mcap.field_path import parse_path
from data.mcap.writer import METADATA_NAME
from tests.data import hostile

ENCODE = serialize_dynamic(joint_state.SCHEMA_NAME, joint_state.SCHEMA)[joint_state.SCHEMA_NAME]
DECODE = generate_dynamic(joint_state.SCHEMA_NAME, joint_state.SCHEMA)[joint_state.SCHEMA_NAME]
NUMBER = st.floats(allow_nan=True, allow_infinity=True, width=64)


def joint_message(frame: str, names: list[str], values: list[float], stamp: int = 5) -> bytes:
    header = {"stamp": {"sec": stamp, "nanosec": 7}, "frame_id": frame}
    raw: bytes = ENCODE(
        {"header": header, "name": names, "position": values, "velocity": [], "effort": values[::-1]}
    )
    return raw


def joint_file(messages: list[bytes]) -> np.ndarray:
    parts = [
        hostile.schema(1, joint_state.SCHEMA_NAME, "ros2msg", joint_state.SCHEMA.encode()),
        hostile.channel(1, 1, "/js", "cdr"),
        *(hostile.message(1, k + 1, raw) for k, raw in enumerate(messages)),
    ]
    return np.frombuffer(hostile.file(hostile.chunk(b"".join(parts))), np.uint8)


@settings(max_examples=80, deadline=None)
@given(
    st.lists(
        st.tuples(
            st.sampled_from(["", "b", "base", "base_link"]),
            st.permutations(["a", "bb", "ccc"]),
            NUMBER,
            NUMBER,
            NUMBER,
        ),
        min_size=1,
        max_size=30,
    )
)
def test_fast_and_ordinary_agree_bit_for_bit(rows: list[tuple[str, list[str], float, float, float]]) -> None:
    messages = [joint_message(frame, names, list(values)) for frame, names, *values in rows]
    wanted = [parse_path(p) for p in ("/js:position{bb}", "/js:position[2]", "/js:effort[0]")]
    got = read_columns(joint_file(messages), wanted).topics["/js"]
    decoded = [DECODE(raw) for raw in messages]
    expected = np.array(
        [
            [m.position[m.name.index("bb")] for m in decoded],
            [m.position[2] for m in decoded],
            [m.effort[0] for m in decoded],
        ]
    )
    values = np.stack([got.values[p.text] for p in wanted])
    assert np.array_equal(values.view(np.int64), expected.view(np.int64))
    assert got.header_time is not None
    assert np.all(got.header_time == 5_000_000_007)


def test_nested_fields_of_any_message() -> None:
    text = (
        "pkg/Motor motor\nfloat32[2] pair\nuint16 raw\nbool on\nstring label\n"
        + "=" * 80
        + "\nMSG: pkg/Motor\nfloat64 current\n"
    )
    encode = serialize_dynamic("pkg/msg/State", text)["pkg/msg/State"]
    raw = encode({"motor": {"current": 2.5}, "pair": [1.0, -2.0], "raw": 65535, "on": True, "label": "x"})
    content = hostile.file(
        hostile.schema(1, "pkg/msg/State", "ros2msg", text.encode()),
        hostile.channel(1, 1, "/s", "cdr"),
        *(hostile.message(1, k, raw) for k in range(3)),
    )
    wanted = [parse_path(p) for p in ("/s:motor.current", "/s:pair[1]", "/s:raw")]
    read = read_columns(np.frombuffer(content, np.uint8), wanted)
    assert [read.topics["/s"].values[p.text][2] for p in wanted] == [2.5, -2.0, 65535.0]
    assert read.topics["/s"].header_time is None
    assert read.decoded_singly == 0
    for path, why in (
        ("/s:motor", "group of fields"),
        ("/s:label", "text, not a number"),
        ("/s:on", "true or false, not a number"),
        ("/s:motors.current", "no field 'motors'.*motor"),
        ("/s:pair", "array of 2 elements"),
        ("/s:pair[2]", "no element 2"),
        ("/s:pair{x}", "no joint"),
        ("/t:pair[0]", "no topic '/t'.*/s"),
    ):
        with pytest.raises(LogError, match=why):
            read_columns(np.frombuffer(content, np.uint8), [parse_path(path)])


@pytest.mark.parametrize(("with_schema"), [True, False])
def test_json_with_and_without_schema(with_schema: bool) -> None:
    body = {"header": {"stamp": {"sec": 3, "nanosec": 4}}, "motor": {"name": ["a", "b"], "i": [1, 2.5]}}
    content = hostile.file(
        hostile.schema(1, "S", "jsonschema", b"{}") if with_schema else b"",
        hostile.channel(1, int(with_schema), "/j", "json"),
        hostile.message(1, 9, json.dumps(body).encode()),
    )
    topic = read_columns(np.frombuffer(content, np.uint8), [parse_path("/j:motor.i{b}")]).topics["/j"]
    assert topic.values["/j:motor.i{b}"].tolist() == [2.5]
    assert topic.header_time is not None
    assert topic.header_time.tolist() == [3_000_000_004]


@pytest.mark.parametrize("value", ["true", "false", "[true]"])
def test_true_and_false_are_no_numbers(value: str) -> None:
    content = hostile.file(
        hostile.channel(1, 0, "/j", "json"), hostile.message(1, 9, b'{"u": %s}' % value.encode())
    )
    with pytest.raises(LogError, match="/j:u is true or false, not a number"):
        read_columns(np.frombuffer(content, np.uint8), [parse_path("/j:u")])


@pytest.mark.parametrize(
    "texts", [["1700000000123456789", "1700000000123456790"], ["1700000000.0001", "1.7e9"]]
)
def test_the_field_that_is_the_clock_is_kept_as_it_is_written(texts: list[str]) -> None:
    bodies = [b'{"t": %s, "u": 0.1}' % text.encode() for text in texts]
    messages = [hostile.message(1, k, body) for k, body in enumerate(bodies)]
    content = np.frombuffer(hostile.file(hostile.channel(1, 0, "/j", "json"), *messages), np.uint8)
    time, torque = parse_path("/j:t"), parse_path("/j:u")
    topic = read_columns(content, [time, torque], clock=time).topics["/j"]
    assert topic.ticks == tuple(Decimal(text) for text in texts)
    assert topic.values["/j:u"].tolist() == [0.1, 0.1]


def test_unread_encodings_and_broken_messages_are_refused_by_name(capfd: pytest.CaptureFixture[str]) -> None:
    cases = [
        (
            hostile.schema(1, "S", "flatbuffer", b"") + hostile.channel(1, 1, "/a", "flatbuffer"),
            b"",
            "'flatbuffer'",
        ),
        (
            hostile.schema(1, "S", "protobuf", b"") + hostile.channel(1, 1, "/a", "protobuf"),
            b"",
            "protobuf schema of S cannot be read",
        ),
        (
            hostile.schema(1, "p/S", "ros1msg", b"what") + hostile.channel(1, 1, "/a", "ros1"),
            b"",
            "is no field",
        ),
        (hostile.schema(1, "S", "ros2idl", b"") + hostile.channel(1, 1, "/a", "cdr"), b"", "'ros2idl'"),
        (hostile.channel(1, 0, "/a", "cdr"), b"", "no schema"),
        (
            hostile.schema(1, "p/msg/S", "ros2msg", b"what") + hostile.channel(1, 1, "/a", "cdr"),
            b"",
            "is no field",
        ),
        (hostile.channel(1, 0, "/a", "json"), b"{", "cannot be decoded"),
        (
            hostile.schema(1, joint_state.SCHEMA_NAME, "ros2msg", joint_state.SCHEMA.encode())
            + hostile.channel(1, 1, "/a", "cdr"),
            b"\0\1\0\0" + struct.pack("<I", 2**31),
            "cannot be decoded",
        ),
    ]
    for head, body, why in cases:
        content = np.frombuffer(hostile.file(head, hostile.message(1, 1, body)), np.uint8)
        with pytest.raises(LogError, match=why):
            read_columns(content, [parse_path("/a:position")])
    assert capfd.readouterr() == ("", "")  # a foreign parser may not print what a log holds


def test_two_publishers_at_once_are_refused_and_in_turn_are_joined() -> None:
    heads = hostile.channel(1, 0, "/a", "json") + hostile.channel(2, 0, "/a", "json")
    bodies = [json.dumps({"x": k}).encode() for k in range(4)]
    turns = [hostile.message(1 + k // 2, k, body) for k, body in enumerate(bodies)]
    mixed = [hostile.message(1 + k % 2, k, body) for k, body in enumerate(bodies)]
    read = read_columns(np.frombuffer(hostile.file(heads, *turns), np.uint8), [parse_path("/a:x")])
    assert read.topics["/a"].values["/a:x"].tolist() == [0, 1, 2, 3]
    both = np.frombuffer(hostile.file(heads, *mixed), np.uint8)
    with pytest.raises(LogError, match=r"two publishers, .* by its number: '/a#1' or '/a#2'"):
        read_columns(both, [parse_path("/a:x")])
    for number, values in ((1, [0, 2]), (2, [1, 3])):
        path = parse_path(f"/a#{number}:x")
        assert read_columns(both, [path]).topics[path.topic].values[path.text].tolist() == values
    with pytest.raises(LogError, match="no topic '/a#3'; the log has /a"):
        read_columns(both, [parse_path("/a#3:x")])


def test_a_publisher_that_cannot_be_decoded_harms_no_other() -> None:
    heads = hostile.channel(1, 0, "/a", "json") + hostile.channel(2, 0, "/a", "cbor")
    content = hostile.file(heads, hostile.message(1, 1, b'{"x": 5}'), hostile.message(2, 1, b"??"))
    data = np.frombuffer(content, np.uint8)
    with pytest.raises(LogError, match="encoded as 'cbor'"):
        read_columns(data, [parse_path("/a:x")])
    assert read_columns(data, [parse_path("/a#1:x")]).topics["/a#1"].values["/a#1:x"].tolist() == [5]
    assert [channel.number for channel in describe(data).channels] == [1, 2]


def test_a_topic_that_is_called_with_a_number_is_itself() -> None:
    content = hostile.file(hostile.channel(1, 0, "/a#2", "json"), hostile.message(1, 1, b'{"x": 5}'))
    read = read_columns(np.frombuffer(content, np.uint8), [parse_path("/a#2:x")])
    assert read.topics["/a#2"].values["/a#2:x"].tolist() == [5]


@pytest.mark.parametrize("text", ["", "/a", "/a:", ":x", "/a:x[", "/a:x[-1]", "/a:x..y", "/a:x.", "/a:[0]"])
def test_what_is_no_field_path(text: str) -> None:
    with pytest.raises(LogError, match="no field path"):
        parse_path(text)


def test_the_metadata_record_has_the_name_that_rigs_may_rely_on() -> None:
    assert METADATA_NAME == "stribeck"


# What an ordinary decoder believes, and what the fast ways must not ----------------------------------------


def cdr_file(definition: str, body: bytes, kind: int = 1) -> bytes:
    """One CDR message of a representation, 1 for little-endian."""
    schema = hostile.schema(1, "p/msg/S", "ros2msg", definition.encode())
    message = hostile.message(1, 1, bytes((0, kind, 0, 0)) + body)
    return hostile.file(schema, hostile.channel(1, 1, "/a", "cdr"), message)


SEPARATOR = "=" * 80
NESTED = f"p/E[] t\n{SEPARATOR}\nMSG: p/E\np/F f\n{SEPARATOR}\nMSG: p/F\nuint8[5] x\n"


@pytest.mark.parametrize(
    ("definition", "body"),
    [
        (NESTED, b"\xff" * 4 + bytes(100)),
        (NESTED.replace("E[] t", "E[4000000000] t"), bytes(100)),
        (
            f"p/A[100000] t\n{SEPARATOR}\nMSG: p/A\np/B[100000] t\n{SEPARATOR}\nMSG: p/B\nuint8 x\n",
            bytes(100),
        ),
        ("string[] t", b"\xff" * 4 + bytes(100)),
        ("bool[4000000000] t", bytes(100)),
        (f"p/E[] t\n{SEPARATOR}\nMSG: p/E\nuint8 x\n", struct.pack("<I", 2_000_000) + bytes(2_000_000)),
    ],
)
def test_a_count_is_held_against_the_bytes_that_are_left(definition: str, body: bytes) -> None:
    content = np.frombuffer(cdr_file(definition, body), np.uint8)
    with pytest.raises(LogError, match="it claims"):
        read_columns(content, [parse_path("/a:y")])
    assert "it claims" in str(describe(content).channels[0].refused)


def test_ros1_and_json_messages_of_millions_of_parts_are_refused() -> None:
    schema = hostile.schema(1, "p/S", "ros1msg", b"time[] t")
    body = struct.pack("<I", 500_000) + bytes(4_000_000)
    for head, encoding, raw, why in (
        (schema, "ros1", body, "more than 100000 elements"),
        (b"", "json", b"[" + b"[]," * 1_500_000 + b"[]]", "JSON of more than"),
    ):
        channel = hostile.channel(1, 1 if head else 0, "/a", encoding)
        content = np.frombuffer(hostile.file(head, channel, hostile.message(1, 1, raw)), np.uint8)
        assert why in str(describe(content).channels[0].refused)


@pytest.mark.parametrize("kind", [2, 3, 6, 7, 8, 9, 10, 11])
def test_other_representations_of_cdr_are_refused_by_name(kind: int) -> None:
    raw = cdr_file("uint32 a\nfloat64 b", struct.pack("<Id", 1, 1.5), kind)
    with pytest.raises(LogError, match="no plain CDR"):
        read_columns(np.frombuffer(raw, np.uint8), [parse_path("/a:b")])


def test_values_that_are_hard_to_show_are_shown() -> None:
    body = b'{"x": 1' + b"0" * 400 + b', "text": "' + b"y" * 5000 + b'"}'
    content = hostile.file(hostile.channel(1, 0, "/a", "json"), hostile.message(1, 1, body))
    fields = {
        field.path: field.value for field in describe(np.frombuffer(content, np.uint8)).channels[0].fields
    }
    assert len(str(fields["x"])) <= 200
    assert len(str(fields["text"])) <= 200
    schema = hostile.schema(1, "p/S", "ros1msg", b"int32[] a\nuint8[] b")
    message = hostile.message(1, 1, struct.pack("<I2iI2B", 2, 7, 8, 2, 5, 6))
    content = hostile.file(schema, hostile.channel(1, 1, "/a", "ros1"), message)
    first = describe(np.frombuffer(content, np.uint8)).channels[0].fields
    assert [field.value for field in first] == [7, 5]
