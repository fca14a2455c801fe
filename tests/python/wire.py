"""Packing and unpacking of edge-and-point messages, from PROTOCOL.md alone."""

import struct

MAX_FRAME = 2 * 1024 * 1024
# Bytes of a packed sample.
SAMPLE = 40
MISS, VIEW_DEPENDENT, PROVISIONAL, LIGHT = 1, 2, 4, 8
NO_OBJECT = 0xFFFFFFFF
FAULTS = ("Version", "Malformed", "OutOfOrder", "Limit", "Value", "Unsupported", "Internal")


class Surprise(Exception):
    """The other side did something that PROTOCOL.md does not allow."""


def u16(n):
    return struct.pack("<H", n)


def u32(n):
    return struct.pack("<I", n)


def u64(n):
    return struct.pack("<Q", n)


def floats(*values):
    return struct.pack(f"<{len(values)}f", *values)


def text(value):
    raw = value.encode("utf-8")
    return u64(len(raw)) + raw


def listing(items):
    return u64(len(items)) + b"".join(items)


def frame(payload):
    if len(payload) > MAX_FRAME:
        raise ValueError(f"{len(payload)} bytes do not fit a frame")
    return u32(len(payload)) + payload


def hello(min_version, max_version, name, seed):
    return u32(0) + u16(min_version) + u16(max_version) + text(name) + u64(seed)


def scene_begin(digest, length):
    return u32(1) + digest + u64(length)


def scene_chunk(data):
    return u32(2) + u64(len(data)) + data


def camera(eye, target, up, fov_y, width, height):
    return floats(*eye, *target, *up, fov_y) + u32(width) + u32(height)


def view(number, packed_camera):
    return u32(3) + u32(number) + packed_camera


def sample_request(number, x, y, offset):
    return u64(number) + u16(x) + u16(y) + floats(*offset)


def request(view_number, packed_requests):
    return u32(4) + u32(view_number) + listing(packed_requests)


def edit(epoch, objects=(), lights=()):
    """Objects are (index, 12 floats), lights (index, packed light)."""
    moved = [u32(index) + floats(*transform) for index, transform in objects]
    changed = [u32(index) + light for index, light in lights]
    return u32(5) + u32(epoch) + listing(moved) + listing(changed)


def cancel(views_before):
    return u32(6) + u32(views_before)


def ping(token):
    return u32(7) + u64(token)


def goodbye():
    return u32(8)


def fault(code, message):
    return u32(9) + u32(code) + text(message)


def shadows(steady, error, methods):
    return u32(10) + struct.pack("<?", steady) + floats(error) + listing([u32(method) for method in methods])


def point_light(position, intensity):
    return u32(0) + floats(*position, *intensity)


def material(name, diffuse):
    """Diffuse only: no map, no specular, roughness 1."""
    return text(name) + floats(*diffuse) + b"\0" + floats(0, 0, 0) + floats(1)


def mesh(positions, faces):
    packed = [floats(*p) for p in positions]
    corners = [struct.pack("<3I", *f) for f in faces]
    return listing(packed) + listing(corners) + u64(0) * 5


def placed(name, mesh_index, material_index, transform, crease_angle):
    return text(name) + u32(mesh_index) + u32(material_index) + floats(*transform, crease_angle)


def scene(ambient, background, lights, materials, meshes, objects):
    """Direct shading, no textures."""
    return (u32(0) + floats(*ambient, *background) + listing(lights) + listing(materials)
            + u64(0) + listing(meshes) + listing(objects))


