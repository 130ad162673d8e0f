// Consumer: stores hits for glsl/finder/stored.glsl, so that several consumers can read them. Mirrors `Recorder` in src/gather/stored.rs.

layout(location = 0) out vec4 recorded[BATCH / 2];

#define RECORD(t) if (i >> 1 == t) recorded[t] = (i & 1) == 0 ? vec4(value, 0.0, 0.0) : vec4(recorded[t].xy, value)
#define EACH(DO) DO(0); DO(1); DO(2); DO(3)
#define CLEAR(t) recorded[t] = vec4(0.0)

void begin()
{
    EACH(CLEAR);
}

void consume(GatherPoint point, PointHit hit, int i)
{
    vec2 value = vec2(hit.distance, hit.triangle);
    EACH(RECORD);
}
