// Glossy points: a lobe over a diffuse base. Mirrors src/scene/gloss.rs, which has the model, and `PointGloss` in src/points/gloss.rs.

uniform sampler2D point_view;       // xyz: unit vector to the eye; w: width of the lobe, 0 where the point has none and is Lambertian
uniform sampler2D point_straight;   // rgb: reflectance of the lobe straight on; w: 1, or 0 where eye rays follow the lobe

struct Gloss
{
    vec3 eye;
    float alpha;
    vec3 straight;
    float counts;
};

// How light weighs: the base by 1 - s, the lobe by F D V.
struct LobeWeights
{
    float base;
    vec3 lobe;
};

Gloss fetch_gloss(ivec2 texel)
{
    vec4 view = texelFetch(point_view, texel, 0);
    vec4 straight = texelFetch(point_straight, texel, 0);
    return Gloss(view.xyz, view.w, straight.rgb, straight.w);
}

// Share of microfacets that are seen from a direction at this cosine.
float smith(float cosine, float alpha)
{
    return 2.0 * cosine / (cosine + sqrt(alpha * alpha + (1.0 - alpha * alpha) * cosine * cosine));
}

// The weights of light from the unit vector `light` above the unit `normal`, for the lobe if it `counts`. The twin of `Brdf::weights` in src/scene/gloss.rs.
LobeWeights lobe_weights(Gloss gloss, vec3 normal, vec3 light, bool counts)
{
    vec3 sum = gloss.eye + light;
    vec3 middle = sum * inversesqrt(max(dot(sum, sum), 1e-12));
    float tilt = clamp(1.0 - dot(gloss.eye, middle), 0.0, 1.0);
    float s = tilt * tilt * tilt * tilt * tilt;
    float base = gloss.alpha > 0.0 ? 1.0 - s : 1.0;
    float seen = dot(normal, gloss.eye);
    float lit = dot(normal, light);
    if (!counts || gloss.alpha == 0.0 || seen <= 0.0 || lit <= 0.0)
        return LobeWeights(base, vec3(0.0));
    vec3 across = cross(normal, middle);
    float cosine = dot(normal, middle);
    float width = gloss.alpha * gloss.alpha;
    float spread = dot(across, across) + width * cosine * cosine;
    float lobe = 0.318309886 * width / (spread * spread) * smith(seen, gloss.alpha) * smith(lit, gloss.alpha) / (4.0 * seen * lit);
    return LobeWeights(base, (gloss.straight + (1.0 - gloss.straight) * s) * lobe);
}
