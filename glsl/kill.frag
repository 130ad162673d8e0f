#version 330 core
// Sampling one layer, as in 2004: every point looks up the texel on its ray and overwrites its sample, unless the texel lies
// behind the point (KILL). Layers come far to near, so the last to survive is the nearest hit. Mirrors src/gather/kill.rs.

#include "points.glsl"

uniform sampler2D layer;
uniform sampler2D farthest;         // the first layer
uniform vec3 direction;
uniform mat4 to_layer;              // unit space to texel x, texel y, window depth
uniform mat4 from_layer;
uniform float clearance;            // how far off its own tangent plane a point can see a surface

layout(location = 0) out vec2 hit;  // distance along the direction; triangle, counted from 1

// Every point lies on the scene. Where its texel sees nothing at all, the texel lies on the scene's outline with its centre outside,
// and the ray would be lost: closed rooms would darken along their edges. This is the step to a neighbour that sees the scene, the
// nearest in the direction of the point first.
ivec2 inward(ivec2 texel, vec2 offset)
{
    if (texelFetch(farthest, texel, 0).w > 0.0)
        return ivec2(0);
    ivec2 side = ivec2(offset.x < 0.0 ? -1 : 1, offset.y < 0.0 ? -1 : 1);
    ivec2 nearer = abs(offset.x) > abs(offset.y) ? ivec2(side.x, 0) : ivec2(0, side.y);
    ivec2 steps[3] = ivec2[3](nearer, side - nearer, side);
    ivec2 last = textureSize(farthest, 0) - 1;
    for (int i = 0; i < 3; ++i) {
        ivec2 step = clamp(texel + steps[i], ivec2(0), last) - texel;
        if (texelFetch(farthest, texel + step, 0).w > 0.0)
            return step;
    }
    return ivec2(0);
}

void main()
{
    GatherPoint point = fetch_point();
    if (!point.exists || cosine(point, direction) == 0.0)
        discard;
    vec3 place = (to_layer * vec4(point.position, 1.0)).xyz;
    ivec2 texel = ivec2(floor(place.xy));
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, textureSize(layer, 0))))
        discard;

    texel += inward(texel, place.xy - (vec2(texel) + 0.5));

    vec4 surface = texelFetch(layer, texel, 0);
    vec2 offset = place.xy - (vec2(texel) + 0.5);
    // The hit's plane, evaluated on the point's own ray, must lie ahead; and the hit must lie above the tangent plane of the point, as
    // all that its hemisphere sees does. The first test is right in concave corners and the second at convex edges, where the
    // texel's centre sees another surface than the point does. The second also tells the point's own surface, at any slope.
    float ahead = surface.x + dot(surface.yz, offset) - place.z;
    float above = dot(point.surface_normal, mat3(from_layer) * vec3(-offset, surface.x - place.z));
    if (ahead <= 0.0 || above <= clearance)
        discard;                    // KILL
    hit = vec2(ahead * dot(direction, from_layer[2].xyz), surface.w);
}
