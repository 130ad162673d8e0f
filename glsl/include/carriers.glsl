// What was gathered at the scene's vertices, wherever it is seen. Mirrors `Carriers` in src/bake/carriers.rs.

uniform sampler2D carriers_of;      // four texels a triangle: its corners' carriers; weight of the second, and of the third, as functions of the position
uniform sampler2D carried_values;   // so many texels a carrier, 1024 in a row
uniform int carried_texels;

struct Carriers
{
    ivec3 corners;
    vec3 weights;
};

Carriers fetch_carriers(int triangle, vec3 position)
{
    ivec2 texel = table_texel(triangle);
    vec4 second = texelFetch(carriers_of, texel + ivec2(1, 0), 0);
    vec4 third = texelFetch(carriers_of, texel + ivec2(2, 0), 0);
    vec2 weights = clamp(vec2(dot(second.xyz, position) + second.w, dot(third.xyz, position) + third.w), 0.0, 1.0);
    return Carriers(ivec3(texelFetch(carriers_of, texel, 0).xyz), vec3(1.0 - weights.x - weights.y, weights));
}

vec4 carried_by(int carrier, int texel)
{
    int index = carrier * carried_texels + texel;
    return texelFetch(carried_values, ivec2(index & 1023, index >> 10), 0);
}

vec4 carried(Carriers carriers, int texel)
{
    return carriers.weights.x * carried_by(carriers.corners.x, texel) + carriers.weights.y * carried_by(carriers.corners.y, texel)
        + carriers.weights.z * carried_by(carriers.corners.z, texel);
}
