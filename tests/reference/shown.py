"""Writes scenes with what files say about lights and surfaces, for comparison with path tracing. Needs numpy; always writes the same bytes.

    python3 tests/reference/shown.py FOLDER [NAME ...]

A scene NAME is NAME.toml, NAME.obj and NAME.mtl. Units are metres, y is up.

| scene      | what it holds                                                                                          |
|------------|--------------------------------------------------------------------------------------------------------|
| blind      | a room with plants of cut-out leaves and a patterned blind before its window, under a sun and a sky     |
| still_life | balls, boxes and a table of metal and varnish, of roughness 0.05 to 1, under a lamp and a sky           |
| screen     | a room with a textured screen as its only lamp                                                         |
| hall       | a hall of columns under 200 lamps: 160 panels, 20 points and 20 spots                                   |

References are means over 8 x 8 pixels:

    python3 tests/reference/path_trace.py FOLDER/blind.toml FOLDER/blind.exr --size 256x192 --spp 768 --brightest 1000 \\
        --blocks tests/reference/shown/blind.exr

The still life takes 1024 paths and `--brightest 1000`, the screen 512 paths. The hall is a sum: 384 paths with `--many-lamps`, and 256 with
`--lights-alone --add` of that picture.
"""
import math
import random

import numpy as np

from buildings import Model, main, write_png

SIZE = (256, 192)


class SmoothModel(Model):
    """As the model of buildings, also with normals at corners."""

    def __init__(self):
        super().__init__()
        self.smooth = []

    def ball(self, material, center, radius, rows=12):
        """A ball of `rows` bands, with its own normals. Its pole is upright."""
        columns = 2 * rows
        def normal(row, column):
            down, around = math.pi * row / rows, 2 * math.pi * column / columns
            return (math.sin(down) * math.cos(around), math.cos(down), math.sin(down) * math.sin(around))
        for row in range(rows):
            for column in range(columns):
                corners = [normal(row, column), normal(row, column + 1), normal(row + 1, column + 1), normal(row + 1, column)]
                if row == 0:
                    del corners[1]
                if row == rows - 1:
                    del corners[2]
                self.smooth.append((material, [tuple(c + radius * n for c, n in zip(center, corner)) for corner in corners], corners))

    def write(self, folder, name):
        super().write(folder, name, "")
        positions, normals, faces, current = {}, {}, [], None
        path = folder / f"{name}.obj"
        text = path.read_text()
        first = text.count("\nv ")
        for material, corners, of_corners in self.smooth:
            if material != current:
                faces.append(f"usemtl {material}\n")
                current = material
            place = lambda table, key, before: table.setdefault(tuple(f"{x:.4f}" for x in key), before + len(table) + 1)
            words = [f"{place(positions, c, first)}//{place(normals, n, 0)}" for c, n in zip(corners, of_corners)]
            faces.append(f"f {' '.join(words)}\n")
        lines = [f"v {' '.join(key)}\n" for key in positions] + [f"vn {' '.join(key)}\n" for key in normals]
        path.write_text(text + "".join(lines + faces))
        used = {polygon[0] for polygon in self.polygons[""]} | {polygon[0] for polygon in self.smooth}
        (folder / f"{name}.mtl").write_text("".join(f"newmtl {material}\n{self.materials[material]}" for material in sorted(used)))


def scene_file(folder, name, eye, target, angle, more):
    camera = f"[camera]\neye = {list(eye)}\ntarget = {list(target)}\nup = [0, 1, 0]\nfov_y_degrees = {angle}\n"
    (folder / f"{name}.toml").write_text(f'mesh = "{name}.obj"\n\n{camera}{more}\n[settings]\nsize = {list(SIZE)}\n')


def room(model, width, height, depth, window=()):
    """From the origin to (width, height, depth), with walls of 20 cm. The window (z from, z to, bottom, top) is in the wall at x = width."""
    wall = 0.2
    model.box("wood", (-wall, -wall, -wall), (width + wall, 0, depth + wall))
    model.box("plaster", (-wall, height, -wall), (width + wall, height + wall, depth + wall))
    model.wall(2, -wall / 2, -wall, depth + wall, wall, height)
    model.wall(2, width + wall / 2, -wall, depth + wall, wall, height, [window] if window else ())
    model.wall(0, -wall / 2, 0, width, wall, height, material="blue")
    model.wall(0, depth + wall / 2, 0, width, wall, height, material="ochre")


