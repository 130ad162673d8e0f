"""Bakes have the bits of the tool, the values of closed forms, and one row for each vertex in its order."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import (
    DIRECTIONS,
    Array,
    Tool,
    box,
    columns,
    join,
    quad,
    room,
    same_bits,
    sky,
    sphere,
    stacked,
    write_hdr,
    write_ply,
)

import finalgather as fg


def scene_and_file(path: Path) -> tuple[fg.Scene, Path]:
    vertices, faces, colors = room()
    return fg.Scene.from_arrays(vertices, faces, albedo=colors), write_ply(
        path / "room.ply", vertices, faces, colors=colors
    )


# The bits of the tool


def test_openness_of_vertices(tmp_path: Path, tool: Tool) -> None:
    scene, file = scene_and_file(tmp_path)
    out = tmp_path / "out.npy"
    wanted = ["--to", "vertices", "--what", "ao,bent-normal,sky", "--directions", DIRECTIONS, "-o", out]
    for per in ("source", "row"):
        tool("bake", file, *wanted, "--per", per)
        expected = columns(out)
        baked = fg.bake(scene, vertices=True, what=["ao", "bent_normal", "sky"], directions=DIRECTIONS, per=per)
        assert set(baked) == {"ao", "bent_normal", "sky"}
        assert same_bits(baked["ao"], expected["AO"])
        assert same_bits(baked["sky"], expected["Sky"])
        assert same_bits(baked["bent_normal"], stacked(expected, "BentNormal", "XYZ"))


def test_transfer_of_vertices(tmp_path: Path, tool: Tool) -> None:
    scene, file = scene_and_file(tmp_path)
    out = tmp_path / "out.npy"
    what = ["--what", "prt", "--order", 3, "--gather-bounces", 1]
    tool("bake", file, "--to", "vertices", "--per", "source", *what, "--directions", DIRECTIONS, "-o", out)
    transfer = fg.prt(scene, order=3, gather_bounces=1, directions=DIRECTIONS)
    assert transfer.shape == (scene.vertex_count, 9, 3)
    assert same_bits(transfer, np.load(out))
    baked = fg.bake(scene, vertices=True, what="prt", order=3, gather_bounces=1, directions=DIRECTIONS)
    assert same_bits(baked["prt"], transfer)


def test_irradiance_of_vertices(tmp_path: Path, tool: Tool) -> None:
    """Under an environment, with the light that photons carry from wall to wall."""
    vertices, faces, colors = room()
    file = write_ply(tmp_path / "room.ply", vertices, faces, colors=colors)
    env = tmp_path / "sky.hdr"
    texels = write_hdr(env, sky())
    out = tmp_path / "out.npy"
    common = ["--env", env, "--photons", 5000, "--directions", DIRECTIONS, "--seed", 3]
    tool(
        "bake", file, "--to", "vertices", "--per", "source", "--what", "irradiance,sh", "--order", 2, *common, "-o", out
    )
    expected = columns(out)
    for environment in (env, texels):
        scene = fg.Scene.from_arrays(vertices, faces, albedo=colors, env=environment)
        baked = fg.bake(
            scene, vertices=True, what=["irradiance", "sh"], order=2, directions=DIRECTIONS, photons=5000, seed=3
        )
        assert same_bits(baked["irradiance"], stacked(expected, "Irradiance"))
        assert same_bits(baked["irradiance_direct"], stacked(expected, "IrradianceDirect"))
        assert same_bits(baked["irradiance_indirect"], stacked(expected, "IrradianceIndirect"))
        assert same_bits(baked["sh"], np.stack([stacked(expected, f"SH.{k:02}") for k in range(4)], axis=1))
    assert baked["irradiance_indirect"].max() > 0.01


def test_lamps(tmp_path: Path, tool: Tool) -> None:
    """Faces that shine are those of an OBJ with two materials."""
    vertices, faces = join(room()[:2], quad([0.3, 0.95, 0.3], [0.4, 0, 0], [0, 0, 0.4]))
    emission = np.zeros((len(faces), 3))
    emission[-2:] = [6, 5, 4]
    (tmp_path / "room.mtl").write_text("newmtl wall\nKd 0.6 0.6 0.6\nnewmtl lamp\nKd 0.6 0.6 0.6\nKe 6 5 4\n")
    lines = ["mtllib room.mtl", *(f"v {x!r} {y!r} {z!r}" for x, y, z in vertices.astype(float).tolist()), "usemtl wall"]
    for number, corners in enumerate(faces.astype(int) + 1):
        lines += ["usemtl lamp"] if number == len(faces) - 2 else []
        lines += ["f " + " ".join(map(str, corners))]
    (tmp_path / "room.obj").write_text("\n".join(lines) + "\n")
    out = tmp_path / "out.npy"
    common = ["--photons", 5000, "--directions", DIRECTIONS, "-o", out]
    tool("bake", tmp_path / "room.obj", "--to", "vertices", "--per", "source", *common)
    scene = fg.Scene.from_arrays(vertices, faces, albedo=0.6, emission=emission)
    baked = fg.bake(scene, vertices=True, directions=DIRECTIONS, photons=5000)
    assert same_bits(baked["irradiance"], stacked(columns(out), "Irradiance"))


def test_points(tmp_path: Path, tool: Tool) -> None:
    scene, file = scene_and_file(tmp_path)
    rng = np.random.default_rng(1)
    positions = rng.uniform(0.2, 0.9, (50, 3)).astype(np.float32)
    normals = rng.normal(size=(50, 3))
    normals = (normals / np.linalg.norm(normals, axis=1, keepdims=True)).astype(np.float32)
    np.save(tmp_path / "points.npy", np.hstack([positions, normals]))
    out = tmp_path / "out.npy"
    tool(
        "bake", file, "--to", f"points:{tmp_path / 'points.npy'}", "--what", "ao", "--directions", DIRECTIONS, "-o", out
    )
    baked = fg.bake(scene, points=(positions, normals), what="ao", directions=DIRECTIONS)
    assert same_bits(baked["ao"], np.load(out))
    assert np.array_equal(baked.positions, positions) and np.allclose(baked.normals, normals, atol=1e-6)


def test_light_map(tmp_path: Path, tool: Tool) -> None:
    scene, file = scene_and_file(tmp_path)
    out = tmp_path / "map.exr"
    tool(
        "bake", file, "--to", "lightmap", "--resolution", 32, "--what", "ao,sky", "--directions", DIRECTIONS, "-o", out
    )
    baked = fg.bake(scene, lightmap=32, what=["ao", "sky"], directions=DIRECTIONS)
    assert baked["ao"].shape == baked["sky"].shape == (32, 32)
    assert baked.mask is not None and baked.mask.shape == (32, 32)
    film = fg.Film.read(out)
    assert np.array_equal(film["A"] > 0, baked.mask)
    assert same_bits(baked["ao"][baked.mask], film["AO"][baked.mask])
    assert same_bits(baked["sky"][baked.mask], film["Sky"][baked.mask])


def test_the_first_row_of_a_light_map_is_the_top() -> None:
    """The mesh's own coordinates: v is 1 at the foot of a wall, and so the first row is dark."""
    floor = quad([0, 0, 0], [0, 0, 1], [1, 0, 0])
    wall = quad([0, 0, 0], [1, 0, 0], [0, 1, 0])
    vertices, faces = join(floor, wall)
    uv = np.zeros((8, 2), np.float32)
    # The floor fills the left half, the wall a strip of the right.
    uv[:4] = np.stack([0.05 + 0.4 * floor[0][:, 0], 0.95 - 0.9 * floor[0][:, 2]], axis=1)
    uv[4:] = np.stack([0.55 + 0.4 * wall[0][:, 0], 0.05 + 0.9 * wall[0][:, 1]], axis=1)
    baked = fg.bake(
        fg.Scene.from_arrays(vertices, faces, uv=uv), lightmap=16, uvs="own", what="ao", directions=DIRECTIONS
    )
    middle = baked["ao"][:, 4]
    assert middle[1] < 0.65 < 0.8 < middle[-2]
    assert baked.uv is not None and baked.uv.shape[1] == 2


