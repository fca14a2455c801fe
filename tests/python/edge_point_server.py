#!/usr/bin/env python3
"""A shader server written from PROTOCOL.md alone: direct light and diffuse reflection, slowly.

    edge_point_server.py [options]

%s

The first line on standard output is `listening on HOST:PORT`. A display starts it with `--shader` and this file's name.
Needs nothing but the standard library. Gloss and indirect light are left out.
"""

import sys

sys.dont_write_bytecode = True

import serving  # noqa: E402 (modules must not be compiled into the checkout)
import tracer  # noqa: E402
from blake3_hash import blake3  # noqa: E402


class Shader:
    """What a session works with."""

    name, says = "edge_point_server.py", "direct"
    credits, max_batch = 4096, 1024
    # Few, so that they come soon.
    portion = 16
    build = staticmethod(tracer.Scene)


def main(arguments):
    if arguments[:1] in (["-h"], ["--help"]):
        print(__doc__ % serving.OPTIONS)
        return 0
    try:
        options = serving.parse(arguments, {})
    except serving.Usage as error:
        print(f"edge_point_server.py: {error}", file=sys.stderr)
        return 2
    return serving.main("edge_point_server.py", options, Shader(), blake3)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
