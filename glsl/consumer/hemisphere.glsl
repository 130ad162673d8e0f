// Consumer: adds hemisphere integrals that are sums over hits (additive blending); with RADIANCE also their radiance. Mirrors src/bake/integrals.rs.

#include "include/surface.glsl"
#ifdef RADIANCE
#include "include/radiance.glsl"
#endif

uniform float open_distance;        // a hit farther away leaves the point open

layout(location = 0) out vec4 reflected;    // rgb: radiance of surfaces x weight; a: weight
layout(location = 1) out vec4 sky;          // rgb: radiance of the environment x weight; a: weight of misses
layout(location = 2) out vec4 open;         // of rays without a near hit: xyz: unit direction x weight; a: weight
layout(location = 3) out vec4 counts;       // x: weight of hits on the back of a surface; y: number of directions in the hemisphere

void begin()
{
    reflected = sky = open = counts = vec4(0.0);
}

void consume(GatherPoint point, PointHit hit, int i)
{
    float weight = cosine(point, hit.direction);
    bool missed = hit.triangle == 0;
    if (weight > 0.0 && !missed) {
        Surface surface = fetch_surface(hit.triangle - 1);
        counts.x += dot(surface.normal, hit.direction) > 0.0 ? weight : 0.0;
#ifdef RADIANCE
        reflected.rgb += weight * hit_radiance(hit.triangle - 1, hit.position, hit.direction);
#endif
    }
    reflected.a += weight;
    sky += missed ? weight * vec4(miss_radiance(hit, i), 1.0) : vec4(0.0);
    open += missed || hit.distance > open_distance ? weight * vec4(hit.direction, 1.0) : vec4(0.0);
    counts.y += dot(point.surface_normal, hit.direction) > 0.0 ? 1.0 : 0.0;
}
