#version 330 core
// The gather points that the camera sees. Mirrors src/points/camera.rs.

#include "include/surface.glsl"
#ifdef CUT_OUTS
#include "include/opacity.glsl"

flat in uint surface_number;        // of the block
uniform int picture_width;
#endif
#include "include/octahedral.glsl"

in vec3 surface_position;
in vec3 surface_normal;
flat in int surface_triangle;

uniform sampler2D albedo_texture;   // shared by all triangles of the draw
uniform vec3 eye;
uniform vec3 forward;
uniform float near;

layout(location = 0) out vec4 position_out;
layout(location = 1) out vec4 normal_out;
layout(location = 2) out vec4 albedo_out;       // w: entry of the table of triangles
layout(location = 3) out vec4 emission_out;     // without its texture; w: distance along the view axis

void main()
{
    Surface surface = fetch_surface(surface_triangle);
    // Before any fragment is discarded: the level of detail comes from its neighbours.
    vec3 texel = texture(albedo_texture, texture_coordinates(surface, surface_position)).rgb;
#ifdef CUT_OUTS
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    if (is_cut(surface_triangle, surface_position, uint(pixel.y * picture_width + pixel.x), surface_number))
        discard;
#endif
    vec3 to_eye = eye - surface_position;
    bool front = dot(surface.normal, to_eye) > 0.0;
    vec3 geometric = front ? surface.normal : -surface.normal;
    bool flat_shaded = dot(surface_normal, surface_normal) < 1e-12;
    vec3 shading = flat_shaded ? geometric : normalize(surface_normal);
    shading = dot(shading, geometric) < 0.0 ? -shading : shading;

    vec2 code = octahedral_encode(geometric);
    position_out = vec4(surface_position, code.x);
    normal_out = vec4(shading, code.y);
    vec4 plain = texelFetch(materials, material_texel(surface), 0);
    vec3 color = (int(plain.a) & 2) != 0 ? vertex_color(surface_triangle, surface_position) : vec3(1.0);
    albedo_out = vec4(plain.rgb * texel * color, float(surface_triangle));
    // 1 at the near plane, falling with distance: a float is then as precise at the far end of a terrain as in a room within it. At the outline of a
    // closed body a front and a back are equally far, and rounding must not show the back, which lies inside.
    gl_FragDepth = near * gl_FragCoord.w * (front ? 1.0 : 1.0 - 4e-6);
    emission_out = vec4(plain_emission(surface, front), -dot(forward, to_eye));
}
