// The albedo and the emission of a hit. Mirrors `Geometry` in src/geometry.rs.

#include "include/surface.glsl"

#ifdef TEXTURED

uniform sampler2D albedo_texels;    // all albedo textures, one after the other; each begins at a new row
uniform int albedo_shift;           // the width of albedo_texels is 2 to this power

// The texel at `place` of an albedo texture of this size, which begins at `row` of albedo_texels.
vec3 albedo_texel(int row, ivec2 size, ivec2 place)
{
    int index = place.y * size.x + place.x;
    return texelFetch(albedo_texels, ivec2(index & ((1 << albedo_shift) - 1), row + (index >> albedo_shift)), 0).rgb;
}

// Coordinates within 0 to 1. Modes along each axis: 0 repeat, 1 mirror, 2 clamp. Mirrors `WrapMode` in src/scene/texture.rs.
vec2 wrapped(vec2 place, ivec2 modes)
{
    vec2 mirrored = 1.0 - abs(1.0 - mod(place, 2.0));
    vec2 inside = mix(fract(place), mirrored, equal(modes, ivec2(1)));
    return mix(inside, clamp(place, 0.0, 1.0), equal(modes, ivec2(2)));
}

// The colour of an albedo texture: bilinear or nearest, without mipmaps. `entry` is width, height, first row and sampler, see `sampler_code` in
// src/geometry.rs. A hit may need any of many textures, more than a shader has samplers.
vec3 albedo_texture_color(vec4 entry, vec2 coordinates)
{
    int sampling = int(entry.w);
    ivec2 size = ivec2(entry.xy);
    vec2 inside = fract(coordinates);
    // The step from one edge to the texel beyond it: to the other edge, or back.
    ivec2 over = size;
    if (sampling != 0)
    {
        ivec2 modes = ivec2(sampling, sampling >> 2) & 3;
        inside = wrapped(coordinates, modes);
        over = ivec2(equal(modes, ivec2(0))) * (size - 1) + 1;
    }
    vec2 place = inside * entry.xy - 0.5;
    vec2 share = fract(place);
    if ((sampling & 16) != 0)
        share = floor(share + 0.5);
    ivec2 low = ivec2(floor(place));
    ivec2 high = low + 1;
    low += ivec2(lessThan(low, ivec2(0))) * over;
    high -= ivec2(greaterThanEqual(high, size)) * over;
    int row = int(entry.z);
    vec3 first = mix(albedo_texel(row, size, low), albedo_texel(row, size, ivec2(high.x, low.y)), share.x);
    vec3 second = mix(albedo_texel(row, size, ivec2(low.x, high.y)), albedo_texel(row, size, high), share.x);
    return mix(first, second, share.y);
}

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
        color *= albedo_texture_color(texelFetch(materials, texel + ivec2(2, 0), 0), texture_coordinates(surface, position));
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
        emitted *= albedo_texture_color(entry, texture_coordinates(surface, position));
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
