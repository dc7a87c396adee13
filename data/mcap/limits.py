"""How much of each thing one log may declare: generous for real rigs, ruinous for no reader.

A few kilobytes of zstd can hold a million channels, and a record of 20 MB a topic's name. What lies beyond
these limits is not read, and is told as lost; it never costs more time or memory than what lies within.
"""

from __future__ import annotations

from typing import Final

LONGEST_NAME: Final = 8192  # [bytes] of a topic, a schema's name, an encoding, a metadata key, ...
LARGEST_SCHEMA: Final = 4 << 20  # [bytes]
DECLARED_BYTES: Final = 32 << 20  # of all schemas and channels together
MOST_CHANNELS: Final = 10_000
MOST_SCHEMAS: Final = 10_000
MOST_DECLARATIONS: Final = 200_000  # beside those that repeat an earlier one to the byte
MOST_METADATA: Final = 20_000  # entries of all metadata records together
METADATA_BYTES: Final = 8 << 20  # of all metadata records together
LONGEST_VALUE: Final = 1 << 20  # [bytes] of a metadata value
MOST_ATTACHMENTS: Final = 10_000
MOST_LOSSES: Final = 1000  # after which the rest of a file is given up
CHUNK_BYTES: Final = 64 << 20  # that one chunk may unpack to
CHUNK_RECORDS: Final = 1_000_000  # in one chunk
STRETCH_BYTES: Final = 16 << 20  # outside chunks that are taken at once
SCHEMA_TYPES: Final = 1000  # that one schema may define
FREE_BYTES: Final = 128 << 20  # that any file may unpack to
PACKED_RATIO: Final = 1000  # times its size, beyond that
