// The radiance that a hit sends back: (albedo/π) E, without emission, because direct light adds that of the lights. E comes from the photon map: from
// the atlas, or with PHOTON_GRID from the grid. With VERTEX_CACHE it comes from irradiance gathered before at the vertices; then backs are black.
// Mirrors `Geometry` in src/geometry.rs.

#include "include/albedo.glsl"
#ifdef VERTEX_CACHE
#include "include/vertex_cache.glsl"
#elif defined(PHOTON_GRID)
#include "include/photon_grid.glsl"
#else
#include "include/photon_atlas.glsl"
#endif

// The radiance of a triangle at a position, on the side that a ray along `direction` meets.
vec3 hit_radiance(int triangle, vec3 position, vec3 direction)
{
    Surface surface = fetch_surface(triangle);
    bool front = dot(surface.normal, direction) < 0.0;
#ifdef VERTEX_CACHE
    vec3 irradiance = front ? cached(cache_place(triangle, position), 0).rgb : vec3(0.0);
#elif defined(PHOTON_GRID)
    vec3 irradiance = photon_irradiance(position, surface.axis, (surface.normal[surface.axis] > 0.0) == front);
#else
    vec3 irradiance = photon_irradiance(triangle, position, front);
#endif
    return albedo(triangle, surface, position) * irradiance * 0.318309886;
}
