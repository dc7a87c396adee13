r"""A CSV file's bytes as text: its encoding, where it ends, and what is no text at all.

A line ends at `\n`, `\r\n` or `\r` and nowhere else: form feeds, file separators and NEL are characters
in a cell. `lines` is the only splitter; whatever counts, skips or cuts lines goes through it (or, over many
lines at once, through `line_bounds`, which gives the same).

A file whose rig lost power ends in zeros, as the file system hands out space that was never written. They are
no text; what stands before them is.
"""

from __future__ import annotations

import codecs
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from data.findings import LogError
from data.names import shown

ByteArray = NDArray[np.uint8]
IndexArray = NDArray[np.intp]
BLOCK: Final = 1 << 20  # bytes that are looked at together
LONGEST_LINE: Final = 1 << 25  # bytes
_MARKS: Final = (
    (b"\xef\xbb\xbf", "utf-8-sig", "utf-8"),
    (b"\xff\xfe\0\0", "utf-32", ""),
    (b"\0\0\xfe\xff", "utf-32", ""),
    (b"\xff\xfe", "utf-16", "utf-16-le"),
    (b"\xfe\xff", "utf-16", "utf-16-be"),
)
_NO_TEXT: Final = (
    (b"\x1f\x8b", "compressed by gzip: unpack it"),
    (b"(\xb5/\xfd", "compressed by zstd: unpack it"),
    (b"BZh", "compressed by bzip2: unpack it"),
    (b"\xfd7zXZ", "compressed by xz: unpack it"),
    (b"PK\x03\x04", "a zip archive, or an Excel workbook: unpack it, or export it as CSV"),
    (b"\xd0\xcf\x11\xe0", "an Excel workbook: export it as CSV"),
    (b"\x89MCAP", "an MCAP log: rename it to .mcap"),
    (b"\x89HDF", "an HDF5 file, or a MATLAB file of version 7.3: save that with -v7, or export it as CSV"),
    (b"MATLAB 5", "a MATLAB file: rename it to .mat"),
    (b"PAR1", "a Parquet file: rename it to .parquet"),
    (b"TDSm", "a LabVIEW TDMS file: export it as CSV"),
    (b"#ROSBAG", "a ROS bag: rename it to .bag"),
    (b"SQLite format 3", "a SQLite database: if a ROS bag, rename it to .db3; else export it as CSV"),
)


