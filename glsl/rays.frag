#version 330 core
// Exact rays: each point casts one along every direction of a batch, towards the end on its side of the surface, and what the ray meets
// first is added to the point's sums (additive blending) or, with FIND, written down. Mirrors src/gather/rays.rs.

#include "points.glsl"
#ifdef FIND
#include "found.glsl"
#include "surface.glsl"
#else
#include "radiance.glsl"
#endif
#include "bvh.glsl"

uniform vec4 directions[BATCH];     // xyz
uniform int direction_count;        // at least 1
#ifdef FIND

const ivec2 first_texel = ivec2(0);

#else

uniform vec4 beyond[BATCH];         // rgb: radiance of what lies beyond all surfaces along each direction,
uniform vec4 behind[BATCH];         // and against it
uniform ivec2 first_texel;          // of the subset in the sums

layout(location = 0) out vec4 sum;  // rgb: radiance x weight; a: weight

#endif

const float RAY_OFFSET = 1e-6;      // as in src/scene/bvh.rs

void main()
{
    GatherPoint point = fetch_point(ivec2(gl_FragCoord.xy) - first_texel);
    vec3 origin = point.position + RAY_OFFSET * point.surface_normal;
#ifdef FIND
    vec2 found_hits[BATCH] = no_hits();
#else
    if (!point.exists)
        discard;
    sum = vec4(0.0);
#endif
    int i = 0;
    do {
        float side = dot(point.surface_normal, directions[i].xyz) < 0.0 ? -1.0 : 1.0;
        vec3 direction = side * directions[i].xyz;
        float weight = cosine(point, direction);
        BvhHit hit = nearest_hit(origin, direction, weight > 0.0 ? FARTHEST : NOWHERE);
#ifdef FIND
        found_hits[i] = vec2(hit.distance, hit.place < 0 ? 0 : triangle_at(hit.place) + 1);
#else
        vec3 radiance = hit_radiance(triangle_at(max(hit.place, 0)), origin + hit.distance * direction, direction);
        vec3 missed = (side > 0.0 ? beyond[i] : behind[i]).rgb;
        sum += vec4(hit.place < 0 ? missed : radiance, 1.0) * weight;
#endif
        ++i;
    } while (i < direction_count);
#ifdef FIND
    write_hits(found_hits);
#endif
}
