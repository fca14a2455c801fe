#!/usr/bin/env python3
"""A shader server around Mitsuba 3: any scene of the display previews with a path tracer behind it.

    mitsuba_shader.py [options]

%s
    --spp N               paths averaged in a sample (default 4: what a request costs besides then weighs little)
    --depth N             most segments of a path from eye to light (default by the scene's model: direct 2, glossy 3, global 6)
    --portion N           samples traced together at most (default 16384)
    --threads N           threads that trace rays (default: one a processor)

Needs `pip install mitsuba==3.9.1 numpy` (and blake3, if it is to be quick with large scenes) and LLVM 17 or newer, such as
libllvm19; DRJIT_LIBLLVM_PATH says where that is if it is not found.
"""

import glob
import os
import pathlib
import sys

sys.dont_write_bytecode = True
HERE = pathlib.Path(__file__).resolve().parent
# Instead of this folder, whose own `mitsuba` is not the package.
sys.path[:1] = [str(HERE / "python"), str(HERE / "mitsuba")]

import serving  # noqa: E402 (modules of this folder, once they can be found)

INSTALL = "pip install mitsuba==3.9.1 numpy; apt-get install libllvm19"
# Where distributions put it, newest first.
LLVM = ("/usr/lib/llvm-*/lib/libLLVM*.so*", "/usr/lib/*/libLLVM*.so*", "/usr/lib/libLLVM*.so*", "/usr/lib64/libLLVM*.so*")
LEAST_LLVM = 17


def version_of(path):
    """LLVM's version, by its name; 0 if that does not say."""
    digits = "".join(c if c.isdigit() else " " for c in os.path.basename(path)).split()
    return int(digits[0]) if digits else 0


def find_llvm():
    if "DRJIT_LIBLLVM_PATH" in os.environ:
        return
    found = [path for pattern in LLVM for path in glob.glob(pattern) if version_of(path) >= LEAST_LLVM]
    if found:
        os.environ["DRJIT_LIBLLVM_PATH"] = max(found, key=version_of)


def load():
    """Module `paths`, with Mitsuba behind it."""
    find_llvm()
    try:
        import mitsuba
        mitsuba.set_variant("llvm_ad_rgb")
        # Fails here, and not at the first sample, if there is no LLVM.
        mitsuba.Float([0.0, 1.0]) + 1
        import paths
    except Exception as error:
        raise SystemExit(f"mitsuba_shader.py: Mitsuba 3 cannot be used ({' '.join(str(error).split())}): {INSTALL}") from None
    return paths


def digest():
    try:
        from blake3 import blake3
        return lambda data: blake3(data).digest()
    except ImportError:
        from blake3_hash import blake3
        return blake3


class Shader:
    """What a session works with."""

    name = "mitsuba_shader.py"
    credits, max_batch = 1 << 16, 1 << 15

    def __init__(self, paths, options):
        self.paths, self.portion = paths, options.get("portion") or 16384
        self.spp, self.depth = options.get("spp") or 4, options.get("depth")
        self.says = f"Mitsuba 3 path tracing, {self.spp} paths a sample"

    def build(self, tables):
        return self.paths.build(tables, self.spp, self.depth)


def whole(least, most):
    def parse(text):
        if not text.isdecimal() or not least <= int(text) <= most:
            raise ValueError(f"{text} is no whole number from {least} to {most}")
        return int(text)
    return parse


def main(arguments):
    if arguments[:1] in (["-h"], ["--help"]):
        print(__doc__ % serving.OPTIONS)
        return 0
    numbers = {"spp": whole(1, 4096), "depth": whole(2, 64), "portion": whole(1, 1 << 15), "threads": whole(1, 1024)}
    try:
        options = serving.parse(arguments, numbers)
    except serving.Usage as error:
        print(f"mitsuba_shader.py: {error}", file=sys.stderr)
        return 2
    try:
        paths = load()
    except SystemExit as error:
        print(error, file=sys.stderr)
        return 2
    if options["threads"]:
        import drjit
        drjit.set_thread_count(options["threads"])
    return serving.main("mitsuba_shader.py", options, Shader(paths, options), digest())


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
