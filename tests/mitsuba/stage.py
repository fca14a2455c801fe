"""A scene as the protocol sends it, in Mitsuba: shapes, materials, and lights as tables.

Everything that a ray can meet is a Mitsuba mesh with one material. Lights are sampled here, from pieces (points, segments, parallelograms
and triangles), so that all of a scene's lights are one table, whatever they are; area lights are black meshes besides.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

import transport

POINT, SEGMENT, PARALLELOGRAM, TRIANGLE = range(4)


def matrix(transform):
    m = np.array(transform, dtype=np.float64).reshape(3, 4)
    return m[:, :3], m[:, 3]


def texture(table):
    """Linear texels, row 0 on top."""
    encoded = np.frombuffer(table["rgb"], dtype=np.uint8).reshape(table["height"], table["width"], 3) / 255.0
    return np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)


def material(table, textures, glossy):
    colour = {"type": "rgb", "value": list(table["diffuse"])}
    if table["map"] is not None:
        texels = textures[table["map"]] * np.array(table["diffuse"])
        colour = {"type": "bitmap", "bitmap": mi.Bitmap(texels.astype(np.float32)), "raw": True}
    if not glossy:
        return mi.load_dict({"type": "twosided", "nested": {"type": "diffuse", "reflectance": colour}})
    return mi.load_dict({"type": "coated", "diffuse": colour, "alpha": table["roughness"],
                         "specular": mi.ScalarColor3f(list(table["specular"]))})


def shape(name, bsdf, positions, faces, normals=None, uvs=None):
    """A Mitsuba mesh. Normals and texture coordinates are by vertex."""
    properties = mi.Properties()
    properties["mesh_bsdf"] = bsdf
    mesh = mi.Mesh(name, len(positions), len(faces), properties, normals is not None, uvs is not None)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.ascontiguousarray(positions, dtype=np.float32).ravel()
    parameters["faces"] = np.ascontiguousarray(faces, dtype=np.uint32).ravel()
    if normals is not None:
        parameters["vertex_normals"] = np.ascontiguousarray(normals, dtype=np.float32).ravel()
    if uvs is not None:
        # Mitsuba looks textures up from the top.
        flipped = np.asarray(uvs, dtype=np.float32) * [1, -1] + [0, 1]
        parameters["vertex_texcoords"] = flipped.astype(np.float32).ravel()
    parameters.update()
    return mesh


class Parts:
    """A mesh of the protocol cut up by material, its tables of corners made one."""

    def __init__(self, mesh):
        arrays = {name: np.array(mesh[name]) for name in mesh}
        positions, faces = arrays["positions"], arrays["faces"]
        self.positions, self.faces = positions, faces
        self.normals = arrays["normals"] if mesh["face_normals"] else None
        self.uvs = arrays["uvs"] if mesh["face_uvs"] else None
        self.face_normals, self.face_uvs = arrays["face_normals"], arrays["face_uvs"]
        self.face_materials = arrays["face_materials"] if mesh["face_materials"] else None

    def materials(self, default):
        """(material, mask of faces) pairs."""
        if self.face_materials is None:
            return [(default, slice(None))] if len(self.faces) else []
        return [(int(m), self.face_materials == m) for m in np.unique(self.face_materials)]

    def placed(self, name, bsdf, which, transform):
        linear, offset = matrix(transform)
        corners = [self.faces[which].reshape(-1)]
        if self.normals is not None:
            corners.append(self.face_normals[which].reshape(-1))
        if self.uvs is not None:
            corners.append(self.face_uvs[which].reshape(-1))
        vertices, faces = np.unique(np.stack(corners), axis=1, return_inverse=True)
        positions = self.positions[vertices[0]] @ linear.T + offset
        normals = uvs = None
        if self.normals is not None:
            # By the inverse transpose.
            normals = self.normals[vertices[1]] @ np.linalg.inv(linear)
            normals /= np.linalg.norm(normals, axis=1, keepdims=True)
        if self.uvs is not None:
            uvs = self.uvs[vertices[-1]]
        return shape(name, bsdf, positions, faces.reshape(-1, 3), normals, uvs)


class Lights:
    """Pieces of all lights, as tables on Dr.Jit's side."""

    def __init__(self, lights):
        rows, first = [], []
        for index, (kind, points, strength) in enumerate(lights):
            points = [np.array(p, dtype=np.float64) for p in points]
            first.append(len(rows))
            rows += [(index, *piece, *strength) for piece in self.pieces(kind, points)]
        self.count = len(rows)
        # Even without a light there is a row, so that there is something to gather from.
        rows = rows or [(0, POINT, *np.zeros((3, 3)), 0.0, 0.0, 0.0, 0.0)]
        table = np.array([np.concatenate([np.atleast_1d(v).astype(np.float64) for v in row]) for row in rows])
        integers, floats = table[:, :2].astype(np.uint32), table[:, 2:].astype(np.float32)
        self.light, self.kind = mi.UInt32(integers[:, 0].copy()), mi.UInt32(integers[:, 1].copy())
        self.corner, self.across, self.along = (self.columns(mi.Point3f, floats, 3 * i) for i in range(3))
        self.size = mi.Float(floats[:, 9].copy())
        self.strength = self.columns(mi.Color3f, floats, 10)
        self.first = mi.UInt32(np.array(first or [0], dtype=np.uint32))
        radiance = [strength if kind == 2 else (0, 0, 0) for kind, _, strength in lights] or [(0, 0, 0)]
        self.radiance = self.columns(mi.Color3f, np.array(radiance, dtype=np.float32), 0)

    @staticmethod
    def columns(kind, table, first):
        return kind(*(mi.Float(np.ascontiguousarray(table[:, first + i], dtype=np.float32)) for i in range(3)))

    @staticmethod
    def pieces(kind, p):
        """(kind, corner, one side, other side, length or area)."""
        nothing = np.zeros(3)
        if kind == 0:
            return [(POINT, p[0], nothing, nothing, 1.0)]
        if kind == 1:
            return [(SEGMENT, p[0], p[1] - p[0], nothing, np.linalg.norm(p[1] - p[0]))]
        area = lambda a, b: np.linalg.norm(np.cross(a, b))  # noqa: E731
        if len(p) == 4 and np.abs(p[0] + p[2] - p[1] - p[3]).max() < 1e-6 * np.abs(p[2] - p[0]).max():
            return [(PARALLELOGRAM, p[0], p[1] - p[0], p[3] - p[0], area(p[1] - p[0], p[3] - p[0]))]
        return [(TRIANGLE, p[0], b - p[0], c - p[0], area(b - p[0], c - p[0]) / 2) for b, c in zip(p[1:], p[2:])]

    def sample(self, index, at, sample):
        """A place on a piece, the direction there, what a cosine at the receiver is to be multiplied by, and the density of the
        direction (0 for what has no area and is never met by chance)."""
        def get(table):
            return dr.gather(type(table), table, index)
        kind, across, along, size = get(self.kind), get(self.across), get(self.along), get(self.size)
        root = dr.sqrt(sample.x)
        triangle = kind == TRIANGLE
        s = dr.select(triangle, root * (1 - sample.y), sample.x)
        t = dr.select(triangle, root * sample.y, sample.y)
        place = get(self.corner) + across * s + along * t
        to = place - at
        squared = dr.maximum(dr.squared_norm(to), 1e-20)
        direction = to * dr.rsqrt(squared)
        flat = kind >= PARALLELOGRAM
        facing = dr.maximum(-dr.dot(direction, dr.normalize(dr.cross(across, along))), 0)
        share = dr.select(flat, facing, 1) * size / squared
        density = dr.select(flat & (share > 0), dr.rcp(share), 0)
        return place, direction, get(self.strength) * share, density

    def density(self, seen, ray):
        """As that of `sample`, of a direction that meets an area light."""
        piece = dr.gather(mi.UInt32, self.first, seen.index, seen.on_light)
        fan = dr.gather(mi.UInt32, self.kind, piece) == TRIANGLE
        piece += dr.select(fan, seen.si.prim_index, 0)
        size = dr.gather(mi.Float, self.size, piece, seen.on_light)
        cosine = dr.abs(dr.dot(seen.si.n, ray.d))
        return dr.select(seen.on_light, dr.square(seen.si.t) / dr.maximum(size * cosine, 1e-20), 0)


