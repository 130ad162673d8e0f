#version 330 core
// Irradiance from a batch of samples on the lights, with exact shadow rays (additive blending). With PUNCTUAL some samples may lie on no surface. With
// GLOSS, irradiance is what passes a point's lobe, and what the lobe reflects is a sum of its own. Mirrors src/direct.rs, and `LightSample` in
// src/scene/light/mod.rs.

#include "include/points.glsl"
#include "include/bvh.glsl"

#define LIGHTS 32

uniform ivec2 first_texel;          // of the subset in the sums
uniform vec4 light_places[LIGHTS];  // w 1: position; 2: without a surface; w 0: unit vector towards a light outside the scene
uniform vec4 light_normals[LIGHTS]; // unit normal of the emitting side; outside the scene the vector towards it, turned round; w: scale of a cone
uniform vec4 light_weights[LIGHTS]; // radiance over the density of the sample, per area or per solid angle; w: offset of a cone
uniform int sample_count;
uniform int ray_samples;            // samples that share a ray; the last ray may have fewer
uniform float choice;               // in [0, 1): to which of its samples the first ray goes; each point shifts it

const float GOLDEN = 0.618034;      // its multiples fill the unit interval evenly
#ifdef PUNCTUAL
const float LIGHT_OFFSET = 2e-6;    // before a light without a surface a shadow ray ends so early, as in src/scene/light/mod.rs
#endif

layout(location = 0) out vec4 irradiance;
#ifdef GLOSS
layout(location = 1) out vec4 reflected;    // rgb: radiance of the lobe
#endif

// A number in [0, 1) from a position.
float hash(vec3 position)
{
    uvec3 bits = floatBitsToUint(position) * uvec3(73856093u, 19349663u, 83492791u);
    uint h = bits.x ^ bits.y ^ bits.z;
    h = (h ^ (h >> 16)) * 0x7feb352du;
    h = (h ^ (h >> 15)) * 0x846ca68bu;
    return float((h ^ (h >> 16)) >> 8) / 16777216.0;
}

void main()
{
    GatherPoint point = fetch_point(ivec2(gl_FragCoord.xy) - first_texel);
    if (!point.exists)
        discard;
    vec3 origin = point.position + RAY_OFFSET * point.surface_normal;
    float first = choice + hash(point.position);
    vec3 irradiance_sum = vec3(0.0);
#ifdef GLOSS
    vec3 reflected_sum = vec3(0.0);
#endif
    int i = 0;
    do {
        float left = fract(first);                          // renewed by what remains of it after each decision
        first += GOLDEN;
        vec3 sum = vec3(0.0);
#ifdef GLOSS
        vec3 lobe_sum = vec3(0.0);
#endif
        float total = 0.0;
        vec4 chosen = vec4(0.0, 0.0, 1.0, NOWHERE);         // xyz: direction; w: reach
        int end = min(i + ray_samples, sample_count);
        do {
            bool near = light_places[i].w > 0.0;
            vec3 way = light_places[i].xyz - (near ? origin : vec3(0.0));
            float distance = length(way);
            vec3 direction = way / distance;
            float emitted = max(-dot(light_normals[i].xyz, direction), 0.0);
#ifdef PUNCTUAL
            float cone = clamp(light_weights[i].w - light_normals[i].w * dot(light_normals[i].xyz, direction), 0.0, 1.0);
            emitted = light_places[i].w > 1.0 ? cone * cone : emitted;
#endif
            float received = cosine(point, direction) * emitted / (near ? distance * distance : 1.0);
#ifdef PUNCTUAL
            distance -= light_places[i].w > 1.0 ? LIGHT_OFFSET : 0.0;
#endif
            // At a distance of 0 it is no number.
            vec3 light = received > 0.0 ? received * light_weights[i].rgb : vec3(0.0);
#ifdef GLOSS
            // Eye rays that follow a lobe meet all other lights.
            bool unseen = light_places[i].w > 1.0 || light_weights[i].w > 0.0;
            LobeWeights weights = lobe_weights(point.gloss, point.normal, direction, point.gloss.counts > 0.0 || unseen);
            vec3 lobe = received > 0.0 ? light * weights.lobe : vec3(0.0);
            light *= weights.base;
            lobe_sum += lobe;
            // In this measure a white base and the lobe count alike.
            float power = dot(light + 3.14159265 * lobe, vec3(1.0));
#else
            float power = light.r + light.g + light.b;
#endif
            sum += light;
            total += power;
            float share = power > 0.0 ? power / total : 0.0;
            bool takes = left < share;
            chosen = takes ? vec4(direction, near ? distance : FARTHEST) : chosen;
            left = takes ? left / share : (left - share) / max(1.0 - share, 1e-7);
        } while (++i < end);
        BvhHit hit = nearest_hit(origin, chosen.xyz, chosen.w);
        irradiance_sum += hit.place < 0 ? sum : vec3(0.0);
#ifdef GLOSS
        reflected_sum += hit.place < 0 ? lobe_sum : vec3(0.0);
#endif
    } while (i < sample_count);
    irradiance = vec4(irradiance_sum, 1.0);
#ifdef GLOSS
    reflected = vec4(reflected_sum, 1.0);
#endif
}
