// Gather points: two RGBA32F textures, one texel for a point. Mirrors src/points/mod.rs.

#include "include/octahedral.glsl"
#ifdef GLOSS
#include "include/gloss.glsl"
#endif

uniform sampler2D point_position;   // xyz: position; w: geometric normal, octahedral x
uniform sampler2D point_normal;     // xyz: unit shading normal, zero where there is no point; w: octahedral y
uniform int point_stride;           // step between the points of a subset, along each axis
uniform ivec2 point_offset;         // texel of the subset's first point

struct GatherPoint
{
    bool exists;
    vec3 position;
    vec3 normal;                    // unit shading normal, the axis of the hemisphere to integrate
    vec3 surface_normal;            // unit geometric normal of the point's surface, on the same side
#ifdef GLOSS
    Gloss gloss;
#endif
};

// The point of the fragment at `place` in the target of one subset.
GatherPoint fetch_point(ivec2 place)
{
    ivec2 texel = place * point_stride + point_offset;
    if (any(greaterThanEqual(texel, textureSize(point_position, 0))))
#ifdef GLOSS
        return GatherPoint(false, vec3(0.0), vec3(0.0), vec3(0.0), Gloss(vec3(0.0), 0.0, vec3(0.0), 0.0));
#else
        return GatherPoint(false, vec3(0.0), vec3(0.0), vec3(0.0));
#endif
    vec4 position = texelFetch(point_position, texel, 0);
    vec4 normal = texelFetch(point_normal, texel, 0);
    vec3 surface_normal = normalize(octahedral_decode(vec2(position.w, normal.w)));
    bool exists = dot(normal.xyz, normal.xyz) > 0.0;
#ifdef GLOSS
    return GatherPoint(exists, position.xyz, normal.xyz, surface_normal, fetch_gloss(texel));
#else
    return GatherPoint(exists, position.xyz, normal.xyz, surface_normal);
#endif
}

// The cosine weight of a unit direction; 0 for directions below the surface.
float cosine(GatherPoint point, vec3 direction)
{
    return dot(point.surface_normal, direction) > 0.0 ? max(dot(point.normal, direction), 0.0) : 0.0;
}
