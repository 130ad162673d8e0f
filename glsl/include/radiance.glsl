// What a hit sends back: (albedo/π) E from the photon map or, with GATHERED, from what was gathered before at the vertices: of fronts only. Its own emission stays out, for light straight from the lights is the direct
// term's. Mirrors `Geometry` in src/geometry.rs.

#include "albedo.glsl"
#ifdef GATHERED
#include "carriers.glsl"
#else
#include "photon_grid.glsl"
#endif

// Radiance of a triangle at a position towards where a ray along `direction` came from, of the side that it met.
vec3 hit_radiance(int triangle, vec3 position, vec3 direction)
{
    Surface surface = fetch_surface(triangle);
    bool front = dot(surface.normal, direction) < 0.0;
#ifdef GATHERED
    vec3 irradiance = front ? carried(fetch_carriers(triangle, position), 0).rgb : vec3(0.0);
#else
    vec3 irradiance = photon_irradiance(position, surface.axis, (surface.normal[surface.axis] > 0.0) == front);
#endif
    return albedo(surface, position) * irradiance * 0.318309886;
}
