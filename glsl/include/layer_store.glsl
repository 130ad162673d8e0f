// Reading the layer store: the surfaces of a texel far to near, in slots. Mirrors `LayerStore` in src/gather/layer_store.rs.

uniform usampler2DArray planes;     // two slots in an element, as layer_store.frag writes them
uniform usampler2DArray stored_triangles;   // a slot in an element
uniform int slot_count;

// (depth, its change to the next texel in x and y, slot counted from 1); the last is 0 where nothing is.
vec4 unpack_surface(uvec2 bits, int slot)
{
    float depth = float(bits.x >> 8) / 16777216.0;
    vec2 slope = vec2(uintBitsToFloat(bits.x << 24 | bits.y >> 8 & 0x00fff000u), uintBitsToFloat(bits.y << 12));
    return vec4(depth, slope, depth == 0.0 ? 0.0 : float(slot + 1));
}

vec4 fetch_surface_in(ivec2 texel, int slot)
{
    uvec4 pair = texelFetch(planes, ivec3(texel, slot >> 1), 0);
    return unpack_surface((slot & 1) == 0 ? pair.xy : pair.zw, slot);
}
