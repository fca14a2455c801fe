"""Requested samples, path by path: the light transport of `reference.py`, for all requests of a batch as one wavefront.

The surface seen gets the light of every light of the scene, or of MOST_LIGHTS picked ones. With the model `direct` that is all, and the
ambient light. With `glossy` its specular part reflects once more, with `global` both parts do, and paths go on over surfaces
that count as diffuse, DEPTHS segments in all unless told otherwise.

Random numbers are a function of the session's seed, the request's id and the number of its path alone (PCG32, one stream each): a sample does
not depend on the batch that it is traced in.
"""

import threading

import drjit as dr
import mitsuba as mi
import numpy as np

import stage
from transport import ALL, DIFFUSE, SPECULAR

DEPTHS = {"direct": 2, "glossy": 3, "global": 6}
# Pieces of lights asked one by one; of more, so many are picked.
MOST_LIGHTS = 8
MISS, VIEW_DEPENDENT, LIGHT, NOTHING = 1, 2, 8, 0xFFFFFFFF
SAMPLE = np.dtype([("id", "<u8"), ("position", "<f4", 3), ("object", "<u4"), ("radiance", "<f4", 3), ("flags", "<u4")])
BRIGHT = 1e9
# Mitsuba and Dr.Jit are used by one thread at a time.
ONE = threading.RLock()


def mixed(x):
    """The finaliser of splitmix64 (Steele, Lea, Flood 2014), on arrays of 64 bits."""
    x = x + np.uint64(0x9E3779B97F4A7C15)
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return x ^ (x >> np.uint64(31))


class Numbers:
    """A stream of random numbers for each path."""

    def __init__(self, seed, ids, spp):
        with np.errstate(over="ignore"):
            paths = np.tile(np.arange(spp, dtype=np.uint64), len(ids))
            start = mixed(np.repeat(mixed(ids ^ mixed(np.uint64(seed))), spp) + paths)
            stream = mixed(start)
        self.rng = mi.PCG32()
        # The constructor would add the number of the lane.
        self.rng.seed(mi.UInt64(start), mi.UInt64(stream))

    def one(self):
        return self.rng.next_float32()

    def two(self):
        x = self.one()
        return mi.Point2f(x, self.one())


class Seen:
    """What a ray meets, and its sides: `geometric` and `normal` face where the ray came from."""

    def __init__(self, world, ray, active):
        self.si = world.scene.ray_intersect(ray, active)
        self.valid = active & self.si.is_valid()
        self.index, is_light = world.who(self.si.shape)
        self.on_light = self.valid & is_light
        n, s = self.si.n, self.si.sh_frame.n
        # From which side a light is seen is its mesh's winding to say.
        self.front = dr.dot(n, ray.d) < 0
        self.geometric = dr.select(self.front, n, -n)
        self.normal = dr.select(dr.dot(s, self.geometric) < 0, -s, s)


def lit(world, seen, piece, numbers, active, reflected):
    """Light of a piece, reflected; with the shadow ray's blocker, whose `blocked` says whether it is an object."""
    place, direction, strength, density = world.lights.sample(piece, seen.si.p, numbers.two())
    cosine = dr.dot(seen.normal, direction)
    active = active & (cosine > 0) & (dr.dot(seen.geometric, direction) > 0) & (dr.max(strength) > 0)
    value = reflected(direction, cosine, density, active)
    blocker = world.scene.ray_intersect_preliminary(seen.si.spawn_ray_to(place), coherent=False, active=active)
    hidden = active & blocker.is_valid()
    return dr.select(active & ~hidden, value * strength, 0), blocker, hidden


def shared(density, other):
    """What one way of sampling a direction keeps where another finds it too (Veach and Guibas 1995, power heuristic)."""
    return dr.square(density) / dr.maximum(dr.square(density) + dr.square(other), 1e-30)


