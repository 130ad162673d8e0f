// What a fragment of the scene is made of. Mirrors `Geometry` in src/geometry.rs.

in vec3 surface_position;
in vec3 surface_normal;
in vec2 surface_uv;

uniform sampler2D triangles;        // a texel each: unit geometric normal; material * 4 + dominant axis of the normal
uniform sampler2D materials;        // two texels each: albedo, emission
uniform sampler2D albedo_texture;   // of all triangles in this draw
uniform int first_triangle;         // of this draw

struct Surface
{
    vec3 normal;                    // geometric, on the side the triangle winds counter-clockwise
    int axis;                       // 0, 1, 2: the largest component of that normal
    int material;
};

Surface fetch_surface()
{
    int id = first_triangle + gl_PrimitiveID;
    int width = textureSize(triangles, 0).x;
    vec4 texel = texelFetch(triangles, ivec2(id % width, id / width), 0);
    int code = int(texel.w);
    return Surface(texel.xyz, code & 3, code >> 2);
}

vec3 fetch_material(int material, int column)
{
    int per_row = textureSize(materials, 0).x / 2;
    return texelFetch(materials, ivec2(material % per_row * 2 + column, material / per_row), 0).rgb;
}

// The derivatives of surface_uv are taken by the caller, before any fragment of the quad is discarded.
vec3 surface_albedo(int material, vec2 uv_dx, vec2 uv_dy)
{
    vec2 flip = vec2(1.0, -1.0);    // v runs up, texture rows run down
    return fetch_material(material, 0) * textureGrad(albedo_texture, surface_uv * flip, uv_dx * flip, uv_dy * flip).rgb;
}

vec3 surface_emission(int material)
{
    return fetch_material(material, 1);
}
