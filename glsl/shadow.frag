#version 330 core
// One face of a shadow map: the inverse distance along the face's axis, linear over the face, and its slope. Mirrors src/direct.rs.

layout(location = 0) out vec4 plane;

void main()
{
    float inverse = gl_FragCoord.w;
    plane = vec4(inverse, dFdx(inverse), dFdy(inverse), 0.0);
}
