// The photon map on surfaces. Mirrors `PhotonAtlas` in src/photon/atlas/mod.rs, which explains charts, pages and pieces, and src/photon/texture.rs.

uniform usampler2D atlas_triangles; // chart * 2, plus 1 if the front of the triangle is the back of its chart
uniform sampler2D atlas_charts;     // four texels each: u and v, in pages, as functions of the position; first page, pages along u and v
uniform usampler2D atlas_pages;     // first cell * 16 + binary logarithm of the cells along a side
uniform usampler2D atlas_cells;     // piece
uniform sampler2D atlas_irradiance; // of each piece, on the front and on the back of its chart

ivec2 atlas_texel(int index)
{
    return ivec2(index & 1023, index >> 10);
}

// Irradiance at a position on one side of a triangle.
vec3 photon_irradiance(int triangle, vec3 position, bool front)
{
    uint code = texelFetch(atlas_triangles, atlas_texel(triangle), 0).x;
    ivec2 chart = table_texel(int(code >> 1));
    vec4 u = texelFetch(atlas_charts, chart, 0);
    vec4 v = texelFetch(atlas_charts, chart + ivec2(1, 0), 0);
    vec3 pages = texelFetch(atlas_charts, chart + ivec2(2, 0), 0).xyz;
    vec2 place = vec2(dot(u.xyz, position) + u.w, dot(v.xyz, position) + v.w);
    vec2 page = clamp(floor(place), vec2(0.0), pages.yz - 1.0);
    uint word = texelFetch(atlas_pages, atlas_texel(int(pages.x) + int(page.y) * int(pages.y) + int(page.x)), 0).x;
    int shift = int(word & 15u);
    float side = float(1 << shift);
    ivec2 cell = ivec2(clamp((place - page) * side, vec2(0.0), vec2(side - 1.0)));
    int piece = int(texelFetch(atlas_cells, atlas_texel(int(word >> 4) + (cell.y << shift) + cell.x), 0).x);
    return texelFetch(atlas_irradiance, atlas_texel(2 * piece + (front == ((code & 1u) == 0u) ? 0 : 1)), 0).rgb;
}
