// A surface of the layer store in 64 bits: 24 bits of depth along the direction, then the upper 20 bits of each of two floats, the change of depth
// to the next texel in x and in y. All bits are 0 where no surface is.

uvec2 pack_surface(float depth, uvec2 slope_bits)
{
    uvec2 bits = slope_bits + 0x800u;       // rounds; the error is at most 1/4096
    return uvec2(uint(depth * 16777216.0) << 8 | bits.x >> 24, (bits.x & 0x00fff000u) << 8 | bits.y >> 12);
}

// (depth, its change to the next texel in x and in y, slot counted from 1; 0: no surface).
vec4 unpack_surface(uvec2 bits, int slot)
{
    float depth = float(bits.x >> 8) / 16777216.0;
    vec2 slope = vec2(uintBitsToFloat(bits.x << 24 | bits.y >> 8 & 0x00fff000u), uintBitsToFloat(bits.y << 12));
    return vec4(depth, slope, depth == 0.0 ? 0.0 : float(slot + 1));
}
