#version 330 core
// Sampling one layer, as in 2004: every point looks up the texel on its ray and overwrites its hit, unless the texel lies
// behind the point (KILL). Layers come far to near, so the last to survive is the nearest hit. Mirrors src/gather/kill.rs.

#include "points.glsl"
#include "layer.glsl"

uniform sampler2DArray layers;
uniform int element;                // of the layer
uniform vec3 direction;

layout(location = 0) out vec2 hit;  // distance along the direction; triangle, counted from 1

void main()
{
    GatherPoint point = fetch_point(ivec2(gl_FragCoord.xy));
    if (cosine(point, direction) == 0.0)
        discard;
    Receiver receiver = receiver(point.position, point.surface_normal, 1.0);
    ivec2 texel = ivec2(floor(receiver.place.xy));
    Sample nearest = sample_texel(receiver, layers, element, texel);
#ifdef FARTHEST
    if (nearest.triangle == 0.0)
        nearest = sample_around(receiver, layers, element, texel);
    else
#endif
    nearest = sample_beside_edge(receiver, layers, element, texel, nearest);
    if (!is_hit(nearest))
#ifdef EARLY
        nearest = NOTHING;          // facing, and so not culled yet: see Kill::early
#else
        discard;                    // KILL
#endif
    hit = vec2(nearest.ahead * dot(direction, from_layer[2].xyz), nearest.triangle);
}
