#version 330 core
// The irradiance of the photon map at each point. Mirrors src/photon_map.rs.

#include "include/points.glsl"
#include "include/photon_grid.glsl"

uniform ivec2 first_texel;          // of the subset in the sums

layout(location = 0) out vec4 irradiance;

void main()
{
    GatherPoint point = fetch_point(ivec2(gl_FragCoord.xy) - first_texel);
    vec3 size = abs(point.surface_normal);
    // Of equal components the first counts, as in `dominant_axis` in src/math.rs.
    int axis = size.x >= max(size.y, size.z) ? 0 : size.y >= size.z ? 1 : 2;
    irradiance = vec4(photon_irradiance(point.position, axis, point.surface_normal[axis] > 0.0), 0.0);
}
