"""Writes open_sky.hdr, the sky of open: a blue dome, brighter and paler towards the horizon, a low sun in haze, and brown ground.

    python3 scenes/open_sky.py scenes/open_sky.hdr

Needs nothing beside Python, and always writes the same bytes. The top row is straight up (+y), the middle of the picture is -z, right of it
+x. The sun is no point: its haze is a lobe some 30 degrees wide, which a thousand directions resolve.
"""
import math
import sys

WIDTH, HEIGHT = 64, 32
SUN = (-0.75, 0.55, 0.2)
ZENITH, HORIZON, HAZE, GROUND = (0.22, 0.42, 0.95), (0.80, 0.90, 1.05), (16.0, 12.5, 8.5), (0.16, 0.13, 0.10)


def radiance(column, row):
    azimuth, polar = 2 * math.pi * ((column + 0.5) / WIDTH - 0.5), math.pi * (row + 0.5) / HEIGHT
    x, y, z = math.sin(polar) * math.sin(azimuth), math.cos(polar), -math.sin(polar) * math.cos(azimuth)
    if y < 0:
        return GROUND
    to_horizon = (1 - y) ** 4
    towards_sun = (x * SUN[0] + y * SUN[1] + z * SUN[2]) / math.hypot(*SUN)
    lobe = math.exp(24 * (towards_sun - 1))
    return tuple(zenith + (horizon - zenith) * to_horizon + haze * lobe for zenith, horizon, haze in zip(ZENITH, HORIZON, HAZE))


def rgbe(color):
    mantissa, exponent = math.frexp(max(color))
    return bytes(int(channel * mantissa * 256 / max(color)) for channel in color) + bytes([exponent + 128])


def main():
    texels = b"".join(rgbe(radiance(column, row)) for row in range(HEIGHT) for column in range(WIDTH))
    with open(sys.argv[1], "wb") as file:
        file.write(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {HEIGHT} +X {WIDTH}\n".encode() + texels)


main()
