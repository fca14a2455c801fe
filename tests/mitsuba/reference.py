#!/usr/bin/env python3
"""Makes a reference picture of a scene with Mitsuba 3, an independent renderer.

    pip install mitsuba numpy
    cargo build --release -p scenes --examples
    python3 tests/mitsuba/reference.py SCENE OUT.exr [--size 256x256] [--spp 256] [--depth 2]

SCENE is whatever `renderer` opens. The scene reaches Mitsuba as triangles in world space (scenes/examples/export.rs), so
no formula of a generator is written twice. --depth is the number of path segments: 2 is direct light, 6 adds four
bounces. Direct light is rendered one light at a time, by emitter sampling, and summed, which has less noise than
choosing among lights; what bounces is one path-traced render less another of its direct part.

What is the same as in the shaders: two-sided diffuse surfaces (specular reflection is left out); textures sRGB, repeating, looked up bilinearly; shading normals
of the file, else flat; area lights shine from one side, are seen, block, and are black from behind; box filter;
linear RGB, row 0 on top. `ambient` adds diffuse * ambient to every surface, and `background` fills the rest.
"""

import argparse
import json
import os
import pathlib
import subprocess
import sys
import tempfile

import mitsuba as mi
import numpy as np

VARIANT = os.environ.get("MITSUBA_VARIANT", "scalar_rgb")
mi.set_variant(VARIANT)

HERE = pathlib.Path(__file__).resolve().parent
EXPORT = HERE.parent.parent / "target" / "release" / "examples" / "export"


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scene")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--size", default="256x256")
    parser.add_argument("--spp", type=int, default=256, help="samples a pixel for each light")
    parser.add_argument("--indirect-spp", type=int, help="and for what bounces (default: --spp)")
    parser.add_argument("--depth", type=int, default=2)
    parser.add_argument("--export", type=pathlib.Path, default=EXPORT)
    parser.add_argument("--seed", type=int, default=0)
    return parser.parse_args()


def exported(scene, export, folder):
    if not export.exists():
        sys.exit(f"{export} is missing: cargo build --release -p scenes --examples")
    subprocess.run([export, scene, folder], check=True)
    return json.loads((folder / "scene.json").read_text())


def reflectance(material, folder):
    diffuse = material["diffuse"]
    if material["map"] is None:
        return {"type": "rgb", "value": diffuse}
    picture = mi.Bitmap(str(folder / material["map"]))
    # Linear before the factor; the shaders multiply what they looked up.
    picture = picture.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, srgb_gamma=False)
    texels = np.array(picture) * np.array(diffuse, dtype=np.float32)
    return {"type": "bitmap", "bitmap": mi.Bitmap(texels.astype(np.float32)), "raw": True}


def bsdf(material, folder):
    base = {"type": "diffuse", "reflectance": reflectance(material, folder)}
    return {"type": "twosided", "nested": base}


def polygon(light):
    """An area light's fan of triangles, and its normal."""
    p = np.array(light["vertices"], dtype=np.float32)
    faces = np.array([[0, i, i + 1] for i in range(1, len(p) - 1)], dtype=np.uint32)
    mesh = mi.Mesh("light", len(p), len(faces))
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = p.ravel()
    parameters["faces"] = faces.ravel()
    parameters.update()
    return mesh


def emitter(light, folder, index, lit):
    """A light as a shape or emitter; where it is not lit an area light still blocks, black."""
    if light["kind"] == "point":
        return lit and {
            "type": "point",
            "position": light["position"],
            "intensity": {"type": "rgb", "value": light["intensity"]},
        }
    if light["kind"] == "linear":
        # As many points as a viewer cannot tell from a line.
        raise SystemExit("linear lights have no counterpart in Mitsuba; leave them out of scenes for references")
    path = folder / f"light-{index}.ply"
    polygon(light).write_ply(str(path))
    shape = {"type": "ply", "filename": str(path), "face_normals": True,
             "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}}
    if lit:
        shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": light["radiance"]}}
    return shape


def build(scene, folder, options, lit):
    """A Mitsuba scene in which the lights numbered in `lit` shine."""
    c = scene["camera"]
    width, height = map(int, options.size.split("x"))
    world = {
        "type": "scene",
        "sensor": {
            "type": "perspective",
            "fov": c["fov_y"],
            "fov_axis": "y",
            "near_clip": 1e-3,
            "to_world": mi.ScalarTransform4f().look_at(origin=c["eye"], target=c["target"], up=c["up"]),
            "film": {"type": "hdrfilm", "width": width, "height": height, "pixel_format": "rgb",
                     "component_format": "float32", "rfilter": {"type": "box"}},
            "sampler": {"type": "independent"},
        },
    }
    for i, material in enumerate(scene["materials"]):
        world[f"material-{i}"] = {**bsdf(material, folder), "id": f"material-{i}"}
    for i, shape in enumerate(scene["shapes"]):
        world[f"shape-{i}"] = {"type": "ply", "filename": str(folder / shape["file"]), "flip_tex_coords": True,
                               "bsdf": {"type": "ref", "id": f"material-{shape['material']}"}}
    for i, light in enumerate(scene["lights"]):
        made = emitter(light, folder, i, i in lit)
        if made:
            world[f"light-{i}"] = made
    return mi.load_dict(world)


def render(world, integrator, spp, seed):
    """The mean of passes that fit memory."""
    most, total, done = 64, None, 0
    while done < spp:
        now = min(most, spp - done)
        picture = np.array(mi.render(world, integrator=integrator, spp=now, seed=seed + done), dtype=np.float64)
        total = picture * now if total is None else total + picture * now
        done += now
    return total / spp


def surfaces(world, spp, seed):
    """Diffuse reflectance in each pixel (for `ambient`) and how much of it is covered (for `background`)."""
    names = {"type": "aov", "aovs": "albedo:albedo,depth:depth", "img": {"type": "direct"}}
    picture = np.array(mi.render(world, integrator=mi.load_dict(names), spp=spp, seed=seed), dtype=np.float64)
    return picture[..., 3:6], picture[..., 6] > 0


def main():
    options = arguments()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scene = exported(options.scene, options.export, folder)
        lights = range(len(scene["lights"]))
        direct = mi.load_dict({"type": "direct", "emitter_samples": 1, "bsdf_samples": 0})
        total = 0.0
        for i in lights:
            world = build(scene, folder, options, {i})
            total = total + render(world, direct, options.spp, options.seed + 7919 * i)
        world = build(scene, folder, options, set(lights))
        if options.depth > 2:
            spp = options.indirect_spp or options.spp
            path = {"type": "path", "rr_depth": 1000}
            all_of_it = render(world, mi.load_dict({**path, "max_depth": options.depth}), spp, options.seed + 1)
            straight = render(world, mi.load_dict({**path, "max_depth": 2}), spp, options.seed + 1)
            total = total + all_of_it - straight
        if any(scene["ambient"]) or any(scene["background"]):
            albedo, covered = surfaces(world, options.spp, options.seed)
            total = total + albedo * np.array(scene["ambient"])
            total = total + np.where(covered[..., None], 0.0, np.array(scene["background"]))
    mi.Bitmap(total.astype(np.float16 if options.out.suffix == ".exr" else np.float32)).write(str(options.out))
    print(f"{options.out}: mean {total.mean():.5f}")


if __name__ == "__main__":
    main()
