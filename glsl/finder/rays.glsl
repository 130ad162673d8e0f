// Hit finder: each point casts an exact ray towards the end of the direction on its side of its surface. Mirrors src/gather/rays.rs.

#include "include/bvh.glsl"

PointHit find_hit(GatherPoint point, ivec2 place, int i)
{
    bool against = dot(point.surface_normal, directions[i].xyz) < 0.0;
    vec3 direction = (against ? -1.0 : 1.0) * directions[i].xyz;
    vec3 origin = point.position + RAY_OFFSET * point.surface_normal;
    BvhHit hit = nearest_hit(origin, direction, cosine(point, direction) > 0.0 ? FARTHEST : NOWHERE);
    int triangle = hit.place < 0 ? 0 : triangle_at(hit.place) + 1;
    return PointHit(direction, against, triangle, hit.distance, origin + hit.distance * direction);
}