def test_texels_per_unit() -> None:
    vertices, faces, _ = room()
    baked = [
        fg.bake(fg.Scene.from_arrays(vertices, faces), texels_per_unit=density, what="ao", directions=8)
        for density in (4.0, 8.0)
    ]
    height, width = baked[0]["ao"].shape
    # Gaps between charts do not grow with it.
    assert 1.2 * height < baked[1]["ao"].shape[0] < 2.2 * height
    # Seven faces have an area of 5 + 6 · 0.3².
    texels = baked[0].mask.sum() if baked[0].mask is not None else 0
    assert texels > 16 * (5 + 6 * 0.3**2) and width > 1


def test_camera(tmp_path: Path, tool: Tool) -> None:
    scene, file = scene_and_file(tmp_path)
    out = tmp_path / "seen.exr"
    view: dict[str, Any] = {"eye": [0.5, 0.6, 3.0], "target": [0.5, 0.5, 0.5], "fov": 45.0}
    options = ["--eye", "0.5,0.6,3", "--target", "0.5,0.5,0.5", "--fov", 45, "--size", "24x16"]
    tool("bake", file, "--to", "camera", "--what", "ao", "--directions", DIRECTIONS, *options, "-o", out)
    baked = fg.bake(scene, camera=True, what="ao", directions=DIRECTIONS, size=(24, 16), **view)
    film = fg.Film.read(out)
    assert baked.mask is not None and baked.mask.shape == baked["ao"].shape == (16, 24)
    assert 0.2 < baked.mask.mean() < 1
    assert np.array_equal(baked.mask, film["A"] > 0)
    assert same_bits(baked["ao"][baked.mask], film["AO"][baked.mask])


