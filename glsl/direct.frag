#version 330 core
// Irradiance from a batch of samples on the lights, each with an exact shadow ray (additive blending). Mirrors src/direct.rs.

#include "include/points.glsl"
#include "include/bvh.glsl"

uniform ivec2 first_texel;          // of the subset in the sums
uniform vec4 light_places[BATCH];   // w 1: position; w 0: unit vector towards a light outside the scene
uniform vec4 light_normals[BATCH];  // unit normal of the emitting side; outside the scene the vector towards it, turned round
uniform vec4 light_weights[BATCH];  // radiance over the density of the sample, per area or per solid angle
uniform int sample_count;

layout(location = 0) out vec4 irradiance;

void main()
{
    GatherPoint point = fetch_point(ivec2(gl_FragCoord.xy) - first_texel);
    if (!point.exists)
        discard;
    vec3 origin = point.position + RAY_OFFSET * point.surface_normal;
    vec3 sum = vec3(0.0);
    int i = 0;
    do {
        bool near = light_places[i].w > 0.0;
        vec3 way = light_places[i].xyz - (near ? origin : vec3(0.0));
        float distance = length(way);
        vec3 direction = way / distance;
        float received = cosine(point, direction) * max(-dot(light_normals[i].xyz, direction), 0.0) / (near ? distance * distance : 1.0);
        float reach = near ? distance : FARTHEST;
        BvhHit hit = nearest_hit(origin, direction, received > 0.0 ? reach : NOWHERE);
        // Not the product alone: at a distance of 0 it is no number.
        sum += received > 0.0 && hit.place < 0 ? received * light_weights[i].rgb : vec3(0.0);
    } while (++i < sample_count);
    irradiance = vec4(sum, 1.0);
}
