#version 330 core
// Integrals over the hemispheres of points that are plain sums over their hits (additive blending). With RADIANCE also what hits send back.
// Mirrors src/bake/integrals.rs.

#include "points.glsl"
#include "hits.glsl"
#ifdef RADIANCE
#include "radiance.glsl"
#else
#include "surface.glsl"
#endif

uniform ivec2 first_texel;          // always 0: points of bakes have no subsets
uniform float open_distance;        // beyond it what is met does not close the point in

layout(location = 0) out vec4 reflected;    // rgb: radiance of surfaces x weight; a: weight
layout(location = 1) out vec4 sky;          // rgb: radiance of the environment x weight; a: weight of what leaves the scene
layout(location = 2) out vec4 open;         // xyz: unit direction x weight of what meets nothing near; a: that weight
layout(location = 3) out vec4 counts;       // weight of hits from behind; number of directions in the hemisphere

void main()
{
    ivec2 place = ivec2(gl_FragCoord.xy) - first_texel;
    GatherPoint point = fetch_point(place);
    reflected = sky = open = counts = vec4(0.0);
    int i = 0;
    do {
        PointHit hit = fetch_hit(point, place, i);
        float weight = cosine(point, hit.direction);
        bool missed = hit.triangle == 0;
        if (weight > 0.0 && !missed) {
            Surface surface = fetch_surface(hit.triangle - 1);
            counts.x += dot(surface.normal, hit.direction) > 0.0 ? weight : 0.0;
#ifdef RADIANCE
            reflected.rgb += weight * hit_radiance(hit.triangle - 1, point.position + hit.distance * hit.direction, hit.direction);
#endif
        }
        reflected.a += weight;
        sky += missed ? weight * vec4(hit.beyond, 1.0) : vec4(0.0);
        open += missed || hit.distance > open_distance ? weight * vec4(hit.direction, 1.0) : vec4(0.0);
        counts.y += dot(point.surface_normal, hit.direction) > 0.0 ? 1.0 : 0.0;
    } while (++i < direction_count);
}
