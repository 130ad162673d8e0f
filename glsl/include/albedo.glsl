// The albedo of a hit. Mirrors `Geometry` in src/geometry.rs.

#include "include/surface.glsl"

#ifdef TEXTURED

#include "include/texture.glsl"

// The albedo of a triangle at a position.
vec3 albedo(int triangle, Surface surface, vec3 position)
{
    ivec2 texel = material_texel(surface);
    vec4 plain = texelFetch(materials, texel, 0);
    int varied = int(plain.a);
    vec3 color = plain.rgb;
    if ((varied & 2) != 0)
        color *= vertex_color(triangle, position);
    if ((varied & 1) != 0)
        color *= texture_color(texelFetch(materials, texel + ivec2(2, 0), 0), texture_coordinates(surface, position)).rgb;
    if ((varied & 4) != 0)
        color = color * texelFetch(materials, texel + ivec2(7, 0), 0).rgb + texelFetch(materials, texel + ivec2(3, 0), 0).rgb;
    return color;
}

#else

vec3 albedo(int triangle, Surface surface, vec3 position)
{
    return plain_albedo(surface);
}

#endif
