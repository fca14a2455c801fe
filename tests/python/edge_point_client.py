#!/usr/bin/env python3
"""A display without a picture: proves that PROTOCOL.md is enough to talk to a shader server.

    edge_point_client.py HOST:PORT     sends a triangle under a point light, checks a few samples and prints them
    edge_point_client.py --self-test   packs and unpacks the examples of PROTOCOL.md

Needs nothing but the standard library. Exit code 0 if all went as the document says, 1 otherwise.
"""

import math
import pathlib
import re
import socket
import sys

import wire
from blake3_hash import blake3
from wire import Surprise

DOCUMENT = pathlib.Path(__file__).resolve().parents[2] / "protocol" / "PROTOCOL.md"
IDENTITY = (1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0)
TIMEOUT_S = 20

EYE, TARGET, UP, FOV_Y, WIDTH, HEIGHT = (0, 1, 4), (0, 0, 0), (0, 1, 0), 45, 64, 48
LIGHT_AT, INTENSITY, DIFFUSE, BACKGROUND = (0, 2, 0), 8, 0.5, 0.25
CORNERS = ((-1, 0, 1), (1, 0, 1), (0, 0, -1))


def example_scene():
    return wire.scene(
        ambient=(0, 0, 0),
        background=(BACKGROUND,) * 3,
        lights=[wire.point_light(LIGHT_AT, (INTENSITY,) * 3)],
        materials=[wire.material("grey", (DIFFUSE,) * 3)],
        meshes=[wire.mesh(CORNERS, [(0, 1, 2)])],
        objects=[wire.placed("floor", 0, 0, IDENTITY, 85)],
    )


def example_camera():
    return wire.camera(EYE, TARGET, UP, FOV_Y, WIDTH, HEIGHT)


# Vectors, as far as a check of the answers needs them.

def sub(a, b):
    return tuple(x - y for x, y in zip(a, b))


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    length = math.sqrt(dot(a, a))
    return tuple(x / length for x in a)


def ray(x, y):
    """Unit direction of the ray through an image point."""
    f = unit(sub(TARGET, EYE))
    r = unit(cross(f, UP))
    u = cross(r, f)
    t = math.tan(math.radians(FOV_Y) / 2)
    right = (2 * x / WIDTH - 1) * t * WIDTH / HEIGHT
    up = (1 - 2 * y / HEIGHT) * t
    return unit(tuple(f[i] + r[i] * right + u[i] * up for i in range(3)))


def expected(x, y, light):
    """(position or direction, radiance, flags, object) of the sample at an image point, the floor being at y = 0."""
    direction = ray(x, y)
    if direction[1] < 0:
        distance = -EYE[1] / direction[1]
        hit = tuple(EYE[i] + direction[i] * distance for i in range(3))
        # The triangle's sides: z <= 1, and |x| at most half of what is left towards the tip.
        if hit[2] <= 1 and abs(hit[0]) <= (hit[2] + 1) / 2:
            to_light = sub(light, hit)
            squared = dot(to_light, to_light)
            cosine = to_light[1] / math.sqrt(squared)
            return hit, DIFFUSE / math.pi * INTENSITY * cosine / squared, 0, 0
    return direction, BACKGROUND, wire.MISS, wire.NO_OBJECT


class Connection:
    def __init__(self, host, port):
        self.socket = socket.create_connection((host, port), timeout=TIMEOUT_S)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, payload):
        self.socket.sendall(wire.frame(payload))

    def _exactly(self, count, may_end):
        data = b""
        while len(data) < count:
            more = self.socket.recv(count - len(data))
            if not more:
                if may_end and not data:
                    return None
                raise Surprise("the connection ended inside a frame")
            data += more
        return data

    def receive(self):
        """The next message, or None at the end of the connection."""
        header = self._exactly(4, may_end=True)
        if header is None:
            return None
        length = int.from_bytes(header, "little")
        if length > wire.MAX_FRAME:
            raise Surprise(f"a frame of {length} bytes")
        name, fields = wire.unpack_to_display(self._exactly(length, may_end=False))
        if name == "Fault":
            raise Surprise(f"the server reports {fields['code']}: {fields['text']}")
        return name, fields

    def expect(self, wanted, passing=("Status", "Triples")):
        """The fields of the next message of this kind; only those named in `passing` may come before it."""
        while True:
            message = self.receive()
            if message is None:
                raise Surprise(f"the connection ended before {wanted}")
            name, fields = message
            if name == wanted:
                return fields
            if name not in passing:
                raise Surprise(f"{name} came where {wanted} was expected")


