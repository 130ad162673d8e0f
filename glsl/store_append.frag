#version 420 core
// Every surface of some tiles of the layer store in one pass over the geometry: each fragment is appended to its texel's list, in whatever order
// they come; store_sort.frag puts them in theirs. Mirrors src/gather/layer_store/sort.rs.

flat in int surface_triangle;

layout(r32ui) uniform uimage2D counts;
layout(rgba32ui) writeonly uniform uimage2DArray lists;     // bits of: depth, its change to the next texel in x and in y, triangle
uniform int list_limit;             // what comes later is counted alone

void main()
{
    float depth = gl_FragCoord.z;
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
    ivec2 texel = ivec2(gl_FragCoord.xy);
    int place = int(imageAtomicAdd(counts, texel, 1u));
    if (place < list_limit)
        imageStore(lists, ivec3(texel, place), uvec4(floatBitsToUint(depth), floatBitsToUint(slope), surface_triangle));
}
