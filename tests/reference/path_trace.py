"""Path-traced reference of a finalgather scene, made with Mitsuba 3 (pip install mitsuba numpy).

    python3 tests/reference/path_trace.py scenes/cornell.toml tests/reference/cornell_256.exr --size 256 --spp 32768
    python3 tests/reference/path_trace.py scenes/cornell_textured.toml tests/reference/cornell_textured_256.exr --size 256 --spp 16384
    python3 tests/reference/path_trace.py scenes/open.toml tests/reference/open_128.exr --size 128 --spp 8192
    python3 tests/reference/path_trace.py FOLDER/office_a_reference.toml FOLDER/office_a.exr --size 256x192 --spp 1280 --many-lamps \\
        --blocks tests/reference/buildings/office_a.exr

Reads the scene file, OBJ and MTL by itself, so that it shares no code with the renderer: Lambertian two-sided
surfaces, mirrors (illum 3), glass (illum 7), cut-outs (map_d) and gloss (Pr, Pm) of the MTL, emission from the side that the winding faces, textured
by map_Ke, an environment, a sun and lights as the scene file's, box pixel filter, unlimited path length. Writes half-float linear RGB, and where surfaces emit beside it NAME_mask.png: black where a pixel shows a light
or lies within two pixels of one, white elsewhere. Prints the image's mean and the standard error of a pixel, as a share of the mean, from
independent passes.

For scenes of buildings.py:
- `--blocks` writes means over 8 x 8 pixels too, and prints their standard error. Their mask is black where a block has a pixel brighter than
  `--brightest`, which is a lamp or a window in these scenes. The whole picture has 32 bits then, and no mask.
- `--many-lamps` is for many lamps in many rooms, without an environment (near_lamps.py).
- `--lights-alone` leaves the lamps black, so that lights without a surface alone shine. `--add FILE` adds the whole picture of an earlier run: the hall
  is the sum of one with `--many-lamps`, which has no other lights, and one with `--lights-alone`.
- `--depth 2` stops paths after the first surface that the camera sees: emission and direct light alone.
"""
import argparse
import pathlib
import time
import tomllib

import mitsuba as mi
import numpy as np


def read_mtl(path):
    materials, current = {}, None
    for line in path.read_text().splitlines():
        words = line.split("#")[0].split()
        if not words:
            continue
        if words[0] == "newmtl":
            current = materials.setdefault(words[1], {"Kd": [0, 0, 0], "Ke": [0, 0, 0], "illum": "2"})
        elif words[0] == "illum":
            current["illum"] = words[1]
        elif words[0] in ("Kd", "Ke", "Ks", "Ni", "Tf"):
            current[words[0]] = [float(x) for x in words[1:4]]
        elif words[0] in ("Pr", "Pm"):
            current[words[0]] = float(words[1])
        elif words[0] in ("map_Kd", "map_Ke", "map_d"):
            current[words[0]] = path.parent / words[1]
    return materials


def read_obj(path):
    positions, uvs, normals, faces, materials, current = [], [], [], {}, {}, None
    for line in path.read_text().splitlines():
        words = line.split("#")[0].split()
        if not words:
            continue
        if words[0] == "v":
            positions.append([float(x) for x in words[1:4]])
        elif words[0] == "vt":
            uvs.append([float(x) for x in words[1:3]])
        elif words[0] == "vn":
            normals.append([float(x) for x in words[1:4]])
        elif words[0] == "mtllib":
            materials = read_mtl(path.parent / words[1])
        elif words[0] == "usemtl":
            current = words[1]
        elif words[0] == "f":
            corners = []
            for corner in words[1:]:
                indices = [int(index) if index else 0 for index in corner.split("/")] + [0, 0]
                of = lambda values, index, none: values[index - (index > 0)] if index else none
                corners.append((of(positions, indices[0], None), of(uvs, indices[1], [0, 0]), of(normals, indices[2], None)))
            for i in range(1, len(corners) - 1):
                faces.setdefault(current, []).append((corners[0], corners[i], corners[i + 1]))
    return faces, materials


