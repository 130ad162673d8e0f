// The albedo of a hit. Mirrors `Geometry` in src/geometry.rs.

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

// The albedo of a surface at a position: bilinear, repeated, without mipmaps. A hit may need any of many textures, more than a shader has samplers.
vec3 albedo(Surface surface, vec3 position)
{
    ivec2 texel = table_texel(surface.material);
    vec4 plain = texelFetch(materials, texel, 0);
    if (plain.a == 0.0)
        return plain.rgb;
    vec4 entry = texelFetch(materials, texel + ivec2(2, 0), 0);     // width, height, first row
    ivec2 size = ivec2(entry.xy);
    vec2 place = fract(texture_coordinates(surface, position)) * entry.xy - 0.5;
    vec2 share = fract(place);
    ivec2 low = ivec2(floor(place));
    ivec2 high = low + 1;
    low += ivec2(lessThan(low, ivec2(0))) * size;
    high -= ivec2(greaterThanEqual(high, size)) * size;
    int row = int(entry.z);
    vec3 first = mix(albedo_texel(row, size, low), albedo_texel(row, size, ivec2(high.x, low.y)), share.x);
    vec3 second = mix(albedo_texel(row, size, ivec2(low.x, high.y)), albedo_texel(row, size, high), share.x);
    return plain.rgb * mix(first, second, share.y);
}

#else

vec3 albedo(Surface surface, vec3 position)
{
    return plain_albedo(surface);
}

#endif
