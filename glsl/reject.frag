#version 330 core
// Early KILL: fragments that get here are rejected by the stencil test from now on; which do, the tests of depth and stencil decide alone.
// Mirrors src/gather/kill.rs.

void main()
{
}
