// What points see along a batch of directions. Mirrors `Hits` in src/gather/hits.rs.

uniform sampler2DArray hits;        // two directions in an element: distance; triangle, counted from 1, 0 where nothing is
uniform vec4 directions[BATCH];     // xyz
uniform int direction_count;
uniform bool both_ends;             // of each direction, a point looks along the one on its side of its surface

struct PointHit
{
    vec3 direction;                 // from the point
    float distance;
    int triangle;                   // counted from 1; 0 where nothing is
};

PointHit fetch_hit(GatherPoint point, ivec2 place, int i)
{
    vec4 pair = texelFetch(hits, ivec3(place, i >> 1), 0);
    vec2 hit = (i & 1) == 0 ? pair.xy : pair.zw;
    vec3 direction = directions[i].xyz;
    return PointHit(both_ends && dot(point.surface_normal, direction) < 0.0 ? -direction : direction, hit.x, int(hit.y));
}
