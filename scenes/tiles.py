"""Writes tiles.png, the floor of cornell_textured: 4 x 4 strongly coloured tiles with bevelled edges and grey grout.

    python3 scenes/tiles.py scenes/tiles.png

Needs nothing beside Python, and always writes the same bytes. No texel is pure black or white.
"""
import struct
import sys
import zlib

SIZE, TILES, GROUT, BEVEL = 256, 4, 2, 3
COLORS = {"r": (226, 52, 36), "g": (52, 168, 60), "b": (40, 84, 214), "y": (244, 190, 30)}
LAYOUT = ["rbyg", "ygrb", "bygr", "grby"]


def texel(x, y):
    tile = SIZE // TILES
    inside_x, inside_y = x % tile, y % tile
    edge = min(inside_x, inside_y, tile - 1 - inside_x, tile - 1 - inside_y)
    if edge < GROUT:
        return (120, 116, 110)
    shade = 0.82 if edge < GROUT + BEVEL else 1.0
    return tuple(round(shade * channel) for channel in COLORS[LAYOUT[y // tile][x // tile]])


def chunk(kind, data):
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


def main():
    rows = b"".join(b"\0" + bytes(c for x in range(SIZE) for c in texel(x, y)) for y in range(SIZE))
    header = struct.pack(">IIBBBBB", SIZE, SIZE, 8, 2, 0, 0, 0)
    png = b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows, 9)) + chunk(b"IEND", b"")
    with open(sys.argv[1], "wb") as file:
        file.write(png)


main()
