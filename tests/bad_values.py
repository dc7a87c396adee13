"""Values that are no numbers, and what every refusal of one says: the argument and an equation."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np
import pytest

from ident.model.friction import ModelError

NO_NUMBERS: Final = ("0.4", None, 0.4j, math.nan, [0.4, 0.5], np.array(0.4), True, 10**400)
NO_WORDS: Final[tuple[Any, ...]] = ("z", None, 1, [], ["r"], {}, np.array(["r", "L"]))
NO_ARRAYS: Final = ("0.4", None, [0.4, None], [0.4j], np.array([0.4j]), [[0.4], [0.4, 0.5]], {0.4: 0.4})


def refused(call: Callable[[], object], *said: str) -> None:
    """The call raises a `ModelError` whose message says all this and names an equation."""
    with pytest.raises(ModelError) as caught:
        call()
    message = str(caught.value)
    assert all(word in message for word in (*said, "eq")), message


def each_refused(function: Callable[..., object], arguments: dict[str, Any], bad: dict[str, Any]) -> None:
    """Each bad value is refused by name in the place of the good one."""
    for name, values in bad.items():
        for value in values:
            refused(partial(function, **{**arguments, name: value}), name)
