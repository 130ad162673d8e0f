// Values gathered at the scene's vertices, interpolated at a hit. Mirrors `VertexCache` in src/bake/vertex_cache.rs.

uniform sampler2D cache_vertices;   // four texels a triangle: cached vertices of its corners; weights of corners 2 and 3 as functions of the position
uniform sampler2D cached_values;    // cached_texels for each vertex, 1024 in a row
uniform int cached_texels;

// A place between three vertices.
struct CachePlace
{
    ivec3 vertices;
    vec3 weights;
};

CachePlace cache_place(int triangle, vec3 position)
{
    ivec2 texel = table_texel(triangle);
    vec4 second = texelFetch(cache_vertices, texel + ivec2(1, 0), 0);
    vec4 third = texelFetch(cache_vertices, texel + ivec2(2, 0), 0);
    vec2 weights = clamp(vec2(dot(second.xyz, position) + second.w, dot(third.xyz, position) + third.w), 0.0, 1.0);
    return CachePlace(ivec3(texelFetch(cache_vertices, texel, 0).xyz), vec3(1.0 - weights.x - weights.y, weights));
}

vec4 cached_at(int vertex, int texel)
{
    int index = vertex * cached_texels + texel;
    return texelFetch(cached_values, ivec2(index & 1023, index >> 10), 0);
}

vec4 cached(CachePlace place, int texel)
{
    return place.weights.x * cached_at(place.vertices.x, texel) + place.weights.y * cached_at(place.vertices.y, texel)
        + place.weights.z * cached_at(place.vertices.z, texel);
}