def blind(folder):
    model = SmoothModel()
    room(model, 4, 2.8, 5, (1.4, 3.6, 0.7, 2.3))
    # White is there, black is not: rows of round holes.
    x, y = np.meshgrid(np.arange(64) + 0.5, np.arange(64) + 0.5)
    away = np.hypot((x + 8 * ((y // 16) % 2)) % 16 - 8, y % 16 - 8)
    hole = np.clip(away - 5, 0, 1)
    write_png(folder / "blind_holes.png", 255 * hole[..., None].repeat(3, 2))
    model.materials["blind"] = "Kd 0.7 0.66 0.55\nmap_d blind_holes.png\n"
    # Four copies of the picture across, three down.
    model.polygon("blind", [(3.97, 0.65, 1.35), (3.97, 0.65, 3.65), (3.97, 2.35, 3.65), (3.97, 2.35, 1.35)], [(0, 0), (4, 0), (4, 3), (0, 3)])
    u, v = (x - 32) / 32, (y - 32) / 32
    leaf = np.clip(8 * (0.55 * np.sqrt(np.maximum(1 - v * v, 0)) * (0.75 + 0.25 * np.sin(14 * v)) - np.abs(u)) + 0.5, 0, 1)
    write_png(folder / "blind_leaf.png", 255 * leaf[..., None].repeat(3, 2))
    model.materials["leaf"] = "Kd 0.16 0.42 0.10\nmap_d blind_leaf.png\n"
    numbers = random.Random(5)
    for x, z, top in ((2.7, 3.9, 1.5), (2.2, 1.1, 1.1), (3.3, 2.5, 0.8)):
        model.box("stone", (x - 0.18, 0, z - 0.18), (x + 0.18, 0.32, z + 0.18))
        model.box("dark", (x - 0.012, 0.32, z - 0.012), (x + 0.012, top, z + 0.012))
        for leaf in range(14):
            turn, low = 2.4 * leaf, 0.4 + (top - 0.4) * leaf / 14
            rise, length, half = 0.5 + 0.5 * numbers.random(), 0.45 + 0.2 * numbers.random(), 0.13
            along = np.array([math.cos(turn) * math.cos(rise), math.sin(rise), math.sin(turn) * math.cos(rise)]) * length
            across = np.array([-math.sin(turn), 0, math.cos(turn)]) * half
            root = np.array([x, low, z])
            corners = [root - across, root + across, root + along + across, root + along - across]
            model.polygon("leaf", [tuple(float(c) for c in corner) for corner in corners], [(0, 0), (1, 0), (1, 1), (0, 1)])
    model.table(1.0, 3.9)
    model.write(folder, "blind")
    lights = "\n[sun]\ndirection = [0.72, 0.55, -0.1]\nilluminance = [60, 54, 44]\nangle_degrees = 0\n\n[environment]\nradiance = [1.6, 2.0, 2.6]\n"
    scene_file(folder, "blind", (0.35, 1.5, 0.5), (2.9, 0.9, 3.1), 62, lights)


def still_life(folder):
    model = SmoothModel()
    metal = lambda color, roughness: f"Kd {color}\nPm 1\nPr {roughness}\n"
    varnish = lambda color, roughness: f"Kd {color}\nPm 0\nPr {roughness}\n"
    model.materials |= {
        "table": varnish("0.35 0.2 0.1", 0.3), "cloth": "Kd 0.5 0.55 0.6\n", "lamp": "Kd 0 0 0\nKe 12 11 9\n",
        "silver": metal("0.95 0.93 0.88", 0.05), "gold": metal("1 0.78 0.34", 0.2), "copper": metal("0.95 0.64 0.54", 0.4),
        "lead": metal("0.7 0.72 0.75", 0.7), "tin": metal("0.8 0.8 0.82", 1),
        "red": varnish("0.6 0.08 0.06", 0.05), "green": varnish("0.1 0.4 0.14", 0.25), "cobalt": varnish("0.08 0.14 0.5", 0.55),
        "chalk": varnish("0.8 0.78 0.74", 1),
    }
    model.box("table", (-1.2, -0.05, -0.7), (1.2, 0, 0.7))
    model.polygon("cloth", [(-3, -0.75, -2.2), (-3, -0.75, 3), (3, -0.75, 3), (3, -0.75, -2.2)])
    model.polygon("cloth", [(-3, -0.75, -2.2), (3, -0.75, -2.2), (3, 2.6, -2.2), (-3, 2.6, -2.2)])
    for material, x, z, radius in (("silver", -0.75, -0.2, 0.24), ("gold", -0.2, -0.3, 0.24), ("copper", 0.36, -0.3, 0.24),
                                   ("red", -0.45, 0.25, 0.17), ("green", 0.02, 0.28, 0.17), ("cobalt", 0.48, 0.25, 0.17)):
        model.ball(material, (x, radius, z), radius)
    model.box("lead", (0.72, 0, -0.5), (1.02, 0.5, -0.2))
    model.box("tin", (0.8, 0, 0.05), (1.05, 0.22, 0.3))
    model.box("chalk", (-1.05, 0, 0.2), (-0.8, 0.22, 0.45))
    # Shines down and forward.
    model.polygon("lamp", [(-1.0, 2.2, -0.6), (0.2, 2.2, -0.6), (0.2, 2.0, 0.4), (-1.0, 2.0, 0.4)])
    model.write(folder, "still_life")
    scene_file(folder, "still_life", (0.1, 0.95, 2.3), (0, 0.18, 0), 42, "\n[environment]\nradiance = [0.25, 0.3, 0.4]\n")


def screen(folder):
    model = SmoothModel()
    room(model, 4, 2.8, 5)
    x, y = np.meshgrid(np.arange(64), np.arange(36))
    picture = np.zeros((36, 64, 3))
    bars = np.array([(255, 255, 255), (255, 230, 0), (0, 220, 255), (0, 230, 40), (240, 0, 220), (255, 20, 10), (10, 20, 255), (0, 0, 0)])
    picture[:26] = bars[x[:26] // 8]
    picture[26:] = np.where(((x[26:] // 4 + y[26:] // 4) % 2)[..., None] == 1, (255, 140, 20), (4, 4, 10))
    write_png(folder / "screen_picture.png", picture)
    model.materials["screen"] = "Kd 0.03 0.03 0.03\nKe 14 14 14\nmap_Ke screen_picture.png\n"
    model.box("dark", (0, 0.8, 1.5), (0.06, 2.1, 3.7))
    model.polygon("screen", [(0.07, 0.85, 3.65), (0.07, 0.85, 1.55), (0.07, 2.05, 1.55), (0.07, 2.05, 3.65)], [(0, 0), (1, 0), (1, 1), (0, 1)])
    model.box("blue", (2.6, 0, 1.6), (3.5, 0.42, 3.6))
    model.box("blue", (3.3, 0.42, 1.6), (3.5, 0.95, 3.6))
    model.table(1.5, 2.6, 0.9, 0.6, 0.4)
    model.box("ochre", (0.2, 0, 0.2), (0.9, 1.8, 0.7))
    model.write(folder, "screen")
    scene_file(folder, "screen", (3.7, 1.6, 4.7), (0.9, 0.9, 1.6), 62, "")


def hall(folder):
    model, height = SmoothModel(), 5.0
    model.box("carpet", (-0.2, -0.2, -0.2), (30.2, 0, 20.2))
    model.box("plaster", (-0.2, height, -0.2), (30.2, height + 0.2, 20.2))
    for axis, at, length in ((0, -0.1, 30), (0, 20.1, 30), (2, -0.1, 20), (2, 30.1, 20)):
        model.wall(axis, at, -0.2, length + 0.2, 0.2, height, material="wall" if axis else "ochre")
    for x in range(5, 30, 5):
        for z in range(4, 20, 4):
            model.box("stone", (x - 0.3, 0, z - 0.3), (x + 0.3, height, z + 0.3))
    numbers = random.Random(9)
    colors = ("18 15 10", "14 15 18", "18 12 7", "10 16 14")
    for index, color in enumerate(colors):
        model.materials[f"lamp{index}"] = f"Kd 0.2 0.2 0.2\nKe {color}\n"
    # Panels hang in fours.
    for i in range(8):
        for j in range(5):
            x, z, y = 1.9 + 3.75 * i, 2 + 4 * j, 3.2 + 1.5 * numbers.random()
            for k, (a, b) in enumerate(((0, 0), (0.35, 0), (0, 0.35), (0.35, 0.35))):
                model.polygon(f"lamp{(i + 2 * j) % 4}", [(x + a, y, z + b), (x + a + 0.25, y, z + b), (x + a + 0.25, y, z + b + 0.25), (x + a, y, z + b + 0.25)])
    for i in range(6):
        model.table(2.5 + 5 * i, 6, 1.8, 0.9)
        model.table(2.5 + 5 * i, 14, 1.8, 0.9)
    model.write(folder, "hall")
    lights = ""
    for number in range(40):
        # Between the columns, so that no lamp is close to a surface.
        x, z = 5 * numbers.randrange(5) + 7.5 + 2 * (numbers.random() - 0.5), 4 * numbers.randrange(4) + 6 + 1.5 * (numbers.random() - 0.5)
        color = [round(4 + 6 * numbers.random(), 1) for _ in range(3)]
        if number % 2:
            lights += f'\n[[lights]]\nkind = "point"\nposition = [{x:.2f}, {1.7 + 1.2 * numbers.random():.2f}, {z:.2f}]\nintensity = {color}\n'
        else:
            aim = [round(numbers.random() - 0.5, 2), -1, round(numbers.random() - 0.5, 2)]
            lights += (f'\n[[lights]]\nkind = "spot"\nposition = [{x:.2f}, 4.8, {z:.2f}]\ndirection = {aim}\n'
                       f"intensity = {[round(8 * c, 1) for c in color]}\ninner_degrees = 29.9\nouter_degrees = 30\n")
    scene_file(folder, "hall", (28.8, 1.7, 1.0), (14, 1.2, 11), 60, lights)


SCENES = {scene.__name__: scene for scene in (blind, still_life, screen, hall)}


if __name__ == "__main__":
    main(SCENES)
