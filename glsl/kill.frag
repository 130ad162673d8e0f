#version 330 core
// Sampling one layer, as in 2004: every point looks up the texel on its ray and overwrites its sample, unless the texel lies
// behind the point (KILL). Layers come far to near, so the last to survive is the nearest hit. Mirrors src/gather/kill.rs.

#include "points.glsl"

uniform sampler2D layer;
uniform vec3 direction;
uniform mat4 to_layer;              // unit space to texel x, texel y, window depth
uniform mat4 from_layer;
uniform float clearance;            // how far off its own tangent plane a point can see a surface

layout(location = 0) out vec2 hit;  // distance along the direction; triangle, counted from 1

void main()
{
    GatherPoint point = fetch_point();
    if (cosine(point, direction) == 0.0)
        discard;
    vec3 place = (to_layer * vec4(point.position, 1.0)).xyz;
    ivec2 texel = ivec2(floor(place.xy));
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, textureSize(layer, 0))))
        discard;

    vec4 surface = texelFetch(layer, texel, 0);
    vec2 offset = place.xy - (vec2(texel) + 0.5);
    // The hit's plane, evaluated on the point's own ray, must lie ahead; and the hit must lie above the tangent plane of the point, as
    // all that its hemisphere sees does. The first test is right in concave corners and the second at convex edges, where the
    // texel's centre sees another surface than the point does. The second also tells the point's own surface, at any slope.
    float ahead = surface.x + dot(surface.yz, offset) - place.z;
    vec3 normal = point.surface_normal * mat3(from_layer);
    float above = dot(normal, vec3(-offset, surface.x - place.z));
    // Where the centre is too close to the tangent plane to tell, and where it was grown and lies off the scene, the point's own ray
    // decides.
    float own = normal.z * ahead;
    above = surface.w < 0.0 ? own : above > 0.0 ? max(above, own) : above;
    if (ahead <= 0.0 || above <= clearance)
        discard;                    // KILL
    hit = vec2(ahead * dot(direction, from_layer[2].xyz), abs(surface.w));
}
