"""`progress=True` with tqdm, which is a bar on stderr that ends full."""

from __future__ import annotations

import numpy as np
import pytest

import finalgather as fg


def test_bar(capfd: pytest.CaptureFixture[str]) -> None:
    scene = fg.Scene.from_arrays(np.eye(3), [[0, 1, 2]])
    fg.bake(scene, vertices=True, what="ao", directions=64, progress=True)
    out, err = capfd.readouterr()
    assert out == "" and "64/64" in err and "100%" in err
