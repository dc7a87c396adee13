"""Unpacking one chunk ahead changes nothing of what is read, and leaves no thread behind."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np
import pytest
import zstandard
from hypothesis import given, settings
from hypothesis import strategies as st

from data.mcap import ahead
from data.mcap import walk as walking
from data.mcap.ahead import Unpacking
from data.mcap.chunks import ChunkHead, extent, unpack
from data.mcap.records import HEADER, ByteArray, Damage
from data.mcap.walk import McapWalk
from data.mcap.writer import write_mcap
from tests.data import hostile


def chunks(contents: list[bytes]) -> tuple[ByteArray, list[int]]:
    """Chunk records with a message index behind each, and where they begin."""
    raw, places = b"", []
    for content in contents:
        places.append(len(raw))
        raw += hostile.chunk(content, compression="zstd", packed=zstandard.compress(content), checksum=True)
        raw += hostile.record(7, b"\1\0" + b"\0\0\0\0")
    return np.frombuffer(raw, np.uint8), places


def walked(content: ByteArray) -> tuple[list[bytes], str]:
    """Every message that a walk finds, and what it proves."""
    found = McapWalk(content, compiled=False)
    messages = [
        block.data[begin : begin + length].tobytes()
        for block in found.blocks()
        for begin, length in zip(block.messages.begin, block.messages.length, strict=True)
    ]
    return messages, repr(found.integrity)


def unpacked(content: ByteArray, places: list[int], *, thread: bool) -> list[bytes | str]:
    found: list[bytes | str] = []
    with Unpacking(content, ahead=thread) as unpacking:
        for place in places:
            head = extent(content, place)
            assert head is not None
            try:
                found.append(unpacking.unpack(head).tobytes())
            except Damage as damage:
                found.append(damage.why)
    return found


@settings(max_examples=50, deadline=None)
@given(st.lists(st.binary(max_size=200), min_size=1, max_size=6), st.data())
def test_in_any_order_with_any_damage(contents: list[bytes], data: st.DataObject) -> None:
    content, places = chunks(contents)
    order = data.draw(st.lists(st.sampled_from(places), max_size=8))
    assert unpacked(content, places, thread=True) == contents
    hurt = content.copy()
    hurt[data.draw(st.integers(HEADER.size + 44, content.size - 1))] ^= 0x10
    order = [place for place in order if extent(hurt, place) is not None]
    assert unpacked(hurt, order, thread=True) == unpacked(hurt, order, thread=False)


def test_the_next_chunk_is_begun_before_it_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    begun = threading.Event()
    content, places = chunks([b"one", b"two"])
    first, second = extent(content, places[0]), extent(content, places[1])
    assert first is not None
    assert second is not None

    def watched(content: ByteArray, head: ChunkHead, *, unpacked_before: int) -> ByteArray:
        if head == second:
            assert threading.current_thread() is not threading.main_thread()
            begun.set()
        return unpack(content, head, unpacked_before=unpacked_before)

    monkeypatch.setattr(ahead, "unpack", watched)
    with Unpacking(content, ahead=True) as unpacking:
        unpacking.unpack(first)
        assert begun.wait(timeout=30)
        assert unpacking.unpack(second).tobytes() == b"two"


def test_a_walk_with_a_thread_reads_the_same_whatever_is_damaged(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "run.mcap"
    time = np.arange(30_000, dtype=np.float64) * 1e-3
    write_mcap(path, time=time, position=np.sin(time), effort=np.cos(time))
    whole = np.frombuffer(path.read_bytes(), np.uint8)
    generator = np.random.default_rng(4)
    for _ in range(25):
        content = whole[: generator.integers(whole.size // 2, whole.size + 1)].copy()
        content[generator.integers(0, content.size, 2)] ^= 1
        monkeypatch.setattr(walking, "_AHEAD", 1 << 40)
        plain = walked(content)
        monkeypatch.setattr(walking, "_AHEAD", 0)
        assert walked(content) == plain


def test_a_walk_that_is_left_leaves_no_thread(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(walking, "_AHEAD", 0)
    path = tmp_path / "run.mcap"
    time = np.arange(30_000, dtype=np.float64) * 1e-3
    write_mcap(path, time=time, position=np.sin(time), effort=np.cos(time))
    blocks = McapWalk(np.frombuffer(path.read_bytes(), np.uint8), compiled=False).blocks()
    next(blocks)
    del blocks
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("unpacking")]
