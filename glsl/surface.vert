#version 330 core
// The scene's triangles under any projection. Mirrors `Geometry` in src/geometry.rs.

layout(location = 0) in vec3 position;
layout(location = 1) in vec3 normal;   // zero: flat shading
layout(location = 2) in vec2 uv;

uniform mat4 to_clip;

out vec3 surface_position;
out vec3 surface_normal;
out vec2 surface_uv;

void main()
{
    surface_position = position;
    surface_normal = normal;
    surface_uv = uv;
    gl_Position = to_clip * vec4(position, 1.0);
}
