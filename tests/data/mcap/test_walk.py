"""Valid files give exactly their records; damaged and hostile ones a statement of what is lost."""

import json
import struct
import tarfile
import tracemalloc
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import lz4.frame
import numpy as np
import pytest
import zstandard

from data.mcap.container import MAGIC
from data.mcap.walk import McapWalk
from tests.data import hostile
from tests.data.mcap.walks import integrity, walk

CONFORMANCE = Path(__file__).parents[4] / "shared/realdata/mcap_conformance/conformance.tar.xz"


def conformance() -> Iterator[tuple[str, bytes, list[dict[str, Any]]]]:
    with tarfile.open(CONFORMANCE) as archive:
        files = {m.name: archive.extractfile(m) for m in archive.getmembers() if m.isfile()}
        for name, stream in files.items():
            expected = files.get(name.removesuffix(".mcap") + ".json")
            if name.endswith(".mcap") and stream is not None and expected is not None:
                yield name, stream.read(), json.load(expected)["records"]


def fields_of(records: list[dict[str, Any]], kind: str) -> list[dict[str, Any]]:
    """What the expected records of one kind hold, numbers as text as they are listed."""
    return [dict(item["fields"]) for item in records if item["type"] == kind]


def raw(numbers: list[str]) -> bytes:
    return bytes(int(number) for number in numbers)


@pytest.mark.skipif(not CONFORMANCE.exists(), reason="the MCAP conformance files are not beside the project")
def test_all_conformance_files_give_their_records() -> None:
    count = 0
    for name, content, records in conformance():
        found, messages = walk(content)
        assert found.integrity.whole, name
        assert messages == [
            (int(m["channel_id"]), int(m["log_time"]), raw(m["data"])) for m in fields_of(records, "Message")
        ], name
        attachments = [
            {
                "name": one.name,
                "media_type": one.media_type,
                "log_time": str(one.log_time),
                "create_time": str(one.create_time),
                "data": [str(byte) for byte in content[one.offset : one.offset + one.size]],
            }
            for one in found.attachments
        ]
        assert attachments == fields_of(records, "Attachment"), name
        assert all(one.checksum == "verified" for one in found.attachments)
        assert [{"name": m.name, "metadata": m.metadata} for m in found.metadata] == [
            {"name": m["name"], "metadata": m["metadata"]} for m in fields_of(records, "Metadata")
        ], name
        assert listed_statistics(found) == fields_of(records, "Statistics"), name
        declared = {channel["id"]: channel for channel in fields_of(records, "Channel")}
        assert {
            str(channel.id): (channel.topic, channel.message_encoding, str(channel.schema_id))
            for channel in found.channels.values()
        } == {k: (c["topic"], c["message_encoding"], c["schema_id"]) for k, c in declared.items()}, name
        count += 1
    assert count == 416


def listed_statistics(found: McapWalk) -> list[dict[str, Any]]:
    """A file's statistics as the expected records list them."""
    if found.statistics is None:
        return []
    counts = found.statistics.channel_message_counts
    plain = {key: str(value) for key, value in vars(found.statistics).items()}
    return [plain | {"channel_message_counts": {str(k): str(v) for k, v in counts.items()}}]


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_cut_at_every_byte_nothing_is_invented(tmp_path: Path, compression: str) -> None:
    content = hostile.run(tmp_path / "run.mcap", n=6, compression=compression)
    _, all_messages = walk(content)
    assert len(all_messages) == 6
    for size in range(len(content)):
        found, messages = walk(content[:size])
        assert not found.integrity.whole, size
        assert messages in ([], all_messages)


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_no_flipped_byte_goes_unseen_or_changes_a_value(tmp_path: Path, compression: str) -> None:
    content = hostile.run(tmp_path / "run.mcap", n=6, compression=compression)
    _, honest = walk(content)
    for place in range(len(content)):
        mutant = bytearray(content)
        mutant[place] ^= 0x41
        found, messages = walk(bytes(mutant))
        assert not found.integrity.whole, place
        assert all(message in honest for message in messages), place


