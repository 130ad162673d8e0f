// Hit finder: each point casts an exact ray towards the end of the direction on its side of its surface. Mirrors src/gather/rays.rs.

#include "include/bvh.glsl"

#ifdef CUT_OUTS
uniform uint numbers[BATCH];        // of the directions, with their bits reversed
#endif

PointHit find_hit(GatherPoint point, ivec2 place, int i)
{
    bool against = dot(point.surface_normal, directions[i].xyz) < 0.0;
    vec3 direction = (against ? -1.0 : 1.0) * directions[i].xyz;
    vec3 origin = point.position + RAY_OFFSET * point.surface_normal;
#ifdef CUT_OUTS
    ray_number = numbers[i];
#endif
    BvhHit hit = nearest_hit(origin, direction, cosine(point, direction) > 0.0 ? FARTHEST : NOWHERE);
    int triangle = hit.place < 0 ? 0 : triangle_at(hit.place) + 1;
    return PointHit(direction, against, triangle, hit.distance, origin + hit.distance * direction);
}
