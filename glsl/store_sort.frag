#version 420 core
// Sorts the lists of store_append.frag into slots of the layer store, as peeling would fill them: surfaces far to near, each depth once. Reads a list
// once for every four slots: lists are short, and a fetch costs more than a comparison. Mirrors src/gather/layer_store/sort.rs.

#include "include/packed_surface.glsl"

uniform usampler2D counts;
uniform usampler2DArray lists;
uniform int list_limit;
uniform ivec2 first_texel;          // of these tiles in the store
layout(rgba32ui) writeonly uniform uimage2DArray planes;
layout(rgba32ui) writeonly uniform uimage2DArray stored_triangles;
layout(r32ui) uniform uimage2D deepest;     // length of the longest list
uniform int granted;                        // shorter lists need not write to `deepest`

// Puts the farther surface into the slot and hands on the other. Depths are positive, so their bits grow with them. Of two surfaces at one depth
// the one drawn first stays, as with a depth test.
void insert(inout uvec4 slot, inout uvec4 surface)
{
    bool farther = surface.x > slot.x || surface.x == slot.x && surface.w < slot.w;
    uvec4 other = farther ? slot : surface;
    slot = farther ? surface : slot;
    surface = other.x == slot.x ? uvec4(0u) : other;
}

uvec2 packed_bits(uvec4 surface)
{
    return surface.x == 0u ? uvec2(0u) : pack_surface(uintBitsToFloat(surface.x), surface.yz);
}

void main()
{
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int count = int(texelFetch(counts, texel, 0).x);
    if (count > granted)
        imageAtomicMax(deepest, ivec2(0), uint(count));
    count = min(count, list_limit);
    uint nearest = 0xffffffffu;         // depth of the nearest surface so far
    int slot = 0;
    do {
        uvec4 a = uvec4(0u), b = a, c = a, d = a;
        int i = 0;
        do {
            uvec4 surface = texelFetch(lists, ivec3(texel, i), 0);
            if (i >= count || surface.x >= nearest)
                surface = uvec4(0u);
            insert(a, surface);
            insert(b, surface);
            insert(c, surface);
            insert(d, surface);
        } while (++i < count);
        imageStore(planes, ivec3(first_texel + texel, slot >> 1), uvec4(packed_bits(a), packed_bits(b)));
        if (c.x > 0u)
            imageStore(planes, ivec3(first_texel + texel, (slot >> 1) + 1), uvec4(packed_bits(c), packed_bits(d)));
        imageStore(stored_triangles, ivec3(first_texel + texel, slot >> 2), uvec4(a.w, b.w, c.w, d.w));
        nearest = d.x;
        slot += 4;
    } while (nearest > 0u && slot < list_limit);
}
