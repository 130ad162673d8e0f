#version 330 core
// The end of a direction: looks up the radiance of each point's hit and adds it, cosine-weighted, to the sums (additive blending).
// Runs once for each batch of triangles; misses go with the first. Mirrors src/gather/accumulate.rs.

#include "points.glsl"
#include "surface.glsl"
#include "photon_grid.glsl"

uniform sampler2D hits;             // as kill.frag writes them
uniform ivec2 first_texel;          // of the subset in the sums
uniform vec3 direction;
uniform int last_triangle;          // of this batch

layout(location = 0) out vec4 sum;  // rgb: radiance x weight; a: weight

const float PI = 3.14159265358979;

void main()
{
    ivec2 place = ivec2(gl_FragCoord.xy) - first_texel;
    GatherPoint point = fetch_point(place);
    if (!point.exists)
        discard;
    vec2 hit = texelFetch(hits, place, 0).xy;
    int triangle = int(hit.y) - 1;
    if (triangle > last_triangle || triangle < (first_triangle == 0 ? -1 : first_triangle))
        discard;

    vec3 radiance = vec3(0.0);
    if (triangle >= 0) {
        // A ray along the direction meets the side that faces against it. Its own emission stays out: light straight from the
        // lights is the direct term's.
        Surface surface = fetch_surface(triangle);
        vec3 position = point.position + hit.x * direction;
        bool front = dot(surface.normal, direction) < 0.0;
        bool positive = (surface.normal[surface.axis] > 0.0) == front;
        vec3 texel = textureLod(albedo_texture, texture_coordinates(surface, position), 0.0).rgb;
        radiance = plain_albedo(surface) * texel * photon_irradiance(position, surface.axis, positive) / PI;
    }
    sum = vec4(radiance, 1.0) * cosine(point, direction);
}
