// Chooses one of many lamps for a point by a tree, and a sample on it. The twin of `LightTree` in src/scene/light/tree.rs; the tables are those of
// src/geometry/light_tables.rs.

#include "include/albedo.glsl"

uniform sampler2D light_nodes;      // four texels each: centre and radius of a sphere about the lamps; axis of the cone of their normals and the cosine
                                    // of its half angle; power, and the first child or -1 less the index of the lamp
uniform sampler2D lamps;            // four texels each: corner and two edges of a triangle, unit normal of the emitting side; their w: red, green and
                                    // blue of radiance times area, and 1 plus the index in `triangles` if a picture multiplies them, else 0

// The cosine of the difference of two angles from 0 to pi, given by their cosines; 1 if the second is greater.
float cosine_less(float a, float b)
{
    return a > b ? 1.0 : a * b + sqrt(max(1.0 - a * a, 0.0) * max(1.0 - b * b, 0.0));
}

// A bound of the light that a node could bring, up to a factor that all nodes share.
float could_bring(int node, vec3 position, vec3 normal)
{
    ivec2 texel = table_texel(node);
    vec4 sphere = texelFetch(light_nodes, texel, 0);
    vec4 cone = texelFetch(light_nodes, texel + ivec2(1, 0), 0);
    float power = texelFetch(light_nodes, texel + ivec2(2, 0), 0).x;
    vec3 way = sphere.xyz - position;
    float squared = dot(way, way);
    float size = sphere.w * sphere.w;
    float subtended = squared > size ? sqrt(1.0 - size / squared) : -1.0;
    vec3 direction = way / sqrt(max(squared, 1e-20));
    float sends = cosine_less(cosine_less(-dot(cone.xyz, direction), cone.w), subtended);
    float receives = cosine_less(dot(normal, direction), subtended);
    return power * max(sends, 0.0) * max(receives, 0.0) / max(squared, size);
}

// The irradiance from a sample on a lamp, over its probability. `numbers`: uniform, and the factor of all lamps. `ray`: direction and reach.
vec3 lamp_light(GatherPoint point, vec3 origin, vec3 numbers, out vec4 ray)
{
    float left = numbers.x;                                 // renewed by what remains of it after each decision
    float density = 1.0;
    int node = 1;                                           // the first of two children; -1 less the index of a lamp
    do {
        float brings = could_bring(node, origin, point.normal);
        float all = brings + could_bring(node + 1, origin, point.normal);
        float share = brings / max(all, 1e-30);
        bool takes = left < share;
        float chance = takes ? share : 1.0 - share;
        left = min((takes ? left : left - share) / chance, 0.99999994);
        density *= all > 0.0 ? chance : 0.0;
        node = int(texelFetch(light_nodes, table_texel(takes ? node : node + 1) + ivec2(2, 0), 0).y);
    } while (node >= 0 && density > 0.0);
    ivec2 texel = table_texel(max(-1 - node, 0));
    vec4 corner = texelFetch(lamps, texel, 0);
    vec4 first = texelFetch(lamps, texel + ivec2(1, 0), 0);
    vec4 second = texelFetch(lamps, texel + ivec2(2, 0), 0);
    vec4 facing = texelFetch(lamps, texel + ivec2(3, 0), 0);
    // As `AreaLight::point_on` in src/scene/light/area.rs.
    float along = sqrt(left);
    vec3 place = corner.xyz + (1.0 - along) * first.xyz + numbers.y * along * second.xyz;
    vec3 way = place - origin;
    float distance = length(way);
    vec3 direction = way / distance;
    float received = cosine(point, direction) * max(-dot(facing.xyz, direction), 0.0) / (distance * distance);
    // At a distance of 0 it is no number.
    bool lit = received > 0.0 && density > 0.0;
    vec3 light = lit ? vec3(corner.w, first.w, second.w) * (received * numbers.z / density) : vec3(0.0);
    // Software drivers skip loops, not branches.
    for (bool pictured = lit && facing.w > 0.0; pictured; pictured = false)
        light = pictured_emission(light, fetch_surface(int(facing.w) - 1), place);
    ray = vec4(direction, distance);
    return light;
}
