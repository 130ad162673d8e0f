#version 330 core
// Draws the scene's triangles by any projection. Triangles share no vertices, so the vertex number gives the triangle: softpipe draws nothing
// when a fragment shader reads gl_PrimitiveID. Mirrors `Geometry` in src/geometry.rs.

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;    // zero: flat shading

#ifdef BATCH
uniform mat4 to_clip[BATCH];            // one for each instance, into its tile of a row
uniform int tiles;                      // in the row
out float gl_ClipDistance[2];           // from the left and the right border of the tile: a bundle may leave out a part of the scene
#else
uniform mat4 to_clip;
#endif

#ifdef CUT_OUTS
#ifdef BATCH
uniform uint numbers[BATCH];            // of the directions, with their bits reversed: see glsl/include/opacity.glsl
#else
uniform uint numbers[1];
#endif
flat out uint surface_number;
#endif

out vec3 surface_position;
out vec3 surface_normal;
flat out int surface_triangle;
invariant gl_Position;                  // peeling compares depths from different programs

void main()
{
    surface_position = position;
    surface_normal = normal;
    surface_triangle = gl_VertexID / 3;
#ifdef CUT_OUTS
    surface_number = numbers[gl_InstanceID];
#endif
#ifdef BATCH
    gl_Position = to_clip[gl_InstanceID] * vec4(position, 1.0);
    float across = 0.5 * (gl_Position.x + 1.0) * float(tiles) - float(gl_InstanceID);
    gl_ClipDistance[0] = across;
    gl_ClipDistance[1] = 1.0 - across;
#else
    gl_Position = to_clip * vec4(position, 1.0);
#endif
}
