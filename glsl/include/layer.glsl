// A receiver, a surface in a texel of a layer, and the rule that decides whether the surface is a hit. Mirrors `Bundle` in src/gather/bundle.rs.

struct Receiver
{
    vec3 place;                     // in layer space: texel x, texel y, window depth
    ivec2 texel;                    // texel of the texture that its ray passes
    vec2 offset;                    // from the centre of that texel to the ray
    vec3 normal;                    // of its surface, as a covector of layer space
    float side;                     // 1: looks along the direction; -1: against it
    float depth_bias;               // least height of a hit above its tangent plane, for normals of length 1
    vec3 metric;                    // of layer space: the inner product of two covectors is dot(metric * a, b)
    vec3 facing;                    // side * metric * normal: dot(facing, b) is the inner product with covector b
};

struct Sample
{
    float id;                       // counted from 1; 0: no surface
    float ahead;                    // depth from the receiver to the texel's plane, on the receiver's own ray
    float above;                    // height of the surface at the texel above the receiver's tangent plane, times the length of its normal
};

const Sample NOTHING = Sample(0.0, -1.0, -1.0);

// A receiver in a layer of `size` texels on a side, which begins at texel `first` of a texture. A receiver outside the layer has no hits.
Receiver receiver(vec3 position, vec3 surface_normal, float side, mat4 to_layer, float depth_bias, vec3 metric, ivec2 first, float size)
{
    vec3 place = (to_layer * vec4(position, 1.0)).xyz;
    // Rounding may put a point of the scene into the border, which has no neighbour texels beyond it.
    vec2 texel = clamp(floor(place.xy), 1.0, size - 2.0);
    vec2 offset = place.xy - texel - 0.5;
    bool outside = max(abs(offset.x), abs(offset.y)) > 1.5;
    vec3 normal = mat3(to_layer) * surface_normal;
    return Receiver(place, first + ivec2(texel), offset, normal / metric, side, outside ? 1e9 : depth_bias, metric, side * normal);
}

// Height above the receiver's tangent plane of a place in layer space: the receiver is `from` beside it.
float height(Receiver receiver, vec2 from, float depth)
{
    return dot(receiver.normal, vec3(-from, depth - receiver.place.z));
}

// Whether the receiver sees a surface from behind, within 18 degrees of its own: the next facet of its own surface is like that.
bool is_next_facet(Receiver receiver, vec2 slope)
{
    float along = receiver.facing.z - dot(receiver.facing.xy, slope);
    return along > 0.0 && along * along > 0.9 * (receiver.metric.z + dot(receiver.metric.xy, slope * slope));
}

// The sample of a surface (depth, its change to the next texel in x and y, id) in a texel. `offset` goes from the texel's centre to the receiver.
Sample sample_surface(Receiver receiver, vec4 surface, vec2 offset)
{
    float ahead = surface.x + dot(surface.yz, offset) - receiver.place.z;
    float above = height(receiver, offset, surface.x);
    float on_ray = receiver.normal.z * ahead;
    // Facets of the receiver's own surface rise a little above its tangent plane or cross its ray, but must not hide anything. So they count only if
    // they do both by a sixteenth of a texel, as another surface does.
    if (is_next_facet(receiver, surface.yz))
        above = min(above, on_ray) - 15.0 * receiver.depth_bias;
    // If the centre is too close to the tangent plane, the receiver's own ray decides. Rasterisers round vertices to a grid of 1/256 of a texel. This
    // moves the receiver's surface by half a grid step, which depth_bias allows for, and the seen surface by half a step times its slope.
    else if (above > -0.5 * receiver.depth_bias - abs(receiver.normal.z) * (abs(surface.y) + abs(surface.z)) / 512.0)
        above = max(above, on_ray);
    return Sample(surface.w, receiver.side * ahead, above);
}

// The texel's centre is off the receiver's ray, so a hit needs two things. Its plane lies ahead on the ray itself: right in concave corners. And the
// texel lies above the tangent plane, as the whole hemisphere does: right at convex edges, and excludes the receiver's own surface at any slope.
bool is_hit(Receiver receiver, Sample s)
{
    return s.id > 0.0 && s.ahead > 0.0 && s.above > receiver.depth_bias;
}

// Whether a sample is a hit nearer than the nearest so far, which may be NOTHING.
bool is_nearer_hit(Receiver receiver, Sample s, Sample nearest)
{
    return is_hit(receiver, s) && (nearest.id == 0.0 || s.ahead < nearest.ahead);
}

// Beside a concave edge the centre may lie below the tangent plane although the ray meets the surface above it. Then the neighbour texel on the upper
// side has the surface. Returns the step to it, along the axis on which it is sure to be above, or 0 when the centre lies higher than the ray.
ivec2 step_beside_edge(Receiver receiver)
{
    vec2 rise = receiver.normal.xy;
    if (dot(receiver.offset, rise) <= 0.0)
        return ivec2(0);
    return abs(rise.x) > abs(rise.y) ? ivec2(sign(rise.x), 0) : ivec2(0, sign(rise.y));
}

// Whether the neighbour's surface ends before the receiver's ray. If not so, it would be above the tangent plane at the receiver's own texel too.
bool has_ended(Receiver receiver, vec4 surface, ivec2 step)
{
    return height(receiver, receiver.offset, surface.x - dot(surface.yz, vec2(step))) > receiver.depth_bias;
}

// Step to neighbour i of eight. Drivers keep tables in slow memory, so this uses none.
ivec2 neighbour(int i)
{
    return (ivec2(0x8858, 0xa085) >> (2 * i) & 3) - 1;
}
