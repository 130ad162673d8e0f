#version 330 core
// The end of a direction: looks up the radiance of each point's hit and adds it, cosine-weighted, to the sums (additive blending).
// Mirrors src/gather/accumulate.rs.

#include "points.glsl"
#include "radiance.glsl"

uniform sampler2DArray hits;        // as kill.frag writes them, one element
uniform ivec2 first_texel;          // of the subset in the sums
uniform vec3 direction;
uniform vec3 beyond;                // radiance of what lies beyond all surfaces

layout(location = 0) out vec4 sum;  // rgb: radiance x weight; a: weight

void main()
{
    ivec2 place = ivec2(gl_FragCoord.xy) - first_texel;
    GatherPoint point = fetch_point(place);
    if (!point.exists)
        discard;
    vec2 hit = texelFetch(hits, ivec3(place, 0), 0).xy;
    vec3 radiance = beyond;
    if (hit.y > 0.0)
        radiance = hit_radiance(int(hit.y) - 1, point.position + hit.x * direction, direction);
    sum = vec4(radiance, 1.0) * cosine(point, direction);
}
