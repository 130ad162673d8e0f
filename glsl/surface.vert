#version 330 core
// The scene's triangles under any projection. Mirrors `Geometry` in src/geometry.rs.

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;    // zero: flat shading

uniform mat4 to_clip;

out vec3 surface_position;
out vec3 surface_normal;

void main()
{
    surface_position = position;
    surface_normal = normal;
    gl_Position = to_clip * vec4(position, 1.0);
}
