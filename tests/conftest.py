"""Settings of the whole suite."""

from __future__ import annotations

from hypothesis import settings

# A first call compiles a kernel, so no example has a deadline; the same examples are tried everywhere.
settings.register_profile("suite", deadline=None, derandomize=True)
settings.load_profile("suite")
