// An EGL driver with faults: Mesa's, with a hand between it and GLVND, which takes it for a vendor's own. So the tool under test is the one that
// people run. Which faults there are, the environment says; what happened is written down at the end. Used by tests/faults.rs.

#include <dlfcn.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef unsigned int uint;
typedef void *(*Address)(const char *);

enum {
    INVALID_VALUE = 0x0501, INVALID_OPERATION = 0x0502, OUT_OF_MEMORY = 0x0505, CONTEXT_LOST = 0x0507, GUILTY_CONTEXT_RESET = 0x8253,
    QUERY_RESULT = 0x8866, MAX_TEXTURE_SIZE = 0x0d33, MAJOR_VERSION = 0x821b, MINOR_VERSION = 0x821c, NUM_EXTENSIONS = 0x821d,
    EXTENSIONS = 0x1f03, RGBA32F = 0x8814, RGBA32UI = 0x8d70, RG32F = 0x8230,
    EGL_NONE = 0x3038, EGL_EXTENSIONS = 0x3055, EGL_CONTEXT_LOST = 0x300e, EGL_BAD_MATCH = 0x3009, EGL_RESET_STRATEGY = 0x31bd, EGL_CONTEXT_FLAGS = 0x30fc,
    EGL_ROBUST_FLAG = 4, NAMES = 1 << 16,
};

static Address real;
static struct { long draws, reads, allocations, refused, robust, lost, after; double longest; uint64_t memory, peak; } seen;
static struct { int area; double queued, pending; uint texture, error, egl_error; uint64_t size[NAMES]; } now;

// A number of the environment's, 0 where it says none.
static double fault(const char *name)
{
    const char *text = getenv(name);
    return text ? atof(text) : 0.0;
}

#define REAL(type, name) ((type)real(name))

static void lose(void)
{
    seen.lost = 1;
}

// What is queued goes to the device, which is taken for hung if it works on that for longer than the watchdog waits.
static void submit(void)
{
    double watchdog = fault("FAULTY_WATCHDOG");
    if (now.queued > seen.longest)
        seen.longest = now.queued;
    if (watchdog > 0.0 && now.queued > watchdog)
        lose();
    now.pending += now.queued;
    now.queued = 0.0;
}

static void wait_for_device(void)
{
    submit();
    usleep((uint)(1e6 * now.pending));
    now.pending = 0.0;
}

// Whether the call may go on to Mesa: a lost context does nothing.
static int alive(void)
{
    seen.after += seen.lost;
    return !seen.lost;
}

static void drawn(int vertices)
{
    // Passes over points are single triangles.
    if (vertices == 3)
        now.queued += fault("FAULTY_SECONDS_A_TEXEL") * now.area;
    if (++seen.draws == (long)fault("FAULTY_LOST_AT_DRAW"))
        lose();
}

static void glDrawArrays(uint mode, int first, int count)
{
    if (alive())
        REAL(void (*)(uint, int, int), "glDrawArrays")(mode, first, count);
    drawn(count);
}

static void glDrawArraysInstanced(uint mode, int first, int count, int instances)
{
    if (alive())
        REAL(void (*)(uint, int, int, int), "glDrawArraysInstanced")(mode, first, count, instances);
    drawn(count);
}

static void glViewport(int x, int y, int width, int height)
{
    now.area = width * height;
    REAL(void (*)(int, int, int, int), "glViewport")(x, y, width, height);
}

static void glFlush(void)
{
    submit();
    if (alive())
        REAL(void (*)(void), "glFlush")();
}

static void glFinish(void)
{
    wait_for_device();
    if (alive())
        REAL(void (*)(void), "glFinish")();
}

static void glGetTexImage(uint kind, int level, uint format, uint type, void *texels)
{
    wait_for_device();
    if (++seen.reads == (long)fault("FAULTY_LOST_AT_READ"))
        lose();
    if (alive())
        REAL(void (*)(uint, int, uint, uint, void *), "glGetTexImage")(kind, level, format, type, texels);
}

static void glGetQueryObjectuiv(uint query, uint name, uint *value)
{
    wait_for_device();
    if (alive())
        REAL(void (*)(uint, uint, uint *), "glGetQueryObjectuiv")(query, name, value);
    else if (name == QUERY_RESULT)
        *value = 0xffffffff; // anything, to who believes it
}

static uint glGetError(void)
{
    uint error = now.error;
    now.error = 0;
    if (!alive())
        return CONTEXT_LOST;
    return error ? error : REAL(uint (*)(void), "glGetError")();
}

static uint glGetGraphicsResetStatus(void)
{
    return seen.lost && seen.robust ? GUILTY_CONTEXT_RESET : 0;
}