# Rows


def test_rows_follow_the_input() -> None:
    vertices, faces = sphere(4)
    vertices[:, 1] *= 0.5
    order = np.random.default_rng(2).permutation(len(vertices))
    place = np.argsort(order)
    shuffled = fg.bake(
        fg.Scene.from_arrays(vertices[order], place[faces]), vertices=True, what="ao", directions=DIRECTIONS
    )
    # Positions go through a space of 32 bits.
    assert np.allclose(shuffled.positions, vertices[order], atol=1e-7)
    assert shuffled.faces is not None and np.array_equal(np.sort(shuffled.faces), np.sort(place[faces]))
    plain = fg.bake(fg.Scene.from_arrays(vertices, faces), vertices=True, what="bent_normal", directions=DIRECTIONS)
    moved = fg.bake(
        fg.Scene.from_arrays(vertices[order], place[faces]), vertices=True, what="bent_normal", directions=DIRECTIONS
    )
    # Rays of other neighbours in a packet round as these do. Only the tree's order of equal faces may differ.
    assert np.allclose(moved["bent_normal"], plain["bent_normal"][order], atol=1e-5)


def test_unused_vertices_have_no_value() -> None:
    vertices, faces = box(cells=2)
    used = fg.bake(fg.Scene.from_arrays(vertices, faces), vertices=True, what=["ao", "bent_normal"], directions=8)
    more = np.vstack([[[9, 9, 9]], vertices, [[0, 0, 0]]]).astype(np.float32)
    baked = fg.bake(fg.Scene.from_arrays(more, faces + 1), vertices=True, what=["ao", "bent_normal"], directions=8)
    for name in ("ao", "bent_normal"):
        assert np.isnan(baked[name][[0, -1]]).all()
        assert same_bits(baked[name][1:-1], used[name])


