"""Writes scenes of buildings and landscapes, for comparison with path tracing. Needs numpy; always writes the same bytes.

    python3 tests/reference/buildings.py FOLDER [NAME ...]

A scene NAME is NAME.obj and NAME.mtl. Each view of it is a scene file of its own, NAME_a.toml, NAME_b.toml. Units are metres, y is up.

| scene     | what it holds                                                                              | what goes wrong easily                       |
|-----------|--------------------------------------------------------------------------------------------|----------------------------------------------|
| office    | 24 x 18 m, walls of 15 cm, lamps half let into a hollow slab, door frames, tables, columns | light in the slab shows on the ceiling below |
| maze      | 34 x 34 m, 25 rooms, 24 box lamps, textures, a floor that runs on under the walls          | hidden area counts, so floors are too dark   |
| window    | a room of 5 x 4 m, lit through one window by an even sky                                   | bands of the few directions that leave by it |
| doors     | a bright and a dark room, joined by a door                                                 | light goes through the wall between          |
| house     | a sealed house on ground of 200 x 200 m, white sky                                         | light gets in: view b must be black          |
| thin      | four rooms with walls of 2 cm; one is sealed                                               | light goes through: view b must be black     |
| sun       | an open court under a sky with a sun                                                       | the sun is missing                           |
| kilometre | a furnished room with an open side in a landscape of 1 km                                  | everything small is too coarse               |

Some views have a twin for the path tracer, NAME_a_reference.toml, with the same light in what is seen and less noise. A path tracer seldom finds a
window, so in the twin a black panel in each window shines as the sky does, and there is no sky; nothing stands outside of these windows. And the
lamps of the office lack their upper halves, which light the inside of the slab alone. References come from the twin where there is one:

    python3 tests/reference/path_trace.py FOLDER/window_a_reference.toml FOLDER/window_a.exr --size 256x192 --spp 1280 \\
        --blocks tests/reference/buildings/window_a.exr

The office, the maze and the thin walls take `--many-lamps`. The references kept here have 256 paths a pixel (house, sun, kilometre_b), 512 (thin),
768 (maze_b, doors_b, kilometre_a), 1280 (office_a, maze_a, window), 1536 (doors_a) or 1792 (office_b); office_a_direct.exr has `--depth 2`.
"""
import argparse
import pathlib
import random
import struct
import zlib

import numpy as np

SIZE = (256, 192)
WALL, PLASTER, OCHRE, BLUE = (0.75, 0.73, 0.70), (0.80, 0.80, 0.80), (0.62, 0.42, 0.30), (0.32, 0.40, 0.58)
CARPET, WOOD, DARK, STONE = (0.36, 0.34, 0.32), (0.58, 0.44, 0.30), (0.30, 0.30, 0.32), (0.55, 0.52, 0.48)
FINISHES = {"wall": WALL, "plaster": PLASTER, "ochre": OCHRE, "blue": BLUE, "carpet": CARPET, "wood": WOOD, "dark": DARK, "stone": STONE}


