// What the scene's triangles are made of. Mirrors `Geometry` in src/geometry.rs.

uniform sampler2D triangles;        // three texels each, see Surface
uniform sampler2D materials;        // three texels each: albedo (a: 1 with a texture), emission, albedo texture

struct Surface
{
    vec3 normal;                    // geometric, on the side the triangle winds counter-clockwise
    int axis;                       // 0, 1, 2: the largest component of that normal
    int material;
    vec4 u;                         // texture coordinates as functions of the position: u = dot(u.xyz, position) + u.w
    vec4 v;
};

// The first texel of entry `index` in a table with entries of `width` texels. Unsigned, because softpipe also divides in lanes that a
// branch has switched off, and there a signed division of whatever they hold can trap.
ivec2 table_texel(sampler2D table, int index, uint width)
{
    uint per_row = uint(textureSize(table, 0).x) / width;
    return ivec2(uint(index) % per_row * width, uint(index) / per_row);
}

Surface fetch_surface(int triangle)
{
    ivec2 texel = table_texel(triangles, triangle, 3u);
    vec4 first = texelFetch(triangles, texel, 0);
    int code = int(first.w);        // material * 4 + axis
    return Surface(first.xyz, code & 3, code >> 2, texelFetch(triangles, texel + ivec2(1, 0), 0),
                   texelFetch(triangles, texel + ivec2(2, 0), 0));
}

// What the material itself reflects; its texture multiplies it.
vec3 plain_albedo(Surface surface)
{
    return texelFetch(materials, table_texel(materials, surface.material, 3u), 0).rgb;
}

vec3 emission(Surface surface)
{
    return texelFetch(materials, table_texel(materials, surface.material, 3u) + ivec2(1, 0), 0).rgb;
}

vec2 texture_coordinates(Surface surface, vec3 position)
{
    // v runs up, texture rows run down.
    return vec2(dot(surface.u.xyz, position) + surface.u.w, -dot(surface.v.xyz, position) - surface.v.w);
}

