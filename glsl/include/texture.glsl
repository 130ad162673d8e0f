// The colour of a texture at a hit. Mirrors `Geometry` in src/geometry.rs, and `ImageTexture` in src/scene/texture.rs.

uniform sampler2D albedo_texels;    // all textures, one after the other; each begins at a new row
uniform int albedo_shift;           // the width of albedo_texels is 2 to this power

// The texel at `place` of a texture of this size, which begins at `row` of albedo_texels.
vec4 texture_texel(int row, ivec2 size, ivec2 place)
{
    int index = place.y * size.x + place.x;
    return texelFetch(albedo_texels, ivec2(index & ((1 << albedo_shift) - 1), row + (index >> albedo_shift)), 0);
}

// Coordinates within 0 to 1. Modes along each axis: 0 repeat, 1 mirror, 2 clamp. Mirrors `WrapMode` in src/scene/texture.rs.
vec2 wrapped(vec2 place, ivec2 modes)
{
    vec2 mirrored = 1.0 - abs(1.0 - mod(place, 2.0));
    vec2 inside = mix(fract(place), mirrored, equal(modes, ivec2(1)));
    return mix(inside, clamp(place, 0.0, 1.0), equal(modes, ivec2(2)));
}

// The colour and alpha of a texture: bilinear or nearest, without mipmaps. `entry` is width, height, first row and sampler, see `sampler_code` in
// src/geometry.rs. A hit may need any of many textures, more than a shader has samplers.
vec4 texture_color(vec4 entry, vec2 coordinates)
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
    vec4 first = mix(texture_texel(row, size, low), texture_texel(row, size, ivec2(high.x, low.y)), share.x);
    vec4 second = mix(texture_texel(row, size, ivec2(low.x, high.y)), texture_texel(row, size, high), share.x);
    return mix(first, second, share.y);
}