def close(a, b, tolerance):
    return math.isfinite(a) and abs(a - b) <= tolerance * max(1.0, abs(b))


def check_sample(sample, view, asked, light):
    x, y = asked[sample["id"]]
    position, radiance, flags, hit = expected(x, y, light)
    print(f"  view {view} id {sample['id']:3} at ({x:5.2f}, {y:5.2f}): object {sample['object']:10} "
          f"radiance {sample['radiance'][0]:.5f} expected {radiance:.5f}")
    if sample["object"] != hit or sample["flags"] & (wire.MISS | wire.LIGHT) != flags:
        raise Surprise(f"sample {sample['id']} hit object {sample['object']}, flags {sample['flags']}")
    if not all(close(a, b, 1e-4) for a, b in zip(sample["position"], position)):
        raise Surprise(f"sample {sample['id']} is at {sample['position']}, not {position}")
    if not all(close(c, radiance, 1e-3) for c in sample["radiance"]):
        raise Surprise(f"sample {sample['id']} has radiance {sample['radiance']}")


def ask(connection, welcome, view, epoch, first_id, light):
    """Asks for samples inside and outside the triangle, never more than the server's credit."""
    points = [(32.5, 24.5), (32.0, 26.25), (28.75, 27.5), (36.25, 28.0), (1.5, 1.5), (60.0, 40.0)]
    asked = {first_id + i: point for i, point in enumerate(points)}
    waiting = list(asked)
    outstanding = set()
    while waiting or outstanding:
        room = min(welcome["credits"] - len(outstanding), welcome["max_batch"], len(waiting))
        if room > 0:
            batch, waiting = waiting[:room], waiting[room:]
            packed = []
            for number in batch:
                x, y = asked[number]
                packed.append(wire.sample_request(number, int(x), int(y), (x % 1, y % 1)))
            connection.send(wire.request(view, packed))
            outstanding.update(batch)
        fields = connection.expect("Samples")
        if fields["view"] != view or fields["epoch"] != epoch or not fields["samples"]:
            raise Surprise(f"samples of view {fields['view']}, epoch {fields['epoch']}")
        for sample in fields["samples"]:
            if sample["id"] not in outstanding:
                raise Surprise(f"sample {sample['id']} is not outstanding")
            outstanding.remove(sample["id"])
            check_sample(sample, view, asked, light)
    return first_id + len(points)


def handshake(connection):
    connection.send(wire.hello(1, 1, "edge_point_client.py", 7))
    welcome = connection.expect("Welcome", passing=())
    if welcome["version"] != 1 or welcome["credits"] < 1 or welcome["max_batch"] < 1:
        raise Surprise(f"a bad offer: {welcome}")
    print(f"{welcome['name']}, shader {welcome['shader']}, {welcome['credits']} credits")
    data = example_scene()
    digest = blake3(data)
    connection.send(wire.scene_begin(digest, len(data)))
    if digest not in welcome["holds"]:
        # In two chunks, since a server has to join them.
        connection.send(wire.scene_chunk(data[:100]))
        connection.send(wire.scene_chunk(data[100:]))
    if connection.expect("SceneReady", passing=("Status",))["digest"] != digest:
        raise Surprise("another scene is ready")
    return welcome


def session(address):
    host, _, port = address.rpartition(":")
    connection = Connection(host.strip("[]"), int(port))
    welcome = handshake(connection)
    connection.send(wire.ping(99))
    if connection.expect("Pong")["token"] != 99:
        raise Surprise("the pong has another token")
    connection.send(wire.view(1, example_camera()))
    next_id = ask(connection, welcome, 1, 0, 1, LIGHT_AT)

    connection.send(wire.view(2, example_camera()))
    connection.send(wire.cancel(2))
    if connection.expect("Status", passing=("Triples",))["cancelled_before"] != 2:
        raise Surprise("the cancel is not confirmed")
    epoch, light = 0, LIGHT_AT
    if welcome["edits"]:
        epoch, light = 1, (0.5, 3, 0)
        moved = wire.point_light(light, (INTENSITY,) * 3)
        connection.send(wire.edit(epoch, lights=[(0, moved)]))
    ask(connection, welcome, 2, epoch, next_id, light)

    connection.send(wire.goodbye())
    while True:
        message = connection.receive()
        if message is None:
            break
        if message[0] not in ("Status", "Triples"):
            raise Surprise(f"{message[0]} after Goodbye")
    print("all as documented")


