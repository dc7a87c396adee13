"""Reading logs: columns of MCAP files beside the ordinary readers, in messages a second, values compared.

    python -m benchmarks.ingest [--quick] [--json]

A file of JointState messages at 1 kHz (zstd, chunks of 1 MB) is read to the columns of position, velocity and
effort. The ordinary reader is mcap's with the decoder of the encoding; it reads a tenth of the messages, and
its time is scaled. The least that any reader has to do is to unpack the chunks and compare their checksums.
Peak memory is what a read allocates, in columns' sizes.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import tracemalloc
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
import zstandard
from google.protobuf import descriptor_pb2
from google.protobuf.message_factory import GetMessageClass
from mcap.reader import make_reader
from mcap.records import Chunk
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from mcap_ros2.decoder import DecoderFactory

from benchmarks.rows import Row, against, figure, in_turns, show
from data.files import read_bytes
from data.mcap import protobuf
from data.mcap.columns import McapColumns, read_columns
from data.mcap.field_path import parse_path
from data.mcap.writer import Encoding, write_mcap
from data.recording import FloatArray

MESSAGES: Final = 600_000
QUICK_MESSAGES: Final = 120_000
PART: Final = 10  # of the messages, one, that the ordinary reader gets
BEGUN: Final = 1_700_000_000_000_000_000  # [ns]
TARGETS: Final = {"cdr": 100.0, "json": 20.0, "protobuf": 40.0}  # times the ordinary reader
FLOOR_TARGET: Final = 2.0  # times unpacking and checksums alone
MEMORY_TARGET: Final = 3.0  # columns' sizes, and a chunk
_PATHS: Final = {
    "cdr": ("position[0]", "velocity[0]", "effort[0]"),
    "json": ("position[0]", "velocity[0]", "effort[0]"),
    "protobuf": ("position", "velocity", "effort"),
}
_TOPIC: Final = "/joint_states"


def rows(quick: bool) -> list[Row]:
    """The rows of every encoding."""
    found = []
    with tempfile.TemporaryDirectory() as scratch:
        for encoding in TARGETS:
            found += _rows_of(encoding, Path(scratch), QUICK_MESSAGES if quick else MESSAGES)
    return found


def main() -> None:
    """As a command."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.ingest")
    parser.add_argument("--json", action="store_true", help="print JSON")
    parser.add_argument("--quick", action="store_true", help="fewer messages")
    asked = parser.parse_args()
    show(rows(asked.quick), as_json=asked.json)


