"""The walls of the house, and proof that the check would see a hole in them."""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ROOMS = ("data", "ident", "compensation", "pipelines")
FORBIDDEN_NAMES = {"utils", "util", "common", "misc", "helpers", "helper", "manager", "handler", "processor"}


def lint_imports(where: Path) -> subprocess.CompletedProcess[str]:
    linter = Path(sys.executable).with_name("lint-imports")
    return subprocess.run(
        [str(linter), "--config", "pyproject.toml", "--no-cache"],
        cwd=where,
        capture_output=True,
        text=True,
        check=False,
        timeout=300,
    )


def test_every_wall_stands() -> None:
    result = lint_imports(ROOT)
    assert result.returncode == 0, result.stdout + result.stderr


@pytest.mark.parametrize(
    ("room", "hole"),
    [
        ("data/recording.py", "import ident.estimate"),
        ("ident/evidence/gathering.py", "import ident.fit.confidence"),
        ("ident/simulation/compiled.py", "import data.recording"),
        ("ident/model/friction.py", "import ident.simulation.compiled"),
        ("compensation/controller.py", "import ident.estimate"),
        ("compensation/controller.py", "import data.recording"),
        ("compensation/orbits/steady_state.py", "import ident.model.robot"),
        ("ident/estimate.py", "import matplotlib"),
        ("pipelines/identify.py", "import pipelines.compare"),
    ],
)
def test_a_hole_in_a_wall_is_seen(tmp_path: Path, room: str, hole: str) -> None:
    for name in ROOMS:
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    target = tmp_path / room
    target.write_text(target.read_text(encoding="utf-8") + f"\n{hole}\n", encoding="utf-8")
    assert lint_imports(tmp_path).returncode != 0


def sources() -> list[Path]:
    return [path for room in ROOMS for path in sorted((ROOT / room).rglob("*.py"))]


def test_no_file_has_a_name_that_says_nothing() -> None:
    assert [path for path in sources() if path.stem in FORBIDDEN_NAMES] == []


def test_a_room_s_init_holds_its_essay_and_nothing_else() -> None:
    for path in sources():
        if path.name == "__init__.py":
            body = ast.parse(path.read_text(encoding="utf-8")).body
            assert len(body) == 1, path
            assert isinstance(body[0], ast.Expr), path


def test_every_package_is_listed_for_installation() -> None:
    import tomllib

    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    listed = set(settings["tool"]["setuptools"]["packages"])
    present = {
        ".".join(path.parent.relative_to(ROOT).parts) for path in sources() if path.name == "__init__.py"
    }
    assert listed == present