def examples(document):
    """The bytes of every example in the document, by name."""
    pattern = re.compile(r"<!-- example: (\S+) -->\n```text\n(.*?)```", re.S)
    pairs = re.compile(r"((?:[0-9a-f]{2} ?)+)(?:  .*)?")
    found = {}
    for name, body in pattern.findall(document):
        data = b""
        for line in body.splitlines():
            data += bytes.fromhex(pairs.fullmatch(line).group(1))
        found[name] = data
    return found


def self_test():
    shown = examples(DOCUMENT.read_text(encoding="utf-8"))
    scene = example_scene()
    digest = blake3(scene)
    light = wire.point_light((1, 2, 0), (8, 8, 8))
    shifted = (1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0)
    packed = {
        "hello": wire.hello(1, 1, "example", 7),
        "scene-begin": wire.scene_begin(digest, len(scene)),
        "scene-chunk": wire.scene_chunk(scene[:5]),
        "view": wire.view(1, example_camera()),
        "request": wire.request(1, [wire.sample_request(258, 32, 24, (0.5, 0.25))]),
        "edit": wire.edit(1, objects=[(0, shifted)], lights=[(0, light)]),
        "cancel": wire.cancel(2),
        "ping": wire.ping(9),
        "goodbye": wire.goodbye(),
        "fault-to-server": wire.fault(4, "NaN"),
        "shadows-to-server": wire.shadows(True, 0.0625, [0, 2]),
    }
    wrong = [name for name, payload in packed.items() if shown.get(name) != wire.frame(payload)]
    if shown.get("scene") != scene:
        wrong.append("scene")
    unpacked = {
        "welcome": ("Welcome", {
            "version": 1, "name": "example", "shader": "direct", "credits": 4096,
            "max_batch": 512, "triples": True, "edits": True, "threads": 2, "holds": [digest]}),
        "scene-ready": ("SceneReady", {"digest": digest}),
        "samples": ("Samples", {"view": 1, "epoch": 0, "samples": [{
            "id": 258, "position": (0.125, 0.0, 0.5), "object": 0,
            "radiance": (0.25,) * 3, "flags": 0}]}),
        "textured": ("Textured", {"view": 1, "epoch": 0, "samples": [{
            "id": 258, "position": (0.125, 0.0, 0.5), "object": 0,
            "radiance": (0.25,) * 3, "flags": 0, "face": 0,
            "reflectance": (0.5, 0.25, 0.125), "reflected": (0.5, 1.0, 2.0)}]}),
        "triples": ("Triples", {"epoch": 0, "triples": [(0, 0, 0)]}),
        "status": ("Status", {"queued": 3, "traced": 100, "rays": 250, "cancelled_before": 2}),
        "pong": ("Pong", {"token": 9}),
        "shadows-to-display": ("Shadows", {"lights": [(0, 1, "a point")]}),
        "fault-to-display": ("Fault", {"code": "Limit", "text": "too many"}),
    }
    for name, message in unpacked.items():
        data = shown.get(name, b"")
        if len(data) != 4 + int.from_bytes(data[:4], "little"):
            wrong.append(name)
        elif wire.unpack_to_display(data[4:]) != message:
            wrong.append(name)
    unknown = set(shown) - set(packed) - set(unpacked) - {"scene"}
    if wrong or unknown:
        raise Surprise(f"examples that differ: {wrong}; examples not known here: {sorted(unknown)}")
    print(f"{len(shown)} examples agree")


def main(arguments):
    if len(arguments) != 1 or arguments[0] in ("-h", "--help"):
        print(__doc__)
        return 0 if arguments else 1
    try:
        if arguments[0] == "--self-test":
            self_test()
        else:
            session(arguments[0])
    except (Surprise, OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
