"""What the tests share: the command-line tool, small meshes, and readers and writers that do not use the package."""

from __future__ import annotations

import json
import os
import struct
import subprocess
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Optional, Union

import numpy as np
import pytest
from numpy.typing import NDArray

REPOSITORY = Path(__file__).resolve().parents[2]
SCENES = REPOSITORY / "scenes"

Array = NDArray[Any]
Mesh = tuple[Array, Array]
Tool = Callable[..., str]

# Tests compare bits with the tool, and so must say the same as it about all that they do not mean to test.
DIRECTIONS = 64


@pytest.fixture(scope="session")
def tool() -> Tool:
    """Runs the command-line tool and returns its stdout. FINALGATHER names it."""
    program = os.environ.get("FINALGATHER")
    assert program, "set FINALGATHER to the command-line tool, as in FINALGATHER=target/release/finalgather"
    program = str(Path(program).resolve())

    def run(*arguments: object) -> str:
        command = [program, *map(str, arguments)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=120)
        assert done.returncode == 0, f"{' '.join(command)}\n{done.stderr}"
        return done.stdout

    return run


def columns(path: Path) -> dict[str, Array]:
    """The columns of a bake's .npy, by their names in the .json beside it."""
    names = json.loads(path.with_suffix(".json").read_text())["columns"]
    values = np.load(path)
    return dict(zip(names, values.reshape(len(values), -1).T))


def stacked(named: dict[str, Array], quantity: str, parts: str = "RGB") -> Array:
    return np.stack([named[f"{quantity}.{part}"] for part in parts], axis=-1)


def same_bits(a: Any, b: Any) -> bool:
    """Whether two arrays hold the same floats, bit by bit. All kinds of NaN are one."""
    a, b = np.asarray(a), np.asarray(b)
    if a.dtype != np.float32 or b.dtype != np.float32 or a.shape != b.shape:
        return False
    missing = np.isnan(a)
    same: bool = np.array_equal(missing, np.isnan(b))
    return same and np.array_equal(a[~missing].view(np.uint32), b[~missing].view(np.uint32))


# Meshes


def quad(corner: Sequence[float], u: Sequence[float], v: Sequence[float], cells: int = 1) -> Mesh:
    """A parallelogram whose front is the side of u x v."""
    steps = np.linspace(0.0, 1.0, cells + 1)
    row = cells + 1
    s, t = np.meshgrid(steps, steps)
    vertices = np.asarray(corner) + s.reshape(-1, 1) * np.asarray(u, float) + t.reshape(-1, 1) * np.asarray(v, float)
    first = (np.arange(cells)[:, None] * row + np.arange(cells)).reshape(-1, 1)
    faces = np.concatenate([first + [0, 1, row + 1], first + [0, row + 1, row]])
    return vertices.astype(np.float32), faces.astype(np.uint32)


def join(*meshes: Mesh) -> Mesh:
    counts = np.cumsum([0, *(len(vertices) for vertices, _ in meshes)])
    faces = [mesh[1] + np.uint32(first) for mesh, first in zip(meshes, counts)]
    return np.concatenate([mesh[0] for mesh in meshes]), np.concatenate(faces)


def box(side: float = 1.0, cells: int = 1, inwards: bool = False) -> Mesh:
    """A cube about the origin, of six quads that share no vertices."""
    quads = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = side * np.eye(3)[(axis + 1) % 3], side * np.eye(3)[(axis + 2) % 3]
            corner = sign * side / 2 * np.eye(3)[axis] - (u + v) / 2
            quads.append(quad(corner, v, u, cells) if (sign < 0) != inwards else quad(corner, u, v, cells))
    return join(*quads)


def room(cells: int = 2) -> tuple[Array, Array, Array]:
    """Something like the Cornell box, open to +z, with a block on its floor: vertices, faces, colours of vertices."""
    floor = quad([0, 0, 0], [0, 0, 1], [1, 0, 0], cells)
    ceiling = quad([0, 1, 0], [1, 0, 0], [0, 0, 1], cells)
    back = quad([0, 0, 0], [1, 0, 0], [0, 1, 0], cells)
    left = quad([0, 0, 0], [0, 1, 0], [0, 0, 1], cells)
    right = quad([1, 0, 0], [0, 0, 1], [0, 1, 0], cells)
    block = box(0.3)
    parts = [floor, ceiling, back, left, right, (block[0] + np.array([0.6, 0.2, 0.45], np.float32), block[1])]
    colors = [[0.7, 0.7, 0.7]] * 3 + [[0.6, 0.05, 0.05], [0.1, 0.5, 0.1], [0.7, 0.6, 0.5]]
    vertices, faces = join(*parts)
    return vertices, faces, np.repeat(np.array(colors, np.float32), [len(part[0]) for part in parts], axis=0)


