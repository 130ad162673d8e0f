// Reads the layer store: a texel has its surfaces in slots, far to near. Mirrors `LayerStore` in src/gather/layer_store/mod.rs.

#include "include/packed_surface.glsl"

uniform usampler2DArray planes;     // two slots in an element
uniform usampler2DArray stored_triangles;   // four slots in an element
uniform int slot_count;

vec4 fetch_surface_in(ivec2 texel, int slot)
{
    uvec4 pair = texelFetch(planes, ivec3(texel, slot >> 1), 0);
    return unpack_surface((slot & 1) == 0 ? pair.xy : pair.zw, slot);
}

int fetch_triangle_in(ivec2 texel, int slot)
{
    uvec4 four = texelFetch(stored_triangles, ivec3(texel, slot >> 2), 0);
    uvec2 two = (slot & 2) == 0 ? four.xy : four.zw;
    return int((slot & 1) == 0 ? two.x : two.y);
}
