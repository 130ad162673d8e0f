#version 330 core
// Sampling one layer, as in 2004: every point looks up the texel on its ray and overwrites its sample, unless the texel lies
// behind the point (KILL). Layers come far to near, so the last to survive is the nearest hit. Mirrors src/gather/kill.rs.

#include "points.glsl"

uniform sampler2D layer_plane;
uniform sampler2D layer_radiance;
uniform vec3 direction;
uniform mat4 to_layer;              // world to texel x, texel y, window depth
uniform mat4 from_layer;
uniform float clearance;            // how far off its own tangent plane a point can see a surface

layout(location = 0) out vec4 sample_radiance;

void main()
{
    GatherPoint point = fetch_point();
    if (!point.exists || cosine(point, direction) == 0.0)
        discard;
    vec3 place = (to_layer * vec4(point.position, 1.0)).xyz;
    ivec2 texel = ivec2(floor(place.xy));
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, textureSize(layer_plane, 0))))
        discard;

    vec4 plane = texelFetch(layer_plane, texel, 0);
    vec2 offset = place.xy - (vec2(texel) + 0.5);
    // The hit's plane, evaluated on the point's own ray, must lie ahead; and the hit must lie above the tangent plane of the point, as
    // all that its hemisphere sees does. The first test is right in concave corners and the second at convex edges, where the
    // texel's centre sees another surface than the point does. The second also tells the point's own surface, at any slope.
    float ahead = plane.x + dot(plane.yz, offset) - place.z;
    float above = dot(point.surface_normal, mat3(from_layer) * vec3(-offset, plane.x - place.z));
    if (ahead <= 0.0 || above <= clearance)
        discard;                    // KILL
    sample_radiance = texelFetch(layer_radiance, texel, 0);
}
