#version 330 core
// Inverse depth peeling: of what lies nearer than the layer before, the farthest remains (depth test GREATER).
// Mirrors src/gather/peel.rs.
//
// A layer texel holds its depth along the direction and the depth's change to the next texel, so that a reader can evaluate the
// surface's plane where it stands, and the radiance that the surface sends back along the direction.

#include "surface.glsl"
#include "photon_grid.glsl"

uniform sampler2D previous_plane;
uniform vec3 direction;

layout(location = 0) out vec4 layer_plane;      // depth, d depth / d texel x, d depth / d texel y
layout(location = 1) out vec4 layer_radiance;

const float PI = 3.14159265358979;

void main()
{
    float depth = gl_FragCoord.z;
    vec2 slope = vec2(dFdx(depth), dFdy(depth));
    vec2 uv_dx = dFdx(surface_uv);
    vec2 uv_dy = dFdy(surface_uv);
    // Both depths come from the same arithmetic at the same place, so that equality is exact and no epsilon is needed.
    if (depth >= texelFetch(previous_plane, ivec2(gl_FragCoord.xy), 0).x)
        discard;

    // A ray along the direction meets the side that faces against it.
    Surface surface = fetch_surface();
    vec3 side = dot(surface.normal, direction) < 0.0 ? surface.normal : -surface.normal;
    vec3 irradiance = photon_irradiance(surface_position, surface.axis, side[surface.axis] > 0.0);

    layer_plane = vec4(depth, slope, 0.0);
    // Without the surface's own emission: light straight from the lights is the direct term's.
    layer_radiance = vec4(surface_albedo(surface.material, uv_dx, uv_dy) * irradiance / PI, 1.0);
}
