"""The shaders' light transport, for Mitsuba 3: what a surface reflects, and which paths of light are followed.

Written from the shaders' documentation, not from their code. Mitsuba traces the rays, looks textures up and samples lights.

`Coated` is the material: GGX with height-correlated masking (Heitz 2014) and Schlick's Fresnel term, what single
scattering loses given back in proportion (Turquin 2019), and below it a diffuse part that gets what the specular one lets
through. `Reflected` follows what Mitsuba's own `direct` integrator does not: light that was reflected before.
"""

import drjit as dr
import mitsuba as mi
import numpy as np

LEAST_COSINE = 1e-3
LEAST_ALPHA = 0.01
ALL, DIFFUSE, SPECULAR = 0xFFFFFFFF, 0, 1


def masked(cosine, alpha, np_or_dr):
    """Smith's lambda."""
    squared = cosine * cosine
    return 0.5 * (np_or_dr.sqrt(1 + alpha * alpha * (1 - squared) / squared) - 1)


def energy(side=64, rays=64):
    """Share of light that single scattering reflects, as `f0 * scale + bias`, by sqrt(cosine) and alpha: scale and bias."""
    u, v = np.meshgrid((np.arange(rays) + 0.5) / rays, (np.arange(rays) + 0.5) / rays)
    share = (np.arange(side) + 0.5) / side
    table = np.zeros((side, side, 2), dtype=np.float32)
    for row, alpha in enumerate(np.maximum(share, LEAST_ALPHA)):
        for column, cosine in enumerate(np.maximum(share**2, LEAST_COSINE)):
            view = np.array([np.sqrt(1 - cosine**2), 0, cosine])
            # Normals by the distribution itself, not by what is seen of it: another way than the shaders'.
            tangent2 = alpha**2 * u / (1 - u)
            z = 1 / np.sqrt(1 + tangent2)
            r = np.sqrt(1 - z * z)
            half = np.stack([r * np.cos(2 * np.pi * v), r * np.sin(2 * np.pi * v), z])
            facing = np.tensordot(view, half, 1)
            light = 2 * facing * half[2] - cosine
            up = (facing > 0) & (light > 0)
            both = 1 + masked(cosine, alpha, np) + masked(np.maximum(light, LEAST_COSINE), alpha, np)
            # f cos / pdf, with pdf = D cos(half) / (4 facing).
            weight = np.where(up, facing / (cosine * z * both), 0)
            grazing = (1 - np.clip(facing, 0, 1)) ** 5
            table[row, column] = [(weight * (1 - grazing)).mean(), (weight * grazing).mean()]
    return table


class Coated(mi.BSDF):
    """Diffuse below specular, on both sides. Parameters: `diffuse` (texture), `specular` (f0, RGB), `alpha`."""

    table = None

    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.diffuse = props.get_texture("diffuse")
        self.specular = mi.Color3f(props["specular"])
        self.alpha = max(props["alpha"], LEAST_ALPHA)
        self.is_specular = max(props["specular"]) > 0
        both = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [mi.BSDFFlags.DiffuseReflection | both, mi.BSDFFlags.GlossyReflection | both]
        self.m_flags = self.m_components[0] | self.m_components[1]
        if Coated.table is None:
            Coated.table = mi.Texture2f(mi.TensorXf(energy()), wrap_mode=dr.WrapMode.Clamp)

    def view(self, si):
        """Towards the viewer, on the upper side, and whether that is the back."""
        back = si.wi.z < 0
        z = dr.maximum(dr.abs(si.wi.z), LEAST_COSINE)
        return dr.normalize(mi.Vector3f(si.wi.x, si.wi.y, z)), back

    def shares(self, view):
        """What single scattering is multiplied by, and the share of light that the specular part reflects."""
        if not self.is_specular:
            return mi.Color3f(0), mi.Color3f(0)
        scale, bias = self.table.eval(mi.Point2f(dr.sqrt(view.z), self.alpha))
        compensation = 1 + self.specular * (1 / (scale + bias) - 1)
        return compensation, dr.minimum((self.specular * scale + bias) * compensation, 1)

    def chance(self, ctx):
        """With which probability the specular part is sampled."""
        if ctx.component == SPECULAR:
            return 1.0
        return 0.5 if ctx.component == ALL and self.is_specular else 0.0

    def parts(self, ctx, si, wo, active):
        """Value times cosine, and density."""
        view, back = self.view(si)
        light = mi.Vector3f(wo.x, wo.y, dr.select(back, -wo.z, wo.z))
        up = active & (light.z > 0)
        compensation, reflected = self.shares(view)
        chance = self.chance(ctx)
        value, density = mi.Color3f(0), mi.Float(0)
        if ctx.component in (ALL, DIFFUSE):
            colour = self.diffuse.eval(si, active)
            value += colour * (1 - reflected) * (light.z * dr.inv_pi)
        density += (1 - chance) * light.z * dr.inv_pi
        if self.is_specular and ctx.component in (ALL, SPECULAR):
            half = dr.normalize(view + light)
            a2 = self.alpha * self.alpha
            d = a2 / (dr.pi * dr.square(1 - (1 - a2) * half.z * half.z))
            at_view = masked(view.z, self.alpha, dr)
            at_light = masked(dr.maximum(light.z, LEAST_COSINE), self.alpha, dr)
            fresnel = self.specular + (1 - self.specular) * (1 - dr.clip(dr.dot(view, half), 0, 1)) ** 5
            value += fresnel * compensation * (d / (4 * view.z * (1 + at_view + at_light)))
            density += chance * d * half.z / dr.maximum(4 * dr.dot(view, half), 1e-9)
        return dr.select(up, value, 0), dr.select(up, density, 0)

    def sample(self, ctx, si, sample1, sample2, active):
        view, back = self.view(si)
        chance = self.chance(ctx)
        # Half vectors by the distribution, reflected, or a cosine.
        tangent2 = self.alpha * self.alpha * sample2.x / dr.maximum(1 - sample2.x, 1e-7)
        z = dr.rsqrt(1 + tangent2)
        r = dr.safe_sqrt(1 - z * z)
        sin, cos = dr.sincos(2 * dr.pi * sample2.y)
        half = mi.Vector3f(r * cos, r * sin, z)
        mirrored = 2 * dr.dot(view, half) * half - view
        picked = mi.Mask(sample1 < chance)
        light = dr.select(picked, mirrored, mi.warp.square_to_cosine_hemisphere(sample2))
        wo = mi.Vector3f(light.x, light.y, dr.select(back, -light.z, light.z))
        value, density = self.parts(ctx, si, wo, active)
        fine = active & (density > 0)
        bs = mi.BSDFSample3f()
        bs.wo, bs.pdf, bs.eta = wo, density, 1.0
        bs.sampled_type = mi.UInt32(int(mi.BSDFFlags.GlossyReflection))
        bs.sampled_component = mi.UInt32(0)
        return bs, dr.select(fine, value / dr.maximum(density, 1e-20), 0)

    def eval(self, ctx, si, wo, active):
        return self.parts(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active):
        return self.parts(ctx, si, wo, active)[1]

    def eval_pdf(self, ctx, si, wo, active):
        return self.parts(ctx, si, wo, active)

    def eval_diffuse_reflectance(self, si, active):
        """As a surface that is only met by a reflected ray: diffuse in all, by its reflectance at normal incidence."""
        return self.specular + self.diffuse.eval(si, active) * (1 - self.specular)

    def traverse(self, callback):
        pass

    def to_string(self):
        return "Coated[]"


