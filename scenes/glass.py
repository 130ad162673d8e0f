"""Writes glass.obj: the Cornell box with the tall block as a mirror, turned, and a ball of glass in place of the short one.

    python3 scenes/glass.py
"""
import math
import pathlib

CENTER, RADIUS = (186.0, 90.5, 169.0), 90.0
SUBDIVISIONS = 3
# Turned about its axis, so that the camera sees the red wall in it.
TALL_BLOCK, AXIS, TURN = range(17, 25), (368.5, 351.25), math.radians(55)
COS, SIN = math.cos(TURN), math.sin(TURN)


def unit(v):
    length = sum(x * x for x in v) ** 0.5
    return tuple(x / length for x in v)


def icosphere():
    """Unit vertices, and faces that wind counter-clockwise from outside."""
    g = (1 + 5**0.5) / 2
    corners = [(a, b, 0) for a in (-1, 1) for b in (-g, g)]
    vertices = [unit(v[k:] + v[:k]) for k in range(3) for v in corners]
    near = lambda i, j: sum(a * b for a, b in zip(vertices[i], vertices[j])) > 0.4
    faces = []
    for i in range(12):
        for j in range(i + 1, 12):
            for k in range(j + 1, 12):
                if near(i, j) and near(j, k) and near(i, k):
                    a, b, c = vertices[i], vertices[j], vertices[k]
                    cross = [b[m - 2] * c[m - 1] - b[m - 1] * c[m - 2] for m in range(3)]
                    faces.append((i, j, k) if sum(x * y for x, y in zip(a, cross)) > 0 else (i, k, j))
    for _ in range(SUBDIVISIONS):
        middles = {}

        def middle(i, j):
            key = (min(i, j), max(i, j))
            if key not in middles:
                middles[key] = len(vertices)
                vertices.append(unit(tuple(a + b for a, b in zip(vertices[i], vertices[j]))))
            return middles[key]

        split = []
        for i, j, k in faces:
            ij, jk, ki = middle(i, j), middle(j, k), middle(k, i)
            split += [(i, ij, ki), (j, jk, ij), (k, ki, jk), (ij, jk, ki)]
        faces = split
    return vertices, faces


here = pathlib.Path(__file__).parent
lines, group, vertex = [], None, 0
for line in (here / "cornell.obj").read_text().splitlines():
    vertex += line.startswith("v ")
    if line.startswith("v ") and vertex in TALL_BLOCK:
        x, y, z = map(float, line.split()[1:])
        x, z = x - AXIS[0], z - AXIS[1]
        line = f"v {AXIS[0] + COS * x - SIN * z:.4f} {y:g} {AXIS[1] + SIN * x + COS * z:.4f}"
    if line.startswith("g "):
        group = line[2:]
    if group == "short_block":
        continue
    line = line.replace("cornell.mtl", "glass.mtl")
    lines.append("usemtl mirror" if group == "tall_block" and line.startswith("usemtl") else line)
lines[0] = "# The Cornell box with a mirror and a ball of glass. Written by glass.py."
vertices, faces = icosphere()
lines += ["", "g ball", "usemtl glass"]
for v in vertices:
    lines.append("v " + " ".join(f"{c + RADIUS * x:.4f}" for c, x in zip(CENTER, v)))
    lines.append("vn " + " ".join(f"{x:.6f}" for x in v))
# Indices from the end: whatever number of vertices stands before.
count = len(vertices)
for face in faces:
    lines.append("f " + " ".join(f"{i - count}//{i - count}" for i in face))
(here / "glass.obj").write_text("\n".join(lines) + "\n")
