// Consumer: adds the cosine-weighted radiance of hits (additive blending). With GLOSS, light that passes a point's lobe counts for the sum, and what the
// lobe reflects has sums of its own. Mirrors `IrradianceGather` in src/gather/irradiance.rs.

#include "include/radiance.glsl"

layout(location = 0) out vec4 sum;  // rgb: radiance x weight; a: weight
#ifdef GLOSS
layout(location = 1) out vec4 lobe_sum;     // rgb: radiance x weight of the lobe
layout(location = 2) out vec4 lobe_weight;  // rgb: weight of the lobe
#endif

void begin()
{
    sum = vec4(0.0);
#ifdef GLOSS
    lobe_sum = vec4(0.0);
    lobe_weight = vec4(0.0);
#endif
}

void consume(GatherPoint point, PointHit hit, int i)
{
    vec3 radiance = miss_radiance(hit, i);
    if (hit.triangle > 0)
        radiance = hit_radiance(hit.triangle - 1, hit.position, hit.direction);
#ifdef GLOSS
    float received = cosine(point, hit.direction);
    LobeWeights weights = lobe_weights(point.gloss, point.normal, hit.direction, point.gloss.counts > 0.0);
    sum += vec4(radiance, 1.0) * (received * weights.base);
    lobe_sum.rgb += radiance * received * weights.lobe;
    lobe_weight.rgb += received * weights.lobe;
#else
    sum += vec4(radiance, 1.0) * cosine(point, hit.direction);
#endif
}
