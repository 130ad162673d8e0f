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

// The first texel of an entry: tables are 1024 texels wide, and entries have 4 texels, the last one unused. No division, which is slow
// on software drivers, and on softpipe traps in lanes that a branch has switched off.
ivec2 table_texel(int entry)
{
    return ivec2(entry & 255, entry >> 8) * ivec2(4, 1);
}

Surface fetch_surface(int triangle)
{
    ivec2 texel = table_texel(triangle);
    vec4 first = texelFetch(triangles, texel, 0);
    int code = int(first.w);        // material * 4 + axis
    return Surface(first.xyz, code & 3, code >> 2, texelFetch(triangles, texel + ivec2(1, 0), 0),
                   texelFetch(triangles, texel + ivec2(2, 0), 0));
}

// What the material itself reflects; its texture multiplies it.
vec3 plain_albedo(Surface surface)
{
    return texelFetch(materials, table_texel(surface.material), 0).rgb;
}

vec3 emission(Surface surface)
{
    return texelFetch(materials, table_texel(surface.material) + ivec2(1, 0), 0).rgb;
}

vec2 texture_coordinates(Surface surface, vec3 position)
{
    // v runs up, texture rows run down.
    return vec2(dot(surface.u.xyz, position) + surface.u.w, -dot(surface.v.xyz, position) - surface.v.w);
}

