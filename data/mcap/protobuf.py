"""Protobuf messages, one at a time: the ordinary decoder, by Google's own parser.

A schema is a FileDescriptorSet. Decoded messages are seen as mappings by field name. proto3 leaves out
numbers that are 0, so that a number without presence that is absent is 0; a message or optional number that
is absent holds nothing, and is no key of the mapping.

Source: protobuf.dev/programming-guides/encoding; mcap.dev/spec/registry.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor import Descriptor
from google.protobuf.message import Message

from data.findings import LogError
from data.names import shown


def descriptor_of(name: str, data: bytes) -> Descriptor:
    """The descriptor of a message type in a FileDescriptorSet.

    Raises
    ------
    LogError
        When the set does not hold it, or is none.
    """
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(data).file
        pool, waiting = descriptor_pool.DescriptorPool(), {file.name: file for file in files}
        while waiting:  # a file may stand before those that it imports
            ready = [file for file in waiting.values() if not waiting.keys() & set(file.dependency)]
            for file in ready or list(waiting.values()):
                pool.Add(file)
                del waiting[file.name]
        return pool.FindMessageTypeByName(name)
    except Exception as error:  # a foreign descriptor may raise anything
        text = shown(f"{type(error).__name__}: {error}", 100)
        raise LogError(f"the protobuf schema of {shown(name)} cannot be read ({text})") from error


def decode(descriptor: Descriptor, raw: bytes) -> Mapping[str, Any]:
    """A message as nested mappings; raises protobuf's DecodeError."""
    return _Fields(message_factory.GetMessageClass(descriptor).FromString(raw))


class _Fields(Mapping[str, Any]):
    """The fields of a message that hold something."""

    def __init__(self, message: Message) -> None:
        self._message = message
        self._names = {
            str(field.name): field
            for field in message.DESCRIPTOR.fields
            if not field.has_presence or message.HasField(field.name)
        }

    def __getitem__(self, name: str) -> Any:
        return _value(self._names[name], getattr(self._message, name))

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


def _value(field: Any, value: Any) -> Any:
    if field.message_type is None:
        return list(value) if field.is_repeated else value
    if field.message_type.GetOptions().map_entry:
        return {str(key): _Fields(own) if isinstance(own, Message) else own for key, own in value.items()}
    return [_Fields(own) for own in value] if field.is_repeated else _Fields(value)
