"""Floods cost what their limits allow; declarations repeated are cheap, and real rigs stay far below."""

import struct
import time
from collections.abc import Callable

import numpy as np
import pytest
import zstandard

from data.mcap.description import MOST_LISTED, describe
from data.mcap.limits import LONGEST_NAME, MOST_CHANNELS, MOST_METADATA, MOST_SCHEMAS
from tests.data import hostile
from tests.data.mcap.walks import walk

LONG = f"{LONGEST_NAME} are the most"
WATCHDOG = 5.0  # [s]; the work takes a tenth of it on a quiet machine


def packed(content: bytes) -> bytes:
    small = zstandard.ZstdCompressor().compress(content)
    return hostile.chunk(content, compression="zstd", packed=small, size=len(content))


def pairs(count: int) -> bytes:
    inside = b"".join(hostile.text(f"{k}") * 2 for k in range(count))
    return hostile.record(12, hostile.text("m") + struct.pack("<I", len(inside)) + inside)


def many_channels(count: int) -> bytes:
    return b"".join(
        hostile.channel(k, 0, f"/{k}", "json") + hostile.message(k, 1 + k, b"{}") for k in range(count)
    )


FLOODS: dict[str, tuple[Callable[[], bytes], str]] = {
    "schemas": (
        lambda: packed(b"".join(hostile.schema(k, "S", "x", b"") for k in range(1, 65_536))) * 4,
        f"more than {MOST_SCHEMAS} schemas",
    ),
    "channels": (lambda: packed(many_channels(60_000)) * 3, f"more than {MOST_CHANNELS} channels"),
    "metadata keys": (lambda: pairs(300_000), f"more than the {MOST_METADATA} entries"),
    "metadata records": (lambda: pairs(1) * 20_000, f"more than {MOST_METADATA} entries"),
    "metadata bytes": (lambda: pairs(700_000), "bytes of metadata"),
    "a topic's name": (
        lambda: hostile.channel(1, 0, "x" * 20_000_000, "json"),
        LONG,
    ),
    "a schema's name": (lambda: hostile.schema(1, "x" * 2_000_000, "e", b""), LONG),
    "chunks in a chunk": (lambda: packed(hostile.chunk(b"") * 50_000), "a chunk record among messages"),
    "attachments": (
        lambda: hostile.record(9, bytes(16) + hostile.text("a") * 2 + bytes(12)) * 12_000,
        "more than 10000 attachments",
    ),
}


@pytest.mark.parametrize("name", FLOODS)
def test_a_flood_is_told_and_soon(name: str) -> None:
    make, why = FLOODS[name]
    content = np.frombuffer(hostile.file(make()), np.uint8)
    begun = time.perf_counter()
    found = describe(content)
    assert time.perf_counter() - begun < WATCHDOG
    assert any(why in loss.why for loss in found.integrity.losses)
    assert len(found.channels) <= MOST_LISTED


def test_what_real_rigs_declare_is_read_whole() -> None:
    declared = b"".join(
        hostile.schema(k, f"pkg/msg/T{k}", "ros2msg", b"float64 x\n" * 50)
        + hostile.channel(k, k, f"/{k}", "json")
        for k in range(1, 1001)
    )
    chunks = [declared + hostile.message(7, k, b"{}") for k in range(1, 21)]
    found, messages = walk(hostile.file(*(packed(chunk) for chunk in chunks)))
    assert found.integrity.whole
    assert len(messages) == 20
    assert len(found.channels) == 1000


def test_channels_beyond_those_listed_are_counted() -> None:
    found = describe(np.frombuffer(hostile.file(many_channels(MOST_LISTED + 25)), np.uint8))
    assert found.integrity.whole
    assert (len(found.channels), found.unlisted, found.empty_topics) == (MOST_LISTED, 25, ())
