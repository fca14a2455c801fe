"""A scene as PROTOCOL.md sends it, and rays in it: direct light, diffuse reflection. Brute force over a tree of boxes."""

import copy
import math
import random

from wire import LIGHT, MISS, NO_OBJECT, sample

# A light that is not a point is asked in so many places, one in each of as many equal parts.
PLACES = 4
LEAF = 4


def add(a, b):
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2])


def sub(a, b):
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


def scale(a, s):
    return (a[0] * s, a[1] * s, a[2] * s)


def dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a, b):
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


def unit(a):
    length = math.sqrt(dot(a, a))
    return scale(a, 1 / length) if length > 0 else a


class Triangle:
    """Corners in world space, whose it is, what it reflects, and what bends and colours it."""

    def __init__(self, corners, owner, diffuse, normals=None, texture=None, uvs=None):
        self.corner, second, third = corners
        self.sides = sub(second, self.corner), sub(third, self.corner)
        self.normal = unit(cross(*self.sides))
        self.owner, self.diffuse = owner, diffuse
        self.normals, self.texture, self.uvs = normals, texture, uvs
        self.low = tuple(min(c[axis] for c in corners) for axis in range(3))
        self.high = tuple(max(c[axis] for c in corners) for axis in range(3))

    def shares(self, at):
        """Barycentric coordinates of a place on it."""
        whole = cross(*self.sides)
        area, to = dot(whole, whole), sub(at, self.corner)
        v, w = dot(cross(to, self.sides[1]), whole) / area, dot(cross(self.sides[0], to), whole) / area
        return 1 - v - w, v, w

    def shading_normal(self, at):
        if not self.normals:
            return self.normal
        return unit(tuple(dot(self.shares(at), c) for c in zip(*self.normals)))

    def reflectance(self, at):
        if not self.texture or not self.uvs:
            return self.diffuse
        uv = (dot(self.shares(at), c) for c in zip(*self.uvs))
        return tuple(a * b for a, b in zip(self.diffuse, self.texture.look(*uv)))

    def distance(self, origin, direction):
        """How far the ray goes to meet it, or None (Moeller and Trumbore 1997)."""
        p = cross(direction, self.sides[1])
        determinant = dot(self.sides[0], p)
        if determinant == 0:
            return None
        to = sub(origin, self.corner)
        u = dot(to, p) / determinant
        q = cross(to, self.sides[0])
        v = dot(direction, q) / determinant
        if u < 0 or v < 0 or u + v > 1:
            return None
        return dot(self.sides[1], q) / determinant


class Box:
    """A tree of boxes over triangles."""

    def __init__(self, triangles):
        self.low = tuple(min(t.low[axis] for t in triangles) for axis in range(3))
        self.high = tuple(max(t.high[axis] for t in triangles) for axis in range(3))
        self.triangles, self.parts = triangles, ()
        if len(triangles) > LEAF:
            longest = max(range(3), key=lambda axis: self.high[axis] - self.low[axis])
            ordered = sorted(triangles, key=lambda t: t.low[longest] + t.high[longest])
            middle = len(ordered) // 2
            self.triangles, self.parts = (), (Box(ordered[:middle]), Box(ordered[middle:]))

    def is_met(self, origin, inverse, limit):
        near, far = 0.0, limit
        for axis in range(3):
            a = (self.low[axis] - origin[axis]) * inverse[axis]
            b = (self.high[axis] - origin[axis]) * inverse[axis]
            near, far = max(near, min(a, b)), min(far, max(a, b))
        return near <= far * (1 + 1e-9)


