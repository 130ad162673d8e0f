#version 420 core
// Collects every surface of some tiles of the layer store in one pass over the geometry: appends each fragment to its texel's list, in any order.
// store_sort.frag sorts the lists. Mirrors src/gather/layer_store/sort.rs.

#ifdef CUT_OUTS
#include "include/cut_fragment.glsl"
#endif

flat in int surface_triangle;

layout(r32ui) uniform uimage2D counts;
layout(rgba32ui) writeonly uniform uimage2DArray lists;     // bits of: depth, its change to the next texel in x and in y, triangle
uniform int list_limit;             // later fragments are counted but not stored

void main()
{
    float depth = gl_FragCoord.z;
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
#ifdef CUT_OUTS
    if (is_cut_fragment(surface_triangle))
        discard;
#endif
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int place = int(imageAtomicAdd(counts, texel, 1u));
    if (place < list_limit)
        imageStore(lists, ivec3(texel, place), uvec4(floatBitsToUint(depth), floatBitsToUint(slope), surface_triangle));
}
