"""What is intact in a damaged file is found again; what is lost is told: which bytes, between which times."""

import io
import struct
from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType, Writer

from data.mcap.container import MAGIC
from tests.data import hostile
from tests.data.mcap.walks import integrity, walk

BEGIN = 1_700_000_000_000_000_000
STEP = 1_000_000


def loose(n: int = 1000, *, body: int = 40) -> bytes:
    """A file without chunks, checksums or summary, as rosbag2's fastwrite leaves it."""
    rng = np.random.default_rng(1)
    messages = [
        hostile.message(1, BEGIN + k * STEP, rng.standard_normal(body // 8).tobytes(), k) for k in range(n)
    ]
    head = hostile.schema(1, "S", "ros2msg", b"float64[5] x") + hostile.channel(1, 1, "/a", "cdr")
    return hostile.file(head, *messages)


def peer(n: int, *, size: int = 2000, compression: CompressionType = CompressionType.NONE) -> bytes:
    """A chunked file as the mcap library writes it."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=size, compression=compression)
    writer.start()
    channel = writer.register_channel("/a", "json", writer.register_schema("S", "jsonschema", b"{}"))
    for k in range(n):
        writer.add_message(channel, BEGIN + k * STEP, b'{"x": %d}' % k, BEGIN + k * STEP, k)
    writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves this one untyped
    return stream.getvalue()


def records(content: bytes, opcode: int) -> list[int]:
    """Where the records of an opcode begin, by the lengths of an intact file."""
    found, here = [], len(MAGIC)
    while here < len(content) - len(MAGIC):
        (length,) = struct.unpack_from("<Q", content, here + 1)
        if content[here] == opcode:
            found.append(here)
        here += 9 + length
    return found


def changed(content: bytes, place: int, mask: int) -> bytes:
    mutant = bytearray(content)
    mutant[place] ^= mask
    return bytes(mutant)


def test_a_message_on_a_channel_that_is_nowhere_declared_costs_that_message_alone() -> None:
    content = loose()
    honest = walk(content)[1]
    place = records(content, 5)[500]
    found, messages = walk(changed(content, place + 9, 0x40))
    assert messages == honest[:500] + honest[501:]
    (loss,) = found.integrity.losses
    assert "1 message on channel 65, which is nowhere declared" in loss.why
    assert (loss.begin, loss.end) == (place, place + 9 + 22 + 40)
    assert (loss.before, loss.behind) == (honest[499][1], honest[501][1])


def test_a_channel_that_is_nowhere_declared_leaves_no_gap_in_the_others() -> None:
    turns = [hostile.message(1 + k % 2, 1000 + k, b"{}") for k in range(200)]
    for inside in (False, True):
        parts = hostile.channel(1, 0, "/a", "json") + b"".join(turns)
        found, messages = walk(hostile.file(hostile.chunk(parts) if inside else parts))
        assert [channel for channel, *_ in messages] == [1] * 100
        (loss,) = found.integrity.losses
        assert "100 messages among others, on channel 2" in loss.why
        assert found.integrity.breaks(np.array([m[1] for m in messages])) == ()


@pytest.mark.parametrize("place", ["stamp", "short"])
def test_a_message_that_cannot_be_one_costs_that_message_alone(place: str) -> None:
    head = hostile.channel(1, 0, "/a", "json")
    bad = hostile.message(1, 2**63, b"{}") if place == "stamp" else hostile.record(5, b"x")
    good = [hostile.message(1, k, b"{}") for k in range(1, 6)]
    found, messages = walk(hostile.file(head, *good[:3], bad, *good[3:]))
    assert [time for _, time, _ in messages] == [1, 2, 3, 4, 5]
    (loss,) = found.integrity.losses
    assert (loss.before, loss.behind) == (3, 4)


@pytest.mark.parametrize("mask", [0x01, 0x10, 0x80])
@pytest.mark.parametrize("digit", range(8))
def test_a_false_length_outside_chunks_costs_what_it_must(digit: int, mask: int) -> None:
    content = loose(300)
    honest = walk(content)[1]
    place = records(content, 5)[100]
    found, messages = walk(changed(content, place + 1 + digit, mask))
    assert messages[:100] == honest[:100]
    assert set(messages) < set(honest)
    assert len(messages) >= len(honest) - 2
    assert not found.integrity.whole
    assert found.integrity.losses[0].begin == place
    assert found.integrity.losses[0].before == honest[99][1]
    assert found.integrity.losses[0].behind == messages[100][1]


@pytest.mark.parametrize("mask", [0x01, 0x04, 0x10, 0x80])
@pytest.mark.parametrize("digit", range(8))
@pytest.mark.parametrize("compression", list(CompressionType))
def test_a_chunk_whose_records_length_is_false_is_proved_by_its_checksum(
    compression: CompressionType, digit: int, mask: int
) -> None:
    content = peer(400, compression=compression)
    honest = walk(content)[1]
    chunks = records(content, 6)
    assert len(chunks) > 5
    found, messages = walk(changed(content, chunks[2] + 1 + digit, mask))
    assert messages == honest
    assert not found.integrity.whole
    assert "length" in found.integrity.losses[0].why


@pytest.mark.parametrize("compression", list(CompressionType))
def test_every_chunk_behind_a_stretch_that_was_overwritten_is_found(compression: CompressionType) -> None:
    content = peer(400, compression=compression)
    honest = walk(content)[1]
    chunks = records(content, 6)
    third = [m for m in honest if m not in walk(cut(content, chunks[2], chunks[3]))[1]]
    filled = content[: chunks[2]] + bytes(chunks[3] - chunks[2]) + content[chunks[3] :]
    found, messages = walk(filled)
    assert messages == [m for m in honest if m not in third]
    loss = found.integrity.losses[0]
    assert (loss.begin, loss.end) == (chunks[2], chunks[3])
    assert (loss.before, loss.behind) == (third[0][1] - STEP, third[-1][1] + STEP)
    kept = found.integrity.kept
    assert kept == ((honest[0][1], third[0][1] - STEP), (third[-1][1] + STEP, honest[-1][1]))


def cut(content: bytes, begin: int, end: int) -> bytes:
    return content[:begin] + content[end:]


@pytest.mark.parametrize("kind", ["delete", "insert", "overwrite"])
def test_next_to_nothing_is_invented_outside_chunks(kind: str) -> None:
    content = loose(60)
    honest = walk(content)[1]
    times = {message[1] for message in honest}
    rng = np.random.default_rng(7)
    touched = 0
    for _ in range(400):
        begin = int(rng.integers(records(content, 5)[0], len(content) - 8))
        size = int(rng.integers(1, 400))
        noise = rng.integers(0, 256, 0 if kind == "delete" else size, np.uint8).tobytes()
        mutant = content[:begin] + noise + content[begin + (0 if kind == "insert" else size) :]
        found, messages = walk(mutant)
        strange = [message for message in messages if message not in honest]
        assert not found.integrity.whole or strange or messages == honest[: len(messages)] or size % 71 == 0
        # Without a checksum, noise over a message's own numbers leaves no trace; no more than one message is
        # ever half of what it was.
        assert len(strange) <= (1 if kind != "overwrite" else 2)
        touched += bool(strange) or not {message[1] for message in messages} <= times
        lost = 0 if kind == "insert" else 1 + size // 71
        assert len(messages) >= len(honest) - lost - 2
    assert touched <= {"delete": 12, "insert": 4, "overwrite": 400}[kind], touched


def test_a_message_whose_opcode_was_damaged_is_missed() -> None:
    content = loose(100)
    honest = walk(content)[1]
    place = records(content, 5)[50]
    for bit in range(8):
        found, messages = walk(changed(content, place, 1 << bit))
        assert messages == honest[:50] + honest[51:], bit
        assert (found.integrity.losses[0].before, found.integrity.losses[0].behind) == (
            honest[49][1],
            honest[51][1],
        )


def test_declarations_that_contradict_each_other_cost_what_they_make_ambiguous() -> None:
    one = hostile.channel(1, 0, "/a", "json") + hostile.channel(2, 0, "/b", "json")
    more = hostile.message(1, 3, b"{}") + hostile.message(2, 3, b"{}")
    early = hostile.message(1, 1, b"{}") + hostile.message(2, 1, b"{}")
    other = hostile.channel(1, 0, "/c", "json")
    found, messages = walk(hostile.file(hostile.chunk(one + early), hostile.chunk(other + more)))
    assert [(channel, time) for channel, time, _ in messages] == [(1, 1), (2, 1), (2, 3)]
    whys = " ".join(loss.why for loss in found.integrity.losses)
    assert "channel 1 is declared twice, differently" in whys
    assert "1 message on channel 1, declared twice, differently" in whys


def test_a_chunk_within_a_chunk_is_damage() -> None:
    inner = hostile.chunk(hostile.message(1, 2, b"{}"))
    outer = hostile.channel(1, 0, "/a", "json") + hostile.message(1, 1, b"{}") + inner
    found, messages = walk(hostile.file(hostile.chunk(outer + hostile.message(1, 3, b"{}"))))
    assert [time for _, time, _ in messages] == [1, 3]
    (loss,) = found.integrity.losses
    assert "a chunk record among messages" in loss.why
    assert (loss.before, loss.behind) == (1, 3)


def test_an_end_of_data_that_is_not_marked_costs_nothing() -> None:
    content = peer(100)
    (place,) = records(content, 15)
    found, messages = walk(content[:place] + content[place + 13 :])
    assert messages == walk(content)[1]
    loss = found.integrity.losses[0]
    assert loss.begin == loss.end
    assert "is not marked; all that stands before it was read" in loss.text
    assert "0 to" not in loss.text


def test_a_first_byte_that_was_damaged_costs_that_alone(tmp_path: Path) -> None:
    content = hostile.run(tmp_path / "run.mcap", n=50)
    found, messages = walk(changed(content, 0, 1))
    assert messages == walk(content)[1]
    assert [(loss.begin, loss.end) for loss in found.integrity.losses] == [(0, 8)]


def test_messages_without_a_checksum_among_others_are_told(tmp_path: Path) -> None:
    content = loose(10)
    text = integrity(content[:-20]).left
    assert text.startswith("10 messages (without a checksum), 0.009 s of log time from")


def test_padding_of_zeros_behind_a_cut_is_no_message() -> None:
    content = loose(20)
    last = records(content, 5)[-1]
    found, messages = walk(content[: last + 40] + bytes(4096))
    assert len(messages) == 19
    assert found.integrity.losses[0].begin == last


def test_messages_of_a_chunk_whose_head_is_gone_are_not_believed(tmp_path: Path) -> None:
    content = hostile.run(tmp_path / "run.mcap", n=30, compression="none")
    (place,) = records(content, 6)
    found, messages = walk(content[:place] + bytes(49) + content[place + 49 :])
    assert messages == []  # its checksum is gone too, and nothing else vouches for them
    assert found.integrity.losses[0].begin == place


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize(("first", "count"), [(9, 64), (9, 512), (25, 23)])
def test_a_chunk_whose_head_was_zeroed_is_a_loss(
    compression: CompressionType, first: int, count: int
) -> None:
    content = bytearray(peer(1000, compression=compression))
    places = records(bytes(content), 6)
    (length,) = struct.unpack_from("<Q", content, places[3] + 1)
    last = min(places[3] + first + count, places[3] + 9 + length)
    content[places[3] + first : last] = bytes(last - places[3] - first)
    found, messages = walk(bytes(content))
    assert found.integrity.losses[0].begin <= places[3] + 9 < found.integrity.losses[0].end
    bodies = [struct.pack("<Q", time) for _, time, _ in messages]
    assert len(set(bodies)) == len(bodies) < 1000
    assert found.integrity.chunks == len(places) - 1


def test_an_index_whose_opcode_was_flipped_is_no_message() -> None:
    content = bytearray(peer(400))
    for place in records(bytes(content), 7)[2::3]:
        content[place] = 5
    found, messages = walk(bytes(content))
    assert [time for _, time, _ in messages] == [BEGIN + k * STEP for k in range(400)]
    assert "an index stands there as a message" in found.integrity.losses[0].why


@pytest.mark.parametrize("bit", range(8))
def test_a_false_length_of_lz4_data_costs_that_chunk_alone(bit: int) -> None:
    content = bytearray(peer(1000, compression=CompressionType.LZ4))
    place = records(bytes(content), 6)[2]
    content[place + 9 + 32 + 3 + 1] ^= 1 << bit  # the second byte of the length of its data
    found, _ = walk(bytes(content))
    assert found.integrity.chunks == len(records(peer(1000, compression=CompressionType.LZ4), 6)) - 1


def test_a_chunk_that_passes_for_a_footer_ends_nothing() -> None:
    content = bytearray(peer(1000))
    places = records(bytes(content), 6)
    content[places[1]] = 2
    assert walk(bytes(content))[0].integrity.chunks == len(places) - 1


@pytest.mark.parametrize("bit", range(12))
def test_an_index_of_a_false_length_costs_no_chunk(bit: int) -> None:
    content = bytearray(peer(1000))
    place = records(bytes(content), 7)[2]
    content[place + 1 + bit // 8] ^= 1 << bit % 8
    found, messages = walk(bytes(content))
    assert len(messages) == 1000
    assert found.integrity.losses