class Model:
    """Polygons by material. All fronts face outward, out of solid things and into rooms."""

    def __init__(self, lamp=0.0):
        self.materials = {name: f"Kd {' '.join(map(str, albedo))}\n" for name, albedo in FINISHES.items()}
        self.materials["lamp"] = f"Kd 0.5 0.5 0.5\nKe {lamp} {0.9 * lamp:g} {0.75 * lamp:g}\n"
        # Those of the scene and of its twin, by name of the file's ending.
        self.polygons = {"": [], "_reference": []}

    def polygon(self, material, corners, uvs=(), endings=("", "_reference")):
        for ending in endings:
            self.polygons[ending].append((material, corners, uvs))

    def box(self, material, low, high, uv_scale=0.0, has_top=True, endings=("", "_reference")):
        """A closed box. With `uv_scale`, so many repeats of its texture a metre, upright on its sides."""
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            for side in (0, 1):
                if axis == 1 and side == 1 and not has_top:
                    continue
                corners = []
                for at_u, at_v in ((0, 0), (1, 0), (1, 1), (0, 1)) if side else ((0, 0), (0, 1), (1, 1), (1, 0)):
                    corner = [0, 0, 0]
                    corner[axis], corner[u], corner[v] = (low, high)[side][axis], (low, high)[at_u][u], (low, high)[at_v][v]
                    corners.append(tuple(corner))
                across, up = ((2, 1), (0, 2), (0, 1))[axis]
                uvs = [(uv_scale * c[across], uv_scale * c[up]) for c in corners] if uv_scale else ()
                self.polygon(material, corners, uvs, endings)

    def wall(self, axis, at, start, end, thickness, height, openings=(), base=0.0, material="wall", uv_scale=0.0, frame=""):
        """A wall along `axis` (0: x, 2: z) about the line `at` of the other one. An opening is (start, end, bottom, top); doors have the bottom
        `base`. The pieces between, under and above the openings are boxes of their own. `frame` is the material of frames, 6 cm wide, which stand
        out from the wall by 2 cm."""
        def piece(material, start, end, bottom, top, thickness=thickness):
            low, high = [0, bottom, 0], [0, top, 0]
            low[axis], high[axis], low[2 - axis], high[2 - axis] = start, end, at - thickness / 2, at + thickness / 2
            if end > start and top > bottom:
                self.box(material, low, high, uv_scale if material != frame else 0.0)

        left = start
        for from_, to, bottom, top in sorted(openings):
            piece(material, left, from_, base, height)
            piece(material, from_, to, base, bottom)
            piece(material, from_, to, top, height)
            if frame:
                deep = thickness + 0.04
                piece(frame, from_, from_ + 0.06, bottom, top - 0.06, deep)
                piece(frame, to - 0.06, to, bottom, top - 0.06, deep)
                piece(frame, from_, to, top - 0.06, top, deep)
            left = to
        piece(material, left, end, base, height)

    def panel(self, radiance, corners):
        """Stands for the sky in an opening, in the twin alone: its front faces the room."""
        self.materials["panel"] = f"Kd 0 0 0\nKe {' '.join(map(str, radiance))}\n"
        self.polygon("panel", corners, endings=("_reference",))

    def has_twin(self):
        return self.polygons[""] != self.polygons["_reference"]

    def table(self, x, z, width=1.6, depth=0.8, height=0.74, base=0.0):
        low, high = (x - width / 2, z - depth / 2), (x + width / 2, z + depth / 2)
        self.box("wood", (low[0], base + height - 0.03, low[1]), (high[0], base + height, high[1]))
        for leg_x in (low[0] + 0.05, high[0] - 0.10):
            for leg_z in (low[1] + 0.05, high[1] - 0.10):
                self.box("dark", (leg_x, base, leg_z), (leg_x + 0.05, base + height - 0.03, leg_z + 0.05))

    def chair(self, x, z, back, base=0.0):
        """`back` is 1 or -1: on which side along z the back of the chair is."""
        self.table(x, z, 0.44, 0.44, 0.45, base)
        edge = z + 0.20 * back
        self.box("blue", (x - 0.22, base + 0.45, edge - 0.02), (x + 0.22, base + 0.90, edge + 0.02))

    def write(self, folder, name, ending):
        polygons, name = self.polygons[ending], name + ending
        used = sorted({material for material, _, _ in polygons})
        (folder / f"{name}.mtl").write_text("".join(f"newmtl {material}\n{self.materials[material]}" for material in used))
        positions, coordinates, faces, current = {}, {}, [], None
        for material, corners, uvs in sorted(polygons, key=lambda polygon: polygon[0]):
            if material != current:
                faces.append(f"usemtl {material}\n")
                current = material
            words = [str(positions.setdefault(tuple(f"{x:.4g}" if abs(x) < 1 else f"{x:.6g}" for x in c), len(positions) + 1)) for c in corners]
            if uvs:
                words = [f"{word}/{coordinates.setdefault(tuple(f'{x:.4g}' for x in uv), len(coordinates) + 1)}" for word, uv in zip(words, uvs)]
            faces.append(f"f {' '.join(words)}\n")
        lines = [f"v {' '.join(key)}\n" for key in positions] + [f"vt {' '.join(key)}\n" for key in coordinates]
        (folder / f"{name}.obj").write_text(f"mtllib {name}.mtl\n" + "".join(lines + faces))


def write_views(folder, name, model, views, environment=""):
    """A scene with its views, each (eye, target, vertical angle in degrees). An even sky is a triple, a picture is a file name."""
    even = isinstance(environment, tuple)
    sky = f"\n[environment]\nradiance = {list(environment)}\n" if even else f'\n[environment]\nfile = "{environment}"\n' if environment else ""
    for ending in ("", "_reference") if model.has_twin() else ("",):
        model.write(folder, name, ending)
        for letter, (eye, target, angle) in zip("ab", views):
            camera = f"\n[camera]\neye = {list(eye)}\ntarget = {list(target)}\nup = [0, 1, 0]\nfov_y_degrees = {angle}\n"
            text = f'mesh = "{name}{ending}.obj"\n{camera}{"" if ending else sky}\n[settings]\nsize = {list(SIZE)}\n'
            (folder / f"{name}_{letter}{ending}.toml").write_text(text)


