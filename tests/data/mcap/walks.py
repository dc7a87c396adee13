"""A walk over bytes, and its messages one by one."""

import numpy as np

from data.integrity import Integrity
from data.mcap.walk import McapWalk

Message = tuple[int, int, bytes]  # channel, log time, the message's own bytes


def walk(content: bytes) -> tuple[McapWalk, list[Message]]:
    """The walk, and its messages."""
    found = McapWalk(np.frombuffer(content, np.uint8), compiled=False)
    messages = [
        (int(c), int(t), block.data[int(b) : int(b + n)].tobytes())
        for block in found.blocks()
        for c, t, b, n in zip(
            block.messages.channel,
            block.messages.log_time,
            block.messages.begin,
            block.messages.length,
            strict=True,
        )
    ]
    return found, messages


def integrity(content: bytes) -> Integrity:
    """What the walk proves."""
    return walk(content)[0].integrity
