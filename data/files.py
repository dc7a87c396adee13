"""Files that are whole or not there, and the bytes of a log.

A result under its final name is complete: it is written under a temporary name in the same folder, flushed to
the disk and then renamed, which every file system does in one step. When anything fails, the temporary file
goes and whatever stood under the final name before still stands.
"""

from __future__ import annotations

import mmap
import os
import secrets
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from data.findings import LogError

ByteArray = NDArray[np.uint8]
Writer = Callable[[BinaryIO], None]


def write_atomically(path: Path, content: bytes | str | Writer) -> None:
    """Write `content` (bytes, text as UTF-8, or a function writing to an open file) to `path`, or nothing.

    Folders that are missing on the way are made.

    Raises
    ------
    OSError
        When the folder cannot be written; nothing is left behind then.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    partial = path.with_name(f".{path.name[:80]}.{secrets.token_hex(4)}.partial")
    try:
        with partial.open("xb") as stream:
            if isinstance(content, str):
                stream.write(content.encode())
            elif isinstance(content, bytes):
                stream.write(content)
            else:
                content(stream)
            stream.flush()
            os.fsync(stream.fileno())
        partial.replace(path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise


def read_bytes(path: Path, *, log: str) -> ByteArray:
    """A file's bytes, mapped rather than read.

    Raises
    ------
    LogError
        When there is no such file, it is a folder, empty, or may not be read.
    """
    try:
        if path.is_dir():
            raise LogError(f"{log} is a folder, not a log file")
        with path.open("rb") as stream:
            if not path.is_file():
                raise LogError(f"{log} is no regular file")
            if path.stat().st_size == 0:
                raise LogError(
                    f"{log} is empty (0 bytes): nothing was recorded. Record it again or exclude it"
                )
            mapped = mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)
    except FileNotFoundError as error:
        raise LogError(f"{log}: there is no such file") from error
    except (OSError, ValueError) as error:
        raise LogError(f"{log} cannot be read: {error}") from error
    return np.frombuffer(mapped, np.uint8)