def write_png(path, rows):
    """8 bits, RGB. `rows` is an array of height x width x 3."""
    height, width = rows.shape[:2]
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    # Stored without compression, so that the bytes do not depend on the version of zlib.
    raw = b"".join(b"\0" + row.astype(np.uint8).tobytes() for row in rows)
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw, 0)) + chunk(b"IEND", b""))


def office(folder):
    model, height, wall = Model(lamp=14), 2.8, 0.15
    model.box("carpet", (-0.2, -0.2, -0.2), (24.2, 0, 18.2))
    # The slab is hollow: its two sheets are 40 cm apart.
    model.box("plaster", (-0.2, height, -0.2), (24.2, height + 0.4, 18.2))
    for axis, at, length in ((0, 0, 24), (0, 18, 24), (2, 0, 18), (2, 24, 18)):
        model.wall(axis, at, 0, length, wall, height)
    door = lambda start: (start, start + 0.95, 0, 2.1)
    model.wall(0, 8, 0, 12, wall, height, [door(4.2), door(7.0)], frame="wood")
    model.wall(0, 10, 0, 24, wall, height, [door(2.0), door(12.6), door(17.5)], frame="wood")
    model.wall(2, 6, 0, 8, wall, height, material="ochre")
    model.wall(2, 12, 0, 8, wall, height, [door(3.0)], frame="wood")
    model.wall(2, 8, 10, 18, wall, height, material="blue")
    model.wall(2, 16, 10, 18, wall, height, [door(14.0)], frame="wood")
    lamps = [(x, z) for x in (3, 9) for z in (2.5, 5.5)] + [(x, z) for x in (14, 18, 22) for z in (2, 5.5)]
    lamps += [(x, 9) for x in (3, 9, 15, 21)] + [(x, z) for x in (4, 12, 20) for z in (12.5, 15.5)]
    for x, z in lamps:
        for top, endings in ((height + 0.05, ("",)), (height, ("_reference",))):
            model.box("lamp", (x - 0.6, height - 0.05, z - 0.15), (x + 0.6, top, z + 0.15), has_top=not endings[0], endings=endings)
    for x in (15, 18, 21):
        model.box("stone", (x - 0.2, 0, 7.8), (x + 0.2, height, 8.2))
    for x, z in [(14.5, 3), (17, 3), (20, 3), (22.3, 3), (14.5, 6), (20, 6), (3, 4), (9, 4), (4, 14), (10, 14), (13.5, 14.6), (20, 14)]:
        model.table(x, z)
        model.chair(x, z + 0.75, 1)
    for x in (9, 10, 11):
        model.box("wood", (x, 0, 17.5), (x + 0.9, 1.9, 17.9))
    for x in (13, 16):
        model.box("dark", (x, 0, 0.1), (x + 1.2, 1.2, 0.5))
    write_views(folder, "office", model, [((23.3, 1.6, 0.7), (15, 0.9, 8.2), 55), ((8.7, 1.65, 16.9), (13.2, 1.0, 10), 58)])