def mesh(name, triangles, material):
    corners = [corner for triangle in triangles for corner in triangle]
    properties = mi.Properties()
    if "map_Kd" in material:
        albedo = {"type": "bitmap", "filename": str(material["map_Kd"])}
    else:
        albedo = {"type": "rgb", "value": material["Kd"]}
    if material["illum"] == "7":
        # The filter is of a body, which light enters and leaves.
        tint = {"type": "rgb", "value": [x**0.5 for x in material["Tf"]]}
        bsdf = {"type": "dielectric", "int_ior": material["Ni"][0], "ext_ior": 1.0, "specular_transmittance": tint}
    elif material["illum"] == "3":
        mirror = {"type": "conductor", "material": "none", "specular_reflectance": {"type": "rgb", "value": material["Ks"]}}
        bsdf = {"type": "twosided", "bsdf": mirror}
    elif "Pr" in material:
        bsdf = {"type": "twosided", "bsdf": gltf_bsdf(material["Kd"], material.get("Pm", 0), material["Pr"])}
    else:
        bsdf = {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": albedo}}
    if "map_d" in material:
        bsdf = {"type": "mask", "opacity": {"type": "bitmap", "filename": str(material["map_d"]), "raw": True}, "bsdf": bsdf}
    properties["bsdf"] = mi.load_dict(bsdf)
    if any(material["Ke"]):
        radiance = {"type": "rgb", "value": material["Ke"]}
        if "map_Ke" in material:
            colors = mi.Bitmap(str(material["map_Ke"])).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False)
            radiance = {"type": "bitmap", "bitmap": mi.Bitmap(np.array(colors) * np.float32(material["Ke"])), "raw": True}
        properties["emitter"] = mi.load_dict({"type": "area", "radiance": radiance})
    smooth = all(corner[2] for corner in corners)
    out = mi.Mesh(name, len(corners), len(triangles), properties, has_vertex_texcoords=True, has_vertex_normals=smooth)
    parameters = mi.traverse(out)
    parameters["vertex_positions"] = np.array([c[0] for c in corners], np.float32).ravel()
    if smooth:
        parameters["vertex_normals"] = np.array([c[2] for c in corners], np.float32).ravel()
    # In OBJ v runs up; Mitsuba's textures run down, and its own OBJ reader turns v round too.
    parameters["vertex_texcoords"] = np.array([(c[1][0], 1 - c[1][1]) for c in corners], np.float32).ravel()
    parameters["faces"] = np.arange(len(corners), dtype=np.uint32)
    parameters.update()
    return out


def connected(triangles):
    """Lists of triangles that share corners, as those of one lamp do."""
    bodies = []
    for triangle in triangles:
        corners = {tuple(corner[0]) for corner in triangle}
        touched = [body for body in bodies if body[0] & corners]
        bodies = [body for body in bodies if not body[0] & corners]
        bodies.append((corners.union(*(body[0] for body in touched)), [t for body in touched for t in body[1]] + [triangle]))
    return [body[1] for body in bodies]


def groups(bodies):
    """Joins lamps whose middles are within 60 cm: one choice of the path tracer is enough for them."""
    joined = []
    for body in bodies:
        middle = np.mean([corner[0] for triangle in body for corner in triangle], axis=0)
        near = [group for group in joined if np.linalg.norm(group[0] - middle) < 0.6]
        if near:
            near[0][1].extend(body)
        else:
            joined.append((middle, list(body)))
    return [group[1] for group in joined]


