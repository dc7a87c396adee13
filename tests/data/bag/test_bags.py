"""ROS bags, written by rosbags itself: the same recording as every other format; what is bad is ours."""

import bz2
from pathlib import Path

import numpy as np
import pytest

from data.bag.columns import read_columns
from data.bag.reader import _unpacked
from data.findings import LogError
from data.ingest import read_recording
from data.mcap.field_path import parse_path
from data.recording import Recording
from data.signals import Clock, RigSignals, Signal, Signals
from pipelines.inspect import inspect_log, to_plain

rosbags = pytest.importorskip("rosbags", reason="the extra `bags` is not installed")

TIME = np.arange(600, dtype=np.float64) * 1e-3
POSITION = np.rint(np.sin(9 * TIME) * 1e5) / 1e5
TORQUE = 0.4 * np.cos(9 * TIME)
EPOCH = 1_700_000_000_000_000_000


def written(path: Path, *, compression: str | None = None) -> Path:
    """A bag of joint states: ROS 1 as one file, ROS 2 as the database inside the bag's folder."""
    from rosbags.rosbag1 import Writer as Writer1
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Writer2
    from rosbags.typesys import Stores, get_typestore

    one = path.suffix == ".bag"
    store = get_typestore(Stores.ROS1_NOETIC if one else Stores.ROS2_HUMBLE)
    kinds = store.types
    if one:
        writer = Writer1(path)
        if compression:
            writer.set_compression(Writer1.CompressionFormat[compression])
    else:
        writer = Writer2(path, version=9, storage_plugin=StoragePlugin.SQLITE3)
    with writer:
        kind = "sensor_msgs/msg/JointState"
        states = writer.add_connection("/joint_states", kind, typestore=store)
        for k, (q, u) in enumerate(zip(POSITION, TORQUE, strict=True)):
            stamp = EPOCH + k * 1_000_000
            time = kinds["builtin_interfaces/msg/Time"](stamp // 10**9, stamp % 10**9)
            numbered = {"seq": k} if one else {}
            header = kinds["std_msgs/msg/Header"](stamp=time, frame_id="base", **numbered)
            message = kinds[kind](
                header=header, name=["other", "link"],
                position=np.array([0.0, q]), velocity=np.zeros(0), effort=np.array([0.0, u]),
            )  # fmt: skip
            raw = store.serialize_ros1(message, kind) if one else store.serialize_cdr(message, kind)
            writer.write(states, stamp + 300_000 * (k % 2), raw)
    return path if one else next(path.glob("*.db3"))


def read(path: Path, clock: Clock | None = None) -> Recording:
    position, torque = Signal("/joint_states:position[1]"), Signal("/joint_states:effort{link}")
    signals = RigSignals(bag=Signals(position=position, torque=torque, clock=clock))
    return read_recording(path, log=path.name, protocol="excitation", signals=signals)


@pytest.mark.parametrize(
    ("name", "compression"), [("run.bag", None), ("run.bag", "BZ2"), ("run.bag", "LZ4"), ("run", None)]
)
def test_a_bag_is_a_recording(tmp_path: Path, name: str, compression: str | None) -> None:
    path = written(tmp_path / name, compression=compression)
    got = read(path)
    assert np.allclose(got.time, TIME, rtol=0, atol=1e-12)
    assert np.array_equal(got.position, POSITION)
    assert np.array_equal(got.torque, TORQUE)
    assert got.begun == pytest.approx(1.7e9)
    jittered = read(path, clock="log").time
    assert np.allclose(jittered, TIME + 3e-4 * (np.arange(600) % 2), rtol=0, atol=1e-12)
    with pytest.raises(LogError, match="keeps no publish times"):
        read(path, clock="publish")


@pytest.mark.parametrize("name", ["run.bag", "run"])
def test_inspection(tmp_path: Path, name: str) -> None:
    found = to_plain(inspect_log(written(tmp_path / name)))
    assert (found["format"], found["status"], found["integrity"]["checksums"]) == ("bag", "whole", "absent")
    (states,) = found["channels"]
    assert (states["topic"], states["schema"]) == ("/joint_states", "sensor_msgs/msg/JointState")
    assert states["log_clock"]["samples"] == 600
    effort = next(item for item in states["fields"] if item["path"] == "effort")
    assert list(effort["joints"]) == ["other", "link"]


@pytest.mark.parametrize("name", ["run.bag", "run"])
def test_what_is_bad_is_ours(tmp_path: Path, name: str) -> None:
    path = written(tmp_path / name)
    content = path.read_bytes()
    for topic in ("/nothing:x", "/joint_states:nothing", "/joint_states:name"):
        with pytest.raises(LogError):
            read_columns(path, [parse_path(topic)])
    generator = np.random.default_rng(3)
    bad = tmp_path / f"bad{path.suffix}"
    for trial in range(60):
        mutant = bytearray(content)
        place = int(generator.integers(len(mutant)))
        if trial % 2:
            del mutant[place:]
        else:
            mutant[place : place + 4] = b"\xff\xff\xff\x7f"
        bad.write_bytes(mutant or b"x")
        try:
            read_columns(bad, [parse_path("/joint_states:position[1]")])
        except LogError:
            continue


def test_a_chunk_that_would_fill_the_memory_is_refused() -> None:
    assert _unpacked(bz2.compress(bytes(5_000_000)) + bz2.compress(b"x")) == bytes(5_000_000) + b"x"
    with pytest.raises(LogError, match="no log does"):
        _unpacked(bz2.compress(bytes(70_000_000)))
    with pytest.raises(LogError, match="cut off"):
        _unpacked(bz2.compress(bytes(1000))[:-4])
