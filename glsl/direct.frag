#version 330 core
// Irradiance from one sample on a light, with its shadow map (additive blending). Mirrors src/direct.rs.
//
// The light's frame has its origin at the sample and z along the emitting normal. The map is a hemicube in one texture: the face across z, then,
// one above the other, the upper halves of the faces across +x, -x, +y, -y.

#include "include/points.glsl"

uniform ivec2 first_texel;          // of the subset in the sums
uniform sampler2D shadow_map;
uniform mat4 to_light;              // unit space to the light's frame
uniform vec3 intensity;             // radiance x area / probability of the sample
uniform float depth_bias;            // as in layer.glsl, per unit of distance

layout(location = 0) out vec4 irradiance;

void main()
{
    GatherPoint point = fetch_point(ivec2(gl_FragCoord.xy) - first_texel);
    vec3 place = (to_light * vec4(point.position, 1.0)).xyz;
    if (!point.exists || place.z <= 0.0)
        discard;
    float squared = dot(place, place);
    mat3 rotation = mat3(to_light);
    float cosine_here = cosine(point, transpose(rotation) * (-place * inversesqrt(squared)));
    if (cosine_here == 0.0)
        discard;

    // The face that sees the point: its axes right, up and outward, and its rows in the map.
    float size = float(textureSize(shadow_map, 0).x);
    vec2 side = abs(place.xy);
    vec3 right, outward, up = vec3(0.0, 0.0, 1.0);
    float first_row, half_face;
    if (place.z >= max(side.x, side.y)) {
        right = vec3(1.0, 0.0, 0.0);
        up = vec3(0.0, 1.0, 0.0);
        outward = vec3(0.0, 0.0, 1.0);
        first_row = 0.0;
        half_face = 0.0;
    } else if (side.x >= side.y) {
        float s = place.x > 0.0 ? 1.0 : -1.0;
        right = vec3(0.0, s, 0.0);
        outward = vec3(s, 0.0, 0.0);
        first_row = (place.x > 0.0 ? 1.0 : 1.5) * size;
        half_face = 1.0;
    } else {
        float s = place.y > 0.0 ? 1.0 : -1.0;
        right = vec3(-s, 0.0, 0.0);
        outward = vec3(0.0, s, 0.0);
        first_row = (place.y > 0.0 ? 2.0 : 2.5) * size;
        half_face = 1.0;
    }
    float distance = dot(outward, place);
    vec2 on_face = vec2(dot(right, place), dot(up, place)) / distance;
    vec2 origin = vec2(0.0, first_row - half_face * 0.5 * size);
    vec2 at = origin + (0.5 * on_face + 0.5) * size;
    vec2 low = vec2(0.0, first_row);
    vec2 high = vec2(size, first_row + (half_face > 0.0 ? 0.5 : 1.0) * size) - 1.0;
    vec2 texel = clamp(floor(at), low, high);

    // As in layer.glsl, the point is in shadow when two things hold: the occluder's plane lies before the point on the point's own ray, and the
    // occluder lies above the point's tangent plane.
    vec4 plane = texelFetch(shadow_map, ivec2(texel), 0);
    float inverse = plane.x + dot(plane.yz, at - (texel + 0.5));
    if (plane.x > 0.0 && inverse * distance > 1.0) {
        vec2 centre = (texel + 0.5 - origin) / size * 2.0 - 1.0;
        vec3 occluder = (outward + centre.x * right + centre.y * up) / plane.x;
        if (dot(rotation * point.surface_normal, occluder - place) > depth_bias * distance)
            discard;
    }
    irradiance = vec4(intensity * cosine_here * place.z * inversesqrt(squared) / squared, 1.0);
}
