"""`progress=True` with tqdm: a bar on stderr."""

from __future__ import annotations

import pytest
from conftest import sphere

import finalgather as fg


def test_bar(capfd: pytest.CaptureFixture[str]) -> None:
    # It shows itself ten times a second, so this takes a little longer.
    scene = fg.Scene.from_arrays(*sphere(12))
    fg.bake(scene, what="ao", directions=8192, progress=True)
    out, err = capfd.readouterr()
    assert out == "" and "/8192 [" in err and "%|" in err
