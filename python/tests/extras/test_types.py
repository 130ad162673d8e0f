"""Types: the stubs are those of the compiled part, and the examples and tests pass strict checks against them."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from conftest import REPOSITORY

PYTHON = REPOSITORY / "python"


# Types for annotations alone, and names of arguments that Python's protocols never use.
ALLOWED = r"""
finalgather\._finalgather\.(Color|EnvironmentLike|Path|Progress|Quantity|Settings|BakeSettings|Vector|__all__)
finalgather\._finalgather\.\w+\.(__getitem__|get)
finalgather\.(Baked|Film|Comparison)\.(__getitem__|get)
"""


def check(*arguments: str) -> None:
    # Not from a folder that holds the sources of the package: the installed one counts.
    done = subprocess.run(
        [sys.executable, "-m", *arguments], capture_output=True, text=True, cwd=PYTHON / "tests", timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_stubs(tmp_path: Path) -> None:
    (tmp_path / "allowed.txt").write_text(ALLOWED)
    allowed = ("--allowlist", str(tmp_path / "allowed.txt"), "--ignore-unused-allowlist")
    check("mypy.stubtest", "finalgather", "--concise", "--ignore-disjoint-bases", *allowed)


def test_examples_and_tests() -> None:
    files = [*(PYTHON / "tests").rglob("*.py"), *(PYTHON / "examples").glob("*.py")]
    check("mypy", "--strict", "--ignore-missing-imports", "--allow-untyped-calls", *map(str, sorted(files)))