@dataclass(frozen=True)
class Text:
    """A file as text."""

    content: ByteArray
    encoding: str  # as it is shown and frozen
    codec: str  # that decodes it without its byte order mark
    begin: int  # behind the byte order mark [bytes]
    end: int  # before the zeros at the end [bytes]

    @property
    def width(self) -> int:
        """Bytes of a line end."""
        return 2 if self.codec.startswith("utf-16") else 1

    def block(self, begin: int, size: int = BLOCK) -> tuple[bytes, int]:
        """Whole lines from byte `begin` on, and the byte behind them; the last line of all may have no end.

        One byte a character where a line end or a delimiter is concerned: UTF-16 comes as UTF-8.

        Raises
        ------
        LogError
            When a line is longer than any row of numbers.
        """
        while True:
            end = min(begin + size, self.end)
            raw = self.content[begin:end].tobytes()
            if end < self.end:
                raw = raw[: self._last_line_end(raw)]
            if raw:
                break
            if end >= self.end:
                return b"", end
            size *= 2
            if size > 2 * LONGEST_LINE:
                raise LogError(
                    f"the line at byte {begin} is longer than {LONGEST_LINE} bytes: no row of numbers. "
                    "Cut it out, or exclude the log"
                )
        return (raw if self.width == 1 else utf8(raw, self.codec)), begin + len(raw)

    def _last_line_end(self, raw: bytes) -> int:
        r"""Behind the last line end of bytes of which more follow; 0: none. A `\r` may be half of one."""
        if self.width == 1:
            return max(raw.rfind(b"\n"), raw.rfind(b"\r", 0, len(raw) - 1)) + 1
        units = np.frombuffer(raw[: len(raw) // 2 * 2], "<u2" if self.codec.endswith("le") else ">u2")
        ends = np.flatnonzero((units[:-1] == ord("\n")) | (units[:-1] == ord("\r")))
        if ends.size and units[ends[-1]] == ord("\r") and units[ends[-1] + 1] == ord("\n"):
            return int(2 * ends[-1] + 4)
        return int(2 * ends[-1] + 2) if ends.size else 0

    @property
    def codec_of_block(self) -> str:
        """What decodes a block."""
        return self.codec if self.width == 1 else "utf-8"

    def size_of(self, text: bytes) -> int:
        """How many bytes of the file a part of a block takes."""
        return len(text) if self.width == 1 else len(text.decode(errors="replace").encode(self.codec))


def open_text(content: bytes | ByteArray, encoding: str | None = None) -> Text:
    """A file's bytes as text, in an encoding or in the one that is found.

    Raises
    ------
    LogError
        When it is no text, or cannot be read in that encoding.
    """
    array = np.frombuffer(content, np.uint8) if isinstance(content, bytes) else content
    head = array[:16].tobytes()
    for mark, why in _NO_TEXT:
        if head.startswith(mark):
            raise LogError(f"it is no text, but {why}")
    marked = next(((mark, name, codec) for mark, name, codec in _MARKS if head.startswith(mark)), None)
    end = _written(array)
    if encoding is None:
        mark, name, codec = marked or (b"", *_unmarked(array[:end]))
    else:
        name = _known(encoding)
        mark, codec = b"", name
        if marked is not None and (codecs.lookup(marked[1]).name == name or marked[2] == name):
            mark, codec = marked[0], marked[2]
        elif name in {"utf-16", "utf-8-sig"}:
            codec = "utf-16-le" if name == "utf-16" else "utf-8"
    if not codec:
        raise LogError("it is written in UTF-32, which no rig's log is; save it as UTF-8")
    if codec.startswith("utf-16"):  # the zero that ends it may belong to its last character
        end = min(array.size // 2 * 2, end + end % 2)
    return Text(array, name, codec, begin=min(len(mark), end), end=end)


def lines(text: bytes) -> list[bytes]:
    """Lines with their ends."""
    return text.splitlines(keepends=True)


def line_bounds(text: bytes) -> tuple[IndexArray, IndexArray]:
    """Where the lines of a text begin, and where they stop, line ends included; (n,) each."""
    body = np.frombuffer(text, np.uint8)
    is_end = body == ord("\n")
    if b"\r" in text:
        is_end |= (body == ord("\r")) & ~np.append(body[1:] == ord("\n"), False)
    ends = np.flatnonzero(is_end) + 1
    begins = np.concatenate(([0], ends[ends < body.size])).astype(np.intp)
    return begins, np.append(begins[1:], body.size).astype(np.intp)


def utf8(text: bytes, codec: str) -> bytes:
    """The same text in UTF-8; what cannot be decoded becomes the replacement character."""
    return text if text.isascii() and codec not in {"utf-16-le", "utf-16-be"} else _recoded(text, codec)


def _recoded(text: bytes, codec: str) -> bytes:
    return text.decode(codec, errors="replace").encode(errors="replace")


def _written(content: ByteArray) -> int:
    """Where the bytes end that are not zero."""
    end = content.size
    while end > 0:
        begin = max(0, end - BLOCK)
        filled = np.flatnonzero(content[begin:end])
        if filled.size:
            return begin + int(filled[-1]) + 1
        end = begin
    return 0


def _unmarked(content: ByteArray) -> tuple[str, str]:
    """Name and codec of a text without a byte order mark."""
    head = content[: 1 << 17].tobytes()
    zeros = head[0::2].count(0), head[1::2].count(0)
    if max(zeros) > 0.4 * len(head) / 2 and min(zeros) == 0:
        return ("utf-16-le",) * 2 if zeros[1] else ("utf-16-be",) * 2
    decoder = codecs.getincrementaldecoder("utf-8")()
    try:
        for begin in range(0, content.size, BLOCK):
            part = content[begin : begin + BLOCK].tobytes()
            if not part.isascii() or decoder.getstate()[0]:
                decoder.decode(part)
        decoder.decode(b"", final=True)
    except UnicodeDecodeError:
        return "latin-1", "latin-1"
    return "utf-8", "utf-8"


def _known(encoding: str) -> str:
    """An encoding by Python's name for it, in which bytes can be searched for line ends and delimiters."""
    probe = "0,;\t\n"
    try:
        name = codecs.lookup(encoding).name
        plain = probe.encode(name) == probe.encode()
    except (LookupError, UnicodeError, ValueError, TypeError) as error:
        raise LogError(f"it cannot be read as {shown(encoding, 30)} ({shown(str(error))})") from error
    if not plain and name not in {"utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"}:
        raise LogError(
            f"it cannot be read as {shown(encoding, 30)}: logs are UTF-8, UTF-16 or a form of ASCII"
        )
    return {"iso8859-1": "latin-1"}.get(name, name)
