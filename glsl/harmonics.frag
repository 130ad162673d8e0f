#version 330 core
// What points see as spherical harmonics (additive blending). With TRANSFER: how a diffuse point answers to a distant environment, cosine-weighted,
// and with GATHERED also by way of the surfaces that it sees. Else: incident radiance, lights and all. Mirrors src/bake/integrals.rs.
//
// Coefficients are rgb triples in a row, four floats to a target; this is pass PASS of as many as it takes with eight targets.

#ifndef ORDER
#define ORDER 3
#define PASS 0
#endif

#include "points.glsl"
#include "hits.glsl"
#include "harmonics.glsl"
#ifdef TRANSFER
#include "albedo.glsl"
#ifdef GATHERED
#include "carriers.glsl"
#endif
#else
#include "radiance.glsl"
#endif
uniform ivec2 first_texel;          // always 0: points of bakes have no subsets

layout(location = 0) out vec4 sums[8];

// Of the f-th float, the basis function, and the colour of rgb; of the t-th four floats, their values. All arguments are constants.
#define FLOATS (3 * COEFFICIENTS)
#define BASIS(f) ((f) < FLOATS ? basis[(f) < FLOATS ? (f) / 3 : 0] : 0.0)
#define CHANNELS(rgb, t) vec4(rgb[(4 * (t)) % 3], rgb[(4 * (t) + 1) % 3], rgb[(4 * (t) + 2) % 3], rgb[(4 * (t) + 3) % 3])
#define FOUR(t) CHANNELS(incident, t) * vec4(BASIS(4 * (t)), BASIS(4 * (t) + 1), BASIS(4 * (t) + 2), BASIS(4 * (t) + 3))
#define ADD(t) total[t] += FOUR(8 * PASS + t)
#define ADD_GATHERED(t) if (4 * (8 * PASS + t) < FLOATS) total[t] += CHANNELS(back, t) * carried(carriers, 8 * PASS + t)
#define WRITE(t) sums[t] = total[t]
#define EACH(DO) DO(0); DO(1); DO(2); DO(3); DO(4); DO(5); DO(6); DO(7)

void main()
{
    ivec2 place = ivec2(gl_FragCoord.xy) - first_texel;
    GatherPoint point = fetch_point(place);
    vec4 total[8];
    for (int t = 0; t < 8; ++t)
        total[t] = vec4(0.0);
    int i = 0;
    do {
        PointHit hit = fetch_hit(point, place, i);
        vec3 position = point.position + hit.distance * hit.direction;
        float basis[COEFFICIENTS];
        harmonics(hit.direction, basis);
#ifdef TRANSFER
        float weight = cosine(point, hit.direction);
        vec3 incident = vec3(hit.triangle == 0 ? weight : 0.0);
        EACH(ADD);
#ifdef GATHERED
        if (hit.triangle > 0 && weight > 0.0) {
            Surface surface = fetch_surface(hit.triangle - 1);
            vec3 back = dot(surface.normal, hit.direction) < 0.0 ? weight * albedo(surface, position) : vec3(0.0);
            Carriers carriers = fetch_carriers(hit.triangle - 1, position);
            EACH(ADD_GATHERED);
        }
#endif
#else
        vec3 incident = hit.triangle == 0 ? hit.beyond : vec3(0.0);
        if (dot(point.surface_normal, hit.direction) <= 0.0) {
            incident = vec3(0.0);
        } else if (hit.triangle > 0) {
            Surface surface = fetch_surface(hit.triangle - 1);
            incident = hit_radiance(hit.triangle - 1, position, hit.direction);
            if (dot(surface.normal, hit.direction) < 0.0)
                incident += emission(surface);
        }
        EACH(ADD);
#endif
    } while (++i < direction_count);
    EACH(WRITE);
}
