"""Reports of the tool and of this package follow `docs/report.schema.json`."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY, Tool, box, sphere, write_ply
from jsonschema import Draft202012Validator

import finalgather as fg

SCHEMA = json.loads((REPOSITORY / "docs" / "report.schema.json").read_text())


def check(report: dict[str, Any]) -> None:
    Draft202012Validator.check_schema(SCHEMA)
    errors = list(Draft202012Validator(SCHEMA).iter_errors(report))
    assert not errors, "\n".join(f"{error.json_path}: {error.message}" for error in errors)


def test_tool(tool: Tool, tmp_path: Path) -> None:
    model, sky = tmp_path / "ball.ply", tmp_path / "sky.exr"
    write_ply(model, *sphere(2))
    shape = ("--size", "32x16", "--directions", 32, "--photons", 1000)
    picture = json.loads(tool("render", model, *shape, "-o", sky, "--json"))
    assert picture["camera"] is not None and picture["outputs"] == [str(sky)]
    check(picture)
    parts = [tmp_path / f"{shard}.part" for shard in (1, 2)]
    for shard, part in enumerate(parts, 1):
        check(json.loads(tool("render", model, *shape, "--shard", f"{shard}/2", "-o", part, "--json")))
    check(json.loads(tool("merge", *parts, "-o", tmp_path / "merged.exr", "--json")))
    prt = tmp_path / "prt.npz"
    baked = json.loads(
        tool("bake", model, "--to", "vertices", "--what", "prt", "--directions", 16, "-o", prt, "--json")
    )
    check(baked)
    check(json.loads(tool("bake", model, "--to", "camera", *shape, "-o", tmp_path / "c.exr", "--json")))
    relit = json.loads(tool("relight", prt, "--env", sky, "-o", tmp_path / "relit.npz", "--json"))
    check(relit)
    assert [report["command"] for report in (picture, baked, relit)] == ["render", "bake", "relight"]


@pytest.mark.filterwarnings("ignore::finalgather.Warning")
def test_package() -> None:
    scene = fg.Scene.from_arrays(*box(cells=2))
    check(fg.render(scene, size=16, directions=32, photons=1000).report)
    baked = fg.bake(scene, what=["ao", "irradiance"], directions=16, photons=1000)
    check(baked.report)
    assert np.isfinite(baked["ao"]).all()


def test_the_schema_can_refuse() -> None:
    report = fg.bake(fg.Scene.from_arrays(*box(cells=2)), what="ao", directions=16).report
    changes: list[dict[str, Any]] = [{"schema": 2}, {"command": "render"}, {"surprise": 1}, {"seconds": {}}, {"part": 3}]
    for change in changes:
        with pytest.raises(AssertionError):
            check({**report, **change})
