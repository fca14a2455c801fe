"""Checks of values that PROTOCOL.md allows, message by message and table by table. What is wrong is raised as `Broken`."""

import math

import wire

MAX_NAME, MAX_TEXT, MAX_MOVES, MAX_SIDE, MAX_BATCH, MAX_CHUNK = 1024, 4096, 16384, 16384, 32768, 1 << 20
MAX_LIGHTS, MAX_LIGHT_VERTICES, MAX_MATERIALS, MAX_TEXTURES, MAX_OBJECTS = 1 << 16, 256, 1 << 16, 4096, 1 << 20
FAR, BRIGHT, INTENSE = 1e9, 1e9, 1e10
# How far the vertices of an area light may be off its plane and dent it, as a share of its extent.
SLACK = 1e-4
# Least sine between a camera's sight and up, least distance to its target, and fields of view.
UPRIGHT, SIGHT, FOV = 1e-4, 1e-6, (1e-3, 179.9)


class Broken(Exception):
    """The display broke a rule; the code is one of section 6."""

    def __init__(self, code, text):
        super().__init__(text)
        self.code = wire.FAULTS.index(code)


def within(values, least, most, what):
    """Not-a-number is nowhere."""
    for value in values:
        if not least <= value <= most:
            raise Broken("Value", f"{what}: {value} is not from {least} to {most}")


def places(points, what):
    for point in points:
        within(point, -FAR, FAR, what)


def counted(count, least, most, what):
    if not least <= count <= most:
        raise Broken("Limit", f"{what}: {count} elements, {least} to {most} are allowed")


def in_table(index, table, what):
    if index >= len(table):
        raise Broken("Value", f"{what}: index {index} is past its table")


def sub(a, b):
    return [x - y for x, y in zip(a, b)]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def length(a):
    return math.sqrt(dot(a, a))


def check_message(name, fields):
    if name == "Hello":
        counted(len(fields["name"].encode()), 0, MAX_NAME, "the display's name")
        if not 1 <= fields["min_version"] <= fields["max_version"]:
            raise Broken("Value", "the range of versions is empty or starts at 0")
    elif name == "Fault":
        counted(len(fields["text"].encode()), 0, MAX_TEXT, "the fault's text")
    elif name == "Shadows":
        within([fields["error"]], 0, 1, "error")
        counted(len(fields["methods"]), 0, MAX_LIGHTS, "methods")
    elif name == "SceneChunk":
        counted(len(fields["data"]), 1, MAX_CHUNK, "data")
    elif name == "View":
        check_camera(fields)
    elif name == "Request":
        counted(len(fields["samples"]), 1, MAX_BATCH, "samples")
        for number, _, _, offset in fields["samples"]:
            if not (0 <= offset[0] < 1 and 0 <= offset[1] < 1):
                raise Broken("Value", f"request {number} has offset {offset}")
    elif name == "Edit":
        counted(len(fields["objects"]), 0, MAX_MOVES, "objects")
        counted(len(fields["lights"]), 0, MAX_MOVES, "lights")
        for _, transform in fields["objects"]:
            check_transform(transform)
        for _, light in fields["lights"]:
            check_light(light)


def check_camera(camera):
    places([camera["eye"], camera["target"], camera["up"]], "camera")
    within([camera["fov_y"]], *FOV, "fov_y")
    within([camera["width"], camera["height"]], 1, MAX_SIDE, "the image's size")
    sight = sub(camera["target"], camera["eye"])
    if length(sight) < SIGHT:
        raise Broken("Value", "the target is the eye itself")
    if not length(cross(sight, camera["up"])) >= UPRIGHT * length(sight) * length(camera["up"]) > 0:
        raise Broken("Value", "up is zero or along the line of sight")


def check_transform(m):
    within(m, -FAR, FAR, "transform")
    columns = [m[c:12:4] for c in range(3)]
    lengths = [length(column) for column in columns]
    within(lengths, 1e-9, 1e9, "scale of a transform")
    if abs(dot(cross(columns[0], columns[1]), columns[2])) < 1e-6 * math.prod(lengths):
        raise Broken("Value", "a transform cannot be inverted")