class Reader:
    """Takes values off the front of a payload."""

    def __init__(self, payload):
        self.payload, self.at = payload, 0

    def left(self):
        return len(self.payload) - self.at

    def take(self, count):
        if count > self.left():
            raise Surprise(f"a message ends {count - self.left()} bytes early")
        self.at += count
        return self.payload[self.at - count:self.at]

    def unpack(self, form):
        values = struct.unpack("<" + form, self.take(struct.calcsize("<" + form)))
        return values[0] if len(values) == 1 else values

    def text(self):
        try:
            return self.take(self.unpack("Q")).decode("utf-8")
        except UnicodeDecodeError as error:
            raise Surprise(f"a text is no UTF-8: {error}") from None

    def boolean(self):
        value = self.unpack("B")
        if value > 1:
            raise Surprise(f"{value} is no bool")
        return value == 1

    def variant(self, count):
        value = self.unpack("I")
        if value >= count:
            raise Surprise(f"variant {value} does not exist")
        return value

    def count(self, size):
        """Length of a list whose elements take `size` bytes each, at least."""
        count = self.unpack("Q")
        if count * size > self.left():
            raise Surprise(f"a list claims {count} elements")
        return count

    def rows(self, form):
        """A list of elements of this form: tuples, or numbers where it has but one."""
        size = struct.calcsize("<" + form)
        rows = struct.iter_unpack("<" + form, self.take(self.count(size) * size))
        return [row[0] for row in rows] if len(form) == 1 else list(rows)


def _welcome(r):
    return {
        "version": r.unpack("H"), "name": r.text(), "shader": r.text(),
        "credits": r.unpack("I"), "max_batch": r.unpack("I"), "triples": r.boolean(),
        "edits": r.boolean(), "threads": r.unpack("I"),
        "holds": [r.take(32) for _ in range(r.count(32))],
    }


def _sample(r):
    return {
        "id": r.unpack("Q"), "position": r.unpack("3f"), "object": r.unpack("I"),
        "radiance": r.unpack("3f"), "flags": r.unpack("I"),
    }


def _samples(r):
    return {
        "view": r.unpack("I"), "epoch": r.unpack("I"),
        "samples": [_sample(r) for _ in range(r.count(40))],
    }


def _textured(r):
    return {
        "view": r.unpack("I"), "epoch": r.unpack("I"),
        "samples": [
            {**_sample(r), "face": r.unpack("I"), "reflectance": r.unpack("3f"),
             "reflected": r.unpack("3f")}
            for _ in range(r.count(68))
        ],
    }


def _shadows(r):
    return {"lights": [(r.unpack("I"), r.unpack("I"), r.text()) for _ in range(r.count(16))]}


def _triples(r):
    return {"epoch": r.unpack("I"), "triples": [r.unpack("3I") for _ in range(r.count(12))]}


def _status(r):
    return {
        "queued": r.unpack("I"), "traced": r.unpack("Q"), "rays": r.unpack("Q"),
        "cancelled_before": r.unpack("I"),
    }


def _fault(r):
    return {"code": FAULTS[r.variant(len(FAULTS))], "text": r.text()}


TO_DISPLAY = (
    ("Welcome", _welcome),
    ("SceneReady", lambda r: {"digest": r.take(32)}),
    ("Samples", _samples),
    ("Triples", _triples),
    ("Status", _status),
    ("Pong", lambda r: {"token": r.unpack("Q")}),
    ("Fault", _fault),
    ("Textured", _textured),
    ("Shadows", _shadows),
)


def _whole(payload, messages):
    """(name, fields) of a message; every byte must belong to it."""
    reader = Reader(payload)
    variant = reader.unpack("I")
    if variant >= len(messages):
        raise Surprise(f"message {variant} does not exist")
    name, unpack = messages[variant]
    fields = unpack(reader)
    if reader.left():
        raise Surprise(f"{reader.left()} bytes after {name}")
    return name, fields


def unpack_to_display(payload):
    """(name, fields) of a message from a server; every byte must belong to it."""
    return _whole(payload, TO_DISPLAY)


# Display to server, unpacked.

def _camera(r):
    return {
        "view": r.unpack("I"), "eye": r.unpack("3f"), "target": r.unpack("3f"), "up": r.unpack("3f"),
        "fov_y": r.unpack("f"), "width": r.unpack("I"), "height": r.unpack("I"),
    }


def _request(r):
    return {"view": r.unpack("I"), "samples": [(number, x, y, (u, v)) for number, x, y, u, v in r.rows("QHHff")]}