class Light:
    """An entry of the scene's table of lights."""

    def __init__(self, kind, places, strength):
        self.kind, self.places, self.strength = kind, places, strength
        self.normal, self.area = None, 0.0
        if kind == 2:
            first = places[0]
            fan = [cross(sub(b, first), sub(c, first)) for b, c in zip(places[1:], places[2:])]
            whole = (sum(n[0] for n in fan), sum(n[1] for n in fan), sum(n[2] for n in fan))
            self.normal, self.area = unit(whole), math.sqrt(dot(whole, whole)) / 2
            self.shares = [math.sqrt(dot(n, n)) / 2 / self.area for n in fan] if self.area else []

    def samples(self, numbers):
        """(place, weight) pairs: what a cosine at the receiver over squared distance is to be multiplied by."""
        if self.kind == 0:
            return [(self.places[0], 1.0)]
        if self.kind == 1:
            start, along = self.places[0], sub(self.places[1], self.places[0])
            weight = math.sqrt(dot(along, along)) / PLACES
            steps = [(i + numbers.random()) / PLACES for i in range(PLACES)]
            return [(add(start, scale(along, s)), weight) for s in steps]
        weight = self.area / PLACES
        return [(self.somewhere((i + numbers.random()) / PLACES, numbers.random()), weight)
                for i in range(PLACES)] if self.area else []

    def somewhere(self, which, across):
        """A place of an area light: `which`, in [0, 1), goes through its triangles by their areas."""
        for index, share in enumerate(self.shares):
            if which < share or index + 1 == len(self.shares):
                break
            which -= share
        u, v = min(which / share, 1.0) if share else 0.0, across
        root = math.sqrt(u)
        a, b, c = self.places[0], self.places[index + 1], self.places[index + 2]
        return add(a, add(scale(sub(b, a), root * (1 - v)), scale(sub(c, a), root * v)))


class Texture:
    """An image, looked up bilinearly."""

    def __init__(self, width, height, rgb):
        self.width, self.height, self.rgb = width, height, rgb

    def texel(self, x, y):
        at = 3 * (y % self.height * self.width + x % self.width)
        return [LINEAR[c] for c in self.rgb[at:at + 3]]

    def look(self, u, v):
        x, y = u * self.width - 0.5, (1 - v) * self.height - 0.5
        left, top = math.floor(x), math.floor(y)
        x, y = x - left, y - top
        four = ((left, top, (1 - x) * (1 - y)), (left + 1, top, x * (1 - y)),
                (left, top + 1, (1 - x) * y), (left + 1, top + 1, x * y))
        return [sum(c) for c in zip(*([c * weight for c in self.texel(i, k)] for i, k, weight in four))]


def linear(encoded):
    """sRGB (IEC 61966-2-1)."""
    return encoded / 12.92 if encoded <= 0.04045 else ((encoded + 0.055) / 1.055) ** 2.4


LINEAR = [linear(c / 255) for c in range(256)]


def carried(m, normal):
    """A normal, by the inverse transpose of a transform: the cofactors of its matrix, and their sign."""
    rows = m[0:3], m[4:7], m[8:11]
    cofactors = cross(rows[1], rows[2]), cross(rows[2], rows[0]), cross(rows[0], rows[1])
    sign = 1 if dot(rows[0], cofactors[0]) > 0 else -1
    return unit(tuple(sign * dot(c, normal) for c in cofactors))


