// Hit finder: searches all layers of a direction. A point that faces along the direction looks for the nearest surface beyond it, another point for
// the nearest surface before it. Mirrors src/gather/layers.rs.
//
// Loops test at the end, as in glsl/gather.frag.

#include "include/layer.glsl"
#include "include/layer_store.glsl"

uniform mat4 to_layer[BATCH];       // unit space to texel x, texel y, window depth
uniform vec4 metric[BATCH];         // xyz: see Receiver

struct LayerHit
{
    Sample seen;                    // its id is the slot, counted from 1
    ivec2 step;                     // from the receiver's texel to the hit's
};

// The search goes through the surfaces of the receiver's texel, far to near, and ends at the receiver. Looking along the direction, it meets the hits
// first; the last one is the nearest. Looking against it, it first meets non-hits, its own surface last; then the first hit is the nearest.
struct Search
{
    Sample nearest;
    Sample under;                   // the surface next to the receiver, on the side away from the hit
    int under_slot;
    bool ended;
};

void look(Receiver receiver, vec4 surface, int slot, inout Search search)
{
    if (search.ended)
        return;
    Sample own = sample_surface(receiver, surface, receiver.offset);
    bool hit = is_hit(receiver, own);
    bool along = receiver.side > 0.0;
    search.ended = own.id == 0.0 || (along ? search.nearest.id > 0.0 && !hit : hit);
    if (hit)
        search.nearest = own;
    else if (along ? search.under_slot < 0 || search.nearest.id > 0.0 : own.id > 0.0) {
        search.under = own;
        search.under_slot = slot;
    }
}

LayerHit search_layers(Receiver receiver)
{
    Search search = Search(NOTHING, NOTHING, -1, false);
    bool empty = false;
    int slot = 0;
    do {
        uvec4 pair = texelFetch(planes, ivec3(receiver.texel, slot >> 1), 0);
        vec4 far = unpack_surface(pair.xy, slot);
        empty = empty || slot == 0 && far.w == 0.0;
        look(receiver, far, slot, search);
        look(receiver, unpack_surface(pair.zw, slot + 1), slot + 1, search);
        slot += 2;
    } while (!search.ended && slot < slot_count);
    LayerHit nearest = LayerHit(search.nearest, ivec2(0));
    Sample under = search.under;
    int under_slot = search.under_slot;

    // Beside a concave edge the hit may be the neighbour texel's surface. A texel on the scene's outline may have its centre outside the scene. Then
    // a texel around it has the surface that closes the scene: the last layer as seen by the receiver.
    ivec2 step = under.id == 0.0 || under.above <= receiver.depth_bias ? step_beside_edge(receiver) : ivec2(0);
    bool beside = step != ivec2(0) && under_slot >= 0 && !empty;
    slot = beside ? under_slot : 0;
    step = empty ? neighbour(0) : beside ? step : ivec2(0);
    Sample last = NOTHING;
    int around = 0;
    do {
        vec4 surface = fetch_surface_in(receiver.texel + step, slot);
        Sample there = sample_surface(receiver, surface, receiver.offset - vec2(step));
        if (!empty) {
            if (beside && !has_ended(receiver, surface, step) && is_hit(receiver, there))
                nearest = LayerHit(there, step);
            around = 8;
        } else {
            if (there.id > 0.0)
                last = there;
            ++slot;
            if (there.id == 0.0 || receiver.side > 0.0 || slot == slot_count) {
                if (is_nearer_hit(receiver, last, nearest.seen))
                    nearest = LayerHit(last, step);
                last = NOTHING;
                slot = 0;
                ++around;
                step = neighbour(around);
            }
        }
    } while (around < 8);
    return nearest;
}

PointHit find_hit(GatherPoint point, ivec2 place, int i)
{
    int size = textureSize(planes, 0).y;
    bool against = dot(point.surface_normal, directions[i].xyz) < 0.0;
    float side = against ? -1.0 : 1.0;
    Receiver receiver = receiver(point.position, point.surface_normal, side, to_layer[i], directions[i].w, metric[i].xyz,
                                 ivec2(i * size, 0), float(size));
    LayerHit found = search_layers(receiver);
    int triangle = 0;
    if (found.seen.id > 0.0)
        triangle = fetch_triangle_in(receiver.texel + found.step, int(found.seen.id) - 1) + 1;
    vec3 direction = side * directions[i].xyz;
    float distance = found.seen.ahead * inversesqrt(metric[i].z);
    return PointHit(direction, against, triangle, distance, point.position + distance * direction);
}
