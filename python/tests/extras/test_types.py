"""Types: the stubs are those of the compiled part, and the examples and tests pass strict checks against them."""

from __future__ import annotations

import subprocess
import sys

from conftest import REPOSITORY

PYTHON = REPOSITORY / "python"


def check(*arguments: str) -> None:
    # Not from a folder that holds the sources of the package: the installed one counts.
    done = subprocess.run(
        [sys.executable, "-m", *arguments], capture_output=True, text=True, cwd=PYTHON / "tests", timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr


def test_stubs() -> None:
    check("mypy.stubtest", "finalgather", "--ignore-disjoint-bases")


def test_examples_and_tests() -> None:
    files = [*(PYTHON / "tests").rglob("*.py"), *(PYTHON / "examples").glob("*.py")]
    check("mypy", "--strict", "--ignore-missing-imports", "--allow-untyped-calls", *map(str, sorted(files)))
