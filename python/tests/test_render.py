"""Pictures have the bits of the tool's, as arrays and as files."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENES, Array, Tool, quad, read_png, room, same_bits, sphere

import finalgather as fg

SMALL: dict[str, Any] = {"size": (40, 32), "directions": 16, "photons": 5000, "seed": 2}
OPTIONS = ["--size", "40x32", "--directions", 16, "--photons", 5000, "--seed", 2]


@pytest.fixture(scope="module")
def box() -> fg.Film:
    return fg.render(fg.Scene.load(SCENES / "cornell.toml"), **SMALL)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory, tool: Tool) -> Path:
    """The folder of the tool's `box.exr` and `box.png`."""
    folder = tmp_path_factory.mktemp("tool")
    tool("render", SCENES / "cornell.toml", *OPTIONS, "-o", folder / "box.exr", "-o", folder / "box.png")
    return folder


def test_bits_of_the_tool(box: fg.Film, files: Path, tmp_path: Path) -> None:
    box.write(tmp_path / "box.exr")
    assert (tmp_path / "box.exr").read_bytes() == (files / "box.exr").read_bytes()
    of_tool = fg.Film.read(files / "box.exr")
    assert same_bits(box.rgb, of_tool.rgb) and box.rgb.shape == (32, 40, 3) and box.rgb.max() > 0
    assert box.size == of_tool.size == (40, 32)


def test_picture_of_the_tool(box: fg.Film, files: Path, tmp_path: Path) -> None:
    box.write(tmp_path / "box.png")
    pixels = read_png(files / "box.png")
    assert np.array_equal(read_png(tmp_path / "box.png"), pixels)
    assert np.array_equal(box.to_srgb()[..., :3], pixels) and (box.to_srgb()[..., 3] == 255).all()
    assert np.array_equal(read_png(box._repr_png_()), pixels)


def test_channels(box: fg.Film) -> None:
    assert {"R", "G", "B", "A", "Direct.R", "Indirect.G", "N.X", "P.Z", "Z", "Albedo.B", "Error.R"} <= set(box.channels)
    assert {"Direct", "Indirect", "Emission", "Albedo"} <= set(box.layers)
    assert same_bits(box["R"], box.rgb[..., 0]) and box["Z"].shape == (32, 40)
    assert box["Direct"].shape == (32, 40, 3) and same_bits(box["Direct"][..., 1], box["Direct.G"])
    # Radiance is the sum of its parts, each of them rounded to 32 bits.
    parts = box["Emission"] + box["Direct"] + box["Indirect"] + box["Caustics"]
    assert np.allclose(box.rgb, parts, rtol=1e-5, atol=1e-6)
    with pytest.raises(KeyError):
        box["Direkt"]
    assert box.alpha is None or same_bits(box.alpha, box["A"])


def test_what_it_says(box: fg.Film) -> None:
    assert box.error is not None and 0 < box.error < 1
    assert box.report["settings"]["directions"] == 16
    assert "40" in repr(box) and "32" in repr(box)
    assert box._repr_html_().lstrip().startswith("<")


def test_read_what_was_written(box: fg.Film, tmp_path: Path) -> None:
    box.write(tmp_path / "box.exr")
    read = fg.Film.read(tmp_path / "box.exr")
    # Files have them by name.
    assert read.channels == sorted(box.channels)
    for name in box.channels:
        assert same_bits(read[name], box[name]), name
    box.write(tmp_path / "box.png")
    png = fg.Film.read(tmp_path / "box.png")
    assert png.size == box.size and png.rgb.shape == box.rgb.shape
    with pytest.raises(fg.Error) as caught:
        box.write(tmp_path / "box.jpeg")
    assert caught.value.cure


def test_exposure(box: fg.Film) -> None:
    assert box.to_srgb().dtype == np.uint8 and box.to_srgb().shape == (32, 40, 4)
    darker, brighter = (box.to_srgb(exposure=stops)[..., :3].astype(int) for stops in (-1.0, 1.0))
    assert (
        (darker <= box.to_srgb()[..., :3]).all()
        and (brighter >= box.to_srgb()[..., :3]).all()
        and brighter.sum() > darker.sum()
    )
    # Below the shoulder of the tone curve, a stop is twice the light: exposure of a film is that of its numbers.
    dark = box.rgb.max(axis=-1) < 0.3
    curve = np.where(2 * box.rgb <= 0.0031308, 25.84 * box.rgb, 1.055 * (2 * box.rgb) ** (1 / 2.4) - 0.055)
    assert dark.any() and np.abs(brighter[dark] - 255 * curve[dark]).max() < 1
    assert box.to_srgb(exposure="auto").shape == (32, 40, 4)


