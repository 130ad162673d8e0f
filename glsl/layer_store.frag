#version 330 core
// Peeling into the layer store: as peel.frag, for the tiles of several directions at once. Mirrors src/gather/layer_store.rs.

flat in int surface_triangle;

uniform sampler2D previous_depth;   // of the layer before

// Twice the same 64 bits, of which the draw writes one half: 24 of the depth along the direction, then of its change to the next texel in x
// and in y the upper 20 of a float.
layout(location = 0) out uvec4 planes;
layout(location = 1) out uint triangle;

void main()
{
    float depth = gl_FragCoord.z;
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
#ifndef FARTHEST
    // The depth buffer holds what the same arithmetic made at the same place: equality is exact, as in peel.frag.
    if (depth >= texelFetch(previous_depth, ivec2(gl_FragCoord.xy), 0).x)
        discard;
#endif
    uvec2 bits = floatBitsToUint(slope) + 0x800u;       // rounded: off by 1/4096 at most
    planes = uvec2(uint(depth * 16777216.0) << 8 | bits.x >> 24, (bits.x & 0x00fff000u) << 8 | bits.y >> 12).xyxy;
    triangle = uint(surface_triangle);
}