def test_a_lost_chunk_is_named_and_the_others_are_kept(tmp_path: Path) -> None:
    content = bytearray(hostile.run(tmp_path / "run.mcap", n=20_000))
    _, honest = walk(bytes(content))
    chunks = [place for place in range(len(content)) if content.startswith(b"\x04\0\0\0zstd", place)]
    content[chunks[0] + 60] ^= 1  # in the first chunk, which all others lean on for nothing
    found, messages = walk(bytes(content))
    lost = len(honest) - len(messages)
    assert 0 < lost < 0.5 * len(honest)
    assert messages == honest[lost:]
    loss = found.integrity.losses[0]
    assert loss.time_range == (honest[0][1], honest[lost - 1][1])
    assert "0 to" not in found.integrity.left


def test_channels_lost_with_the_first_chunk_come_from_the_summary() -> None:
    inside = hostile.schema(1, "S", "jsonschema", b"{}") + hostile.channel(1, 1, "/a", "json")
    first = bytearray(hostile.chunk(inside + hostile.message(1, 1, b"{}")))
    first[-1] ^= 1
    second = hostile.chunk(hostile.message(1, 2, b"{}"))
    body = MAGIC + hostile.record(1, hostile.text("") + hostile.text("")) + bytes(first) + second
    body += hostile.record(15, struct.pack("<I", 0))
    start = len(body)
    footer = struct.pack("<BQQQ", 2, 20, start, 0)
    content = body + inside + footer + struct.pack("<I", zlib.crc32(inside + footer)) + MAGIC
    found, messages = walk(content)
    assert messages == [(1, 2, b"{}")]
    assert len(found.integrity.losses) == 1


def bombs() -> Iterator[tuple[str, bytes]]:
    zeros = bytes(1 << 20)
    zstd = zstandard.ZstdCompressor().compress(zeros * 64)
    honest_size = 64 << 20
    yield "zstd that says 2 GiB", hostile.chunk(b"", compression="zstd", packed=zstd, size=2 << 30)
    yield "zstd that says 1 byte", hostile.chunk(b"", compression="zstd", packed=zstd, size=1)
    lz4_bytes = lz4.frame.compress(zeros * 64)
    yield "lz4 that says 1 byte", hostile.chunk(b"", compression="lz4", packed=lz4_bytes, size=1)
    yield "zeros as records", hostile.chunk(b"", compression="zstd", packed=zstd, size=honest_size)
    yield "1 TiB record", hostile.record(5, b"x" * 30, claimed=1 << 40)
    yield "1 TiB chunk", hostile.record(6, b"x" * 60, claimed=1 << 40)
    yield "largest length", hostile.record(12, b"", claimed=2**64 - 1)
    yield "metadata that says more", hostile.record(12, struct.pack("<I", 2**31) + b"x")
    yield "schema that says more", hostile.record(3, struct.pack("<HI", 1, 2**32 - 1))
    yield (
        "attachment that says more",
        hostile.record(9, bytes(16) + hostile.text("a") + hostile.text("b") + b"\xff" * 8),
    )
    yield "empty messages", hostile.record(5, b"") * 1000
    yield "unknown compression", hostile.chunk(b"x", compression="\x1b[31mrar", packed=b"x")
    yield "not UTF-8", hostile.record(4, struct.pack("<HHI", 1, 0, 2) + b"\xff\xfe" + bytes(8))


@pytest.mark.parametrize(("name", "content"), list(bombs()), ids=[name for name, _ in bombs()])
def test_bombs_and_lies_are_lost_parts_in_bounded_memory(name: str, content: bytes) -> None:
    tracemalloc.start()
    found, messages = walk(hostile.file(content))
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert messages == []
    assert not found.integrity.whole, name
    assert peak < 200 << 20


def test_random_bytes_are_no_log() -> None:
    rng = np.random.default_rng(3)
    for size in (0, 1, 7, 8, 9, 500):
        noise = rng.integers(0, 256, size, np.uint8).tobytes()
        assert not integrity(noise).whole
        assert not integrity(MAGIC + noise).whole


def test_statistics_that_promise_more_are_a_loss(tmp_path: Path) -> None:
    found = integrity(hostile.file(hostile.record(11, struct.pack("<QHIIIIQQI", 7, 0, 0, 0, 0, 0, 0, 0, 0))))
    assert "promise 7 messages, 0 were found" in found.losses[0].why