class Stage:
    """Tables of the protocol, Mitsuba's scene of them, and who is who in it."""

    def __init__(self, tables, before=None):
        self.tables = tables
        self.model, glossy = tables["model"], tables["model"] != "direct"
        if before is None:
            textures = [texture(t) for t in tables["textures"]]
            self.shiny = glossy and any(any(m["specular"]) for m in tables["materials"])
            self.bsdfs = [material(m, textures, self.shiny) for m in tables["materials"]]
            self.black = mi.load_dict({"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}})
            self.meshes = [Parts(mesh) for mesh in tables["meshes"]]
            self.shapes = [self.placed(i) for i in range(len(tables["objects"]))]
        else:
            self.shiny, self.bsdfs, self.black, self.meshes = before.shiny, before.bsdfs, before.black, before.meshes
            self.shapes = list(before.shapes)
        self.ambient, self.background = mi.Color3f(*tables["ambient"]), mi.Color3f(*tables["background"])

    def placed(self, index):
        """Shapes of an object: one a material."""
        thing = self.tables["objects"][index]
        mesh = self.meshes[thing["mesh"]]
        return [mesh.placed(f"object-{index}-{m}", self.bsdfs[m], which, thing["transform"])
                for m, which in mesh.materials(thing["material"])]

    def finish(self):
        """Makes the scene that rays are traced in."""
        tables = self.tables
        self.lights = Lights(tables["lights"])
        owners = [(shape, False, i) for i, shapes in enumerate(self.shapes) for shape in shapes]
        for i, (kind, points, _) in enumerate(tables["lights"]):
            if kind == 2:
                fan = [(0, k, k + 1) for k in range(1, len(points) - 1)]
                owners.append((shape(f"light-{i}", self.black, points, fan), True, i))
        world = {"type": "scene"} | {f"shape-{k}": owner[0] for k, owner in enumerate(owners)}
        self.scene = mi.load_dict(world)
        # By Mitsuba's number of a shape: which object or light it is.
        numbers = [int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(owner[0]))[0]) for owner in owners]
        index, light = np.zeros((2, max(numbers, default=0) + 1), dtype=np.uint32)
        for number, (_, is_light, i) in zip(numbers, owners):
            index[number], light[number] = i, is_light
        self.index, self.is_light = mi.UInt32(index), mi.UInt32(light)
        return self

    def who(self, shape):
        """Index in the table of objects or lights, and whether it is a light."""
        number = dr.reinterpret_array(mi.UInt32, shape)
        return dr.gather(mi.UInt32, self.index, number), dr.gather(mi.UInt32, self.is_light, number) == 1

    def edited(self, objects, lights):
        tables = {**self.tables, "objects": [dict(o) for o in self.tables["objects"]], "lights": list(self.tables["lights"])}
        for index, transform in objects:
            tables["objects"][index]["transform"] = transform
        for index, light in lights:
            tables["lights"][index] = light
        stage = Stage(tables, self)
        for index in {index for index, _ in objects}:
            stage.shapes[index] = stage.placed(index)
        return stage.finish()


def build(tables):
    return Stage(tables).finish()


transport.register()
