"""A log that was cut off at any byte gives every chunk, or message outside chunks, that is complete."""

import pytest

from benchmarks.fuzzing.mutations import records
from benchmarks.fuzzing.seeds import seeds
from tests.data.mcap.walks import walk

LOGS = {
    seed.name: seed.content
    for seed in seeds(6)
    if seed.name
    in (
        "own cdr zstd",
        "own json lz4",
        "chunks cdr none",
        "chunks cdr zstd",
        "chunks json none, no checksum",
        "loose cdr, no checksum",
        "loose json, no checksum, summary",
    )
}


@pytest.mark.parametrize("name", LOGS)
def test_cut_off_at_any_byte(name: str) -> None:
    content = LOGS[name]
    honest = walk(content)[1]
    listed = records(content)
    data_end = next(begin for opcode, begin, _ in listed if opcode == 15)
    held: list[int] = []  # where each message is complete
    for opcode, begin, end in listed:
        if begin < data_end and opcode in (5, 6):
            held += [end] * (len(walk(content[:end])[1]) - len(held))
    assert len(held) == len(honest)
    for size in range(len(content)):
        found, messages = walk(content[:size])
        assert messages == honest[: sum(end <= size for end in held)], size
        loss = found.integrity.losses[-1]
        assert loss.end == size
        assert loss.begin >= max((end for _, _, end in listed if end <= size), default=0), size
        if size < listed[-1][2]:  # else only the last magic number is missing
            assert loss.before == (messages[-1][1] if messages else None)
