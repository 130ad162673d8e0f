#version 330 core
// Peels into the layer store, as peel.frag does, but for the tiles of several directions at once. Mirrors src/gather/layer_store/peel.rs.

#ifdef CUT_OUTS
#include "include/cut_fragment.glsl"
#endif
#include "include/packed_surface.glsl"

flat in int surface_triangle;

uniform sampler2D previous_depth;   // of the layer before

layout(location = 0) out uvec4 planes;      // the surface twice; the draw writes one half
layout(location = 1) out uvec4 triangle;    // the triangle four times; the draw writes one

void main()
{
    float depth = gl_FragCoord.z;
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
#ifdef CUT_OUTS
    if (is_cut_fragment(surface_triangle))
        discard;
#endif
#ifndef FARTHEST
    // The same arithmetic made the depth in the buffer, at the same place: equality is exact, as in peel.frag.
    if (depth >= texelFetch(previous_depth, ivec2(gl_FragCoord.xy), 0).x)
        discard;
#endif
    planes = pack_surface(depth, floatBitsToUint(slope)).xyxy;
    triangle = uvec4(surface_triangle);
}
