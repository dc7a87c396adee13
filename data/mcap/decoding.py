"""One message at a time: the ordinary decoders, for what no fixed layout can be proved of.

ROS 2 CDR messages go through mcap_ros2, JSON through Python's own parser. They are slow and general, and the
oracle of the fast ways. What a foreign message makes them raise becomes one error that names the topic.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from decimal import Decimal
from functools import partial
from io import StringIO

from mcap.records import Channel, Schema
from mcap_ros2.decoder import DecoderFactory

from data.findings import LogError
from data.names import shown

Decode = Callable[[bytes], object]


def decoder(channel: Channel, schema: Schema | None, *, exact: bool = False) -> Decode:
    """How to decode a channel's messages; with `exact`, decimals of a JSON text stay as they are written.

    Raises
    ------
    LogError
        When its encoding is not one that is read, or its schema cannot be.
    """
    topic, encoding = shown(channel.topic), channel.message_encoding
    described = f"{shown(encoding, 40)!r} with " + (
        f"a schema in {shown(schema.encoding, 40)!r}" if schema else "no schema"
    )
    if encoding == "json":
        loads = partial(json.loads, parse_float=Decimal) if exact else json.loads
        return lambda raw: _guarded(loads, raw, topic)
    if encoding == "cdr" and schema is not None and schema.encoding == "ros2msg":
        try:
            # The parser prints what it cannot read, as it stands in the log, terminal escapes and all.
            with redirect_stderr(StringIO()), redirect_stdout(StringIO()):
                decode = DecoderFactory().decoder_for(encoding, schema)
        except Exception as error:
            raise LogError(f"{topic}: its schema cannot be read ({_reason(error)})") from error
        if decode is not None:
            found: Decode = decode
            return lambda raw: _guarded(found, raw, topic)
    raise LogError(
        f"{topic} is encoded as {described}; messages are read as cdr with ros2msg, or as json. "
        "Convert the log, or name another topic"
    )


def _guarded(decode: Callable[[bytes], object], raw: bytes, topic: str) -> object:
    try:
        return decode(raw)
    except Exception as error:  # a foreign decoder on foreign bytes may raise anything
        raise LogError(
            f"{topic}: a message of {len(raw)} bytes cannot be decoded ({_reason(error)})"
        ) from error


def _reason(error: Exception) -> str:
    return shown(f"{type(error).__name__}: {error}", 100)
