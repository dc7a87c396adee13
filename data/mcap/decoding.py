"""How a channel's messages are read: the ordinary decoders, and who recognises their layout.

ROS 2 CDR messages go through mcap_ros2, protobuf through Google's parser, JSON through Python's own, ROS 1
through `ros1`. They are slow and general, and the oracle of the fast ways. What a foreign message makes them
raise becomes one error that names the topic.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from decimal import Decimal
from functools import partial
from io import StringIO
from typing import Final

from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory

from data.findings import LogError
from data.mcap import ros1, ros_layout
from data.mcap.layout_reader import Recognise
from data.mcap.ros_bounds import require_bounds
from data.mcap.ros_definitions import Dialect, Field, parse_definition
from data.names import shown

Decode = Callable[[bytes], object]
_DIALECTS: Final[dict[str, Dialect]] = {"cdr": "ros2", "ros1": "ros1"}
_CDR: Final = (b"\0\0", b"\0\1")  # big- and little-endian
_LONGEST_JSON: Final = 4 << 20  # [bytes]
_READ: Final = "cdr with ros2msg, ros1 with ros1msg, protobuf, or json"


def decoder(channel: Channel, schema: Schema | None, *, exact: bool = False) -> Decode:
    """How to decode a channel's messages; with `exact`, decimals of a JSON text stay as they are written.

    Raises
    ------
    LogError
        When its encoding is not one that is read, or its schema cannot be.
    """
    topic, encoding = shown(channel.topic), channel.message_encoding
    if encoding == "json":
        loads = partial(json.loads, parse_float=Decimal) if exact else json.loads
        return partial(_guarded, partial(_json, loads), topic=topic)
    kind = (encoding, schema.encoding if schema else None)
    try:
        if schema is not None and kind == ("cdr", "ros2msg"):
            fields = _definition(schema, "ros2")  # within bounds, which the decoder's own parser has not
            return partial(_guarded, partial(_cdr, fields, _cdr_decoder(encoding, schema)), topic=topic)
        if schema is not None and kind == ("ros1", "ros1msg"):
            return partial(_guarded, partial(ros1.decode, _definition(schema, "ros1")), topic=topic)
        if schema is not None and kind == ("protobuf", "protobuf"):
            from data.mcap import protobuf  # noqa: PLC0415  # few logs need it

            descriptor = protobuf.descriptor_of(schema.name, schema.data)
            return partial(_guarded, partial(protobuf.decode, descriptor), topic=topic)
    except LogError as error:
        raise LogError(f"{topic}: {error}") from error
    described = f"a schema in {shown(schema.encoding, 40)!r}" if schema else "no schema"
    raise LogError(
        f"{topic} is encoded as {shown(encoding, 40)!r} with {described}; messages are read as {_READ}. "
        "Convert the log, or name another topic"
    )


def recogniser(channel: Channel, schema: Schema | None) -> Recognise | None:
    """Who recognises the layout of a channel's messages; None where none can be proved."""
    if schema is None:
        return None
    dialect = _DIALECTS.get(channel.message_encoding)
    try:
        if dialect is not None and schema.encoding == f"{dialect}msg":
            return partial(ros_layout.recognise, _definition(schema, dialect), dialect)
        if channel.message_encoding == schema.encoding == "protobuf":
            from data.mcap import protobuf, protobuf_layout  # noqa: PLC0415  # few logs need it

            return partial(protobuf_layout.recognise, protobuf.descriptor_of(schema.name, schema.data))
    except LogError:  # the ordinary decoder may know better
        return None
    return None


def _definition(schema: Schema, dialect: Dialect) -> tuple[Field, ...]:
    return parse_definition(schema.name, schema.data.decode(errors="replace"), dialect)


def _cdr_decoder(encoding: str, schema: Schema) -> Decode:
    try:
        # The parser prints what it cannot read, as it stands in the log, terminal escapes and all.
        with redirect_stderr(StringIO()), redirect_stdout(StringIO()):
            decode = DecoderFactory().decoder_for(encoding, schema)
    except Exception as error:
        raise LogError(f"its schema cannot be read ({_reason(error)})") from error
    if decode is None:
        raise LogError("its schema cannot be read")
    found: Decode = decode
    return found


def _cdr(fields: tuple[Field, ...], decode: Decode, raw: bytes) -> object:
    if raw[:2] not in _CDR:
        raise LogError(f"it is no plain CDR (representation {raw[:2].hex()}), which alone is read")
    require_bounds(fields, raw)
    return decode(raw)


def _json(loads: Callable[[bytes], object], raw: bytes) -> object:
    if len(raw) > _LONGEST_JSON:
        raise LogError(f"JSON of more than {_LONGEST_JSON} bytes in one message")
    return loads(raw)


def _guarded(decode: Callable[[bytes], object], raw: bytes, topic: str) -> object:
    try:
        return decode(raw)
    except LogError as error:
        raise LogError(f"{topic}: a message of {len(raw)} bytes cannot be decoded: {error}") from error
    except Exception as error:  # a foreign decoder on foreign bytes may raise anything
        raise LogError(
            f"{topic}: a message of {len(raw)} bytes cannot be decoded ({_reason(error)})"
        ) from error


def _reason(error: Exception) -> str:
    return shown(f"{type(error).__name__}: {error}", 100)
