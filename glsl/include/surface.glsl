// The tables of the scene's triangles and materials. Mirrors `Geometry` in src/geometry.rs.

uniform sampler2D triangles;        // four texels each: see Surface; index in the scene, and 1 if it may be cut
uniform sampler2D materials;        // eight texels each, see material_texel
uniform sampler2D colors;           // three texels for each triangle: red, green and blue as functions of the position; empty without vertex colours

struct Surface
{
    vec3 normal;                    // unit geometric normal, on the side where the triangle winds counter-clockwise
    int axis;                       // 0, 1, 2: the largest component of that normal
    int material;
    vec4 u;                         // texture coordinates as functions of the position: u = dot(u.xyz, position) + u.w
    vec4 v;
};

// The first texel of an entry. Tables are 1024 texels wide; an entry has 4 texels. Division is slow on software drivers, and
// softpipe traps on it in lanes that a branch has switched off, so this uses none.
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

// The first texel of a surface's material:
// 0: albedo; a: bits of what varies it, 1 a texture, 2 vertex colours, 4 gloss
// 1: emission; a: 1 if the back emits
// 2: albedo texture
// 3: added to the albedo of hits, with gloss
// 4: texture whose alpha is opacity; 0 if it has none
// 5: opacity, which that alpha multiplies; least opacity of what is there, -1 if it lets a share of the light pass
// 6: emission texture; zero without one
// 7: multiplies the albedo of hits, with gloss
ivec2 material_texel(Surface surface)
{
    return table_texel(2 * surface.material);
}

// The albedo of the material, without its texture and vertex colours, which multiply it.
vec3 plain_albedo(Surface surface)
{
    return texelFetch(materials, material_texel(surface), 0).rgb;
}

// The vertex colours of a triangle at a position.
vec3 vertex_color(int triangle, vec3 position)
{
    ivec2 texel = table_texel(triangle);
    vec4 place = vec4(position, 1.0);
    vec3 color = vec3(dot(texelFetch(colors, texel, 0), place), dot(texelFetch(colors, texel + ivec2(1, 0), 0), place),
                      dot(texelFetch(colors, texel + ivec2(2, 0), 0), place));
    // Rounding may leave the range.
    return clamp(color, 0.0, 1.0);
}

// The radiance that the front or the back emits, without its texture, which multiplies it.
vec3 plain_emission(Surface surface, bool front)
{
    vec4 emitted = texelFetch(materials, material_texel(surface) + ivec2(1, 0), 0);
    return front || emitted.a > 0.0 ? emitted.rgb : vec3(0.0);
}

vec2 texture_coordinates(Surface surface, vec3 position)
{
    // v runs up, texture rows run down.
    return vec2(dot(surface.u.xyz, position) + surface.u.w, 1.0 - (dot(surface.v.xyz, position) + surface.v.w));
}

