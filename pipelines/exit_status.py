"""How a command ends: the four exit codes, and the two refusals of ours that carry one.

A refusal's message is one sentence or a few: what was got, where, which rule it breaks and what to do. The
command line prints it as it stands; nobody sees a traceback. Bad logs (`LogError`) and bad model values
(`ModelError`) come from the rooms below and end in `REFUSED` too.
"""

from __future__ import annotations

from enum import IntEnum


class Status(IntEnum):
    """The exit codes that interface and manifest speak of."""

    DONE = 0
    REFUSED = 1  # the input cannot be used; nothing was written under a final name
    USAGE = 2  # the command or its campaign.toml is wrong
    WITHHELD = 3  # done, and something was withheld, salvaged or left out, and said so


class RefusalError(Exception):
    """An input file cannot be used: exit code 1."""


class UsageError(Exception):
    """The command line or a settings file asks for something that makes no sense: exit code 2."""