class Reflected(mi.SamplingIntegrator):
    """All but the direct light of the surface seen: `ambient`, `background`, and what was reflected on the way to it.

    The surface seen reflects with both parts (`component` ALL) or with the specular one alone; every surface beyond it
    as if it were diffuse. `depth` is the most segments of a path from the eye to a light; lights met are left out, for they are
    the direct light of the surface before.
    """

    def __init__(self, props):
        mi.SamplingIntegrator.__init__(self, props)
        self.depth = props["depth"]
        self.component = SPECULAR if props["specular_only"] else ALL
        self.ambient = mi.Color3f(props["ambient"])
        self.background = mi.Color3f(props["background"])

    def sample(self, scene, sampler, ray, medium=None, active=True):
        active = mi.Mask(active)
        si = scene.ray_intersect(ray, active)
        radiance = dr.select(active & ~si.is_valid(), self.background, 0)
        active &= si.is_valid()
        seen = mi.Mask(active)
        bsdf = si.bsdf(ray)
        ctx = mi.BSDFContext()
        ctx.component = DIFFUSE
        # Sampled by its cosine the diffuse part has one weight in all directions.
        _, weight = bsdf.sample(ctx, si, 0.5, mi.Point2f(0.5), active)
        radiance += dr.select(active, weight * self.ambient, 0)
        ctx.component = self.component
        found, beta = bsdf.sample(ctx, si, sampler.next_1d(), sampler.next_2d(), active)
        onwards = si.to_world(found.wo)
        for _ in range(self.depth - 2):
            active &= dr.max(beta) > 0
            ray = si.spawn_ray(onwards)
            si = scene.ray_intersect(ray, active)
            radiance += dr.select(active & ~si.is_valid(), beta * self.background, 0)
            active &= si.is_valid()
            beta *= si.bsdf(ray).eval_diffuse_reflectance(si, active)
            normal = dr.select(dr.dot(si.sh_frame.n, ray.d) > 0, -si.sh_frame.n, si.sh_frame.n)
            light, given = scene.sample_emitter_direction(si, sampler.next_2d(), True, active)
            given *= dr.maximum(dr.dot(normal, light.d), 0) * dr.inv_pi
            radiance += dr.select(active, beta * (given + self.ambient), 0)
            onwards = mi.Frame3f(normal).to_world(mi.warp.square_to_cosine_hemisphere(sampler.next_2d()))
        return radiance, seen, []

    def aov_names(self):
        return []

    def traverse(self, callback):
        pass

    def to_string(self):
        return "Reflected[]"


def register():
    """Makes both known to `mi.load_dict`."""
    mi.register_bsdf("coated", Coated)
    mi.register_integrator("reflected", Reflected)