def _light(r):
    """(variant, places, strength)."""
    variant = r.variant(3)
    points = r.rows("3f") if variant == 2 else [r.unpack("3f") for _ in range(variant + 1)]
    return variant, points, r.unpack("3f")


def _edit(r):
    return {
        "epoch": r.unpack("I"),
        "objects": [(r.unpack("I"), r.unpack("12f")) for _ in range(r.count(52))],
        "lights": [(r.unpack("I"), _light(r)) for _ in range(r.count(32))],
    }


def _wish(r):
    return {
        "steady": r.boolean(), "error": r.unpack("f"),
        "methods": [r.variant(4) for _ in range(r.count(4))],
    }


TO_SERVER = (
    ("Hello", lambda r: {"min_version": r.unpack("H"), "max_version": r.unpack("H"), "name": r.text(),
                         "seed": r.unpack("Q")}),
    ("SceneBegin", lambda r: {"digest": r.take(32), "bytes": r.unpack("Q")}),
    ("SceneChunk", lambda r: {"data": r.take(r.count(1))}),
    ("View", _camera),
    ("Request", _request),
    ("Edit", _edit),
    ("Cancel", lambda r: {"views_before": r.unpack("I")}),
    ("Ping", lambda r: {"token": r.unpack("Q")}),
    ("Goodbye", lambda r: {}),
    ("Fault", _fault),
    ("Shadows", _wish),
)


def unpack_to_server(payload):
    """(name, fields) of a message from a display; every byte must belong to it."""
    return _whole(payload, TO_SERVER)


def _material(r):
    r.text()
    diffuse = r.unpack("3f")
    texture = r.unpack("I") if r.boolean() else None
    return {"diffuse": diffuse, "map": texture, "specular": r.unpack("3f"), "roughness": r.unpack("f")}


def _texture(r):
    return {"width": r.unpack("I"), "height": r.unpack("I"), "rgb": r.take(3 * r.count(3))}


def _mesh(r):
    return {"positions": r.rows("3f"), "faces": r.rows("3I"), "normals": r.rows("3f"), "face_normals": r.rows("3I"),
            "uvs": r.rows("2f"), "face_uvs": r.rows("3I"), "face_materials": r.rows("I")}


def _object(r):
    return {"name": r.text(), "mesh": r.unpack("I"), "material": r.unpack("I"),
            "transform": r.unpack("12f"), "crease_angle": r.unpack("f")}


MODELS = ("direct", "glossy", "global")


def unpack_scene(data):
    """The tables of section 5."""
    r = Reader(data)
    tables = {"model": MODELS[r.variant(3)], "ambient": r.unpack("3f"), "background": r.unpack("3f")}
    for name, unpack, least in (("lights", _light, 28), ("materials", _material, 37), ("textures", _texture, 16),
                                ("meshes", _mesh, 56), ("objects", _object, 68)):
        tables[name] = [unpack(r) for _ in range(r.count(least))]
    if r.left():
        raise Surprise(f"{r.left()} bytes after the scene")
    return tables


# Server to display, packed.

def welcome(version, name, shader, credits, max_batch, holds):
    """Of a server with one thread that reports triples and takes edits."""
    return (u32(0) + u16(version) + text(name) + text(shader) + u32(credits) + u32(max_batch)
            + b"\1\1" + u32(1) + listing(holds))


def scene_ready(digest):
    return u32(1) + digest


def sample(number, position, thing, radiance, flags):
    return u64(number) + floats(*position) + u32(thing) + floats(*radiance) + u32(flags)


def samples(view_number, epoch, count, packed):
    """So many samples, packed one after another."""
    return u32(2) + u32(view_number) + u32(epoch) + u64(count) + packed


def triples(epoch, found):
    return u32(3) + u32(epoch) + listing([struct.pack("<3I", *triple) for triple in found])


def status(queued, traced, rays, cancelled_before):
    return u32(4) + u32(queued) + u64(traced) + u64(rays) + u32(cancelled_before)


def pong(token):
    return u32(5) + u64(token)


def fault_to_display(code, message):
    return u32(6) + u32(code) + text(message)
