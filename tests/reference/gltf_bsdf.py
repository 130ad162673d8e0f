"""The metallic-roughness material of glTF 2.0 (appendix B) as a BSDF of Mitsuba 3: the model of src/scene/gloss.rs.

    f = (1 - F) (1 - metallic) base / pi + F D V        F = F0 + (1 - F0) (1 - v.h)^5        F0 = mix(specular, base, metallic)

D is GGX with alpha = roughness^2, V the separable Smith term. Both sides reflect. `gltf_bsdf(base, metallic, roughness)` returns an entry for a
scene of `mi.load_dict`; base, metallic, roughness and specular are numbers, lists of three, or dictionaries of textures. Of a texture of metallic or
roughness the first channel counts (`raw` textures). Set a variant with RGB before the import.

    python tests/reference/gltf_bsdf.py        checks it: against `roughconductor`, its pdf, and its samples
"""

import drjit as dr
import mitsuba as mi

if mi.variant() is None:
    mi.set_variant("llvm_ad_rgb")

# Below it all is as sharp as this.
LEAST_ALPHA = 1e-3


class GltfBsdf(mi.BSDF):
    def __init__(self, props):
        mi.BSDF.__init__(self, props)
        self.base = props.get_texture("base", 0.5)
        self.metallic = props.get_texture("metallic", 0.0)
        self.roughness = props.get_texture("roughness", 1.0)
        self.specular = props.get_texture("specular", 0.04)
        sides = mi.BSDFFlags.FrontSide | mi.BSDFFlags.BackSide
        self.m_components = [mi.BSDFFlags.GlossyReflection | sides, mi.BSDFFlags.DiffuseReflection | sides]
        self.m_flags = mi.BSDFFlags.GlossyReflection | mi.BSDFFlags.DiffuseReflection | sides

    def traverse(self, callback):
        for name in ["base", "metallic", "roughness", "specular"]:
            callback.put_object(name, getattr(self, name), mi.ParamFlags.Differentiable)

    def parameters(self, si, active):
        """F0, diffuse base, alpha and the probability of the lobe."""
        base = self.base.eval(si, active)
        metallic = self.metallic.eval_1(si, active)
        roughness = self.roughness.eval_1(si, active)
        f0 = dr.lerp(self.specular.eval(si, active), base, metallic)
        diffuse = (1 - metallic) * base
        alpha = dr.maximum(roughness * roughness, LEAST_ALPHA)
        grazing = (1 - dr.abs(mi.Frame3f.cos_theta(si.wi))) ** 5
        lobe, under = mi.luminance(f0 + (1 - f0) * grazing), mi.luminance(diffuse) * (1 - grazing)
        return f0, diffuse, alpha, lobe / dr.maximum(lobe + under, 1e-9)

    @staticmethod
    def smith(cosine, alpha):
        """G1 of a direction at this cosine."""
        return 2 * cosine / (cosine + dr.sqrt(alpha * alpha + (1 - alpha * alpha) * cosine * cosine))

    @staticmethod
    def ggx(cosine, alpha):
        # cos^2 (alpha^2 - 1) + 1 loses all digits of a sharp lobe.
        spread = dr.maximum(1 - cosine * cosine, 0) + alpha * alpha * cosine * cosine
        return alpha * alpha / (dr.pi * spread * spread)

    @staticmethod
    def on_one_side(si, wo):
        """Both directions, turned to the front."""
        side = dr.mulsign(mi.Vector3f(0, 0, 1), mi.Frame3f.cos_theta(si.wi))
        turn = lambda w: mi.Vector3f(w.x, w.y, w.z * side.z)
        return turn(si.wi), turn(wo)

    def density(self, wi, wo, alpha, share):
        half = dr.normalize(wi + wo)
        visible = self.smith(wi.z, alpha) * self.ggx(half.z, alpha) / (4 * wi.z)
        return share * visible + (1 - share) * wo.z / dr.pi

    def eval_pdf(self, ctx, si, wo, active=True):
        f0, diffuse, alpha, share = self.parameters(si, active)
        wi, wo = self.on_one_side(si, wo)
        active = active & (wi.z > 0) & (wo.z > 0)
        half = dr.normalize(wi + wo)
        fresnel = f0 + (1 - f0) * (1 - dr.clip(dr.dot(wi, half), 0, 1)) ** 5
        lobe = self.ggx(half.z, alpha) * self.smith(wi.z, alpha) * self.smith(wo.z, alpha) / (4 * wi.z * wo.z)
        value = ((1 - fresnel) * diffuse / dr.pi + fresnel * lobe) * wo.z
        pdf = self.density(wi, wo, alpha, share)
        return dr.select(active, value, 0), dr.select(active, pdf, 0)

    def eval(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[0]

    def pdf(self, ctx, si, wo, active=True):
        return self.eval_pdf(ctx, si, wo, active)[1]

    def sample(self, ctx, si, sample1, sample2, active=True):
        _, _, alpha, share = self.parameters(si, active)
        wi, _ = self.on_one_side(si, si.wi)
        # A visible normal (Heitz 2018, "Sampling the GGX distribution of visible normals").
        stretched = dr.normalize(mi.Vector3f(alpha * wi.x, alpha * wi.y, wi.z))
        length = stretched.x * stretched.x + stretched.y * stretched.y
        first = dr.select(length > 1e-12, mi.Vector3f(-stretched.y, stretched.x, 0) * dr.rsqrt(dr.maximum(length, 1e-12)),
                          mi.Vector3f(1, 0, 0))
        second = dr.cross(stretched, first)
        disc = mi.warp.square_to_uniform_disk_concentric(sample2)
        upper = 0.5 * (1 + stretched.z)
        y = (1 - upper) * dr.sqrt(dr.maximum(1 - disc.x * disc.x, 0)) + upper * disc.y
        up = dr.sqrt(dr.maximum(1 - disc.x * disc.x - y * y, 0))
        normal = disc.x * first + y * second + up * stretched
        normal = dr.normalize(mi.Vector3f(alpha * normal.x, alpha * normal.y, dr.maximum(normal.z, 1e-6)))
        mirrored = 2 * dr.dot(wi, normal) * normal - wi
        spread = mi.warp.square_to_cosine_hemisphere(sample2)
        by_lobe = sample1 < share
        wo = dr.select(by_lobe, mirrored, spread)
        sample = mi.BSDFSample3f()
        sample.wo = mi.Vector3f(wo.x, wo.y, dr.mulsign(wo.z, mi.Frame3f.cos_theta(si.wi)))
        sample.eta = 1.0
        sample.sampled_type = dr.select(by_lobe, mi.UInt32(+mi.BSDFFlags.GlossyReflection), mi.UInt32(+mi.BSDFFlags.DiffuseReflection))
        sample.sampled_component = dr.select(by_lobe, mi.UInt32(0), mi.UInt32(1))
        value, sample.pdf = self.eval_pdf(ctx, si, sample.wo, active)
        active = active & (wi.z > 0) & (wo.z > 0) & (sample.pdf > 0)
        return sample, dr.select(active, value / dr.maximum(sample.pdf, 1e-30), 0)

    def to_string(self):
        return "GltfBsdf[]"


mi.register_bsdf("gltf", lambda props: GltfBsdf(props))


def gltf_bsdf(base=0.5, metallic=0.0, roughness=1.0, specular=0.04):
    """An entry for a scene of `mi.load_dict`."""
    def value(of):
        return {"type": "rgb", "value": list(of)} if isinstance(of, (list, tuple)) else of

    return {"type": "gltf", "base": value(base), "metallic": value(metallic), "roughness": value(roughness), "specular": value(specular)}


def check():
    ctx = mi.BSDFContext()
    si = dr.zeros(mi.SurfaceInteraction3f)
    count = 1 << 20
    numbers = mi.load_dict({"type": "independent"})
    numbers.seed(0, count)
    for roughness in [0.1, 0.3, 0.6, 1.0]:
        for cosine in [0.95, 0.5, 0.1]:
            si.wi = mi.Vector3f((1 - cosine * cosine) ** 0.5, 0, cosine)
            metal = mi.load_dict(gltf_bsdf(1.0, 1.0, roughness))
            peer = mi.load_dict({"type": "roughconductor", "material": "none", "distribution": "ggx", "alpha": roughness**2})
            sample, _ = metal.sample(ctx, si, numbers.next_1d(), numbers.next_2d())
            ours, theirs = metal.eval(ctx, si, sample.wo), peer.eval(ctx, si, sample.wo)
            difference = dr.max(dr.abs(ours - theirs) / (dr.abs(theirs) + 1e-3), axis=None)[0]
            assert difference < 1e-2, (roughness, cosine, difference)
            for bsdf in [metal, mi.load_dict(gltf_bsdf([0.8, 0.5, 0.2], 0.3, roughness)), mi.load_dict(gltf_bsdf(0.5, 0.0, roughness))]:
                wo = mi.warp.square_to_uniform_hemisphere(numbers.next_2d())
                value, pdf = bsdf.eval_pdf(ctx, si, wo)
                even = dr.mean(value.y) * 2 * dr.pi
                whole = dr.mean(pdf)[0] * 2 * dr.pi
                _, weight = bsdf.sample(ctx, si, numbers.next_1d(), numbers.next_2d())
                print(roughness, cosine, "integral", even[0], "samples", dr.mean(weight.y)[0], "pdf", whole)
                # Even directions hardly meet a sharp lobe.
                if roughness >= 0.3:
                    assert abs(even[0] - dr.mean(weight.y)[0]) < 0.02, "samples and integral differ"
                    assert whole < 1.02, "pdf"


if __name__ == "__main__":
    check()