class Scene:
    """The tables of section 5, with what rays need."""

    def __init__(self, tables):
        self.ambient, self.background = tables["ambient"], tables["background"]
        self.materials, self.meshes = tables["materials"], tables["meshes"]
        self.textures = [Texture(**texture) for texture in tables["textures"]]
        self.objects = [dict(o) for o in tables["objects"]]
        self.lights = [Light(*light) for light in tables["lights"]]
        self.build()

    def build(self):
        triangles = [t for index in range(len(self.objects)) for t in self.triangles_of(index)]
        for index, light in enumerate(self.lights):
            if light.kind == 2:
                corners = zip(light.places[1:], light.places[2:])
                triangles += [Triangle((light.places[0], b, c), (LIGHT, index), None) for b, c in corners]
        self.tree = Box(triangles) if triangles else None

    def triangles_of(self, index):
        thing = self.objects[index]
        mesh, m = self.meshes[thing["mesh"]], thing["transform"]
        placed = [tuple(dot(m[4 * row:4 * row + 3], p) + m[4 * row + 3] for row in range(3))
                  for p in mesh["positions"]]
        bent = [carried(m, n) for n in mesh["normals"]]
        for face, corners in enumerate(mesh["faces"]):
            material = self.materials[mesh["face_materials"][face] if mesh["face_materials"] else thing["material"]]
            normals = [bent[i] for i in mesh["face_normals"][face]] if mesh["face_normals"] else None
            uvs = [mesh["uvs"][i] for i in mesh["face_uvs"][face]] if mesh["face_uvs"] else None
            texture = None if material["map"] is None else self.textures[material["map"]]
            triangle = Triangle([placed[i] for i in corners], (0, index), material["diffuse"], normals, texture, uvs)
            # Without an area it is met by nothing.
            if any(triangle.normal):
                yield triangle

    def edited(self, objects, lights):
        """A scene of its own, as it is after an edit."""
        scene = copy.copy(self)
        scene.objects, scene.lights = [dict(o) for o in self.objects], list(self.lights)
        for index, transform in objects:
            scene.objects[index]["transform"] = transform
        for index, light in lights:
            scene.lights[index] = Light(*light)
        scene.build()
        return scene

    def meet(self, origin, direction, limit, skip=None, any_will_do=False):
        """(distance, triangle) of the nearest that the ray meets before `limit`, or of any, or None."""
        inverse = tuple(1 / d if d else math.inf for d in direction)
        best, waiting = None, [self.tree] if self.tree else []
        while waiting:
            box = waiting.pop()
            if not box.is_met(origin, inverse, limit):
                continue
            waiting.extend(box.parts)
            for triangle in box.triangles:
                t = triangle.distance(origin, direction) if triangle is not skip else None
                if t is not None and 1e-6 * (1 + limit if limit < 1e9 else 1) < t < limit:
                    best, limit = (t, triangle), t
                    if any_will_do:
                        return best
        return best

    def trace(self, seed, pinhole, requests):
        """Packed samples of these requests, and the triples that were met."""
        packed, triples = [], set()
        for number, x, y, offset in requests:
            fields, met = self.shade(seed, number, pinhole.eye, pinhole.direction(x + offset[0], y + offset[1]))
            packed.append(sample(number, *fields))
            triples |= met
        return b"".join(packed), triples

    def shade(self, seed, number, origin, direction):
        """Fields of a sample, and the triples that were met."""
        found = self.meet(origin, direction, math.inf)
        if found is None:
            return (direction, NO_OBJECT, self.background, MISS), set()
        distance, triangle = found
        at, (kind, index) = add(origin, scale(direction, distance)), triangle.owner
        if kind == LIGHT:
            light = self.lights[index]
            shines = dot(sub(origin, light.places[0]), light.normal) > 0
            return (at, index, light.strength if shines else (0.0,) * 3, LIGHT), set()
        normal = triangle.normal if dot(triangle.normal, direction) <= 0 else scale(triangle.normal, -1)
        bent = triangle.shading_normal(at)
        bent = bent if dot(bent, normal) >= 0 else scale(bent, -1)
        numbers = random.Random(seed << 64 | number)
        light, triples = self.reflected(at, normal, bent, triangle, numbers)
        reflected = add(scale(light, 1 / math.pi), self.ambient)
        radiance = tuple(min(a * b, 1e9) for a, b in zip(triangle.reflectance(at), reflected))
        return (at, index, radiance, 0), triples

    def reflected(self, at, normal, bent, triangle, numbers):
        """Irradiance from all lights by the normal that shades, and the triples that were met."""
        total, triples = (0.0,) * 3, set()
        for index, light in enumerate(self.lights):
            for place, weight in light.samples(numbers):
                to = sub(place, at)
                squared = dot(to, to)
                distance = math.sqrt(squared)
                towards = scale(to, 1 / distance) if distance else to
                cosine = dot(towards, bent)
                if light.kind == 2:
                    weight *= -dot(towards, light.normal)
                if cosine <= 0 or weight <= 0 or dot(towards, normal) <= 0:
                    continue
                blocker = self.meet(at, towards, distance * (1 - 1e-5), triangle, True)
                if blocker is None:
                    total = add(total, scale(light.strength, cosine * weight / squared))
                elif blocker[1].owner[0] != LIGHT:
                    triples.add((index, blocker[1].owner[1], triangle.owner[1]))
        return total, triples
