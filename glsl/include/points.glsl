// Gather points: two RGBA32F textures, a texel a point. Mirrors src/points/mod.rs.

#include "include/octahedral.glsl"

uniform sampler2D point_position;   // xyz: position; w: geometric normal, octahedral x
uniform sampler2D point_normal;     // xyz: unit shading normal, zero where there is no point; w: octahedral y
uniform int point_stride;           // a subset of the points: every so many along each axis,
uniform ivec2 point_offset;         // from here on

struct GatherPoint
{
    bool exists;
    vec3 position;
    vec3 normal;                    // shading normal: the hemisphere that is integrated
    vec3 surface_normal;            // unit geometric normal on the same side: the surface the point lies on
};

// The point that the fragment at `place` of a target for one subset is about.
GatherPoint fetch_point(ivec2 place)
{
    ivec2 texel = place * point_stride + point_offset;
    if (any(greaterThanEqual(texel, textureSize(point_position, 0))))
        return GatherPoint(false, vec3(0.0), vec3(0.0), vec3(0.0));
    vec4 position = texelFetch(point_position, texel, 0);
    vec4 normal = texelFetch(point_normal, texel, 0);
    vec3 surface_normal = normalize(octahedral_decode(vec2(position.w, normal.w)));
    return GatherPoint(dot(normal.xyz, normal.xyz) > 0.0, position.xyz, normal.xyz, surface_normal);
}

// The cosine weight of a unit direction, 0 where it leaves through the surface itself.
float cosine(GatherPoint point, vec3 direction)
{
    return dot(point.surface_normal, direction) > 0.0 ? max(dot(point.normal, direction), 0.0) : 0.0;
}