def environment(table, folder):
    """Of a finalgather picture's texels, whose centres lie within its borders; Mitsuba's first and last rows lie on the poles, and its middle
    column is along +z. So it gets one of its own kind, fine enough that its bilinear look-up adds nothing."""
    if "radiance" in table:
        return {"type": "constant", "radiance": {"type": "rgb", "value": [table.get("scale", 1) * c for c in table["radiance"]]}}
    texels = np.array(mi.Bitmap(str(folder / table["file"])).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32), np.float64)
    rows, columns = texels.shape[:2]
    finer = max(1, min(32, 4096 // columns))
    width, height = finer * columns, finer * rows + 1
    x = ((np.arange(width) + 0.5) / width + table.get("turn_degrees", 0) / 360) * columns - 0.5
    y = np.clip(np.arange(height) / (height - 1) * rows - 0.5, 0, rows - 1)
    left, above = np.floor(x).astype(int), np.floor(y).astype(int)
    across, down = (x - left)[None, :, None], (y - above)[:, None, None]
    at = lambda row, column: texels[np.minimum(row, rows - 1)][:, column % columns]
    upper, lower = [at(row, left) * (1 - across) + at(row, left + 1) * across for row in (above, above + 1)]
    picture = table.get("scale", 1) * (upper * (1 - down) + lower * down)
    turn = mi.ScalarTransform4f().rotate([0, 1, 0], 180)
    return {"type": "envmap", "bitmap": mi.Bitmap(picture.astype(np.float32)), "to_world": turn}


def three(value):
    return value if isinstance(value, list) else [value] * 3


def lights(scene_file):
    """The sun and the lights without a surface. A spot's cone has a hard edge here: Mitsuba's own edge has another profile."""
    found = {}
    if "sun" in scene_file:
        sun = scene_file["sun"]
        irradiance = {"type": "rgb", "value": three(sun["illuminance"])}
        found["sun"] = {"type": "directional", "direction": [-c for c in sun["direction"]], "irradiance": irradiance}
    for number, light in enumerate(scene_file.get("lights", [])):
        intensity = {"type": "rgb", "value": three(light["intensity"])}
        if light["kind"] == "point":
            found[f"light_{number}"] = {"type": "point", "position": light["position"], "intensity": intensity}
        else:
            place = mi.ScalarTransform4f().look_at(light["position"], np.add(light["position"], light["direction"]), [0.1, 0, 1])
            edge = light["outer_degrees"]
            found[f"light_{number}"] = {"type": "spot", "to_world": place, "intensity": intensity, "cutoff_angle": edge, "beam_width": edge - 0.01}
    return found


def blocks(image):
    """Means over 8 x 8 pixels."""
    height, width = image.shape[:2]
    return image.reshape(height // 8, 8, width // 8, 8, 3).mean(axis=(1, 3))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("scene", type=pathlib.Path)
    parser.add_argument("output", type=pathlib.Path)
    parser.add_argument("--size", default="256", help="N or WxH")
    parser.add_argument("--spp", type=int, default=16384)
    parser.add_argument("--depth", type=int, default=-1, help="most segments of a path; without it, any number")
    parser.add_argument("--seed", type=int, default=0, help="of the first pass; those of the others follow")
    parser.add_argument("--many-lamps", action="store_true")
    parser.add_argument("--lights-alone", action="store_true")
    parser.add_argument("--add", type=pathlib.Path)
    parser.add_argument("--blocks", type=pathlib.Path, help="picture of means over 8 x 8 pixels")
    parser.add_argument("--brightest", type=float, default=2.5)
    parser.add_argument("--spp-per-pass", type=int, default=64)
    parser.add_argument("--variant", default="llvm_ad_rgb")
    arguments = parser.parse_args()
    mi.set_variant(arguments.variant)
    if arguments.many_lamps:
        from near_lamps import NearLamps
        mi.register_integrator("near_lamps", NearLamps)
    global gltf_bsdf
    from gltf_bsdf import gltf_bsdf
    width, height = map(int, (arguments.size.split("x") * 2)[:2])

    scene_file = tomllib.loads(arguments.scene.read_text())
    camera = scene_file["camera"]
    faces, materials = read_obj(arguments.scene.parent / scene_file["mesh"])
    scene = {
        "type": "scene",
        # Shadow rays of `path` take a cut-out for a wall.
        "integrator": {"type": "volpath" if any("map_d" in m for m in materials.values()) else "path", "max_depth": arguments.depth, "rr_depth": 4},
        "sensor": {
            "type": "perspective",
            "fov_axis": "y",
            "fov": camera["fov_y_degrees"],
            "to_world": mi.ScalarTransform4f().look_at(camera["eye"], camera["target"], camera["up"]),
            "film": {
                "type": "hdrfilm", "width": width, "height": height,
                "rfilter": {"type": "box"}, "pixel_format": "rgb", "component_format": "float32",
            },
            "sampler": {"type": "multijitter", "sample_count": arguments.spp_per_pass},
        },
    }
    if arguments.lights_alone:
        for material in materials.values():
            material["Ke"] = [0, 0, 0]
    for name, triangles in faces.items():
        bodies = groups(connected(triangles)) if arguments.many_lamps and any(materials[name]["Ke"]) else [triangles]
        for number, body in enumerate(bodies):
            scene[f"{name}_{number}"] = mesh(f"{name}_{number}", body, materials[name])
    if "environment" in scene_file:
        scene["environment"] = environment(scene_file["environment"], arguments.scene.parent)
    without_surface = lights(scene_file)
    if not arguments.many_lamps:
        scene |= without_surface
    scene = mi.load_dict(scene)
    integrator = scene.integrator()
    if arguments.many_lamps:
        integrator = mi.load_dict({"type": "near_lamps", "max_depth": arguments.depth})
        integrator.find_lamps(scene)

    passes = max(2, arguments.spp // arguments.spp_per_pass)
    total = squares = block_squares = 0
    start = time.time()
    for i in range(passes):
        image = np.array(mi.render(scene, integrator=integrator, spp=arguments.spp_per_pass, seed=arguments.seed + i), np.float64)
        total, squares = total + image, squares + image * image
        if arguments.blocks:
            block_squares = block_squares + blocks(image) ** 2
        if i in (0, 9) or i == passes - 1:
            print(f"pass {i + 1} of {passes}: {time.time() - start:.0f} s", flush=True)
    mean = total / passes
    if arguments.add:
        mean = mean + np.array(mi.Bitmap(str(arguments.add)))
    error = np.sqrt(np.maximum(squares / passes - mean * mean, 0) / (passes - 1))
    print("mean", mean.mean(axis=(0, 1)), "root mean square standard error / mean", np.sqrt((error**2).mean()) / mean.mean())
    if arguments.blocks:
        means = blocks(mean)
        counted = mean.max(axis=2).reshape(height // 8, 8, width // 8, 8).max(axis=(1, 3)) <= arguments.brightest
        error = np.sqrt(np.maximum(block_squares / passes - means * means, 0) / (passes - 1))[counted]
        print("of 8 x 8 pixels: root mean square standard error / mean", np.sqrt((error**2).mean()) / means[counted].mean())
        mi.Bitmap(means.astype(np.float32)).convert(component_format=mi.Struct.Type.Float16).write(str(arguments.blocks))
        mask = np.where(counted, 255, 0).astype(np.uint8)[..., None].repeat(3, axis=2)
        mi.Bitmap(mask).write(str(arguments.blocks.with_name(arguments.blocks.stem + "_mask.png")))
        mi.Bitmap(mean.astype(np.float32)).write(str(arguments.output))
        return
    brightest = max(max(material["Ke"]) for material in materials.values())
    if brightest > 0:
        # Lights are far brighter than all that they light: a pixel that is a twentieth as bright as one shows a part of one.
        light = np.pad(mean.max(axis=2) > 0.05 * brightest, 2)
        near = np.any([light[y:y + height, x:x + width] for y in range(5) for x in range(5)], axis=0)
        mask = np.where(near, 0, 255).astype(np.uint8)[..., None].repeat(3, axis=2)
        mi.Bitmap(mask).write(str(arguments.output.with_name(arguments.output.stem + "_mask.png")))
    mi.Bitmap(mean.astype(np.float32)).convert(component_format=mi.Struct.Type.Float16).write(str(arguments.output))


if __name__ == "__main__":
    main()
