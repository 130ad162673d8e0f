"""The blocks of docs/python.md run in their order, as one program, and its tables name what there is."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
from conftest import REPOSITORY

import finalgather as fg

PAGE = REPOSITORY / "docs" / "python.md"
TEXT = PAGE.read_text()


@pytest.mark.filterwarnings("ignore::finalgather.Warning")
def test_blocks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    blocks = list(re.finditer(r"^```python\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL))
    assert len(blocks) > 10
    for block in blocks:
        # Lines of a traceback are those of the page.
        first = TEXT.count("\n", 0, block.start(1))
        exec(compile("\n" * first + block[1], str(PAGE), "exec"), names)
    assert {"valley.npz", "valley.exr", "valley.glb", "relit.png"} <= {path.name for path in tmp_path.iterdir()}


def test_names() -> None:
    for name in re.findall(r"`fg\.([A-Za-z_.]+)", TEXT):
        found: Any = fg
        for part in name.split("."):
            found = getattr(found, part)
    public = {
        name
        for name in dir(fg)
        if not name.startswith("_") and getattr(getattr(fg, name), "__module__", "").startswith("finalgather")
    }
    missing = {name for name in public if not re.search(rf"\b{name}\b", TEXT)}
    assert not missing, f"docs/python.md does not name {missing}"


def test_links() -> None:
    for target in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", TEXT):
        assert (PAGE.parent / target).exists(), target
