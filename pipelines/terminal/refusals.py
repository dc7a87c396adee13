"""Where every error of ours becomes one message on stderr and an exit code; nobody sees a traceback.

What is not ours is a defect of this program: it is said in one line, with how to report it, and with the
traceback only where the environment sets STRIBECK_DEBUG.
"""

from __future__ import annotations

import functools
import os
import sys
import traceback
from collections.abc import Callable
from typing import Final, ParamSpec

import typer

from pipelines.exit_status import RefusalError, Status, UsageError

P = ParamSpec("P")

DEBUG: Final = "STRIBECK_DEBUG"
INTERRUPTED: Final = 130
_REMEDY: Final = "Look at that path, its rights and the room on its disk, or name another (results: -o)"


def ends_well(command: Callable[P, Status]) -> Callable[P, None]:
    """Let a command end with its status as the exit code, and every exception as a message and one."""

    @functools.wraps(command)
    def ended(*args: P.args, **kwargs: P.kwargs) -> None:
        try:
            status = int(command(*args, **kwargs))
        except typer.Exit:
            raise
        except KeyboardInterrupt:
            _say("interrupted; every file that stands under its final name is whole")
            status = INTERRUPTED
        except Exception as failure:
            status = _refused(failure)
        raise typer.Exit(status)

    return ended


def _refused(failure: Exception) -> int:
    """Say what was wrong, and the exit code of it."""
    if isinstance(failure, UsageError):
        _say(str(failure))
        return Status.USAGE
    if isinstance(failure, RefusalError) or _is_of_the_rooms_below(failure):
        _say(str(failure))
        return Status.REFUSED
    if isinstance(failure, OSError) and failure.strerror:
        where = f"{failure.filename}: " if failure.filename else ""
        _say(f"{where}{failure.strerror}. {_REMEDY}")
        return Status.REFUSED
    if os.environ.get(DEBUG):
        traceback.print_exception(failure)
    _say(
        f"this should not have happened: {type(failure).__name__}: {failure}. Please report it, with the "
        f"output of the same command under {DEBUG}=1"
    )
    return Status.REFUSED


def _is_of_the_rooms_below(failure: Exception) -> bool:
    """`LogError` and `ModelError`; imported here, so that a command that fails early loads nothing for it."""
    from data.findings import LogError  # noqa: PLC0415
    from ident.model.friction import ModelError  # noqa: PLC0415

    return isinstance(failure, (LogError, ModelError))


def _say(message: str) -> None:
    """One message on stderr, with what could steer a terminal taken out of it."""
    shown = "".join(c if c.isprintable() or c == "\n" else "\N{REPLACEMENT CHARACTER}" for c in message)
    encoding = sys.stderr.encoding or "utf-8"
    print("stribeck: " + shown.encode(encoding, "replace").decode(encoding), file=sys.stderr)
