#version 330 core
// Inverse depth peeling: of what lies nearer than the layer before, the farthest remains (depth test GREATER).
// Mirrors src/gather/peel.rs.

flat in int surface_triangle;

uniform sampler2D previous_layer;

// Depth along the direction and its change to the next texel in x and y, so that a reader can evaluate the surface's plane where it
// stands; and the triangle, counted from 1.
layout(location = 0) out vec4 layer;

void main()
{
    float depth = gl_FragCoord.z;
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
    // Both depths come from the same arithmetic at the same place, so that equality is exact and no epsilon is needed.
    if (depth >= texelFetch(previous_layer, ivec2(gl_FragCoord.xy), 0).x)
        discard;
    layer = vec4(depth, slope, float(surface_triangle + 1));
}
