#version 330 core
// Irradiance from a batch of samples on the lights, with exact shadow rays (additive blending). With PUNCTUAL some samples may lie on no surface. With
// GLOSS, irradiance is what passes a point's lobe, and what the lobe reflects is a sum of its own. With MANY_LIGHTS each point chooses lamps by a tree.
// Mirrors src/direct/on_gl.rs; its twins are src/direct/on_cpu.rs, and `LightSample` in src/scene/light/mod.rs.

#include "include/points.glsl"
#include "include/bvh.glsl"

#define LIGHTS 32

uniform ivec2 first_texel;          // of the subset in the sums
#ifdef MANY_LIGHTS
#include "include/light_tree.glsl"
uniform vec4 lamp_numbers[LIGHTS];  // of a sample by the tree: xy: uniform; z: its factor
#else
uniform vec4 light_places[LIGHTS];  // w 0: unit vector towards a light outside the scene; 1: position; 2: of a cone; 3: centre of a sphere
uniform vec4 light_normals[LIGHTS]; // unit normal of the emitting side; outside the scene the vector towards it, turned round; of a cone its axis,
                                    // w: its scale; of a sphere a point of the unit disc and the radius
uniform vec4 light_weights[LIGHTS]; // radiance over the density of the sample, per area or per solid angle; w: offset of a cone, 1 if no ray meets it
#endif
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

#ifdef PUNCTUAL
// A vector of the unit hemisphere about `axis`, from a point of its disc. The frame is that of `math::frame`.
vec3 on_hemisphere(vec3 axis, vec2 disc)
{
    float side = axis.z < 0.0 ? -1.0 : 1.0;
    float a = -1.0 / (side + axis.z);
    float b = axis.x * axis.y * a;
    vec3 x = vec3(1.0 + side * axis.x * axis.x * a, side * b, -side * axis.x);
    vec3 y = vec3(b, side + axis.y * axis.y * a, -axis.y);
    return disc.x * x + disc.y * y + sqrt(max(1.0 - dot(disc, disc), 0.0)) * axis;
}
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
#ifdef MANY_LIGHTS
            vec4 ray;
            vec3 light = lamp_light(point, origin, lamp_numbers[i].xyz, ray);
            const bool unseen = false;
#else
            bool near = light_places[i].w > 0.0;
            vec3 place = light_places[i].xyz;
#ifdef PUNCTUAL
            // Samples of a sphere lie on the side that the point sees.
            vec3 axis = normalize(origin - place);
            vec3 normal = on_hemisphere(axis, light_normals[i].xy);
            bool sphere = light_places[i].w > 2.0;
            place += sphere ? light_normals[i].z * normal : vec3(0.0);
#endif
            vec3 way = place - (near ? origin : vec3(0.0));
            float distance = length(way);
            vec3 direction = way / distance;
            float emitted = max(-dot(light_normals[i].xyz, direction), 0.0);
#ifdef PUNCTUAL
            float cone = clamp(light_weights[i].w - light_normals[i].w * dot(light_normals[i].xyz, direction), 0.0, 1.0);
            emitted = light_places[i].w > 1.0 ? cone * cone : emitted;
            emitted = sphere ? max(-dot(normal, direction), 0.0) / max(dot(normal, axis), 1e-6) : emitted;
#endif
            float received = cosine(point, direction) * emitted / (near ? distance * distance : 1.0);
#ifdef PUNCTUAL
            distance -= light_places[i].w > 1.0 ? LIGHT_OFFSET : 0.0;
#endif
            // At a distance of 0 it is no number.
            vec3 light = received > 0.0 ? received * light_weights[i].rgb : vec3(0.0);
            vec4 ray = vec4(direction, near ? distance : FARTHEST);
            // Eye rays that follow a lobe meet all other lights.
            bool unseen = light_places[i].w > 1.0 || light_weights[i].w > 0.0;
#endif
#ifdef GLOSS
            LobeWeights weights = lobe_weights(point.gloss, point.normal, ray.xyz, point.gloss.counts > 0.0 || unseen);
            vec3 lobe = light != vec3(0.0) ? light * weights.lobe : vec3(0.0);
            light = light != vec3(0.0) ? light * weights.base : vec3(0.0);
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
            chosen = takes ? ray : chosen;
            left = takes ? left / share : (left - share) / max(1.0 - share, 1e-7);
        } while (++i < end);
        BvhHit hit = nearest_hit(origin, chosen.xyz, chosen.w);
#ifdef CUT_OUTS
        irradiance_sum += hit.passed * sum;
#else
        irradiance_sum += hit.place < 0 ? sum : vec3(0.0);
#endif
#ifdef GLOSS
#ifdef CUT_OUTS
        reflected_sum += hit.passed * lobe_sum;
#else
        reflected_sum += hit.place < 0 ? lobe_sum : vec3(0.0);
#endif
#endif
    } while (i < sample_count);
    irradiance = vec4(irradiance_sum, 1.0);
#ifdef GLOSS
    reflected = vec4(reflected_sum, 1.0);
#endif
}
