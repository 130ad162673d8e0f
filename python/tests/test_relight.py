"""Light of baked transfer: closed forms, and environments given in different ways."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import SCENES, Array, Tool, box, quad, read_png, room, same_bits, sky, sphere, write_hdr, write_ply

import finalgather as fg


@pytest.fixture(scope="module")
def scene() -> fg.Scene:
    vertices, faces, colors = room()
    return fg.Scene.from_arrays(vertices, faces, albedo=colors)


@pytest.fixture(scope="module")
def transfer(scene: fg.Scene) -> Array:
    return fg.prt(scene, order=3, gather_bounces=1, directions=64)


def test_radiance_one_around_a_convex_body() -> None:
    """E = π. Transfer of band 0 is a sum over N directions, off by about N^-3/4; the others meet coefficients of 0."""
    directions = 1024
    vertices, faces = box(cells=2)
    light = fg.relight(fg.prt(fg.Scene.from_arrays(vertices, faces), directions=directions), 1.0)
    assert light.shape == (len(vertices), 3) and light.dtype == np.float32
    assert np.abs(light / np.pi - 1).max() < 2 * directions**-0.75


def test_a_sum_of_products(transfer: Array) -> None:
    """π Σ T c, and a colour has the one coefficient √(4π) L."""
    color = np.array([0.5, 1.0, 2.0])
    expected = np.pi * transfer[:, 0] * color * np.sqrt(4 * np.pi)
    # Quadrature of the environment is good to 1e-5 of the coefficient, for each of nine terms.
    assert np.allclose(fg.relight(transfer, color), np.maximum(expected, 0), rtol=1e-4, atol=1e-4)


def test_light_is_never_negative(scene: fg.Scene) -> None:
    """A lamp that fills a few texels makes a short series swing below 0."""
    texels = np.zeros((16, 32, 3), np.float32)
    texels[3, 20] = 1000
    light = fg.relight(fg.prt(scene, order=4, directions=64), texels)
    assert light.min() == 0 and light.max() > 0


def test_ways_to_give_an_environment(transfer: Array, tmp_path: Path, tool: Tool) -> None:
    texels = write_hdr(tmp_path / "sky.hdr", sky())
    by_array = fg.relight(transfer, texels)
    assert same_bits(by_array, fg.relight(transfer, tmp_path / "sky.hdr"))
    assert same_bits(by_array, fg.relight(transfer, str(tmp_path / "sky.hdr")))
    assert same_bits(by_array, fg.relight(transfer, texels.astype(np.float64)))
    assert same_bits(by_array, fg.relight(np.asfortranarray(transfer), np.asfortranarray(texels)))
    assert same_bits(fg.relight(transfer, 0.5), fg.relight(transfer, [0.5, 0.5, 0.5]))
    flat = np.full((8, 16, 3), 0.5, np.float32)
    assert np.allclose(fg.relight(transfer, flat), fg.relight(transfer, 0.5), rtol=1e-5)
    # The tool reads the same.
    vertices, faces, colors = room()
    file = write_ply(tmp_path / "room.ply", vertices, faces, colors=colors)
    prt, lit = tmp_path / "prt.npy", tmp_path / "lit.npy"
    tool(
        "bake",
        file,
        "--to",
        "vertices",
        "--per",
        "source",
        "--what",
        "prt",
        "--gather-bounces",
        1,
        "--directions",
        64,
        "-o",
        prt,
    )
    tool("relight", prt, "--env", tmp_path / "sky.hdr", "-o", lit)
    assert same_bits(by_array, np.load(lit))


def test_axes_of_an_environment() -> None:
    """The middle of a picture is -z, +x lies right of it, and the top row is +y."""
    height = 32
    directions: dict[str, tuple[int, Any]] = {
        "+x": (16, 48),
        "-x": (16, 16),
        "+y": (0, slice(None)),
        "-y": (31, slice(None)),
        "-z": (16, 32),
        "+z": (16, 0),
    }
    vertices, faces = box()
    baked = fg.bake(fg.Scene.from_arrays(vertices, faces), vertices=True, what="prt", directions=64)
    for name, (row, column) in directions.items():
        texels = np.zeros((height, 2 * height, 3), np.float32)
        texels[row, column] = 100
        brightest = baked.normals[fg.relight(baked["prt"], texels)[:, 0].argmax()]
        assert brightest["xyz".index(name[1])] * (1 if name[0] == "+" else -1) > 0.9, name


def test_transfer_is_light(scene: fg.Scene, transfer: Array) -> None:
    """Relit by a gradient, which two bands hold, transfer gives what a gather of that light finds.

    The sum over 256 directions is off by about 1 %. One that divides by its weights is not, so the mean may differ so.
    """
    texels = sky(32)
    light = fg.relight(fg.prt(scene, order=3, gather_bounces=3, directions=256), texels)
    vertices, faces, colors = room()
    lit = fg.Scene.from_arrays(vertices, faces, albedo=colors, env=texels)
    expected = fg.bake(lit, vertices=True, radiance_cache="gathered", gather_bounces=3, directions=256)["irradiance"]
    assert abs(light.mean() / expected.mean() - 1) < 0.03
    assert np.sqrt(((light - expected) ** 2).mean()) < 0.05 * expected.mean()


def test_picture(scene: fg.Scene, transfer: Array, tmp_path: Path) -> None:
    film = fg.relight_picture(
        scene, transfer, sky(), size=(24, 16), eye=[0.5, 0.6, 3.0], target=[0.5, 0.5, 0.5], fov=45.0
    )
    assert film.size == (24, 16) and film.rgb.shape == (16, 24, 3) and film.rgb.max() > 0.1
    assert read_png(film._repr_png_()).shape[:2] == (16, 24)
    brighter = fg.relight_picture(
        scene, transfer, 2 * sky(), size=(24, 16), eye=[0.5, 0.6, 3.0], target=[0.5, 0.5, 0.5], fov=45.0
    )
    assert np.allclose(brighter.rgb, 2 * film.rgb, rtol=1e-4, atol=1e-5)


def test_picture_of_open_walls() -> None:
    """A white convex body under radiance 1 cannot be told from its background, but for the error of the transfer."""
    scene = fg.Scene.from_arrays(*sphere(3), albedo=1.0)
    film = fg.relight_picture(scene, fg.prt(scene, directions=1024), 1.0, size=16)
    assert np.abs(film.rgb - 1).max() < 2 * 1024**-0.75


def test_vertices_without_transfer_have_no_light() -> None:
    transfer = np.ones((3, 9, 3), np.float32)
    transfer[1] = np.nan
    light = fg.relight(transfer, 1.0)
    assert np.isnan(light[1]).all() and np.isfinite(light[[0, 2]]).all()
    # The axes before are those of the points: a list, or a picture.
    assert fg.relight(np.ones((2, 5, 9, 3)), 1.0).shape == (2, 5, 3)


@pytest.mark.parametrize(
    ("transfer", "env"),
    [
        (np.ones((4, 9)), 1.0),
        (np.ones((4, 8, 3)), 1.0),
        (np.ones((4, 36, 3)), 1.0),
        (np.full((4, 9, 3), "a"), 1.0),
        (np.ones((4, 9, 3)), np.ones((4, 4, 3))),
        (np.ones((4, 9, 3)), np.ones((4, 8))),
        (np.ones((4, 9, 3)), [1.0, 2.0]),
        (np.ones((4, 9, 3)), "nowhere.hdr"),
        (np.ones((4, 9, 3)), SCENES / "cornell.toml"),
    ],
)
def test_refused(transfer: Array, env: object) -> None:
    with pytest.raises(fg.Error) as caught:
        fg.relight(transfer, env)  # type: ignore[arg-type]
    assert isinstance(caught.value, ValueError) and caught.value.cure


def test_transfer_of_another_mesh(scene: fg.Scene) -> None:
    with pytest.raises(fg.Error) as caught:
        fg.relight_picture(scene, np.ones((5, 9, 3), np.float32), 1.0, size=8)
    assert caught.value.cure


def test_a_picture_shows_each_vertex_at_its_place() -> None:
    """Also where faces use vertices in another order than the input has them."""
    left, faces = quad([-1, 0, 0], [1, 0, 0], [0, 1, 0])
    right, _ = quad([0, 0, 0], [1, 0, 0], [0, 1, 0])
    scene = fg.Scene.from_arrays(np.concatenate([right, left]), np.concatenate([faces + 4, faces]))
    transfer = np.zeros((8, 1, 3), np.float32)
    transfer[:4] = 1.0
    film = fg.relight_picture(scene, transfer, 1.0, size=(16, 8), eye=[0, 0.5, 2], target=[0, 0.5, 0], fov=20.0)
    # The coefficient of an environment of radiance 1 is the root of 4π, and the default albedo 0.5.
    assert np.allclose(film.rgb[2:6, 2:6], 0) and np.allclose(film.rgb[2:6, 10:14], 0.5 * np.sqrt(4 * np.pi), rtol=1e-3)
