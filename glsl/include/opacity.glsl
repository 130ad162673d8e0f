// How much of the light a surface stops, and whether it stops one ray. Mirrors src/scene/opacity.rs.

#include "include/surface.glsl"
#include "include/texture.glsl"

// Whether a triangle may be cut somewhere.
bool is_cut_out(int triangle)
{
    return texelFetch(triangles, table_texel(triangle) + ivec2(3, 0), 0).y > 0.0;
}

// The share of the light, from 0 to 1, that a triangle stops at a position on it.
float opacity(int triangle, vec3 position)
{
    Surface surface = fetch_surface(triangle);
    ivec2 texel = material_texel(surface);
    vec4 entry = texelFetch(materials, texel + ivec2(4, 0), 0);
    vec2 share = texelFetch(materials, texel + ivec2(5, 0), 0).xy;
    float stopped = share.x;
    if (entry.x > 0.0)
        stopped *= texture_color(entry, texture_coordinates(surface, position)).a;
    return share.y < 0.0 ? stopped : float(stopped >= share.y);
}

// The twin of `hash` in src/random.rs.
uint hashed(uint bits)
{
    bits = (bits ^ (bits >> 16)) * 0x7feb352du;
    bits = (bits ^ (bits >> 15)) * 0x846ca68bu;
    return bits ^ (bits >> 16);
}

// In [0, 1): a triangle of at most this opacity is cut. `reversed_number` is the number of the choice in its stream, with its bits reversed. The twin of
// `Chance::threshold`, and of `stratified` in src/random.rs.
float threshold(int triangle, uint stream, uint reversed_number)
{
    uint index = uint(texelFetch(triangles, table_texel(triangle) + ivec2(3, 0), 0).x);
    uint x = reversed_number + hashed(index ^ hashed(stream));
    x ^= x * 0x6c50b47cu;
    x ^= x * 0xb82f1e52u;
    x ^= x * 0xc7afe638u;
    x ^= x * 0x8d22f6e6u;
    return float(x >> 8) / 16777216.0;
}

// Whether a ray passes through a triangle at a position on it.
bool is_cut(int triangle, vec3 position, uint stream, uint reversed_number)
{
    return is_cut_out(triangle) && opacity(triangle, position) <= threshold(triangle, stream, reversed_number);
}
