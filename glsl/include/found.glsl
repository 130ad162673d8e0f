// Writes down what a point sees along a batch of directions, for glsl/include/hits.glsl. Mirrors `FoundHits` in src/gather/hits.rs.

layout(location = 0) out vec4 found[BATCH / 2];

vec2[BATCH] no_hits()
{
    vec2 none[BATCH];
    for (int i = 0; i < BATCH; ++i)
        none[i] = vec2(0.0);
    return none;
}

// Of each direction the distance and the triangle, counted from 1.
void write_hits(vec2 hits[BATCH])
{
    found[0] = vec4(hits[0], hits[1]);
    found[1] = vec4(hits[2], hits[3]);
    found[2] = vec4(hits[4], hits[5]);
    found[3] = vec4(hits[6], hits[7]);
}
