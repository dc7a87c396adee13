"""How much a compressed part of a file from outside may unpack to.

Numbers of a rig pack to a tenth, a channel that never moves to a hundredth or less; a part that packs to a
thousandth and is large besides was made to fill the memory of whoever opens it.
"""

from __future__ import annotations

from typing import Final

FREE: Final = 1 << 26  # [bytes] that anything may unpack to
MOST: Final = 1 << 30  # [bytes] that nothing may exceed
_RATIO: Final = 100  # of unpacked to packed bytes, above FREE


def over_limit(unpacked: int, packed: int) -> bool:
    """Whether a part of so many bytes claims to unpack to more than a log would."""
    return unpacked > MOST or (unpacked > FREE and unpacked > _RATIO * packed)
