#version 330 core
// Samples one layer by the method of 2004: every point looks up the texel on its ray and overwrites its hit, unless the texel lies behind the point
// (KILL). Layers come far to near, so the last sample that survives is the nearest hit. Mirrors src/gather/kill.rs.

#include "include/points.glsl"
#include "include/layer.glsl"

uniform sampler2D layer;
uniform vec3 direction;
uniform mat4 to_layer;              // unit space to texel x, texel y, window depth
uniform float depth_bias;           // see Receiver
uniform vec3 metric;                // see Receiver

layout(location = 0) out vec2 hit;  // distance along the direction; triangle, counted from 1

#ifdef FARTHEST

// A texel on the scene's outline may have its centre outside the scene. Then a texel around it has the surface that closes the scene. It must lie
// above the tangent plane, because around a convex body nothing does. Of several, the ray leaves the scene through the nearest.
Sample sample_around(Receiver receiver)
{
    Sample nearest = NOTHING;
    for (int i = 0; i < 8; ++i) {
        ivec2 step = neighbour(i);
        vec4 surface = texelFetch(layer, receiver.texel + step, 0);
        Sample beside = sample_surface(receiver, surface, receiver.offset - vec2(step));
        if (is_nearer_hit(receiver, beside, nearest))
            nearest = beside;
    }
    return nearest;
}

#endif

void main()
{
    GatherPoint point = fetch_point(ivec2(gl_FragCoord.xy));
    if (cosine(point, direction) == 0.0)
        discard;
    float size = float(textureSize(layer, 0).y);
    Receiver receiver = receiver(point.position, point.surface_normal, 1.0, to_layer, depth_bias, metric, ivec2(0), size);
    vec4 surface = texelFetch(layer, receiver.texel, 0);
    Sample nearest = sample_surface(receiver, surface, receiver.offset);
#ifdef FARTHEST
    if (nearest.id == 0.0)
        nearest = sample_around(receiver);
    else
#endif
    if (nearest.id == 0.0 || nearest.above <= receiver.depth_bias) {
        ivec2 step = step_beside_edge(receiver);
        vec4 beside = texelFetch(layer, receiver.texel + step, 0);
        if (step != ivec2(0) && !has_ended(receiver, beside, step))
            nearest = sample_surface(receiver, beside, receiver.offset - vec2(step));
    }
    if (!is_hit(receiver, nearest))
#ifdef EARLY
        nearest = NOTHING;          // the point faces the direction, so this layer does not cull it: see Kill::early
#else
        discard;                    // KILL
#endif
    hit = vec2(nearest.ahead * inversesqrt(metric.z), nearest.id);
}