// Whether the device has this much left; what is refused is reported by the next glGetError.
static int allocate(uint64_t bytes)
{
    double memory = fault("FAULTY_MEMORY"), above = fault("FAULTY_MEMORY_AT_ONCE");
    int refused = ++seen.allocations == (long)fault("FAULTY_MEMORY_ENDS_AT") || (memory > 0.0 && seen.memory + bytes > memory) ||
                  (above > 0.0 && bytes > above);
    seen.refused += refused;
    if (refused) {
        now.error = OUT_OF_MEMORY;
        return 0;
    }
    seen.memory += bytes;
    if (seen.memory > seen.peak)
        seen.peak = seen.memory;
    return 1;
}

static int texture_fits(int internal, int width, int height, int depth)
{
    double limit = fault("FAULTY_TEXTURE_SIZE");
    if (limit > 0.0 && (width > limit || height > limit)) {
        now.error = INVALID_VALUE;
        return 0;
    }
    int texel = internal == RGBA32F || internal == RGBA32UI ? 16 : internal == RG32F ? 8 : 4;
    uint64_t bytes = (uint64_t)texel * width * height * depth;
    if (!allocate(bytes))
        return 0;
    now.size[now.texture % NAMES] = bytes;
    return 1;
}

static void glTexImage2D(uint kind, int level, int internal, int width, int height, int border, uint format, uint type, const void *texels)
{
    if (alive() && texture_fits(internal, width, height, 1))
        REAL(void (*)(uint, int, int, int, int, int, uint, uint, const void *), "glTexImage2D")
        (kind, level, internal, width, height, border, format, type, texels);
}

static void glTexImage3D(uint kind, int level, int internal, int width, int height, int depth, int border, uint format, uint type,
                         const void *texels)
{
    if (alive() && texture_fits(internal, width, height, depth))
        REAL(void (*)(uint, int, int, int, int, int, int, uint, uint, const void *), "glTexImage3D")
        (kind, level, internal, width, height, depth, border, format, type, texels);
}

static void glBufferData(uint kind, long size, const void *data, uint usage)
{
    if (alive() && allocate((uint64_t)size))
        REAL(void (*)(uint, long, const void *, uint), "glBufferData")(kind, size, data, usage);
}

static void glBindTexture(uint kind, uint name)
{
    now.texture = name;
    REAL(void (*)(uint, uint), "glBindTexture")(kind, name);
}

static void glDeleteTextures(int count, const uint *names)
{
    for (int i = 0; i < count; ++i) {
        seen.memory -= now.size[names[i] % NAMES];
        now.size[names[i] % NAMES] = 0;
    }
    if (alive())
        REAL(void (*)(int, const uint *), "glDeleteTextures")(count, names);
}

static void glBindImageTexture(uint unit, uint texture, int level, uint8_t layered, int layer, uint access, uint format)
{
    if (fault("FAULTY_IMAGES_FAIL") > 0.0)
        now.error = INVALID_OPERATION;
    else if (fault("FAULTY_IMAGES_VANISH") == 0.0)
        REAL(void (*)(uint, uint, int, uint8_t, int, uint, uint), "glBindImageTexture")(unit, texture, level, layered, layer, access, format);
}

static void glGetIntegerv(uint name, int *value)
{
    REAL(void (*)(uint, int *), "glGetIntegerv")(name, value);
    if (name == MAX_TEXTURE_SIZE && fault("FAULTY_TEXTURE_SIZE") > 0.0)
        *value = 16384;
    if ((name == MAJOR_VERSION || name == MINOR_VERSION) && fault("FAULTY_VERSION") > 0.0)
        *value = name == MAJOR_VERSION ? 4 : 5;
    *value += name == NUM_EXTENSIONS && seen.robust;
}

static const uint8_t *glGetStringi(uint name, uint index)
{
    int count = 0;
    REAL(void (*)(uint, int *), "glGetIntegerv")(NUM_EXTENSIONS, &count);
    if (name == EXTENSIONS && seen.robust && (int)index == count)
        return (const uint8_t *)"GL_KHR_robustness";
    return REAL(const uint8_t *(*)(uint, uint), "glGetStringi")(name, index);
}

