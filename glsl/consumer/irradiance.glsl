// Consumer: adds the cosine-weighted radiance of hits (additive blending). Mirrors `IrradianceGather` in src/gather/irradiance.rs.

#include "include/radiance.glsl"

layout(location = 0) out vec4 sum;  // rgb: radiance x weight; a: weight

void begin()
{
    sum = vec4(0.0);
}

void consume(GatherPoint point, PointHit hit, int i)
{
    vec3 radiance = miss_radiance(hit, i);
    if (hit.triangle > 0)
        radiance = hit_radiance(hit.triangle - 1, hit.position, hit.direction);
    sum += vec4(radiance, 1.0) * cosine(point, hit.direction);
}
