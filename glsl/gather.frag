#version 330 core
// Final gathering: each point looks along every direction of a batch. A hit finder (a file of glsl/finder/) finds the hit, and a consumer (a file
// of glsl/consumer/) uses it. The defines FINDER and CONSUMER name the two. Mirrors src/gather/pass.rs.
//
// A finder defines `PointHit find_hit(GatherPoint point, ivec2 place, int i)` for direction i of the batch.
// A consumer declares the outputs. Its `begin` clears them, and its `consume` adds one hit.

#include "include/points.glsl"
#include "include/hits.glsl"
#include "finder/FINDER.glsl"
#include "consumer/CONSUMER.glsl"

uniform ivec2 first_texel;          // of the tile that holds this subset of the points

void main()
{
    ivec2 place = ivec2(gl_FragCoord.xy) - first_texel;
    GatherPoint point = fetch_point(place);
    // Without this, texels without a point would search as long as others.
    if (!point.exists)
        discard;
    begin();
    // The loop tests at the end. With a test at the beginning, software drivers run the body once more before they see it fail.
    int i = 0;
    do {
        consume(point, find_hit(point, place, i), i);
    } while (++i < direction_count);
}
