// Finds the nearest triangle on a ray in a bounding volume hierarchy that needs no stack. With ANY_HIT the search ends at the first triangle found.
// With CUT_OUTS a ray passes through what is cut; with ANY_HIT too it finds what all triangles on it let pass.
// Mirrors src/geometry/ray_tables.rs, and `FlatBvh` in src/scene/flat_bvh.rs.
//
// Software drivers run both sides of every branch, but leave a loop when no ray is left in it. So work that can be skipped is in loops, which test at
// the end, to test once less. Two rules for llvmpipe (Mesa 22.3): a ray that has left a loop keeps only variables that the loop carries from turn to
// turn, so code after a loop reads no others; and tests are products of comparisons, not branches.

#include "include/surface.glsl"
#ifdef CUT_OUTS
#include "include/opacity.glsl"
#endif

uniform usampler2D bvh_nodes;       // a texel each, 1024 in a row
uniform int bvh_count;              // nodes of one order
uniform vec3 bvh_origin;            // origin of box coordinates
uniform vec3 bvh_step;              // length of their unit
uniform sampler2D bvh_triangles;    // in the order of the leaves, four texels each: plane; weights of two corners as functions of
                                    // the position; index

const float FARTHEST = 4.0;         // beyond the scene, whose diameter is 2
const float NOWHERE = -1.0;         // reach of a ray that is not cast
const float RAY_OFFSET = 1e-6;      // height above its surface at which a ray starts, as in src/scene/bvh.rs

struct BvhHit
{
    float distance;
    int place;                      // place of the triangle in the leaves; -1: no hit
#if defined(CUT_OUTS) && defined(ANY_HIT)
    float passed;                   // share of the light that passes; 0 with a hit
#endif
};

#ifdef CUT_OUTS
uint ray_number = 0u;               // of the direction, with its bits reversed: see `threshold` in glsl/include/opacity.glsl
#endif

// The index in `triangles` of the triangle at a place in the leaves.
int triangle_at(int place)
{
    return int(texelFetch(bvh_triangles, table_texel(place) + ivec2(3, 0), 0).x);
}

// Both sides of a triangle count. Its plane gives the distance; the weights of the corners at that position show whether the ray meets the triangle
// (Baldwin and Weber 2016, "Fast ray-triangle intersections by coordinate transformation").
// `last` is the place behind its leaf.
void meet_triangle(int place, int last, vec3 origin, vec3 direction, inout BvhHit nearest)
{
    ivec2 texel = table_texel(place);
    vec4 plane = texelFetch(bvh_triangles, texel, 0);
    vec4 second = texelFetch(bvh_triangles, texel + ivec2(1, 0), 0);
    vec4 third = texelFetch(bvh_triangles, texel + ivec2(2, 0), 0);
    float distance = -(dot(plane.xyz, origin) + plane.w) / dot(plane.xyz, direction);
    vec3 position = origin + distance * direction;
    float u = dot(second.xyz, position) + second.w;
    float v = dot(third.xyz, position) + third.w;
    bool met = distance > 0.0 && distance < nearest.distance && min(min(u, v), 1.0 - u - v) >= 0.0;
#ifdef CUT_OUTS
    // What a ray without a leaf tests would take its share of the light twice.
    if (met && place < last) {
        int triangle = triangle_at(place);
#ifdef ANY_HIT
        nearest.passed *= is_cut_out(triangle) ? 1.0 - opacity(triangle, position) : 0.0;
        met = nearest.passed == 0.0;
#else
        met = !is_cut(triangle, position, 0u, ray_number);
#endif
    }
#endif
    nearest.distance = met ? distance : nearest.distance;
    nearest.place = met ? place : nearest.place;
}

// The nearest triangle that a ray meets within its reach; with ANY_HIT one of them.
BvhHit nearest_hit(vec3 origin, vec3 direction, float reach)
{
    // Avoids division by zero. The change moves the ray by less than the margin of the boxes.
    vec3 slope = mix(direction, vec3(1e-7), lessThan(abs(direction), vec3(1e-7)));
    // The distance to a box side at step s is factor * s + offset.
    vec3 factor = bvh_step / slope;
    vec3 offset = (bvh_origin - origin) / slope;
    ivec3 octant = ivec3(lessThan(slope, vec3(0.0))) * ivec3(1, 2, 4);
    int node = (octant.x + octant.y + octant.z) * bvh_count;
    int end = node + bvh_count;
#if defined(CUT_OUTS) && defined(ANY_HIT)
    BvhHit nearest = BvhHit(reach, -1, 1.0);
#else
    BvhHit nearest = BvhHit(reach, -1);
#endif
    do {
        int leaf = 0;
        do {
            uvec4 words = texelFetch(bvh_nodes, ivec2(node & 1023, node >> 10), 0);
            vec3 enter = vec3(ivec3(words.xyz & 0xffffu)) * factor + offset;
            vec3 leave = vec3(ivec3(words.xyz >> 16)) * factor + offset;
            bool met = max(max(enter.x, enter.y), max(enter.z, 0.0)) <= min(min(leave.x, leave.y), min(leave.z, nearest.distance));
            int code = int(words.w);    // negative for leaves
            leaf = met && code < 0 ? code & 0x7fffffff : leaf;
            node = met || code < 0 ? node + 1 : code;
        } while (leaf == 0 && node < end);
        // A ray without a leaf tests the first triangle of the scene, which does no harm.
        int place = leaf >> 3;
        int last = place + (leaf & 7);
        do {
            meet_triangle(place, last, origin, direction, nearest);
            ++place;
        } while (place < last);
#ifdef ANY_HIT
        node = nearest.place < 0 ? node : end;
#endif
    } while (node < end);
    return nearest;
}
