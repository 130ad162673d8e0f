// Whether a fragment of a layer lets the rays of its direction pass. The passes that fill layers discard it, as KILL does with samples.

#include "include/opacity.glsl"

in vec3 surface_position;
flat in uint surface_number;

bool is_cut_fragment(int triangle)
{
    return is_cut(triangle, surface_position, 0u, surface_number);
}
