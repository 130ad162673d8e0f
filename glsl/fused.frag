#version 330 core
// All layers of a direction in one pass, for the rays of both its ends: a point that faces along the direction looks for the nearest surface
// beyond it, any other for the nearest before it, and what it sees is added to its sums (additive blending). Points in texels where no
// layer has anything, on the scene's outline, are left to a second pass, the variant OUTLINE.
// Mirrors src/gather/fused.rs.

#include "points.glsl"
#include "layer.glsl"
#include "radiance.glsl"

uniform sampler2DArray even_layers; // layers 0, 2, ... from afar
uniform sampler2DArray odd_layers;
uniform int layer_count;
uniform vec3 direction;
uniform ivec2 first_texel;          // of the subset in the sums

layout(location = 0) out vec4 sum;  // rgb: radiance x weight; a: weight

#ifdef OUTLINE

// The farthest layer seen along the direction; seen against it, the last that has anything at this texel.
Sample sample_outline(Receiver receiver, ivec2 texel)
{
    if (receiver.side > 0.0)
        return sample_around(receiver, even_layers, 0, texel);
    Sample nearest = NOTHING;
    for (int i = 0; i < 8; ++i) {
        Sample last = NOTHING;
        for (int layer = 0; layer < layer_count; ++layer) {
            Sample beside = NOTHING;
            if ((layer & 1) == 0)
                beside = sample_texel(receiver, even_layers, layer >> 1, texel + NEIGHBOURS[i]);
            else
                beside = sample_texel(receiver, odd_layers, layer >> 1, texel + NEIGHBOURS[i]);
            if (beside.triangle == 0.0)
                break;
            last = beside;
        }
        if (is_hit(last) && (nearest.triangle == 0.0 || last.ahead < nearest.ahead))
            nearest = last;
    }
    return nearest;
}

#endif

void main()
{
    ivec2 place = ivec2(gl_FragCoord.xy) - first_texel;
    GatherPoint point = fetch_point(place);
    float side = dot(point.surface_normal, direction) < 0.0 ? -1.0 : 1.0;
    float weight = cosine(point, side * direction);
    Receiver receiver = receiver(point.position, point.surface_normal, side);
    ivec2 texel = ivec2(floor(receiver.place.xy));
#ifdef OUTLINE
    Sample nearest = sample_outline(receiver, texel);
#else
    Sample nearest = NOTHING;
    for (int layer = 0; layer < layer_count; layer += 2) {
        Sample even = sample_texel(receiver, even_layers, layer >> 1, texel);
        if (layer == 0 && even.triangle == 0.0 && weight > 0.0)
            discard;
        even = sample_beside_edge(receiver, even_layers, layer >> 1, texel, even);
        if (is_hit(even) && (side > 0.0 || nearest.triangle == 0.0))
            nearest = even;
        if (layer + 1 < layer_count) {
            Sample odd = sample_texel(receiver, odd_layers, layer >> 1, texel);
            odd = sample_beside_edge(receiver, odd_layers, layer >> 1, texel, odd);
            if (is_hit(odd) && (side > 0.0 || nearest.triangle == 0.0))
                nearest = odd;
        }
    }
#endif
    vec3 radiance = vec3(0.0);
    if (nearest.triangle > 0.0) {
        float along = nearest.ahead * dot(direction, from_layer[2].xyz);
        radiance = hit_radiance(int(nearest.triangle) - 1, point.position + side * along * direction, side * direction);
    }
    sum = vec4(radiance, 1.0) * weight;
}
