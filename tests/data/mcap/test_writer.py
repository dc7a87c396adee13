"""What is written opens in mcap's own reader, and what is read is what was written, bit for bit."""

import json
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

from data.findings import LogError
from data.mcap.columns import read_columns
from data.mcap.container import Compression
from data.mcap.field_path import parse_path
from data.mcap.writer import Encoding, write_mcap
from data.recording import FloatArray

PATHS = [parse_path(f"/joint_states:{name}") for name in ("position[0]", "velocity{link}", "effort")]
EPOCH = 1_700_000_000_000_000_000


def write(path: Path, encoding: Encoding, compression: Compression, columns: FloatArray) -> FloatArray:
    time = np.arange(columns.shape[1], dtype=np.float64) * 1e-3
    write_mcap(
        path,
        time=time,
        position=columns[0],
        velocity=columns[1],
        effort=columns[2],
        metadata={"simulated": "true"},
        encoding=encoding,
        compression=compression,
        extra={"/command": columns[0] + 1.0},
        epoch=EPOCH,
    )
    return time


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
@pytest.mark.parametrize("encoding", ["cdr", "json"])
def test_the_ecosystem_reads_it(tmp_path: Path, encoding: Encoding, compression: Compression) -> None:
    columns = np.random.default_rng(0).normal(size=(3, 6000))
    path = tmp_path / "run.mcap"
    time = write(path, encoding, compression, columns)
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        summary = reader.get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.channel_message_counts == {1: 6000, 2: 6000}
        assert len(summary.chunk_indexes) == summary.statistics.chunk_count > 1
        assert [record.metadata for record in reader.iter_metadata()] == [{"simulated": "true"}]
        stamps = [m.log_time for _, _, m in reader.iter_messages(topics=["/joint_states"])]
        assert stamps == (EPOCH + np.rint(time * 1e9).astype(np.int64)).tolist()
        # A time range goes through the chunk and message indexes.
        part = [
            m
            for _, _, m in reader.iter_messages(
                ["/command"], starting_at=stamps[4000], ending_before=stamps[4010]
            )
        ]
        assert [m.sequence for m in part] == list(range(4000, 4010))
        if encoding == "cdr":
            first = [m for _, _, _, m in reader.iter_decoded_messages(topics=["/joint_states"])]
            got = np.array([(m.position[0], m.velocity[0], m.effort[0]) for m in first]).T
            assert first[1].header.stamp.nanosec == 1_000_000
            assert first[0].name == ["link"]
        else:
            bodies = [json.loads(m.data) for _, _, m in reader.iter_messages(topics=["/joint_states"])]
            got = np.array([(m["position"][0], m["velocity"][0], m["effort"][0]) for m in bodies]).T
    assert np.array_equal(got, columns)


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
@pytest.mark.parametrize("encoding", ["cdr", "json"])
def test_we_read_it(tmp_path: Path, encoding: Encoding, compression: Compression) -> None:
    columns = np.random.default_rng(1).normal(size=(3, 6000))
    path = tmp_path / "run.mcap"
    time = write(path, encoding, compression, columns)
    read = read_columns(np.fromfile(path, np.uint8), [*PATHS, parse_path("/command:position")])
    topic = read.topics["/joint_states"]
    assert np.array_equal(np.stack([topic.values[p.text] for p in PATHS]), columns)
    assert np.array_equal(read.topics["/command"].values["/command:position"], columns[0] + 1.0)
    stamps = EPOCH + np.rint(time * 1e9).astype(np.int64)
    assert topic.header_time is not None
    for clock in (topic.log_time, topic.publish_time, topic.header_time):
        assert np.array_equal(clock, stamps)
    assert read.integrity.checksums == "verified"
    assert read.integrity.whole
    assert read.metadata["simulated"] == "true"
    assert read.decoded_singly == (0 if encoding == "cdr" else 12000)


@settings(max_examples=40, deadline=None)
@given(
    columns=arrays(
        np.float64, st.tuples(st.just(3), st.integers(1, 40)), elements=st.floats(allow_nan=False, width=64)
    ),
    joint=st.text(st.characters(exclude_categories=("Cs", "Cc")), min_size=1, max_size=12).filter(
        lambda name: not set(name) & set("{}")
    ),
)
def test_every_number_and_joint_name_survives(columns: FloatArray, joint: str) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "run.mcap"
        write_mcap(
            path,
            joint=joint,
            time=np.arange(columns.shape[1], dtype=np.float64) * 1e-3,
            position=columns[0],
            effort=columns[2],
        )
        wanted = [parse_path(f"/joint_states:position{{{joint}}}"), parse_path("/joint_states:effort[0]")]
        read = read_columns(np.fromfile(path, np.uint8), wanted)
    for path_, column in zip(wanted, (columns[0], columns[2]), strict=True):
        assert np.array_equal(
            read.topics["/joint_states"].values[path_.text].view(np.int64), column.view(np.int64)
        )


def test_what_cannot_be_written_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    three, two = np.arange(3.0), np.arange(2.0)
    with pytest.raises(LogError, match="shape"):
        write_mcap(path, time=three, position=two)
    with pytest.raises(LogError, match="no word for nan"):
        write_mcap(path, time=two, position=np.array([0.0, np.nan]), encoding="json")
    with pytest.raises(LogError, match="before 1970"):
        write_mcap(path, time=two - 1.0, position=two)
    with pytest.raises(LogError, match="finite seconds"):
        write_mcap(path, time=np.array([0.0, np.inf]), position=two)
    assert list(tmp_path.iterdir()) == []
