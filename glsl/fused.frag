#version 330 core
// All layers of several directions in one pass, for the rays of both ends: a point that faces along the direction looks for the nearest surface
// beyond it, any other for the nearest before it, and what it sees is added to its sums (additive blending) or, with FIND, written down.
//
// Loops are written to test at the end, for software drivers run a body once more to find that the test at the beginning fails.
// Mirrors src/gather/fused.rs.

#include "points.glsl"
#include "layer.glsl"
#include "layer_store.glsl"
#ifdef FIND
#include "found.glsl"
#else
#include "radiance.glsl"
#endif

uniform int direction_count;
uniform vec4 directions[BATCH];     // xyz: unit direction; w: clearance, see Receiver
uniform mat4 to_layer[BATCH];       // unit space to texel x, texel y, window depth
uniform vec4 metric[BATCH];         // xyz: see Receiver
#ifndef FIND

uniform vec4 beyond[BATCH];         // rgb: radiance of what lies beyond all surfaces along each direction,
uniform vec4 behind[BATCH];         // and against it
uniform ivec2 first_texel;          // of the subset in the sums

layout(location = 0) out vec4 sum;  // rgb: radiance x weight; a: weight

#else

const ivec2 first_texel = ivec2(0);

#endif

struct Found
{
    Sample seen;                    // its id is the slot, counted from 1
    ivec2 step;                     // to the texel it was found in
};

// The receiver stands somewhere in the stack of its texel's surfaces, and there its search ends. Seen along the direction, the hits come first and
// the last of them is the nearest; seen against it, what is no hit comes first, its own surface last of all, and the first hit is the nearest.
struct Search
{
    Sample nearest;
    Sample under;                   // next to the receiver on the far side of its hit
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

Found find_hit(Receiver receiver)
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
    Found nearest = Found(search.nearest, ivec2(0));
    Sample under = search.under;
    int under_slot = search.under_slot;

    // Beside a concave edge the neighbour's surface may be the hit. And a texel on the scene's outline may have its centre outside: what closes
    // the scene there, its last layer as seen by the receiver, is in a texel around.
    ivec2 step = under.id == 0.0 || under.above <= receiver.clearance ? step_beside_edge(receiver) : ivec2(0);
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
                nearest = Found(there, step);
            around = 8;
        } else {
            if (there.id > 0.0)
                last = there;
            ++slot;
            if (there.id == 0.0 || receiver.side > 0.0 || slot == slot_count) {
                if (is_nearer_hit(receiver, last, nearest.seen))
                    nearest = Found(last, step);
                last = NOTHING;
                slot = 0;
                ++around;
                step = neighbour(around);
            }
        }
    } while (around < 8);
    return nearest;
}

void main()
{
    GatherPoint point = fetch_point(ivec2(gl_FragCoord.xy) - first_texel);
    int size = textureSize(planes, 0).y;
#ifdef FIND
    vec2 found_hits[BATCH] = no_hits();
#else
    // It would search as long as any.
    if (!point.exists)
        discard;
    vec4 total = vec4(0.0);
#endif
    int i = 0;
    do {
        vec3 direction = directions[i].xyz;
        float side = dot(point.surface_normal, direction) < 0.0 ? -1.0 : 1.0;
        Receiver receiver = receiver(point.position, point.surface_normal, side, to_layer[i], directions[i].w,
                                     metric[i].xyz, ivec2(i * size, 0), float(size));
        Found found = find_hit(receiver);
        int triangle = -1;
        float distance = found.seen.ahead * inversesqrt(metric[i].z);
        if (found.seen.id > 0.0)
            triangle = fetch_triangle_in(receiver.texel + found.step, int(found.seen.id) - 1);
#ifdef FIND
        found_hits[i] = vec2(distance, triangle + 1);
    } while (++i < direction_count);
    write_hits(found_hits);
#else
        vec3 radiance = (side > 0.0 ? beyond[i] : behind[i]).rgb;
        if (triangle >= 0)
            radiance = hit_radiance(triangle, point.position + distance * (side * direction), side * direction);
        total += vec4(radiance, 1.0) * cosine(point, side * direction);
    } while (++i < direction_count);
    sum = total;
#endif
}