class Paths:
    """The radiance of rays."""

    def __init__(self, world, depth):
        self.world, self.depth = world, depth or DEPTHS[world.model]
        self.picks = min(world.lights.count, MOST_LIGHTS)
        # With which probability a piece is among those picked, at the surface seen.
        self.picked = self.picks / max(world.lights.count, 1)
        # Which part of a surface reflects what was reflected before.
        self.part = SPECULAR if world.model == "glossy" else ALL

    def piece(self, k, numbers):
        """The k-th piece to be asked: itself, or any of one of as many equal parts of the table."""
        if self.picks == self.world.lights.count:
            return mi.UInt32(k)
        piece = mi.UInt32((k + numbers.one()) / self.picked)
        return dr.minimum(piece, self.world.lights.count - 1)

    def trace(self, ray, numbers):
        """What the rays meet, whether that is an object, the radiance, and (light, blocker, whether an object blocks) for each
        light asked."""
        world = self.world
        seen = Seen(world, ray, mi.Mask(True))
        surface = seen.valid & ~seen.on_light
        bsdf = seen.si.bsdf(ray)
        radiance = dr.select(seen.valid, 0, world.background)
        radiance += self.shine(seen, seen.valid)
        albedo = bsdf.eval_diffuse_reflectance(seen.si, surface)
        diffuse = albedo
        if world.shiny:
            ctx = mi.BSDFContext()
            ctx.component = DIFFUSE
            _, diffuse = bsdf.sample(ctx, seen.si, 0.5, mi.Point2f(0.5), surface)
        radiance += dr.select(surface, diffuse * world.ambient, 0)
        by_chance = mi.BSDFContext()
        by_chance.component = self.part

        def reflected(direction, cosine, density, active):
            if not world.shiny:
                return albedo * (cosine * dr.inv_pi)
            local = seen.si.to_local(direction)
            value = bsdf.eval(mi.BSDFContext(), seen.si, local, active)
            other = bsdf.pdf(by_chance, seen.si, local, active)
            return value * dr.select(density > 0, shared(density * self.picked, other), 1)

        met = []
        for k in range(self.picks):
            piece = self.piece(k, numbers)
            light, blocker, hidden = lit(world, seen, piece, numbers, surface, reflected)
            radiance += light / self.picked
            who, is_light = world.who(blocker.shape)
            met.append((dr.gather(mi.UInt32, world.lights.light, piece), who, hidden & ~is_light))
        if self.depth > 2 and (world.shiny or world.model != "glossy"):
            radiance += self.beyond(seen, surface, bsdf, by_chance, albedo, numbers)
        return seen, surface, radiance, met

    def shine(self, seen, active):
        """Radiance of lights that are met, from the side on which they emit."""
        shines = active & seen.on_light & seen.front
        return dr.gather(mi.Color3f, self.world.lights.radiance, seen.index, shines)

    def beyond(self, seen, surface, bsdf, by_chance, albedo, numbers):
        """Light that was reflected before, and the share of lights met by chance that sampling lights leaves."""
        world, si, active, radiance = self.world, seen.si, mi.Mask(surface), mi.Color3f(0)
        if world.shiny:
            found, beta = bsdf.sample(by_chance, si, numbers.one(), numbers.two(), active)
            onwards, density = si.to_world(found.wo), found.pdf
            at_light = bsdf.eval(mi.BSDFContext(), si, found.wo, active) / dr.maximum(density, 1e-20)
        else:
            onwards = mi.Frame3f(seen.normal).to_world(mi.warp.square_to_cosine_hemisphere(numbers.two()))
            beta = mi.Color3f(albedo)
        active &= dr.dot(onwards, seen.geometric) > 0
        for segment in range(self.depth - 2):
            active &= dr.max(beta) > 0
            ray = si.spawn_ray(onwards)
            there = Seen(world, ray, active)
            radiance += dr.select(active & ~there.valid, beta * world.background, 0)
            if segment == 0 and world.shiny:
                share = shared(density, world.lights.density(there, ray) * self.picked)
                radiance += dr.select(active, at_light * share * self.shine(there, active), 0)
            active &= there.valid & ~there.on_light
            beta *= there.si.bsdf(ray).eval_diffuse_reflectance(there.si, active)
            radiance += dr.select(active, beta * world.ambient, 0)
            if world.lights.count:
                piece = dr.minimum(mi.UInt32(numbers.one() * world.lights.count), world.lights.count - 1)
                light, _, _ = lit(world, there, piece, numbers, active, lambda direction, cosine, *_: mi.Color3f(cosine * dr.inv_pi))
                radiance += dr.select(active, beta * light * world.lights.count, 0)
            onwards = mi.Frame3f(there.normal).to_world(mi.warp.square_to_cosine_hemisphere(numbers.two()))
            active &= dr.dot(onwards, there.geometric) > 0
            si = there.si
        return radiance


