"""Measures of pictures are those of their definitions, and those of the tool."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
from conftest import Array, Tool, quad, read_png, same_bits

import finalgather as fg

RNG = np.random.default_rng(4)
A = RNG.uniform(0.1, 1.0, (12, 16, 3)).astype(np.float32)
B = (A * RNG.uniform(0.9, 1.2, A.shape)).astype(np.float32)


def measures(a: Array, b: Array) -> dict[str, float]:
    a, b = a.astype(float), b.astype(float)
    rmse = math.sqrt(((a - b) ** 2).mean())
    return {
        "mean_a": a.mean(),
        "mean_b": b.mean(),
        "bias": (a.mean() - b.mean()) / b.mean(),
        "mae": np.abs(a - b).mean(),
        "rmse": rmse,
        "relative_rmse": rmse / b.mean(),
        "relative_mse": ((a - b) ** 2 / (b**2 + 0.01)).mean(),
        "psnr": -20 * math.log10(rmse),
    }


def test_definitions() -> None:
    found = fg.compare(A, B)
    for name, expected in measures(A, B).items():
        assert found[name] == pytest.approx(expected, rel=1e-5), name
        assert found.as_dict()[name] == found[name]
    assert found["pixels"] == 12 * 16 and 0 < found["flip"] < 1


def test_equal_pictures() -> None:
    same = fg.compare(A, A)
    assert same["rmse"] == same["bias"] == same["flip"] == 0 and same["psnr"] == math.inf


def test_mask_and_trim() -> None:
    mask = np.zeros(A.shape[:2], bool)
    mask[2:5, 3:9] = True
    some = fg.compare(A, B, mask=mask)
    assert some["pixels"] == mask.sum()
    assert some["rmse"] == pytest.approx(measures(A[mask], B[mask])["rmse"], rel=1e-5)
    # A quarter of the pixels, the worst ones, do not count.
    worst = ((A.astype(float) - B) ** 2).sum(axis=-1)
    kept = worst < np.sort(worst.ravel())[144]
    trimmed = fg.compare(A, B, trim=0.25)
    assert trimmed["pixels"] == 144
    assert trimmed["rmse"] == pytest.approx(measures(A[kept], B[kept])["rmse"], rel=1e-4)


def test_map() -> None:
    found = fg.compare(A, B)
    assert np.allclose(found.map.rgb, A - B, atol=1e-6)
    assert found.map["FLIP"].mean() == pytest.approx(found["flip"], rel=1e-4)
    assert read_png(found._repr_png_()).shape[:2] == (12, 16)
    assert "flip" in repr(found).lower() and found._repr_html_().lstrip().startswith("<")


def test_numbers_of_the_tool(tmp_path: Path, tool: Tool) -> None:
    scene = fg.Scene.from_arrays(*quad([-1, -1, 0], [2, 0, 0], [0, 2, 0]), env=[0.2, 0.5, 1.0])
    films = [fg.render(scene, size=(24, 16), fov=fov, directions=8, photons=100) for fov in (40.0, 50.0)]
    for name, film in zip("ab", films):
        film.write(tmp_path / f"{name}.exr")
    of_tool = json.loads(tool("compare", tmp_path / "a.exr", tmp_path / "b.exr", "--json", "-o", tmp_path / "map.exr"))
    found = fg.compare(*films)
    assert found.as_dict() == of_tool
    assert same_bits(found.map["FLIP"], fg.Film.read(tmp_path / "map.exr")["FLIP"])
    # Arrays of a film are the film.
    assert fg.compare(films[0].rgb, films[1]).as_dict() == of_tool


def test_kinds_of_arrays() -> None:
    expected = fg.compare(A, B).as_dict()
    assert fg.compare(A.astype(np.float64), np.asfortranarray(B)).as_dict() == expected
    assert fg.compare(np.repeat(A, 2, axis=1)[:, ::2], B).as_dict() == expected


@pytest.mark.parametrize(
    ("a", "b", "more"),
    [
        (A, B[:-1], {}),
        (A[..., :2], B[..., :2], {}),
        (np.where(A > 0.99, np.nan, A), B, {}),
        (A, B, {"mask": np.ones((3, 3), bool)}),
        (A, B, {"mask": np.zeros(A.shape[:2], bool)}),
        (A, B, {"trim": 1.0}),
        (A, B, {"trim": -0.1}),
        (np.zeros((0, 0, 3)), np.zeros((0, 0, 3)), {}),
    ],
)
def test_refused(a: Array, b: Array, more: dict[str, object]) -> None:
    with pytest.raises(fg.Error) as caught:
        fg.compare(a, b, **more)  # type: ignore[arg-type]
    assert isinstance(caught.value, ValueError) and caught.value.cure


def test_bytes_are_no_radiance() -> None:
    """The bytes of a PNG have a tone curve and an exposure."""
    with pytest.raises(fg.UsageError, match="picture: bytes"):
        fg.compare(np.zeros((8, 8, 3), np.uint8), np.zeros((8, 8, 3), np.float32))
