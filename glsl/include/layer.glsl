// A receiver's view of a surface in a texel of a layer, and the rule that tells whether it is a hit. Mirrors `Bundle` in src/gather/bundle.rs.

struct Receiver
{
    vec3 place;                     // in layer space: texel x, texel y, window depth
    ivec2 texel;                    // of the texture, that its ray passes,
    vec2 offset;                    // this far beside the centre
    vec3 normal;                    // of its surface, as a covector of layer space
    float side;                     // looks along the direction: 1, against it: -1
    float depth_bias;                // how far off its own tangent plane it can see a surface, for normals of length 1
    vec3 metric;                    // of layer space: the inner product of two covectors is dot(metric * a, b)
    vec3 facing;                    // metric * normal, on its side: what makes that product with a surface's normal
};

struct Sample
{
    float id;                       // counted from 1; 0 where nothing is
    float ahead;                    // depth from the receiver to the texel's plane, on the receiver's own ray
    float above;                    // distance of the texel from the receiver's tangent plane, times the length of its normal
};

const Sample NOTHING = Sample(0.0, -1.0, -1.0);

// In a layer of `size` texels on a side, which begins at texel `first` of a texture. What lies outside the layer sees nothing.
Receiver receiver(vec3 position, vec3 surface_normal, float side, mat4 to_layer, float depth_bias, vec3 metric, ivec2 first, float size)
{
    vec3 place = (to_layer * vec4(position, 1.0)).xyz;
    // A point on the scene may be rounded into the border, beyond which there are no neighbours to look at.
    vec2 texel = clamp(floor(place.xy), 1.0, size - 2.0);
    vec2 offset = place.xy - texel - 0.5;
    bool outside = max(abs(offset.x), abs(offset.y)) > 1.5;
    vec3 normal = mat3(to_layer) * surface_normal;
    return Receiver(place, first + ivec2(texel), offset, normal / metric, side, outside ? 1e9 : depth_bias, metric, side * normal);
}

// How far a place of layer space, seen from the receiver, lies above its tangent plane.
float height(Receiver receiver, vec2 from, float depth)
{
    return dot(receiver.normal, vec3(-from, depth - receiver.place.z));
}

// Whether a surface is seen from behind and lies within 18 degrees of the receiver's own: as the next facet of the same does.
bool is_next_facet(Receiver receiver, vec2 slope)
{
    float along = receiver.facing.z - dot(receiver.facing.xy, slope);
    return along > 0.0 && along * along > 0.9 * (receiver.metric.z + dot(receiver.metric.xy, slope * slope));
}

// Of a surface (depth, its change to the next texel in x and y, id) in a texel whose centre the receiver is `offset` beside.
Sample sample_surface(Receiver receiver, vec4 surface, vec2 offset)
{
    float ahead = surface.x + dot(surface.yz, offset) - receiver.place.z;
    float above = height(receiver, offset, surface.x);
    float on_ray = receiver.normal.z * ahead;
    // Facets of the receiver's own surface rise a little above its tangent plane or cross its ray, and hide nothing from it: they must do both by a
    // sixteenth of a texel, as what is of another surface does.
    if (is_next_facet(receiver, surface.yz))
        above = min(above, on_ray) - 15.0 * receiver.depth_bias;
    // Where the centre is too close to the tangent plane to tell, the receiver's own ray decides. Rasterisers have vertices on a grid of 1/256 of a
    // texel: rounding moves the receiver's surface by half of that, which depth_bias allows for, and the surface seen by as much of its slope.
    else if (above > -0.5 * receiver.depth_bias - abs(receiver.normal.z) * (abs(surface.y) + abs(surface.z)) / 512.0)
        above = max(above, on_ray);
    return Sample(surface.w, receiver.side * ahead, above);
}

// The texel's centre is off the receiver's ray, so two things must hold: the hit's plane lies ahead on the ray itself, which is right in
// concave corners; and the texel lies above the receiver's tangent plane, as all that its hemisphere sees does, which is right
// at convex edges and tells the receiver's own surface at any slope.
bool is_hit(Receiver receiver, Sample s)
{
    return s.id > 0.0 && s.ahead > 0.0 && s.above > receiver.depth_bias;
}

// Whether it is one, and before the nearest so far, which may be NOTHING.
bool is_nearer_hit(Receiver receiver, Sample s, Sample nearest)
{
    return is_hit(receiver, s) && (nearest.id == 0.0 || s.ahead < nearest.ahead);
}

// Beside a concave edge the centre may lie beneath the tangent plane although the ray meets the surface above it; then the neighbour on the
// upper side, along the axis on which it is sure to be above, has the surface: the step to it, or 0 where the centre lies higher than the ray.
ivec2 step_beside_edge(Receiver receiver)
{
    vec2 rise = receiver.normal.xy;
    if (dot(receiver.offset, rise) <= 0.0)
        return ivec2(0);
    return abs(rise.x) > abs(rise.y) ? ivec2(sign(rise.x), 0) : ivec2(0, sign(rise.y));
}

// Whether the neighbour's surface has ended before the receiver's ray: at the receiver's own texel too it would be above the tangent plane.
bool has_ended(Receiver receiver, vec4 surface, ivec2 step)
{
    return height(receiver, receiver.offset, surface.x - dot(surface.yz, vec2(step))) > receiver.depth_bias;
}

// The eight neighbours of a texel, without a table: drivers keep those in slow memory.
ivec2 neighbour(int i)
{
    return (ivec2(0x8858, 0xa085) >> (2 * i) & 3) - 1;
}