// Makers of names, of which a lost context makes none.
#define MAKER(name) \
    static void name(int count, uint *names) \
    { \
        if (alive()) \
            REAL(void (*)(int, uint *), #name)(count, names); \
    }
#define CREATOR(name) \
    static uint name(uint kind) \
    { \
        return alive() ? REAL(uint (*)(uint), #name)(kind) : 0; \
    }
MAKER(glGenTextures)
MAKER(glGenFramebuffers)
MAKER(glGenBuffers)
MAKER(glGenVertexArrays)
MAKER(glGenQueries)
CREATOR(glCreateProgram)
CREATOR(glCreateShader)
CREATOR(glCheckFramebufferStatus)

static uint eglMakeCurrent(void *display, void *draw, void *read, void *context)
{
    return (!context || alive()) && REAL(uint (*)(void *, void *, void *, void *), "eglMakeCurrent")(display, draw, read, context);
}

static int eglGetError(void)
{
    int error = REAL(int (*)(void), "eglGetError")(), own = now.egl_error;
    now.egl_error = 0;
    return seen.lost ? EGL_CONTEXT_LOST : own ? own : error;
}

static const char *eglQueryString(void *display, int name)
{
    static char text[1 << 14];
    const char *own = REAL(const char *(*)(void *, int), "eglQueryString")(display, name);
    if (!own || !display || name != EGL_EXTENSIONS)
        return own;
    snprintf(text, sizeof text, "%s EGL_EXT_create_context_robustness", own);
    return text;
}

// Robust contexts, which not all of Mesa's drivers make, are made of others; or none is, though it is promised.
static void *eglCreateContext(void *display, void *config, void *share, const int *attributes)
{
    int own[64], count = 0;
    for (int i = 0; attributes && attributes[i] != EGL_NONE && count < 60; i += 2) {
        int flags = attributes[i] == EGL_CONTEXT_FLAGS;
        if (attributes[i] == EGL_RESET_STRATEGY) {
            if (fault("FAULTY_ROBUST") == 0.0) {
                now.egl_error = EGL_BAD_MATCH;
                return NULL;
            }
            seen.robust = 1;
            continue;
        }
        own[count++] = attributes[i];
        own[count++] = flags ? attributes[i + 1] & ~EGL_ROBUST_FLAG : attributes[i + 1];
    }
    own[count] = EGL_NONE;
    return REAL(void *(*)(void *, void *, void *, const int *), "eglCreateContext")(display, config, share, own);
}

static void *address(const char *name)
{
#define OWN(function) {#function, (void *)function}
    static const struct { const char *name; void *function; } own[] = {
        OWN(glDrawArrays), OWN(glDrawArraysInstanced), OWN(glViewport), OWN(glFlush), OWN(glFinish), OWN(glGetTexImage),
        OWN(glGetQueryObjectuiv), OWN(glGetError), OWN(glGetGraphicsResetStatus), OWN(glTexImage2D), OWN(glTexImage3D), OWN(glBufferData),
        OWN(glBindTexture), OWN(glDeleteTextures), OWN(glBindImageTexture), OWN(glGetIntegerv), OWN(glGetStringi), OWN(glGenTextures),
        OWN(glGenFramebuffers), OWN(glGenBuffers), OWN(glGenVertexArrays), OWN(glGenQueries), OWN(glCreateProgram), OWN(glCreateShader),
        OWN(glCheckFramebufferStatus), OWN(eglMakeCurrent), OWN(eglGetError), OWN(eglQueryString), OWN(eglCreateContext),
    };
    for (uint i = 0; i < sizeof own / sizeof *own; ++i)
        if (!strcmp(name, own[i].name))
            return own[i].function;
    return real(name);
}

__attribute__((destructor)) static void tell(void)
{
    const char *path = getenv("FAULTY_LOG");
    FILE *log = path ? fopen(path, "w") : NULL;
    if (!log)
        return;
    fprintf(log, "{\"draws\": %ld, \"reads\": %ld, \"allocations\": %ld, \"refused\": %ld, \"robust\": %ld, \"lost\": %ld, \"calls_after\": %ld, ", seen.draws,
            seen.reads, seen.allocations, seen.refused, seen.robust, seen.lost, seen.after);
    fprintf(log, "\"longest\": %f, \"peak\": %llu}\n", seen.longest, (unsigned long long)seen.peak);
    fclose(log);
}

// GLVND's way in. Of what it is to be given back, the fourth function is the one that finds all others (glvnd/libeglabi.h).
uint8_t __egl_Main(uint32_t version, const void *exports, void *vendor, void **imports)
{
    void *mesa = dlopen("libEGL_mesa.so.0", RTLD_NOW | RTLD_LOCAL);
    uint8_t (*main)(uint32_t, const void *, void *, void **) = mesa ? dlsym(mesa, "__egl_Main") : NULL;
    if (!main || !main(version, exports, vendor, imports))
        return 0;
    real = (Address)imports[3];
    imports[3] = (void *)address;
    return 1;
}