def test_rows_for_each_normal() -> None:
    """A corner of a cube is one vertex of the input, and three rows."""
    corners = np.array(list(np.ndindex(2, 2, 2)), np.float32)
    sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    faces = np.array([[side[0], *pair] for side in sides for pair in (side[1:3], side[2:4])])
    scene = fg.Scene.from_arrays(corners, faces)
    rows = fg.bake(scene, vertices=True, what=["ao", "bent_normal"], directions=DIRECTIONS, per="row")
    assert len(rows["ao"]) == 24 and rows.sources is not None
    vertex = rows.sources[:, 1]
    assert not rows.sources[:, 0].any()
    assert np.array_equal(np.bincount(vertex), [3] * 8)
    assert np.allclose(corners[vertex], rows.positions, atol=1e-7)
    assert rows.faces is not None and rows.faces.max() == 23
    sources = fg.bake(scene, vertices=True, what=["ao", "bent_normal"], directions=DIRECTIONS)
    assert sources["ao"].shape == (8,) and sources["bent_normal"].shape == (8, 3)
    mean = np.array([rows["bent_normal"][vertex == corner].sum(axis=0) for corner in range(8)])
    # Each of the three faces has a right angle at the corner, so all have one weight.
    assert np.allclose(sources["bent_normal"], mean / np.linalg.norm(mean, axis=1, keepdims=True), atol=1e-5)


# Closed forms


def test_a_convex_body_is_open() -> None:
    """No ray that leaves a convex body meets it, but those along a face, by rounding. They weigh nothing."""
    vertices, faces = box(cells=2)
    baked = fg.bake(fg.Scene.from_arrays(vertices, faces), vertices=True, what=["ao", "sky"], directions=DIRECTIONS)
    assert baked["ao"].min() > 1 - 1e-4 and baked["sky"].min() > 1 - 1e-4 and baked["ao"].max() <= 1


@pytest.mark.filterwarnings("ignore::finalgather.Warning")
def test_a_closed_room_is_dark() -> None:
    """Every ray of the inside meets a wall."""
    vertices, faces = box(cells=2, inwards=True)
    baked = fg.bake(fg.Scene.from_arrays(vertices, faces), vertices=True, what=["ao", "sky"], directions=DIRECTIONS)
    assert (baked["ao"] == 0).all() and (baked["sky"] == 0).all()


def test_radiance_one_from_everywhere() -> None:
    """The estimator divides by the sum of the cosines, so π comes out but for the rounding of sums of 32 bits."""
    vertices, faces = box(cells=2)
    scene = fg.Scene.from_arrays(vertices, faces, env=1.0)
    baked = fg.bake(scene, vertices=True, what=["irradiance", "sh"], order=1, directions=DIRECTIONS, photons=100)
    assert np.abs(baked["irradiance"] / np.pi - 1).max() < 1e-5
    assert not baked["irradiance_indirect"].any()
    assert "W/m²" in baked.units["irradiance"] and "W/(m² sr)" in baked.units["sh"]


def form_factor(polygon: Array, position: Array, normal: Array) -> float:
    """Lambert's: the share of the hemisphere, weighted by the cosine, that a polygon in front of a point hides."""
    toward = polygon - position
    toward = toward / np.linalg.norm(toward, axis=1, keepdims=True)
    following = np.roll(toward, -1, axis=0)
    axes = np.cross(toward, following)
    angles = np.arctan2(np.linalg.norm(axes, axis=1), (toward * following).sum(axis=1))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    return abs(float((axes @ normal) @ angles)) / (2 * np.pi)


PLATE = np.array([[-0.5, 1, -0.5], [0.5, 1, -0.5], [0.5, 1, 0.5], [-0.5, 1, 0.5]], np.float32)


def points_below(count: int = 64) -> tuple[Array, Array]:
    places = np.random.default_rng(5).uniform(-0.5, 0.5, (count, 3)).astype(np.float32)
    places[:, 1] = 0.25
    return places, np.tile(np.array([0, 1, 0], np.float32), (count, 1))


