// Consumer: adds spherical harmonics of the light at a point (additive blending). With TRANSFER: the cosine-weighted transfer from a distant
// environment to a diffuse point, with VERTEX_CACHE also by way of the surfaces that it sees. Without: incident radiance, including lights.
// Mirrors src/bake/integrals.rs.
//
// The rgb triples of the coefficients follow each other, four floats to a target. A pass has eight targets; this is pass PASS.

#include "include/harmonics.glsl"
#ifdef TRANSFER
#include "include/albedo.glsl"
#ifdef VERTEX_CACHE
#include "include/vertex_cache.glsl"
#endif
#else
#include "include/radiance.glsl"
#endif

layout(location = 0) out vec4 sums[8];

// BASIS: the basis function of float f. CHANNELS: the colours of the four floats of target t. FOUR: their values. All arguments are constants.
#define FLOATS (3 * COEFFICIENTS)
#define BASIS(f) ((f) < FLOATS ? basis[(f) < FLOATS ? (f) / 3 : 0] : 0.0)
#define CHANNELS(rgb, t) vec4(rgb[(4 * (t)) % 3], rgb[(4 * (t) + 1) % 3], rgb[(4 * (t) + 2) % 3], rgb[(4 * (t) + 3) % 3])
#define FOUR(t) CHANNELS(incident, t) * vec4(BASIS(4 * (t)), BASIS(4 * (t) + 1), BASIS(4 * (t) + 2), BASIS(4 * (t) + 3))
#define CLEAR(t) sums[t] = vec4(0.0)
#define ADD(t) sums[t] += FOUR(8 * PASS + t)
#define ADD_CACHED(t) if (4 * (8 * PASS + t) < FLOATS) sums[t] += CHANNELS(back, 8 * PASS + t) * cached(place, 8 * PASS + t)
#define EACH(DO) DO(0); DO(1); DO(2); DO(3); DO(4); DO(5); DO(6); DO(7)

void begin()
{
    EACH(CLEAR);
}

void consume(GatherPoint point, PointHit hit, int i)
{
    float basis[COEFFICIENTS];
    harmonics(hit.direction, basis);
#ifdef TRANSFER
    float weight = cosine(point, hit.direction);
    vec3 incident = vec3(hit.triangle == 0 ? weight : 0.0);
    EACH(ADD);
#ifdef VERTEX_CACHE
    if (hit.triangle > 0 && weight > 0.0) {
        Surface surface = fetch_surface(hit.triangle - 1);
        vec3 back = dot(surface.normal, hit.direction) < 0.0 ? weight * albedo(hit.triangle - 1, surface, hit.position) : vec3(0.0);
        CachePlace place = cache_place(hit.triangle - 1, hit.position);
        EACH(ADD_CACHED);
    }
#endif
#else
    vec3 incident = hit.triangle == 0 ? miss_radiance(hit, i) : vec3(0.0);
    if (dot(point.surface_normal, hit.direction) <= 0.0) {
        incident = vec3(0.0);
    } else if (hit.triangle > 0) {
        Surface surface = fetch_surface(hit.triangle - 1);
        incident = hit_radiance(hit.triangle - 1, hit.position, hit.direction);
        incident += emission(surface, dot(surface.normal, hit.direction) < 0.0, hit.position);
    }
    EACH(ADD);
#endif
}
