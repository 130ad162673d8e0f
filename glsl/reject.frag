#version 330 core
// Early KILL: the depth and stencil tests decide which fragments get here; later the stencil test rejects them. Mirrors src/gather/kill.rs.

void main()
{
}