def test_openness_below_a_plate() -> None:
    """1 less the form factor F of the plate.

    Of N directions, N F/4 meet it, counted by cosine. In sequences of low discrepancy, the share of them that the
    outline puts on the wrong side falls with the power 3/4 of their number. The factor 2 is that of the project's tests
    of closed forms.
    """
    directions = 1024
    positions, normals = points_below()
    scene = fg.Scene.from_arrays(PLATE, [[0, 1, 2], [0, 2, 3]])
    found = fg.bake(scene, points=(positions, normals), what="ao", directions=directions)["ao"]
    hidden = np.array([form_factor(PLATE.astype(float), p.astype(float), np.array([0.0, 1, 0])) for p in positions])
    assert np.abs((1 - found) / hidden - 1).max() < 2 * (directions * hidden.min() / 4) ** -0.75
    # The mean over points has fewer errors of outlines: 1 % with 4096 directions, growing as 1/√N at most.
    assert abs((1 - found).mean() / hidden.mean() - 1) < 0.01 * (4096 / directions) ** 0.5


def test_surfaces_beyond_the_distance_do_not_count() -> None:
    positions, normals = points_below(8)
    scene = fg.Scene.from_arrays(PLATE, [[0, 1, 2], [0, 2, 3]])
    near, far = (
        fg.bake(scene, points=(positions, normals), what=["ao", "sky"], ao_distance=reach, directions=64)
        for reach in (0.7, 3.0)
    )
    assert (near["ao"] == 1).all() and (far["ao"] < 0.9).all()
    assert same_bits(near["sky"], far["sky"]) and same_bits(far["sky"], far["ao"])


def test_irradiance_below_a_lamp() -> None:
    """π L F. Each point sends light_samples = 128 rays to places that are spread over the lamp, so 3 % is ample."""
    positions, normals = points_below()
    lamp = fg.Scene.from_arrays(PLATE, [[0, 1, 2], [0, 2, 3]], albedo=0.0, emission=[2.0, 1.0, 0.0])
    baked = fg.bake(lamp, points=(positions, normals), directions=DIRECTIONS, photons=100)
    factors = np.array([form_factor(PLATE.astype(float), p.astype(float), np.array([0.0, 1, 0])) for p in positions])
    assert np.abs(baked["irradiance"][:, 0] / (2 * np.pi * factors) - 1).max() < 0.03
    assert np.allclose(baked["irradiance_direct"][:, 0], 2 * baked["irradiance"][:, 1], rtol=1e-5)
    assert not baked["irradiance"][:, 2].any() and not baked["irradiance_indirect"].any()


def lobes(normals: Array) -> Array:
    """The transfer of open surfaces: the cosine over π in bands 0 to 2 (Ramamoorthi and Hanrahan 2001)."""
    x, y, z = normals.T.astype(float)
    band1 = np.sqrt(3 / (4 * np.pi)) * np.array([y, z, x])
    band2 = [x * y, y * z, (3 * z * z - 1) / np.sqrt(12), x * z, (x * x - y * y) / 2]
    band2 = np.sqrt(15 / (4 * np.pi)) * np.array(band2)
    return np.vstack([np.full((1, len(x)), np.sqrt(1 / (4 * np.pi))), 2 / 3 * band1, band2 / 4]).T


def test_transfer_of_open_surfaces() -> None:
    """Without shadows it is a closed form. A convex body comes near: sums over N directions are off by about N^-3/4."""
    directions = 1024
    vertices, faces = box()
    baked = fg.bake(
        fg.Scene.from_arrays(vertices, faces), vertices=True, what=["prt", "prt_unshadowed"], directions=directions
    )
    expected = np.repeat(lobes(baked.normals)[:, :, None], 3, axis=2)
    assert np.abs(baked["prt_unshadowed"] - expected).max() < 1e-6
    assert np.abs(baked["prt"] - expected).max() < 2 * directions**-0.75


# Shapes and files


def test_vertices_are_the_default() -> None:
    scene = fg.Scene.from_arrays(*sphere(2))
    assert same_bits(
        fg.bake(scene, what="ao", directions=8)["ao"], fg.bake(scene, vertices=True, what="ao", directions=8)["ao"]
    )


