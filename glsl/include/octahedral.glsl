// Unit vectors as two numbers: the octahedron |x| + |y| + |z| = 1, unfolded. Mirrors src/points/list.rs.

vec2 octahedral_encode(vec3 n)
{
    vec2 p = n.xy / (abs(n.x) + abs(n.y) + abs(n.z));
    vec2 fold = (1.0 - abs(p.yx)) * vec2(p.x < 0.0 ? -1.0 : 1.0, p.y < 0.0 ? -1.0 : 1.0);
    return n.z < 0.0 ? fold : p;
}

// Not normalised: readers normalise where they need to, because most of this file's cost is here.
vec3 octahedral_decode(vec2 p)
{
    vec3 n = vec3(p, 1.0 - abs(p.x) - abs(p.y));
    float fold = max(-n.z, 0.0);
    n.xy -= vec2(p.x < 0.0 ? -fold : fold, p.y < 0.0 ? -fold : fold);
    return n;
}
