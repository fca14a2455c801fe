#!/usr/bin/env python3
"""Makes a reference picture of a scene with Mitsuba 3, an independent renderer.

    pip install mitsuba numpy
    cargo build --release -p scenes --examples
    python3 tests/mitsuba/reference.py SCENE OUT.exr [--model direct|glossy|global] [--size 256x256] [--spp 256] [--reflected-spp 256]

SCENE is whatever `renderer` opens. The scene reaches Mitsuba as triangles in world space (scenes/examples/export.rs), so
no formula of a generator is written twice. Mitsuba's `direct` integrator renders one light at a time, and the pictures are summed, which
has less noise than choosing among lights. The rest is `transport.py`'s, and so is the material. With E the eye, L a light, D a
diffuse reflection, S a specular one, X one of either kind, which counts as diffuse with albedo f0 + (1 - f0) * diffuse:

    direct   E D L                                    no surface is specular
    glossy   E (D|S) L   E S X L                      what is reflected in a surface shows its own direct light
    global   E (D|S) L   E (D|S) X{1,4} L             up to six segments in all

`ambient` is radiance that reaches the diffuse part at every D and X, `background` is what rays that miss bring, at every segment
but the last.

What is the same as in the shaders: two-sided surfaces; textures sRGB, repeating, v up, looked up bilinearly; shading normals
of the file, else flat; area lights shine from one side, are seen, block, and are black from behind; box filter;
linear RGB, row 0 on top. A linear light becomes LINEAR_POINTS points in the middle of as many equal pieces: where nothing hides it
that is wrong by less than 1e-4 from further away than a fiftieth of its length, and its penumbrae are as many steps.

Mitsuba's LLVM variants need LLVM 17 or newer for materials written in Python; DRJIT_LIBLLVM_PATH says where it is.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
import transport  # noqa: E402, after the variant is set

transport.register()

HERE = pathlib.Path(__file__).resolve().parent
EXPORT = HERE.parent.parent / "target" / "release" / "examples" / "export"

# Most segments between eye and light.
DEPTHS = {"direct": 2, "glossy": 3, "global": 6}
LINEAR_POINTS = 128


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scene")
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--size", default="256x256")
    parser.add_argument("--spp", type=int, default=256, help="samples a pixel for each light")
    parser.add_argument("--reflected-spp", type=int, help="and for what was reflected before (default: --spp)")
    parser.add_argument("--model", choices=DEPTHS, help="default: the scene's own")
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


def bsdf(material, folder, model):
    colour = reflectance(material, folder)
    if model == "direct":
        return {"type": "twosided", "nested": {"type": "diffuse", "reflectance": colour}}
    return {"type": "coated", "diffuse": colour, "alpha": material["roughness"],
            "specular": mi.ScalarColor3f(material["specular"])}


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


def point(position, intensity):
    return {"type": "point", "position": list(position), "intensity": {"type": "rgb", "value": list(intensity)}}


def emitters(light, folder, index, lit):
    """A light as shapes or emitters; where it is not lit an area light still blocks, black."""
    if light["kind"] == "point":
        return [point(light["position"], light["intensity"])] if lit else []
    if light["kind"] == "linear":
        ends = np.array(light["from"]), np.array(light["to"])
        each = np.array(light["intensity"]) * np.linalg.norm(ends[1] - ends[0]) / LINEAR_POINTS
        shares = (np.arange(LINEAR_POINTS) + 0.5) / LINEAR_POINTS
        return [point(ends[0] + (ends[1] - ends[0]) * s, each) for s in shares] if lit else []
    path = folder / f"light-{index}.ply"
    polygon(light).write_ply(str(path))
    shape = {"type": "ply", "filename": str(path), "face_normals": True,
             "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}}
    if lit:
        shape["emitter"] = {"type": "area", "radiance": {"type": "rgb", "value": light["radiance"]}}
    return [shape]


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
        world[f"material-{i}"] = {**bsdf(material, folder, options.model), "id": f"material-{i}"}
    for i, shape in enumerate(scene["shapes"]):
        world[f"shape-{i}"] = {"type": "ply", "filename": str(folder / shape["file"]), "flip_tex_coords": True,
                               "bsdf": {"type": "ref", "id": f"material-{shape['material']}"}}
    for i, light in enumerate(scene["lights"]):
        for k, made in enumerate(emitters(light, folder, i, i in lit)):
            world[f"light-{i}-{k}"] = made
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


def main():
    options = arguments()
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scene = exported(options.scene, options.export, folder)
        options.model = options.model or scene["model"].lower()
        lights = range(len(scene["lights"]))
        shiny = options.model != "direct" and any(any(m["specular"]) for m in scene["materials"])
        direct = mi.load_dict({"type": "direct", "emitter_samples": 1, "bsdf_samples": int(shiny)})
        total = 0.0
        for i in lights:
            world = build(scene, folder, options, {i})
            total = total + render(world, direct, options.spp, options.seed + 7919 * i)
        reflected = mi.load_dict({
            "type": "reflected",
            "depth": DEPTHS[options.model],
            "specular_only": options.model == "glossy",
            "ambient": mi.ScalarColor3f(scene["ambient"]),
            "background": mi.ScalarColor3f(scene["background"]),
        })
        world = build(scene, folder, options, set(lights))
        total = total + render(world, reflected, options.reflected_spp or options.spp, options.seed + 1)
    mi.Bitmap(total.astype(np.float16 if options.out.suffix == ".exr" else np.float32)).write(str(options.out))
    print(f"{options.out}: mean {total.mean():.5f}")


if __name__ == "__main__":
    main()