def check_light(light):
    kind, points, strength = light
    within(strength, 0, BRIGHT if kind == 2 else INTENSE, "a light's strength")
    places(points, "a light")
    if kind == 1 and points[0] == points[1]:
        raise Broken("Value", "a linear light has no length")
    if kind == 2:
        check_polygon(points)


def check_polygon(points):
    """Planar, convex, once round."""
    counted(len(points), 3, MAX_LIGHT_VERTICES, "vertices of an area light")
    points = [sub(p, points[0]) for p in points]
    nexts = points[1:] + points[:1]
    extent = max(length(p) for p in points)
    normal = [sum(c) for c in zip(*(cross(a, b) for a, b in zip(points, nexts)))]
    if not length(normal) > SLACK * SLACK * extent * extent > 0:
        raise Broken("Value", "an area light has no area")
    normal = [c / length(normal) for c in normal]
    turned = 0.0
    for a, b, c in zip(points, nexts, nexts[1:] + nexts[:1]):
        along, after = sub(b, a), sub(c, b)
        turn = dot(cross(along, after), normal)
        if abs(dot(a, normal)) > SLACK * extent or turn < -SLACK * extent * length(sub(c, a)) or not any(along):
            raise Broken("Value", "an area light is no planar convex polygon")
        turned += math.atan2(turn, dot(along, after))
    if abs(turned - math.tau) > 0.1:
        raise Broken("Value", "an area light goes round more than once")


def check_scene(tables):
    """All tables of section 5."""
    within(tables["ambient"] + tables["background"], 0, BRIGHT, "shading")
    for name, most in (("lights", MAX_LIGHTS), ("materials", MAX_MATERIALS), ("textures", MAX_TEXTURES),
                       ("meshes", MAX_OBJECTS), ("objects", MAX_OBJECTS)):
        counted(len(tables[name]), 0, most, name)
    for light in tables["lights"]:
        check_light(light)
    for material in tables["materials"]:
        within(material["diffuse"] + material["specular"], 0, 1, "reflectance of a material")
        if not 0 < material["roughness"] <= 1:
            raise Broken("Value", f"roughness {material['roughness']}")
        if material["map"] is not None:
            in_table(material["map"], tables["textures"], "diffuse_map")
    for texture in tables["textures"]:
        within([texture["width"], texture["height"]], 1, MAX_SIDE, "a texture's size")
        pixels = texture["width"] * texture["height"]
        counted(len(texture["rgb"]), 3 * pixels, 3 * pixels, "a texture's bytes")
    for mesh in tables["meshes"]:
        check_mesh(mesh, tables["materials"])
    names = set()
    for thing in tables["objects"]:
        in_table(thing["mesh"], tables["meshes"], "mesh of an object")
        in_table(thing["material"], tables["materials"], "material of an object")
        within([thing["crease_angle"]], 0, 180, "crease_angle")
        check_transform(thing["transform"])
        counted(len(thing["name"].encode()), 0, MAX_NAME, "an object's name")
        if thing["name"] in names:
            raise Broken("Value", f"two objects are named {thing['name']}")
        names.add(thing["name"])


def check_mesh(mesh, materials):
    places(mesh["positions"], "positions")
    places(mesh["uvs"], "uvs")
    for normal in mesh["normals"]:
        within([length(normal)], 0.99, 1.01, "length of a normal")
    count = len(mesh["faces"])
    for faces, table in (("faces", "positions"), ("face_normals", "normals"), ("face_uvs", "uvs")):
        if mesh[faces]:
            counted(len(mesh[faces]), count, count, faces)
            in_table(max(map(max, mesh[faces])), mesh[table], faces)
    if mesh["face_materials"]:
        counted(len(mesh["face_materials"]), count, count, "face_materials")
        in_table(max(mesh["face_materials"]), materials, "face_materials")