class Scene:
    """What a session works with: `build` of a shader, `edited` and `trace`."""

    def __init__(self, world, spp, depth):
        self.world, self.spp, self.depth = world, spp, depth
        self.paths = Paths(world, depth)

    def edited(self, objects, lights):
        with ONE:
            return Scene(self.world.edited(objects, lights), self.spp, self.depth)

    def rays(self, pinhole, x, y):
        """Of these image points, each repeated for its paths."""
        across = ((2 * x / pinhole.width - 1) * pinhole.tangent * pinhole.width / pinhole.height)[:, None]
        upwards = ((1 - 2 * y / pinhole.height) * pinhole.tangent)[:, None]
        d = np.array(pinhole.forward) + across * np.array(pinhole.right) + upwards * np.array(pinhole.up)
        d = np.repeat(d / np.linalg.norm(d, axis=1, keepdims=True), self.spp, axis=0).astype(np.float32)
        return mi.Ray3f(mi.Point3f(*map(float, pinhole.eye)), mi.Vector3f(*(mi.Float(np.ascontiguousarray(c)) for c in d.T)))

    def trace(self, seed, pinhole, requests):
        ids = np.array([r[0] for r in requests], dtype=np.uint64)
        x = np.array([r[1] + r[3][0] for r in requests])
        y = np.array([r[2] + r[3][1] for r in requests])
        with ONE:
            ray = self.rays(pinhole, x, y)
            seen, surface, radiance, met = self.paths.trace(ray, Numbers(seed, ids, self.spp))
            place = dr.select(seen.valid, seen.si.p, ray.d)
            dr.eval(place, radiance, seen.valid, seen.on_light, seen.index, met)
            return self.samples(ids, place, radiance, seen), self.triples(seen, met)

    def samples(self, ids, place, radiance, seen):
        first = slice(None, None, self.spp)
        valid, on_light = np.array(seen.valid)[first], np.array(seen.on_light)[first]
        mean = np.array(radiance).T.reshape(len(ids), self.spp, 3).mean(axis=1)
        packed = np.zeros(len(ids), dtype=SAMPLE)
        packed["id"], packed["position"] = ids, np.array(place).T[first]
        packed["object"] = np.where(valid, np.array(seen.index)[first], NOTHING)
        packed["radiance"] = np.clip(np.nan_to_num(mean), 0, BRIGHT)
        shiny = VIEW_DEPENDENT if self.world.shiny else 0
        packed["flags"] = np.where(valid, np.where(on_light, LIGHT, shiny), MISS)
        return packed.tobytes()

    def triples(self, seen, met):
        """(light, blocker, receiver), each once."""
        receiver, found = np.array(seen.index), set()
        for light, blocker, blocked in met:
            which = np.flatnonzero(np.array(blocked))
            lights = np.broadcast_to(np.array(light), receiver.shape)[which].astype(np.uint64)
            # Tables have at most 2^20 objects and 2^16 lights.
            keys = lights << np.uint64(40) | np.array(blocker)[which].astype(np.uint64) << np.uint64(20) | receiver[which]
            ones = (1 << 20) - 1
            found.update((key >> 40, key >> 20 & ones, key & ones) for key in np.unique(keys).tolist())
        return found


def build(tables, spp, depth):
    with ONE:
        return Scene(stage.build(tables), spp, depth)
