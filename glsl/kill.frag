#version 330 core
// Sampling one layer, as in 2004: every point looks up the texel on its ray and overwrites its hit, unless the texel lies
// behind the point (KILL). Layers come far to near, so the last to survive is the nearest hit. Mirrors src/gather/kill.rs.

#include "points.glsl"

uniform sampler2D layer;
uniform vec3 direction;
uniform mat4 to_layer;              // unit space to texel x, texel y, window depth
uniform mat4 from_layer;
uniform bool is_farthest;           // the first layer
uniform float clearance;            // how far off its own tangent plane a point can see a surface

layout(location = 0) out vec2 hit;  // distance along the direction; triangle, counted from 1

vec3 place;                         // of the point in layer space
vec3 normal;                        // of the point's surface, as a covector of layer space

const ivec2 NEIGHBOURS[8] = ivec2[8](ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1),
                                     ivec2(-1, -1), ivec2(1, -1), ivec2(-1, 1), ivec2(1, 1));

const float ROUNDING = 1e-6;        // of heights above the tangent plane

struct Sample
{
    float triangle;
    float ahead;                    // depth from the point to the texel's plane, on the point's own ray
    float above;                    // distance of the texel from the point's tangent plane
};

Sample sample_layer(ivec2 texel)
{
    if (any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, textureSize(layer, 0))))
        return Sample(0.0, -1.0, -1.0);
    vec4 surface = texelFetch(layer, texel, 0);
    vec2 offset = place.xy - (vec2(texel) + 0.5);
    float ahead = surface.x + dot(surface.yz, offset) - place.z;
    float above = dot(normal, vec3(-offset, surface.x - place.z));
    // Where the texel's centre is too close to the tangent plane to tell, and where it was grown and lies off the scene beneath that
    // plane, the point's own ray decides. Grown texels above it are what convex bodies have around them: nothing.
    // Where the centre is too close to the tangent plane to tell, the point's own ray decides.
    if (above > -ROUNDING)
        above = max(above, normal.z * ahead);
    return Sample(surface.w, ahead, above);
}

bool is_hit(Sample s)
{
    return s.triangle > 0.0 && s.ahead > 0.0 && s.above > clearance;
}

void main()
{
    GatherPoint point = fetch_point(ivec2(gl_FragCoord.xy));
    if (cosine(point, direction) == 0.0)
        discard;
    place = (to_layer * vec4(point.position, 1.0)).xyz;
    normal = point.surface_normal * mat3(from_layer);
    ivec2 texel = ivec2(floor(place.xy));

    // The texel's centre is off the point's ray, so two things must hold: the hit's plane lies ahead on the ray itself, which is right in
    // concave corners; and the texel lies above the point's tangent plane, as all that its hemisphere sees does, which is right
    // at convex edges and tells the point's own surface at any slope.
    Sample nearest = sample_layer(texel);
    // Beside a concave edge the centre may lie beneath the tangent plane although the ray meets the surface above it; then the
    // neighbour on the upper side, along the axis on which it is sure to be above, has the surface or nothing has.
    vec2 lower = place.xy - (vec2(texel) + 0.5);
    if (is_farthest && nearest.triangle == 0.0) {
        // Points lie on the scene, but a texel on its outline may have its centre outside. What closes the scene there is in a texel
        // around; above the tangent plane, for about a convex body nothing is. Of several, the ray leaves the scene through the nearest.
        for (int i = 0; i < 8; ++i) {
            Sample beside = sample_layer(texel + NEIGHBOURS[i]);
            if (is_hit(beside) && (nearest.triangle == 0.0 || beside.ahead < nearest.ahead))
                nearest = beside;
        }
    } else if (nearest.above <= clearance && dot(lower, normal.xy) > 0.0) {
        nearest = sample_layer(texel + (abs(normal.x) > abs(normal.y) ? ivec2(sign(normal.x), 0) : ivec2(0, sign(normal.y))));
    }
    if (!is_hit(nearest))
        discard;                    // KILL
    hit = vec2(nearest.ahead * dot(direction, from_layer[2].xyz), nearest.triangle);
}
