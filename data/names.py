"""Names that come out of a log, made fit to be shown.

A topic, a header or a metadata key is data: it may hold terminal escapes, line breaks or thousands of
characters. `shown` gives one printable line of bounded length; nothing from a log goes into a message without
it. (Markup and HTML are escaped where they are written.)
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable

_LONGEST = 120


def shown(name: str, longest: int = _LONGEST) -> str:
    """One printable line of at most `longest` characters; control characters as escapes."""
    cut = name if len(name) <= longest else name[: longest - 1] + "…"
    if cut.isprintable():
        return cut
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in cut)[: 2 * longest]


def nearest(wanted: str, available: Iterable[str], count: int = 4) -> str:
    """The available names most like `wanted`, ready for a message: `a, b, c`, or what there is."""
    names = list(dict.fromkeys(available))
    if not names:
        return "nothing"
    near = difflib.get_close_matches(wanted, names[:2000], n=count, cutoff=0.5)
    inside = [name for name in names[:2000] if name not in near and wanted.strip("/").lower() in name.lower()]
    chosen = (near + inside)[:count] or names[:count]
    more = f" and {len(names) - len(chosen)} more" if not near and len(names) > len(chosen) else ""
    return ", ".join(shown(name, 60) for name in chosen) + more
