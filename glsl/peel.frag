#version 330 core
// Inverse depth peeling: keeps the farthest fragment that is nearer than the layer before (depth test GREATER). Mirrors src/gather/peel.rs.

#ifdef CUT_OUTS
#include "include/cut_fragment.glsl"
#endif

flat in int surface_triangle;

uniform sampler2D previous_layer;

// Depth along the direction; its change to the next texel in x and y, by which readers find the surface's plane; the triangle, counted from 1.
layout(location = 0) out vec4 layer;

void main()
{
    float depth = gl_FragCoord.z;
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
#ifdef CUT_OUTS
    if (is_cut_fragment(surface_triangle))
        discard;
#endif
    // Both depths come from the same arithmetic at the same place, so equality is exact and needs no epsilon.
    if (depth >= texelFetch(previous_layer, ivec2(gl_FragCoord.xy), 0).x)
        discard;
    layer = vec4(depth, slope, float(surface_triangle + 1));
}