def sphere(frequency: int = 4, radius: float = 1.0) -> Mesh:
    """An octahedron, divided and blown up: 4 frequency² + 2 vertices, which faces share."""
    step = np.arange(frequency + 1)
    i, j = (grid.ravel() for grid in np.meshgrid(step, step))
    inside = i + j <= frequency
    triangle = np.stack([i, j, frequency - i - j], axis=1)[inside]
    number = np.full((frequency + 2, frequency + 2), -1)
    number[triangle[:, 0], triangle[:, 1]] = np.arange(len(triangle))
    up = [[number[a, b], number[a + 1, b], number[a, b + 1]] for a, b, _ in triangle if a + b < frequency]
    down = [[number[a + 1, b], number[a + 1, b + 1], number[a, b + 1]] for a, b, _ in triangle if a + b < frequency - 1]
    points: list[Array] = []
    faces: list[Array] = []
    for octant in np.ndindex(2, 2, 2):
        sign = 1 - 2 * np.array(octant)
        corners = np.array(up + down)
        faces.append((corners if sign.prod() > 0 else corners[:, ::-1]) + len(triangle) * len(points))
        points.append(triangle * sign)
    shared, index = np.unique(np.concatenate(points), axis=0, return_inverse=True)
    directions = shared / np.linalg.norm(shared, axis=1, keepdims=True)
    return (radius * directions).astype(np.float32), index.ravel()[np.concatenate(faces)].astype(np.uint32)


# Files


def write_ply(
    path: Path,
    vertices: Array,
    faces: Array,
    *,
    normals: Optional[Array] = None,
    colors: Optional[Array] = None,
    uv: Optional[Array] = None,
) -> Path:
    """A binary PLY. 64-bit positions stay so. Colours are linear."""
    vertices = np.asarray(vertices)
    names = {"float32": "float", "float64": "double"}
    fields = [(name, vertices.dtype, vertices[:, k]) for k, name in enumerate("xyz")]
    for columns_of, attribute in ((["nx", "ny", "nz"], normals), (["r", "g", "b"], colors), (["s", "t"], uv)):
        if attribute is not None:
            fields += [(name, np.dtype(np.float32), attribute[:, k]) for k, name in enumerate(columns_of)]
    table = np.zeros(len(vertices), [(name, dtype) for name, dtype, _ in fields])
    for name, _, values in fields:
        table[name] = values
    polygons = np.zeros(len(faces), [("count", "u1"), ("corners", "<u4", 3)])
    polygons["count"], polygons["corners"] = 3, faces
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(vertices)}"]
    header += [f"property {names[dtype.name]} {name}" for name, dtype, _ in fields]
    header += [f"element face {len(faces)}", "property list uchar uint vertex_indices", "end_header\n"]
    path.write_bytes("\n".join(header).encode() + table.tobytes() + polygons.tobytes())
    return path


def write_hdr(path: Path, radiance: Array) -> Array:
    """A Radiance picture, not packed. Returns its texels as the file holds them."""
    _, exponent = np.frexp(radiance.max(axis=-1))
    mantissa = np.floor(np.ldexp(radiance, 8 - exponent[..., None])).astype(np.uint8)
    height, width, _ = radiance.shape
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
    path.write_bytes(header + np.dstack([mantissa, (exponent + 128).astype(np.uint8)]).tobytes())
    texels: Array = np.ldexp(mantissa.astype(np.float32), exponent[..., None] - 8)
    return texels


def sky(height: int = 16) -> Array:
    """A lat-long picture without symmetry: brighter above, red to +x, blue to -z."""
    latitude = np.pi * (0.5 - (np.arange(height) + 0.5) / height)[:, None]
    azimuth = np.pi * ((np.arange(2 * height) + 0.5) / height - 1)[None, :]
    x, y = np.sin(azimuth) * np.cos(latitude), np.sin(latitude) + 0 * azimuth
    z = -np.cos(azimuth) * np.cos(latitude)
    return np.dstack([1 + 0.8 * x, 1 + 0.5 * y, 1 - 0.8 * z]).astype(np.float32)


def read_png(source: Union[Path, bytes]) -> NDArray[np.uint8]:
    """The pixels of a PNG of 8 bits, in colours, with or without alpha."""
    data = source.read_bytes() if isinstance(source, Path) else source
    assert data[:8] == b"\x89PNG\r\n\x1a\n", "not a PNG"
    at, packed, header = 8, b"", (0, 0, 0, 0)
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            header = struct.unpack(">IIBB", body[:10])
        packed += body if kind == b"IDAT" else b""
        at += 12 + length
    width, height, bits, color = header
    assert bits == 8 and color in (2, 6), f"a PNG of {bits} bits and colour type {color}"
    channels = 3 if color == 2 else 4
    rows = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + width * channels)
    pixels = np.zeros((height + 1, width + 1, channels), int)
    for y, row in enumerate(rows, start=1):
        for x, value in enumerate(row[1:].reshape(width, channels).astype(int), start=1):
            left, above, corner = pixels[y, x - 1], pixels[y - 1, x], pixels[y - 1, x - 1]
            near = [np.abs(left + above - corner - other) for other in (left, above, corner)]
            paeth = np.where(
                (near[0] <= near[1]) & (near[0] <= near[2]), left, np.where(near[1] <= near[2], above, corner)
            )
            pixels[y, x] = (value + [0 * left, left, above, (left + above) // 2, paeth][row[0]]) % 256
    return pixels[1:, 1:].astype(np.uint8)
