#version 330 core
// Peeling into the layer store: as peel.frag, for the tiles of several directions at once. Mirrors src/gather/layer_store/peel.rs.

#include "include/packed_surface.glsl"

flat in int surface_triangle;

uniform sampler2D previous_depth;   // of the layer before

layout(location = 0) out uvec4 planes;      // the surface twice, of which the draw writes one half
layout(location = 1) out uvec4 triangle;    // four times, of which it writes one

void main()
{
    float depth = gl_FragCoord.z;
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
#ifndef FARTHEST
    // The depth buffer holds what the same arithmetic made at the same place: equality is exact, as in peel.frag.
    if (depth >= texelFetch(previous_depth, ivec2(gl_FragCoord.xy), 0).x)
        discard;
#endif
    planes = pack_surface(depth, floatBitsToUint(slope)).xyxy;
    triangle = uvec4(surface_triangle);
}
