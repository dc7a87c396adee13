from pathlib import Path
from typing import BinaryIO

import pytest

from data.files import write_atomically


def test_text_bytes_and_writer_arrive_whole(tmp_path: Path) -> None:
    def write(stream: BinaryIO) -> None:
        stream.write(b"abc")

    for name, content, expected in (("a", "é", "é".encode()), ("b", b"\0", b"\0"), ("c", write, b"abc")):
        path = tmp_path / "deep" / "er" / name
        write_atomically(path, content)
        assert path.read_bytes() == expected
    assert len(list((tmp_path / "deep" / "er").iterdir())) == 3


def test_a_failure_leaves_what_was_there_and_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "result"
    write_atomically(path, "before")

    def fail(stream: BinaryIO) -> None:
        stream.write(b"half")
        raise RuntimeError("power lost")

    with pytest.raises(RuntimeError, match="power lost"):
        write_atomically(path, fail)
    assert path.read_text() == "before"
    assert list(tmp_path.iterdir()) == [path]
