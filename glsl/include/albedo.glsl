// The albedo and the emission of a hit. Mirrors `Geometry` in src/geometry.rs.

#include "include/surface.glsl"

#ifdef TEXTURED

#include "include/texture.glsl"

// The albedo of a triangle at a position.
vec3 albedo(int triangle, Surface surface, vec3 position)
{
    ivec2 texel = material_texel(surface);
    vec4 plain = texelFetch(materials, texel, 0);
    int varied = int(plain.a);
    vec3 color = plain.rgb;
    if ((varied & 2) != 0)
        color *= vertex_color(triangle, position);
    if ((varied & 1) != 0)
        color *= texture_color(texelFetch(materials, texel + ivec2(2, 0), 0), texture_coordinates(surface, position)).rgb;
    if ((varied & 4) != 0)
        color = color * texelFetch(materials, texel + ivec2(7, 0), 0).rgb + texelFetch(materials, texel + ivec2(3, 0), 0).rgb;
    return color;
}

// What the picture of emission of a surface, if it has one, makes of `emitted` at a position.
vec3 pictured_emission(vec3 emitted, Surface surface, vec3 position)
{
    vec4 entry = texelFetch(materials, material_texel(surface) + ivec2(6, 0), 0);
    // Software drivers skip loops, not branches.
    for (bool left = entry.x > 0.0 && emitted != vec3(0.0); left; left = false)
        emitted *= texture_color(entry, texture_coordinates(surface, position)).rgb;
    return emitted;
}

// The radiance that the front or the back emits at a position. The twin of `Scene::emission` in src/scene/mod.rs.
vec3 emission(Surface surface, bool front, vec3 position)
{
    return pictured_emission(plain_emission(surface, front), surface, position);
}

#else

vec3 emission(Surface surface, bool front, vec3 position)
{
    return plain_emission(surface, front);
}

vec3 albedo(int triangle, Surface surface, vec3 position)
{
    return plain_albedo(surface);
}

#endif
