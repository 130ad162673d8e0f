"""A path tracer for many lamps in many rooms: at each surface it chooses among the lamps by their distance. Mitsuba's own chooses evenly, and most of
what it tries is in other rooms. Rays of the surface's own sampling and of the lamps' are weighted by the balance heuristic, as there.

Each lamp is an emitter with a mesh of its own. There is no environment, and no mirror or glass.
"""
import drjit as dr
import mitsuba as mi


class NearLamps(mi.SamplingIntegrator):
    def __init__(self, properties):
        super().__init__(properties)
        self.max_depth = properties.get("max_depth", -1)
        self.rr_depth = properties.get("rr_depth", 4)

    def find_lamps(self, scene):
        """Centres and squared radii of the lamps, in the order of the scene's emitters."""
        boxes = [emitter.bbox() for emitter in scene.emitters()]
        self.lamps = [(box.center(), dr.squared_norm(box.extents()) / 4) for box in boxes]

    def shares(self, point):
        """Chances of the lamps. The distance is at least a lamp's radius. All lamps keep a small chance, for a near one may be hidden."""
        near = [1 / (dr.squared_norm(point - mi.Point3f(center)) + float(radius)) for center, radius in self.lamps]
        total = sum(near)
        return [0.95 * weight / total + 0.05 / len(near) for weight in near]

    @dr.syntax
    def sample(self, scene, sampler, ray, medium=None, active=True):
        emitters = scene.emitters_dr()
        context = mi.BSDFContext()
        ray = mi.Ray3f(ray)
        active = mi.Bool(active)
        light, throughput = mi.Spectrum(0), mi.Spectrum(1)
        depth = mi.UInt32(0)
        from_surface, before = mi.Float(1), dr.zeros(mi.Interaction3f)
        while active:
            si = scene.ray_intersect(ray, active)
            # A lamp that the surface's own ray has met.
            emitter = si.emitter(scene)
            lit = active & (emitter != None)
            share = mi.Float(0)
            for index, chance in enumerate(self.shares(before.p)):
                share = dr.select(emitter == dr.gather(mi.EmitterPtr, emitters, mi.UInt32(index)), chance, share)
            ds = mi.DirectionSample3f(scene, si, before)
            from_lamp = share * emitter.pdf_direction(before, ds, lit)
            weight = dr.select(depth == 0, 1, from_surface / (from_surface + from_lamp))
            light += dr.select(lit, throughput * emitter.eval(si, lit) * weight, 0)
            active &= si.is_valid()
            if self.max_depth >= 0:
                active &= depth + 1 < self.max_depth

            # A point of a chosen lamp.
            bsdf = si.bsdf(ray)
            u, chosen, chosen_share, below = sampler.next_1d(active), mi.UInt32(0), mi.Float(1), mi.Float(0)
            for index, chance in enumerate(self.shares(si.p)):
                inside = (u >= below) & (u < below + chance)
                chosen, chosen_share = dr.select(inside, index, chosen), dr.select(inside, chance, chosen_share)
                below += chance
            lamp = dr.gather(mi.EmitterPtr, emitters, chosen, active)
            ds, radiance = lamp.sample_direction(si, sampler.next_2d(active), active)
            tried = active & (ds.pdf > 0)
            tried &= ~scene.ray_test(si.spawn_ray_to(ds.p), tried)
            value, surface_pdf = bsdf.eval_pdf(context, si, si.to_local(ds.d), tried)
            lamp_pdf = chosen_share * ds.pdf
            light += dr.select(tried, throughput * value * radiance / chosen_share * lamp_pdf / (lamp_pdf + surface_pdf), 0)

            # On from the surface.
            bs, value = bsdf.sample(context, si, sampler.next_1d(active), sampler.next_2d(active), active)
            throughput *= value
            from_surface, before = bs.pdf, mi.Interaction3f(si)
            ray = si.spawn_ray(si.to_world(bs.wo))
            depth += 1
            brightest = dr.max(throughput)
            lives = dr.minimum(brightest, 0.95)
            ends = depth >= self.rr_depth
            survives = sampler.next_1d(active) < lives
            throughput = dr.select(ends, throughput / lives, throughput)
            active &= (brightest > 0) & (~ends | survives)
        return light, mi.Bool(True), []