def body(**more: Any) -> fg.Film:
    return fg.render(fg.Scene.from_arrays(*sphere(3), env=0.5), directions=16, photons=500, **more)


def test_background() -> None:
    film = body(size=24, background="transparent")
    pixels = film.to_srgb()
    assert pixels.shape == (24, 24, 4) and pixels[0, 0, 3] == 0 and pixels[12, 12, 3] == 255
    assert film.alpha is not None and film.alpha[0, 0] == 0 and film.alpha[12, 12] == 1
    coloured = film.to_srgb(background="#ff0080")
    assert coloured[0, 0, :3].tolist() == [255, 0, 128]
    assert np.array_equal(coloured, film.to_srgb(background=[1.0, 0.0, ((128 / 255 + 0.055) / 1.055) ** 2.4]))


def test_a_grey_ball_under_a_grey_sky() -> None:
    """A convex body of albedo a under radiance L shows a L: exactly for constant radiance, but for 32 bits."""
    film = body(size=24)
    assert np.abs(film.rgb[12, 12] - 0.25).max() < 1e-4
    assert np.abs(film.rgb[0, 0] - 0.5).max() < 1e-6


def test_numbers_of_numpy() -> None:
    more = {"eye": np.array([0, 0, 5]), "fov": np.float32(40), "exposure": np.float64(1), "seed": np.uint8(3)}
    assert same_bits(body(size=np.int64(12), **more).rgb, body(size=12, eye=(0, 0, 5), fov=40, exposure=1, seed=3).rgb)


def test_size_is_of_width_and_height() -> None:
    assert body(size=(24, 12)).rgb.shape == (12, 24, 3)
    assert body(size=12).rgb.shape == (12, 12, 3)


def test_camera() -> None:
    """Where the options put it, and what they do not name stays."""
    scene = fg.Scene.from_arrays(*quad([-1, -1, 0], [2, 0, 0], [0, 2, 0]), env=1.0)
    seen: list[Array] = []
    for eye in (np.array([0.0, 0.0, 4.0]), (0, 0, 8), [0.0, 0.0, -4.0]):
        film = fg.render(scene, eye=eye, target=[0, 0, 0], up=(0, 1, 0), fov=60.0, size=32, directions=8, photons=100)
        seen.append(film["A"])
    # The square spans 2 of 2 · 4 · tan 30° = 4.62 units, and half as much from twice as far.
    assert abs(seen[0].mean() - (2 / 4.62) ** 2) < 0.03 and abs(seen[1].mean() - (1 / 4.62) ** 2) < 0.03
    assert np.allclose(seen[2].mean(), seen[0].mean(), atol=0.01)


def test_the_default_light_warns() -> None:
    vertices, faces, _ = room()
    with pytest.warns(fg.Warning, match="sky"):
        film = fg.render(fg.Scene.from_arrays(vertices, faces), size=16, directions=8, photons=500)
    assert film.rgb.max() > 0
    assert any("sky" in text for text in film.warnings + fg.Scene.from_arrays(vertices, faces).warnings)


def test_settings() -> None:
    """Unlike seeds give unlike bits, like ones the same. A pipeline is by its name."""
    first, again, other = (body(size=16, seed=seed) for seed in (1, 1, 2))
    assert same_bits(first.rgb, again.rgb) and not same_bits(first["Indirect"], other["Indirect"])
    kill = body(size=16, pipeline="kill")
    assert kill.report["pipeline"] == "kill"


def test_the_camera_is_as_asked() -> None:
    scene = fg.Scene.from_arrays(*sphere(2), env=1.0)
    asked: dict[str, Any] = {"eye": [0.5, 1.0, 4.0], "target": [0.25, 0.0, 0.5], "up": [1.0, 0.0, 0.0], "fov": 25.0}
    camera = fg.render(scene, size=8, directions=8, photons=100, **asked).report["camera"]
    assert [camera[name] for name in ("eye", "target", "up", "fov_y_degrees")] == list(asked.values())
    # A part of it replaces that part alone.
    moved = fg.render(scene, size=8, directions=8, photons=100, fov=30.0).report["camera"]
    plain = fg.render(scene, size=8, directions=8, photons=100).report["camera"]
    assert moved["fov_y_degrees"] == 30.0 and moved["up"] == plain["up"]


def test_numpy_takes_a_film_for_its_radiance(box: fg.Film) -> None:
    assert same_bits(np.asarray(box), box.rgb) and np.asarray(box, dtype=np.float64).dtype == np.float64
