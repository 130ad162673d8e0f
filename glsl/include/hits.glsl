// The hit of a point along a direction of the batch: finders write it, consumers read it. Mirrors `Found` and `MissRadiance` in src/gather/mod.rs.

uniform vec4 directions[BATCH];     // xyz: unit vector; w: depth bias of its layers, for glsl/finder/layers.glsl
uniform int direction_count;        // at least 1
uniform vec4 miss_along[BATCH];     // rgb: miss radiance along each direction
uniform vec4 miss_against[BATCH];   // rgb: miss radiance against each direction

struct PointHit
{
    vec3 direction;                 // unit vector from the point
    bool against;                   // whether direction is the opposite of directions[i]
    int triangle;                   // counted from 1; 0: a miss, whose distance and position have no meaning
    float distance;                 // from the point
    vec3 position;
};

vec3 miss_radiance(PointHit hit, int i)
{
    return (hit.against ? miss_against[i] : miss_along[i]).rgb;
}
