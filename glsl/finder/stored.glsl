// Hit finder: reads the hits of the whole batch from a texture. Mirrors `StoredHits` in src/gather/stored.rs.

uniform sampler2DArray hits;        // two directions in an element: distance; triangle, counted from 1, 0 for a miss
uniform bool both_ends;             // a point looks along the end of the direction on its side of its surface

PointHit find_hit(GatherPoint point, ivec2 place, int i)
{
    vec4 pair = texelFetch(hits, ivec3(place, i >> 1), 0);
    vec2 hit = (i & 1) == 0 ? pair.xy : pair.zw;
    vec3 direction = directions[i].xyz;
    bool against = both_ends && dot(point.surface_normal, direction) < 0.0;
    direction = against ? -direction : direction;
    return PointHit(direction, against, int(hit.y), hit.x, point.position + hit.x * direction);
}
