"""A scene as PROTOCOL.md sends it, and rays in it: direct light, diffuse reflection. Brute force over a tree of boxes."""

import copy
import math
import random

from wire import LIGHT, MISS, NO_OBJECT

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
    """Corners in world space, whose it is, and what it reflects."""

    def __init__(self, corners, owner, diffuse):
        self.corner, second, third = corners
        self.sides = sub(second, self.corner), sub(third, self.corner)
        self.normal = unit(cross(*self.sides))
        self.owner = owner
        self.diffuse = diffuse
        self.low = tuple(min(c[axis] for c in corners) for axis in range(3))
        self.high = tuple(max(c[axis] for c in corners) for axis in range(3))

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


class Scene:
    """The tables of section 5, with what rays need."""

    def __init__(self, tables):
        self.ambient, self.background = tables["ambient"], tables["background"]
        self.materials, self.meshes = tables["materials"], tables["meshes"]
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
        materials = mesh["face_materials"] or [thing["material"]] * len(mesh["faces"])
        for corners, material in zip(mesh["faces"], materials):
            yield Triangle([placed[i] for i in corners], (0, index), self.materials[material])

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
        numbers = random.Random(seed << 64 | number)
        light, triples = self.reflected(at, normal, triangle, numbers)
        reflected = add(scale(light, 1 / math.pi), self.ambient)
        radiance = tuple(a * b for a, b in zip(triangle.diffuse, reflected))
        return (at, index, radiance, 0), triples

    def reflected(self, at, normal, triangle, numbers):
        """Irradiance from all lights, and the triples that were met."""
        total, triples = (0.0,) * 3, set()
        for index, light in enumerate(self.lights):
            for place, weight in light.samples(numbers):
                to = sub(place, at)
                squared = dot(to, to)
                distance = math.sqrt(squared)
                towards = scale(to, 1 / distance) if distance else to
                cosine = dot(towards, normal)
                if light.kind == 2:
                    weight *= -dot(towards, light.normal)
                if cosine <= 0 or weight <= 0:
                    continue
                blocker = self.meet(at, towards, distance * (1 - 1e-5), triangle, True)
                if blocker is None:
                    total = add(total, scale(light.strength, cosine * weight / squared))
                elif blocker[1].owner[0] != LIGHT:
                    triples.add((index, blocker[1].owner[1], triangle.owner[1]))
        return total, triples
