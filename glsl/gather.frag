#version 330 core
// Final gathering: each point looks along every direction of a batch. A finder (a file of glsl/finder/) finds the hit, and a consumer (a file of
// glsl/consumer/) uses it. The defines FINDER and CONSUMER name the two. Mirrors src/gather/pass.rs.
//
// A finder gives `PointHit find_hit(GatherPoint point, ivec2 place, int i)` for direction i of the batch.
// A consumer declares the outputs, `begin` clears them, and `consume` adds one hit.

#include "include/points.glsl"
#include "include/hits.glsl"
#include "finder/FINDER.glsl"
#include "consumer/CONSUMER.glsl"

uniform ivec2 first_texel;          // of the tile that holds this subset of the points

void main()
{
    ivec2 place = ivec2(gl_FragCoord.xy) - first_texel;
    GatherPoint point = fetch_point(place);
    // Texels without a point would search as long as any.
    if (!point.exists)
        discard;
    begin();
    // The loop tests at the end: software drivers run the body once more to find that a test at the beginning fails.
    int i = 0;
    do {
        consume(point, find_hit(point, place, i), i);
    } while (++i < direction_count);
}
