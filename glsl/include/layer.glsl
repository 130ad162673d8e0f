// A receiver's view of one layer, and the rule that tells whether its texel is a hit. Mirrors `Bundle` and `Layer` in src/gather.

uniform mat4 to_layer;              // unit space to texel x, texel y, window depth
uniform mat4 from_layer;
uniform float clearance;            // how far off its own tangent plane a point can see a surface, for normals of length 1

const ivec2 NEIGHBOURS[8] = ivec2[8](ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1),
                                     ivec2(-1, -1), ivec2(1, -1), ivec2(-1, 1), ivec2(1, 1));

struct Receiver
{
    vec3 place;                     // in layer space
    vec3 normal;                    // of its surface, as a covector of layer space
    float side;                     // looks along the direction: 1, against it: -1
};

struct Sample
{
    float triangle;                 // counted from 1; 0 where nothing is
    float ahead;                    // depth from the receiver to the texel's plane, on the receiver's own ray
    float above;                    // distance of the texel from the receiver's tangent plane, times the length of its normal
};

const Sample NOTHING = Sample(0.0, -1.0, -1.0);

Receiver receiver(vec3 position, vec3 surface_normal, float side)
{
    return Receiver((to_layer * vec4(position, 1.0)).xyz, surface_normal * mat3(from_layer), side);
}

// As peel.frag writes it; nothing beyond the layer's border.
vec4 fetch_surface_at(sampler2DArray layers, int element, ivec2 texel)
{
    bool outside = any(lessThan(texel, ivec2(0))) || any(greaterThanEqual(texel, textureSize(layers, 0).xy));
    return outside ? vec4(0.0) : texelFetch(layers, ivec3(texel, element), 0);
}

// How far a place of layer space, seen from the receiver, lies above its tangent plane.
float height(Receiver receiver, vec2 from, float depth)
{
    return dot(receiver.normal, vec3(-from, depth - receiver.place.z));
}

Sample sample_surface(Receiver receiver, vec4 surface, ivec2 texel)
{
    if (surface.w == 0.0)
        return NOTHING;
    vec2 offset = receiver.place.xy - (vec2(texel) + 0.5);
    float ahead = surface.x + dot(surface.yz, offset) - receiver.place.z;
    float above = height(receiver, offset, surface.x);
    // Where the centre is too close to the tangent plane to tell, the receiver's own ray decides. Clearance allows for vertices on a grid of
    // 1/256 of a texel; rounding moves them by half of that.
    if (above > -0.5 * clearance)
        above = max(above, receiver.normal.z * ahead);
    return Sample(surface.w, receiver.side * ahead, above);
}

Sample sample_texel(Receiver receiver, sampler2DArray layers, int element, ivec2 texel)
{
    return sample_surface(receiver, fetch_surface_at(layers, element, texel), texel);
}

// The texel's centre is off the receiver's ray, so two things must hold: the hit's plane lies ahead on the ray itself, which is right in
// concave corners; and the texel lies above the receiver's tangent plane, as all that its hemisphere sees does, which is right
// at convex edges and tells the receiver's own surface at any slope.
bool is_hit(Sample s)
{
    return s.triangle > 0.0 && s.ahead > 0.0 && s.above > clearance;
}

// Beside a concave edge the centre may lie beneath the tangent plane although the ray meets the surface above it; then the neighbour on the
// upper side, along the axis on which it is sure to be above, has the surface. One that would be above here too has ended before:
// the ray passes it. `own` is the sample of the receiver's texel.
Sample sample_beside_edge(Receiver receiver, sampler2DArray layers, int element, ivec2 texel, Sample own)
{
    vec2 rise = receiver.normal.xy;
    vec2 offset = receiver.place.xy - (vec2(texel) + 0.5);
    if (own.above > clearance || dot(offset, rise) <= 0.0)
        return own;
    ivec2 step = abs(rise.x) > abs(rise.y) ? ivec2(sign(rise.x), 0) : ivec2(0, sign(rise.y));
    vec4 surface = fetch_surface_at(layers, element, texel + step);
    if (height(receiver, offset, surface.x - dot(surface.yz, vec2(step))) > clearance)
        return NOTHING;
    return sample_surface(receiver, surface, texel + step);
}

// Receivers lie on the scene, but a texel on its outline may have its centre outside. What closes the scene there is in a texel around;
// above the tangent plane, for about a convex body nothing is. Of several, the ray leaves the scene through the nearest.
Sample sample_around(Receiver receiver, sampler2DArray layers, int element, ivec2 texel)
{
    Sample nearest = NOTHING;
    for (int i = 0; i < 8; ++i) {
        Sample beside = sample_texel(receiver, layers, element, texel + NEIGHBOURS[i]);
        if (is_hit(beside) && (nearest.triangle == 0.0 || beside.ahead < nearest.ahead))
            nearest = beside;
    }
    return nearest;
}
