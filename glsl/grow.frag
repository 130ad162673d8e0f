#version 330 core
// Grows the farthest layer by one texel. Points lie on the scene, but a texel on its outline may have its centre outside; a point
// there would see nothing, and closed rooms would darken along their edges. Mirrors src/gather/peel.rs.

uniform sampler2D farthest;

layout(location = 0) out vec4 layer;    // as peel.frag writes it, the triangle negative where it was grown

const ivec2 NEIGHBOURS[8] = ivec2[8](ivec2(-1, 0), ivec2(1, 0), ivec2(0, -1), ivec2(0, 1),
                                     ivec2(-1, -1), ivec2(1, -1), ivec2(-1, 1), ivec2(1, 1));

void main()
{
    ivec2 here = ivec2(gl_FragCoord.xy);
    ivec2 last = textureSize(farthest, 0) - 1;
    layer = texelFetch(farthest, here, 0);
    for (int i = 0; i < 8 && layer.w == 0.0; ++i) {
        ivec2 there = clamp(here + NEIGHBOURS[i], ivec2(0), last);
        layer = texelFetch(farthest, there, 0);
        layer.x += dot(layer.yz, vec2(here - there));
        layer.w = -layer.w;
    }
}
