"""A float field of a frozen value says its unit, in the comment on its line or in the class's docstring."""

from __future__ import annotations

import ast
import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
UNIT = re.compile(r"\[[^\]]+\]")


def float_fields_without_unit(path: Path) -> list[str]:
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    missing = []
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.ClassDef) or "dataclass" not in ast.unparse(node)[:200]:
            continue
        documented = UNIT.search(ast.get_docstring(node) or "")
        for field in node.body:
            if not isinstance(field, ast.AnnAssign) or documented:
                continue
            kind = ast.unparse(field.annotation)
            span = "\n".join(lines[field.lineno - 1 : (field.end_lineno or field.lineno)])
            if re.match(r"(float|FloatArray|NDArray\[np\.float64\])\b", kind) and not UNIT.search(span):
                missing.append(f"{path.relative_to(ROOT)}:{field.lineno} {ast.unparse(field.target)}")
    return missing


def test_physical_fields_state_their_units() -> None:
    rooms = ("data", "ident", "compensation")
    files = [path for room in rooms for path in sorted((ROOT / room).rglob("*.py"))]
    missing = [found for path in files for found in float_fields_without_unit(path)]
    assert missing == []
