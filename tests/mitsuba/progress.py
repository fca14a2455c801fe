#!/usr/bin/env python3
"""Mitsuba's own progressive picture of a scene: passes of one sample a pixel by its path tracer, averaged.

    python3 tests/mitsuba/progress.py SCENE FOLDER [--size 512x512] [--seconds 60] [--seed 0]

Writes pass-N.exr to FOLDER for numbers of passes N that grow by a quarter, and prints N and the seconds spent on rendering so far, writing
left out. For the time that a display takes with `mitsuba_shader.py` behind it to be held against.
"""

import argparse
import pathlib
import tempfile
import time

import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
import reference  # noqa: E402, after the variant is set


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("scene")
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--size", default="512x512")
    parser.add_argument("--seconds", type=float, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--export", type=pathlib.Path, default=reference.EXPORT)
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        scene = reference.exported(options.scene, options.export, folder)
        options.model = scene["model"].lower()
        world = reference.build(scene, folder, options, set(range(len(scene["lights"]))))
    integrator = mi.load_dict({"type": "path", "max_depth": reference.DEPTHS[options.model], "rr_depth": 100})
    total, spent, passes, written = 0.0, 0.0, 0, 0
    while spent < options.seconds:
        start = time.monotonic()
        total = total + np.array(mi.render(world, integrator=integrator, spp=1, seed=options.seed * 1_000_003 + passes))
        passes += 1
        spent += time.monotonic() - start
        if passes >= written * 1.25:
            written = passes
            mi.Bitmap((total / passes).astype(np.float32)).write(str(options.folder / f"pass-{passes:05}.exr"))
            print(passes, f"{spent:.3f}", flush=True)


if __name__ == "__main__":
    main()
