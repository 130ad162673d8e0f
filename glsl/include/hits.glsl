// What points see along a batch of directions. Mirrors `Hits` in src/gather/hits.rs.

uniform sampler2DArray hits;        // two directions in an element: distance; triangle, counted from 1, 0 where nothing is
uniform vec4 directions[BATCH];     // xyz
uniform vec4 beyond[BATCH];         // rgb: radiance of what lies beyond all surfaces along each direction,
uniform vec4 behind[BATCH];         // and against it
uniform int direction_count;
uniform bool both_ends;             // of each direction, a point looks along the one on its side of its surface

struct PointHit
{
    vec3 direction;                 // from the point
    float distance;
    int triangle;                   // counted from 1; 0 where nothing is,
    vec3 beyond;                    // then its radiance
};

PointHit fetch_hit(GatherPoint point, ivec2 place, int i)
{
    vec4 pair = texelFetch(hits, ivec3(place, i >> 1), 0);
    vec2 hit = (i & 1) == 0 ? pair.xy : pair.zw;
    vec3 direction = directions[i].xyz;
    bool against = both_ends && dot(point.surface_normal, direction) < 0.0;
    return PointHit(against ? -direction : direction, hit.x, int(hit.y), (against ? behind[i] : beyond[i]).rgb);
}
