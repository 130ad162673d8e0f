#version 330 core
// The scene's triangles under any projection. Vertices are not shared, so that their numbers tell the triangle: softpipe draws
// nothing where a fragment shader reads gl_PrimitiveID. Mirrors `Geometry` in src/geometry.rs.

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;    // zero: flat shading

#ifdef BATCH
uniform mat4 to_clip[BATCH];            // one for each instance
#else
uniform mat4 to_clip;
#endif

out vec3 surface_position;
out vec3 surface_normal;
flat out int surface_triangle;
invariant gl_Position;                  // peeling compares depths that different programs have made

void main()
{
    surface_position = position;
    surface_normal = normal;
    surface_triangle = gl_VertexID / 3;
#ifdef BATCH
    gl_Position = to_clip[gl_InstanceID] * vec4(position, 1.0);
#else
    gl_Position = to_clip * vec4(position, 1.0);
#endif
}
