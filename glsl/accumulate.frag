#version 330 core
// Adds one direction's samples, cosine-weighted, to the sums (additive blending). Mirrors src/gather/accumulate.rs.

#include "points.glsl"

uniform sampler2D samples;
uniform vec3 direction;

layout(location = 0) out vec4 sum;  // rgb: radiance x weight; a: weight

void main()
{
    GatherPoint point = fetch_point();
    if (!point.exists)
        discard;
    vec3 radiance = texelFetch(samples, ivec2(gl_FragCoord.xy), 0).rgb;
    sum = vec4(radiance, 1.0) * cosine(point, direction);
}