def _rows_of(encoding: str, scratch: Path, messages: int) -> list[Row]:
    whole, part = scratch / f"{encoding}.mcap", scratch / f"{encoding}_part.mcap"
    truth, part_truth = _written(whole, encoding, messages), _written(part, encoding, messages // PART)
    found: list[McapColumns] = []

    def ours() -> None:
        found[:] = [_read(whole, encoding)]

    theirs: list[FloatArray] = []

    def peer() -> None:
        theirs[:] = [_ordinary(part, encoding)]

    chunks = _chunks(whole)
    mine, other, floor = in_turns([ours, peer, lambda: _unpack(chunks)], rounds=3, repeats=(1, 1, 1))
    columns = np.array(list(found[0].topics[_TOPIC].values.values()))
    wrong = float(np.max(np.abs(columns - truth)))
    off = float(np.max(np.abs(theirs[0] - part_truth)))
    compared = against(
        f"{messages} messages, {encoding}",
        "mcap's reader and decoder",
        1e6 * mine / messages,
        1e6 * other / (messages // PART),
        error_ours=wrong,
        error_peer=off,
        unit="us a message",
    )
    return [
        {**compared, "target": TARGETS[encoding], "decoded_singly": found[0].decoded_singly},
        figure(f"{encoding}: over unpacking and checksums alone", mine / floor, FLOOR_TARGET, "x"),
        figure(f"{encoding}: peak memory over the columns", _peak(whole, encoding), MEMORY_TARGET, "x"),
    ]


def _read(path: Path, encoding: str) -> McapColumns:
    return read_columns(
        read_bytes(path, log=path.name), [parse_path(f"{_TOPIC}:{end}") for end in _PATHS[encoding]]
    )


def _peak(path: Path, encoding: str) -> float:
    """Bytes allocated at most in one read, less a chunk's, over those of the columns."""
    tracemalloc.start()
    read = _read(path, encoding)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    columns = sum(own.nbytes for own in read.topics[_TOPIC].values.values())
    return (peak - (1 << 20)) / columns


def _chunks(path: Path) -> list[tuple[bytes, int]]:
    """Each chunk as it is packed, and its size."""
    with path.open("rb") as stream:
        records = StreamReader(stream, emit_chunks=True).records
        return [(own.data, own.uncompressed_size) for own in records if isinstance(own, Chunk)]


def _unpack(chunks: Sequence[tuple[bytes, int]]) -> None:
    machine = zstandard.ZstdDecompressor()
    for data, size in chunks:
        zlib.crc32(machine.decompress(data, max_output_size=size))


def _ordinary(path: Path, encoding: str) -> FloatArray:
    """The columns (3, n) as the ordinary reader gives them."""
    with path.open("rb") as stream:
        if encoding == "cdr":
            reader = make_reader(stream, decoder_factories=[DecoderFactory()])
            rows: Iterable[Any] = (
                (own.position[0], own.velocity[0], own.effort[0])
                for _, _, _, own in reader.iter_decoded_messages()
            )
        else:
            raws = (message.data for _, _, message in make_reader(stream).iter_messages())
            rows = map(_row_of(encoding), raws)
        return np.array(list(rows)).T


def _row_of(encoding: str) -> Callable[[bytes], tuple[float, float, float]]:
    if encoding == "json":

        def from_json(raw: bytes) -> tuple[float, float, float]:
            own = json.loads(raw)
            return own["position"][0], own["velocity"][0], own["effort"][0]

        return from_json
    kind: Any = GetMessageClass(protobuf.descriptor_of("rig.State", _protobuf_schema()))

    def from_protobuf(raw: bytes) -> tuple[float, float, float]:
        own = kind.FromString(raw)
        return own.position, own.velocity, own.effort

    return from_protobuf


def _written(path: Path, encoding: str, messages: int) -> FloatArray:
    """Write a run; its position, velocity and effort (3, n)."""
    time, generator = np.arange(messages, dtype=np.float64) * 1e-3, np.random.default_rng(0)
    noise = generator.standard_normal((3, messages))
    truth = np.array([np.sin(time), np.cos(time), 0.1 * np.sin(3.0 * time)]) + 1e-5 * noise
    if encoding == "protobuf":
        _write_protobuf(path, time, truth)
    else:
        kind: Encoding = "cdr" if encoding == "cdr" else "json"
        write_mcap(
            path,
            time=time,
            position=truth[0],
            velocity=truth[1],
            effort=truth[2],
            encoding=kind,
            epoch=BEGUN,
        )
    return np.asarray(truth)


def _write_protobuf(path: Path, time: FloatArray, truth: FloatArray) -> None:
    kind: Any = GetMessageClass(protobuf.descriptor_of("rig.State", _protobuf_schema()))
    with path.open("wb") as stream:
        writer = Writer(stream, compression=CompressionType.ZSTD)
        writer.start()
        schema = writer.register_schema("rig.State", "protobuf", _protobuf_schema())
        channel = writer.register_channel(_TOPIC, "protobuf", schema)
        for now, position, velocity, effort in zip(time.tolist(), *truth.tolist(), strict=True):
            stamp = BEGUN + round(now * 1e9)
            content = kind(
                stamp={"seconds": stamp // 10**9, "nanos": stamp % 10**9},
                position=position,
                velocity=velocity,
                effort=effort,
            ).SerializeToString()
            writer.add_message(channel, stamp, content, stamp)
        writer.finish()  # type: ignore[no-untyped-call]  # mcap leaves this one untyped


def _protobuf_schema() -> bytes:
    file = descriptor_pb2.FileDescriptorProto(name="rig.proto", package="rig", syntax="proto3")
    stamp = file.message_type.add(name="Stamp")
    stamp.field.add(name="seconds", number=1, type="TYPE_INT64", label="LABEL_OPTIONAL")
    stamp.field.add(name="nanos", number=2, type="TYPE_INT32", label="LABEL_OPTIONAL")
    state = file.message_type.add(name="State")
    state.field.add(
        name="stamp", number=1, type="TYPE_MESSAGE", type_name=".rig.Stamp", label="LABEL_OPTIONAL"
    )
    for number, name in enumerate(("position", "velocity", "effort"), start=2):
        state.field.add(name=name, number=number, type="TYPE_DOUBLE", label="LABEL_OPTIONAL")
    return descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()


if __name__ == "__main__":
    main()