def maze(folder):
    cells, room, height, wall = 5, 6.8, 3.0, 0.15
    model = Model(lamp=14)
    side = cells * room
    model.materials["floor"] = "Kd 1 1 1\nmap_Kd maze_floor.png\n"
    model.materials["tiled"] = "Kd 1 1 1\nmap_Kd maze_wall.png\n"
    x, y = np.meshgrid(np.arange(64), np.arange(64))
    planks = 120 + 40 * ((x // 16 + 2 * (y // 32)) % 3)
    write_png(folder / "maze_floor.png", np.stack([planks + 30, planks, planks * 0.7], 2))
    joint = (x % 32 < 2) | (y % 32 < 2)
    tiles = np.where((x // 32 + y // 32) % 2, 205, 235)
    write_png(folder / "maze_wall.png", np.stack([np.where(joint, 110, tiles * share) for share in (1, 0.95, 0.88)], 2))
    # One sheet of floor and one of ceiling, under and over all walls.
    low, high = -wall / 2, side + wall / 2
    uv = [(0, 0), (0, 1), (1, 1), (1, 0)]
    model.polygon("floor", [(low, 0, low), (low, 0, high), (high, 0, high), (high, 0, low)], [(side / 2 * u, side / 2 * v) for u, v in uv])
    model.polygon("plaster", [(low, height, low), (high, height, low), (high, height, high), (low, height, high)])

    # A tree of doors reaches all rooms, a few more doors close rings.
    numbers = random.Random(18)
    pick = lambda items: items[int(numbers.random() * len(items))]
    doors, seen, path = set(), {(0, 0)}, [(0, 0)]
    beside = lambda i, j: [(i + di, j + dj) for di, dj in ((1, 0), (-1, 0), (0, 1), (0, -1)) if 0 <= i + di < cells and 0 <= j + dj < cells]
    while path:
        fresh = [cell for cell in beside(*path[-1]) if cell not in seen]
        if not fresh:
            path.pop()
            continue
        cell = pick(fresh)
        doors.add(frozenset((path[-1], cell)))
        seen.add(cell)
        path.append(cell)
    for _ in range(8):
        cell = (int(numbers.random() * cells), int(numbers.random() * cells))
        doors.add(frozenset((cell, pick(beside(*cell)))))
    for line in range(cells + 1):
        for run in range(cells):
            for axis in (0, 2):
                pair = [(run, line - 1), (run, line)] if axis == 0 else [(line - 1, run), (line, run)]
                start = run * room
                at = start + room * (0.2 + 0.45 * numbers.random())
                openings = [(at, at + 1.1, 0, 2.2)] if frozenset(pair) in doors else []
                material = "tiled" if (line + run) % 2 else "ochre" if axis else "wall"
                model.wall(axis, line * room, start, start + room, wall, height, openings, material=material, uv_scale=0.5)
    for i in range(cells):
        for j in range(cells):
            x, z = (i + 0.5) * room, (j + 0.5) * room
            if (i, j) == (2, 2):
                model.box("wood", (x - 1, 0, z - 1), (x + 1, 0.5, z + 1))
            else:
                model.box("lamp", (x - 0.3, height - 0.5, z - 0.3), (x + 0.3, height - 0.38, z + 0.3))
                model.box("stone", (x + 1.2, 0, z - 0.4), (x + 2.0, 0.9, z + 0.4))
    write_views(folder, "maze", model, [((7.3, 1.65, 13.0), (13.0, 1.1, 8.6), 62), ((26.7, 1.65, 26.7), (22.3, 1.1, 20.4), 62)])


def window(folder):
    model, height, wall, sky = Model(), 2.7, 0.2, (5, 5, 5)
    model.box("carpet", (-0.2, -0.2, -0.2), (5.2, 0, 4.2))
    model.box("plaster", (-0.2, height, -0.2), (5.2, height + 0.2, 4.2))
    model.wall(2, -wall / 2, -0.2, 4.2, wall, height, [(1.3, 2.8, 0.9, 2.1)])
    model.wall(2, 5 + wall / 2, -0.2, 4.2, wall, height, material="ochre")
    model.wall(0, -wall / 2, 0, 5, wall, height)
    model.wall(0, 4 + wall / 2, 0, 5, wall, height, material="blue")
    model.panel(sky, [(-0.2, 0.9, 1.3), (-0.2, 2.1, 1.3), (-0.2, 2.1, 2.8), (-0.2, 0.9, 2.8)])
    model.table(1.6, 2.9)
    model.chair(1.6, 2.2, -1)
    model.box("wood", (0.6, 0, 3.5), (1.8, 1.9, 4.0))
    model.box("stone", (3.2, 0, 3.4), (3.8, 0.6, 3.9))
    write_views(folder, "window", model, [((4.7, 1.5, 0.4), (1.2, 1.0, 2.6), 60), ((0.3, 1.5, 0.5), (4.4, 0.9, 3.2), 60)], sky)


def doors(folder):
    model, height, wall = Model(lamp=16), 2.6, 0.15
    model.box("carpet", (-0.2, -0.2, -0.2), (10.2, 0, 5.2))
    model.box("plaster", (-0.2, height, -0.2), (10.2, height + 0.2, 5.2))
    for axis, at, length in ((0, 0, 10), (0, 5, 10), (2, 0, 5), (2, 10, 5)):
        model.wall(axis, at, 0, length, wall, height)
    model.wall(2, 5, 0, 5, wall, height, [(1.0, 1.95, 0, 2.1)], frame="wood", material="ochre")
    # Shines through the door.
    model.box("lamp", (0.075, 0.8, 0.9), (0.15, 2.0, 2.5))
    model.table(7.6, 3.6)
    model.chair(7.6, 2.9, -1)
    model.box("blue", (5.3, 0, 3.0), (5.9, 1.6, 4.6))
    model.box("stone", (1.4, 0, 3.2), (2.2, 0.8, 4.0))
    write_views(folder, "doors", model, [((9.6, 1.55, 4.6), (5.6, 1.0, 1.6), 60), ((0.4, 1.55, 4.6), (4.8, 1.0, 1.4), 60)])


def house(folder):
    model, wall = Model(), 0.2
    model.polygon("stone", [(-100, 0, -100), (-100, 0, 100), (100, 0, 100), (100, 0, -100)])
    for axis, at in ((0, -4.9), (0, 4.9), (2, -4.9), (2, 4.9)):
        inset = 0 if axis else wall
        model.wall(axis, at, -5 + inset, 5 - inset, wall, 3, material="ochre" if axis else "wall")
    model.box("plaster", (-5.2, 3, -5.2), (5.2, 3.2, 5.2))
    model.table(1, -2)
    model.box("wood", (-4.6, 0, -4.6), (-3.4, 1.9, -4.0))
    model.box("wood", (6.5, 0, 2), (7.5, 1, 3))
    write_views(folder, "house", model, [((13, 2.2, 14), (1, 1.2, 0), 50), ((4.5, 1.6, 4.5), (-3, 1.0, -4), 65)], (3, 3, 3))


def thin(folder):
    model, height, wall, sky = Model(lamp=16), 2.6, 0.02, (3, 3, 3)
    model.box("carpet", (-0.01, -0.02, -0.01), (8.01, 0, 8.01))
    model.box("plaster", (-0.01, height, -0.01), (8.01, height + 0.02, 8.01))
    # Room x < 4, z < 4 has two windows, x > 4, z < 4 a door to it, x < 4, z > 4 a lamp and a door to it; x > 4, z > 4 is sealed.
    model.wall(0, 0, 0, 8, wall, height, [(0.8, 2.6, 0.8, 2.1)])
    model.wall(2, 0, 0, 8, wall, height, [(1.0, 2.8, 0.8, 2.1)])
    model.wall(0, 8, 0, 8, wall, height)
    model.wall(2, 8, 0, 8, wall, height)
    model.wall(2, 4, 0, 8, wall, height, [(2.2, 3.2, 0, 2.1)], material="ochre")
    model.wall(0, 4, 0, 8, wall, height, [(1.6, 2.6, 0, 2.1)], material="blue")
    model.panel(sky, [(0.8, 0.8, -0.01), (2.6, 0.8, -0.01), (2.6, 2.1, -0.01), (0.8, 2.1, -0.01)])
    model.panel(sky, [(-0.01, 0.8, 1.0), (-0.01, 2.1, 1.0), (-0.01, 2.1, 2.8), (-0.01, 0.8, 2.8)])
    model.box("lamp", (1.0, height - 0.06, 6), (1.6, height, 6.6))
    for x, z in ((2.2, 1.6), (6.2, 2.4), (2.4, 6.4), (6, 6)):
        model.table(x, z)
        model.chair(x, z + 0.7, 1)
    write_views(folder, "thin", model, [((0.4, 1.55, 0.4), (3.8, 0.9, 3.4), 64), ((7.6, 1.5, 7.6), (4.4, 0.9, 4.4), 64)], sky)


def sun(folder):
    """The sky is even along the horizon, so that the picture packs well. The sun is 3 x 3 texels, 2 degrees wide."""
    columns, rows = 512, 256
    sky = np.empty((rows, columns, 3))
    up = np.cos(np.pi * (np.arange(rows) + 0.5) / rows)
    for channel, (zenith, horizon, ground) in enumerate(zip((0.18, 0.30, 0.58), (0.55, 0.60, 0.68), (0.16, 0.14, 0.11))):
        sky[:, :, channel] = np.where(up > 0, zenith + (horizon - zenith) * (1 - np.abs(up)) ** 4, ground)[:, None]
    row, column = 73, 330
    sky[row - 1:row + 2, column - 1:column + 2] = (5600, 5000, 4100)
    texels = np.zeros((rows, columns, 4), np.uint8)
    mantissa, exponent = np.frexp(sky.max(2))
    texels[:, :, :3] = sky * (np.ldexp(256.0, -exponent))[:, :, None]
    texels[:, :, 3] = exponent + 128
    packed = bytearray(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {rows} +X {columns}\n".encode())
    for line in texels:
        packed += struct.pack(">BBH", 2, 2, columns)
        for plane in line.T:
            starts = [0] + [i for i in range(1, columns) if plane[i] != plane[i - 1]] + [columns]
            for start, end in zip(starts, starts[1:]):
                for at in range(start, end, 127):
                    packed += bytes((128 + min(127, end - at), plane[start]))
    (folder / "sun.hdr").write_bytes(packed)

    model = Model()
    model.polygon("stone", [(-30, 0, -30), (-30, 0, 30), (30, 0, 30), (30, 0, -30)])
    model.wall(0, -6, -6, 6, 0.3, 3.5, [(-3.5, -2.5, 0, 2.2), (1.5, 3.5, 1.0, 2.4)], material="plaster", frame="wood")
    model.wall(2, -6, -6, 6, 0.3, 3.5, material="ochre")
    model.wall(2, 6, -6, 6, 0.3, 3.5, material="blue")
    # A roof on columns along the wall on the left.
    model.box("wood", (-6, 3.0, -5.85), (-3.4, 3.15, 5.5))
    for z in (-4, -1, 2, 5):
        model.box("plaster", (-3.7, 0, z - 0.15), (-3.4, 3.0, z + 0.15))
    model.table(1.5, -2.5, 2.0, 1.0)
    model.chair(1.5, -1.6, 1)
    model.box("plaster", (-0.5, 0, 1.0), (0.5, 0.5, 2.0))
    write_views(folder, "sun", model, [((4.8, 1.7, 7.5), (-2.5, 1.0, -3.5), 55), ((-5.4, 1.6, 5.0), (0.5, 0.9, -4.0), 60)], "sun.hdr")


def kilometre(folder):
    model, height, wall, base = Model(lamp=12), 2.9, 0.2, 0.2
    cells, step = 20, 50.0
    def ground(i, j):
        x, z = (i - cells / 2) * step, (j - cells / 2) * step
        away = min(max((np.hypot(x, z) - 90) / 200, 0), 1)
        return (x, away * away * (3 - 2 * away) * (22 + 25 * np.sin(x / 90) * np.cos(z / 70 + 1)), z)
    for i in range(cells):
        for j in range(cells):
            a, b, c, d = ground(i, j), ground(i, j + 1), ground(i + 1, j + 1), ground(i + 1, j)
            model.polygon("stone", [a, b, c])
            model.polygon("stone", [a, c, d])
    model.box("wood", (-3.2, 0, -2.7), (3.2, base, 2.7))
    model.box("plaster", (-3.4, height, -2.9), (3.4, height + 0.2, 2.9))
    model.wall(2, -3.1, -2.5, 2.5, wall, height, base=base, material="ochre")
    model.wall(2, 3.1, -2.5, 2.5, wall, height, [(-1.0, 0.2, 1.1, 2.2)], base=base, material="blue", frame="wood")
    model.wall(0, -2.6, -3.2, 3.2, wall, height, base=base)
    model.wall(0, 2.6, -3.2, 3.2, wall, height, [(-2.4, 2.4, base, 2.6)], base=base)
    model.table(0.3, -0.4, 1.8, 0.9, base=base)
    model.chair(0.3, 0.4, 1, base)
    model.chair(-0.4, -1.2, -1, base)
    model.box("wood", (-2.9, base, -2.4), (-1.7, 2.0, -1.9))
    model.box("blue", (1.6, base, -2.3), (2.9, 0.65, -1.5))
    model.box("lamp", (-0.2, 2.3, -0.6), (0.3, 2.4, -0.1))
    write_views(folder, "kilometre", model, [((2.7, 1.75, 2.2), (-1.4, 0.9, -2.2), 62), ((9, 2.4, 12), (0, 1.4, 0), 45)], (2.6, 2.8, 3.2))


SCENES = {scene.__name__: scene for scene in (office, maze, window, doors, house, thin, sun, kilometre)}


def main(scenes=SCENES):
    parser = argparse.ArgumentParser()
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("names", nargs="*", default=list(scenes), metavar="NAME")
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    for name in arguments.names:
        scenes[name](arguments.folder)


if __name__ == "__main__":
    main()
