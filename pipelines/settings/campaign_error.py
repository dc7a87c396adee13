"""What is wrong with a campaign.toml, in the file's own words: file, key, rule, the nearest known key."""

from __future__ import annotations

import difflib
import typing
from collections.abc import Mapping, Sequence
from pathlib import Path

from pydantic import BaseModel, ValidationError

from pipelines.exit_status import UsageError
from pipelines.settings.campaign_schema import CampaignDocument


class CampaignError(UsageError):
    """A campaign.toml that breaks a rule: the message names the file, the key, the rule and the remedy."""


def explained(path: Path, table: Mapping[str, object], failure: ValidationError) -> str:
    """The first broken rule, unknown keys before all, as file, place, key and rule."""
    errors = failure.errors(include_url=False)
    errors.sort(key=lambda error: error["type"] != "extra_forbidden")
    first = errors[0]
    message = f"{path}: {_place(table, first['loc'])}: "
    if first["type"] == "extra_forbidden":
        message += f"unknown key{nearest(str(first['loc'][-1]), _known_keys(first['loc'][:-1]))}"
    elif first["type"] == "missing":
        message += "is missing"
    else:
        rule = first["msg"].removeprefix("Value error, ")
        message += rule
        if not isinstance(first["input"], (Mapping, list)) and repr(first["input"]) not in rule:
            message += f" (it is {first['input']!r})"
    others = len(errors) - 1
    return message + (f" (and {others} more to correct)" if others else "")


def _place(table: Mapping[str, object], location: Sequence[int | str]) -> str:
    """A key path as a reader of the file sees it: [[experiment]] 3 (set_point): observer_gain."""
    parts = list(location)
    if not parts:
        return "the file"
    if parts[0] == "experiment" and len(parts) > 1 and isinstance(parts[1], int):
        entries = table.get("experiment")
        entry = entries[parts[1]] if isinstance(entries, list) else None
        protocol = entry.get("protocol") if isinstance(entry, Mapping) else None
        head = f"[[experiment]] {parts[1] + 1}" + (f" ({protocol})" if isinstance(protocol, str) else "")
        rest = parts[2:]
    elif len(parts) > 1:
        head, rest = f"[{parts[0]}]", parts[1:]
    else:
        return str(parts[0])
    return head + (f": {'.'.join(map(str, rest))}" if rest else "")


def _known_keys(location: Sequence[int | str]) -> list[str]:
    """The keys that a table of the campaign may have."""
    model: type[BaseModel] | None = CampaignDocument
    for part in location:
        if model is not None and part in model.model_fields:
            model = _table_in(model.model_fields[str(part)].annotation)
    return [] if model is None else list(model.model_fields)


def _table_in(annotation: object) -> type[BaseModel] | None:
    """The model inside `list[Model]`, `Model | None` and the like."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next(filter(None, map(_table_in, typing.get_args(annotation))), None)


def nearest(name: str, known: Sequence[str]) -> str:
    """The end of a sentence that refuses a name: the nearest known one, else what is known."""
    found = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    if found:
        return f"; the nearest known one is {found[0]!r}"
    return f"; known: {', '.join(map(repr, known[:8]))}{', ...' if len(known) > 8 else ''}" if known else ""