def test_a_mapping() -> None:
    vertices, faces = sphere(2)
    baked = fg.bake(fg.Scene.from_arrays(vertices, faces), vertices=True, what=["ao", "prt"], order=2, directions=8)
    assert len(baked) == 2 and list(baked) == ["ao", "prt"] and "ao" in baked
    assert {name: values.shape for name, values in baked.items()} == {"ao": (18,), "prt": (18, 4, 3)}
    assert all(values.dtype == np.float32 for values in baked.values())
    with pytest.raises(KeyError):
        baked["sky"]
    for text in (repr(baked), baked._repr_html_()):
        assert "ao" in text and "prt" in text
    assert baked._repr_html_().lstrip().startswith("<")
    assert baked.report["settings"]["directions"] == 8


def test_arrays_are_writable_or_refuse() -> None:
    """An array of a result may be changed only where the result does not change with it."""
    baked = fg.bake(fg.Scene.from_arrays(*sphere(2)), vertices=True, what="ao", directions=8)
    values = baked["ao"]
    expected = values.copy()
    if values.flags.writeable:
        values[:] = 7
    assert same_bits(baked["ao"], expected)


def test_write_as_the_tool(tmp_path: Path, tool: Tool) -> None:
    scene, file = scene_and_file(tmp_path)
    tool(
        "bake",
        file,
        "--to",
        "vertices",
        "--per",
        "source",
        "--what",
        "ao",
        "--directions",
        DIRECTIONS,
        "-o",
        tmp_path / "tool.npy",
    )
    baked = fg.bake(scene, vertices=True, what="ao", directions=DIRECTIONS)
    for ending in ("npy", "npz", "ply"):
        baked.write(tmp_path / f"out.{ending}")
    assert (tmp_path / "out.npy").read_bytes() == (tmp_path / "tool.npy").read_bytes()
    with np.load(tmp_path / "out.npz") as archive:
        assert same_bits(archive["ao"], baked["ao"])
    assert (tmp_path / "out.ply").read_bytes().startswith(b"ply\n")
    with pytest.raises(fg.Error) as caught:
        baked.write(tmp_path / "out.txt")
    assert caught.value.cure


def test_it_is_a_mapping() -> None:
    """By the rules of Python's own, whatever the key."""
    baked = fg.bake(fg.Scene.from_arrays(*sphere(2)), what=["ao", "sky"], directions=16)
    assert isinstance(baked, Mapping) and list(baked) == ["ao", "sky"] and len(baked) == 2
    assert baked.keys() & {"ao", "prt"} == {"ao"} and "ao" in baked
    strangers: list[object] = [5, None, ()]
    assert not any(key in baked for key in strangers)
    assert same_bits(dict(baked)["sky"], baked["sky"]) and {key for key, _ in baked.items()} == {"ao", "sky"}
    assert baked.get("prt") is None and all(values.shape == (18,) for values in baked.values())
    with pytest.raises(KeyError):
        baked["prt"]


def test_a_light_map_holds_its_map_alone(tmp_path: Path) -> None:
    """Normals are those of the mesh's vertices, as positions are."""
    baked = fg.bake(fg.Scene.from_arrays(*box(cells=1)), lightmap=16, what="ao", directions=16)
    assert baked.normals.shape == baked.positions.shape and baked["ao"].shape == (16, 16)
    baked.write(tmp_path / "map.npz")
    with np.load(tmp_path / "map.npz") as file:
        assert same_bits(file["ao"], baked["ao"]) and same_bits(file["normals"], baked.normals)


def test_lists_do_as_well_as_tuples() -> None:
    scene = fg.Scene.from_arrays(*sphere(2), sun=[120, 35])
    points = [[[0.0, 2.0, 0.0]], [[0.0, -1.0, 0.0]]]
    seen = [fg.bake(scene, points=kind(points), what="sky", directions=16)["sky"] for kind in (list, tuple)]
    assert same_bits(*seen) and 0 < seen[0][0] < 1
    with pytest.raises(fg.UsageError, match="points are no pair"):
        fg.bake(scene, points=points[:1], what="sky", directions=16)
