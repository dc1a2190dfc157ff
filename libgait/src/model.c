#include "model.h"

#include "blob.h"
#include "hash.h"

#include <string.h>

#define LARGEST_NUMBER     1e4f /* no length, angle or rate of a walker comes near it; products stay finite */
#define LARGEST_PROPORTION 0.1f /* per standard deviation */
#define ANY                UINT32_MAX

/* The first failure sticks; later calls do nothing. */
typedef struct reader {
    blob b;
    gait_error *err;
    gait_status status;
} reader;

static void refuse(reader *r, gait_status s, const char *tag, const char *what)
{
    if (r->status == GAIT_OK)
        r->status = base_fail(r->err, s, -1, "model: section %s: %s", tag, what);
}

static void require(reader *r, bool ok, const char *tag, const char *what)
{
    if (!ok)
        refuse(r, GAIT_ERR_CORRUPT, tag, what);
}

/* A section of this type, rank and shape (ANY: whatever it is; dims receives it); NULL after a failure. */
static const void *take(reader *r, const char *tag, uint32_t dtype, uint32_t rank, uint32_t dims[4])
{
    if (r->status != GAIT_OK)
        return NULL;
    uint32_t got[4] = {0};
    const void *const p = blob_section(&r->b, tag, dtype, rank, got);
    require(r, p != NULL, tag, "missing, or of another type or rank");
    for (uint32_t i = 0; p && i < rank; i++) {
        require(r, dims[i] == ANY || dims[i] == got[i], tag, "its shape does not fit the other sections");
        dims[i] = got[i];
    }
    return r->status == GAIT_OK ? p : NULL;
}

static const float *take_floats(reader *r, const char *tag, uint32_t rank, uint32_t dims[4])
{
    const float *const x = take(r, tag, BLOB_F32, rank, dims);
    if (!x)
        return NULL;
    size_t n = 1;
    for (uint32_t i = 0; i < rank; i++)
        n *= dims[i];
    for (size_t i = 0; i < n; i++)
        if (!(fabsf(x[i]) < LARGEST_NUMBER)) {
            refuse(r, GAIT_ERR_CORRUPT, tag, "holds a number that is not finite or absurdly large");
            return NULL;
        }
    return x;
}

static const float *take_table(reader *r, const char *tag, int32_t rows, uint32_t columns)
{
    return take_floats(r, tag, 2, (uint32_t[4]){(uint32_t)rows, columns});
}

static const int32_t *take_ints(reader *r, const char *tag, int32_t rows, uint32_t columns)
{
    return take(r, tag, BLOB_I32, columns ? 2 : 1, (uint32_t[4]){(uint32_t)rows, columns});
}

/* Names: [1, most] of them, none empty, NUL-terminated, all different. */
static const char (*take_names(reader *r, const char *tag, uint32_t most, int32_t *count)) [MODEL_NAME] {
    uint32_t dims[4] = {ANY, MODEL_NAME};
    const char (*const name)[MODEL_NAME] = (const char (*)[MODEL_NAME])take(r, tag, BLOB_U8, 2, dims);
    if (!name)
        return NULL;
    require(r, dims[0] > 0, tag, "is empty");
    if (dims[0] > most)
        refuse(r, GAIT_ERR_LIMIT, tag, "has more rows than this build can hold");
    for (uint32_t i = 0; r->status == GAIT_OK && i < dims[0]; i++) {
        require(r, name[i][0] && !name[i][MODEL_NAME - 1], tag, "holds a name that is empty or too long");
        for (uint32_t k = 0; r->status == GAIT_OK && k < i; k++)
            require(r, strcmp(name[i], name[k]) != 0, tag, "holds a name twice");
    }
    *count = (int32_t)dims[0];
    return r->status == GAIT_OK ? name : NULL;
}

static void read_channels(reader *r, gait_model *m)
{
    static const char *const root[MODEL_ROOT_CHANNELS] = {"root_forward", "root_sway",  "root_height",
                                                          "root_roll",    "root_pitch", "root_yaw"};
    m->channel_name = take_names(r, "CHNM", MODEL_MAX_CHANNELS, &m->channels);
    m->root_channel = m->angles = m->channels - MODEL_ROOT_CHANNELS;
    require(r, m->angles >= 0, "CHNM", "does not end with the six root channels");
    for (int32_t i = 0; r->status == GAIT_OK && i < MODEL_ROOT_CHANNELS; i++)
        require(r, strcmp(m->channel_name[m->root_channel + i], root[i]) == 0, "CHNM",
                "does not end with the six root channels");
}

static void read_curves(reader *r, gait_model *m)
{
    uint32_t dims[4] = {ANY, ANY, (uint32_t)m->channels};
    m->curves = take_floats(r, "CURV", 3, dims);
    if (!m->curves)
        return;
    require(r, dims[0] > 0 && dims[1] >= MODEL_MIN_PHASES, "CURV", "needs a mean and at least 8 phases");
    if (dims[0] > 1 + GAIT_MAX_COMPONENTS || dims[1] > MODEL_MAX_PHASES)
        refuse(r, GAIT_ERR_LIMIT, "CURV", "has more components or phases than this build can hold");
    m->components = (int32_t)dims[0] - 1;
    m->phases = (int32_t)dims[1];
}

static void read_statistics(reader *r, gait_model *m)
{
    m->channel_stat = take_table(r, "CHST", m->channels, 4);
    m->score_stat = take_table(r, "SCST", m->components, 3);
    const float *const g = take_floats(r, "GAIT", 1, (uint32_t[4]){8});
    for (int32_t i = 0; r->status == GAIT_OK && i < m->channels; i++) {
        const float *const s = m->channel_stat + 4 * i;
        require(r, s[0] >= 0.0f && s[1] <= s[2] && s[3] >= 0.0f, "CHST", "negative sd or empty range");
    }
    for (int32_t i = 0; r->status == GAIT_OK && i < 3 * m->components; i++)
        require(r, m->score_stat[i] >= 0.0f, "SCST", "has a negative sd");
    if (r->status != GAIT_OK)
        return;
    m->stride_hz = g[0];
    m->stride_hz_sd = g[1];
    m->stride_cv = g[2];
    m->stride_length = g[3];
    m->stride_length_sd = g[4];
    m->stature_mean = g[6];
    m->stature_sd = g[7];
    require(r, g[0] > 0.0f && g[3] >= 0.0f && g[6] > 0.0f, "GAIT", "stride rate or stature not positive");
    require(r, g[1] >= 0.0f && g[2] >= 0.0f && g[4] >= 0.0f && g[7] >= 0.0f, "GAIT", "has a negative sd");
}

/* The pairs (axis, channel) of a frame: n of them valid, the others 0. */
static bool rotations_valid(const gait_model *m, const int32_t info[FRAME_INFO])
{
    bool ok = info[1] >= 0 && info[1] <= FRAME_ROTATIONS;
    for (int32_t i = 0; i < FRAME_ROTATIONS; i++) {
        int32_t const axis = info[2 + 2 * i], channel = info[3 + 2 * i];
        if (i < info[1])
            ok = ok && axis && axis >= -3 && axis <= 3 && channel >= 0 && channel < m->channels;
        else
            ok = ok && axis == 0 && channel == 0;
    }
    return ok;
}

static void read_frames(reader *r, gait_model *m)
{
    int32_t const root = m->root_channel;
    const int32_t first[FRAME_INFO] = {-1, 3, 3, root + ROOT_YAW, 2, root + ROOT_PITCH, 1, root + ROOT_ROLL};
    m->frame_name = take_names(r, "FRNM", MODEL_MAX_FRAMES, &m->frames);
    m->frame_info = take_ints(r, "FRMI", m->frames, FRAME_INFO);
    m->frame_origin = take_table(r, "FRMF", m->frames, 3);
    if (r->status != GAIT_OK)
        return;
    require(r, memcmp(m->frame_info, first, sizeof first) == 0, "FRMI",
            "frame 0 must be the root: +3 root_yaw, +2 root_pitch, +1 root_roll");
    for (int32_t k = 0; k < 3; k++)
        require(r, m->frame_origin[k] == 0.0f, "FRMF", "frame 0 must lie at 0");
    for (int32_t f = 1; r->status == GAIT_OK && f < m->frames; f++) {
        const int32_t *const info = m->frame_info + FRAME_INFO * f;
        require(r, info[0] >= 0 && info[0] < f, "FRMI", "a parent does not come before its child");
        require(r, rotations_valid(m, info), "FRMI", "has a rotation with a bad axis, channel or count");
    }
}

/* Optional: models without it have one body for everybody. */
static void read_proportions(reader *r, gait_model *m)
{
    uint32_t dims[4] = {ANY, (uint32_t)m->frames + 1};
    if (r->status != GAIT_OK || !blob_has(&r->b, "PROP"))
        return;
    m->proportion = take_floats(r, "PROP", 2, dims);
    if (dims[0] > GAIT_MAX_PROPORTIONS)
        refuse(r, GAIT_ERR_LIMIT, "PROP", "has more rows than this build can hold");
    for (uint32_t i = 0; r->status == GAIT_OK && i < dims[0] * dims[1]; i++)
        require(r, fabsf(m->proportion[i]) <= LARGEST_PROPORTION, "PROP",
                "changes a length by more than 10 %");
    m->proportions = r->status == GAIT_OK ? (int32_t)dims[0] : 0;
}

static void read_points(reader *r, gait_model *m)
{
    m->point_name = take_names(r, "PTNM", GAIT_MAX_JOINTS, &m->points);
    m->point_frame = take_ints(r, "PTNI", m->points, 0);
    m->point_offset = take_table(r, "PTNF", m->points, 3);
    if (r->status == GAIT_OK)
        require(r, strcmp(m->point_name[0], "pelvis") == 0, "PTNM", "does not begin with the pelvis");
    for (int32_t i = 0; r->status == GAIT_OK && i < m->points; i++)
        require(r, m->point_frame[i] >= 0 && m->point_frame[i] < m->frames, "PTNI", "no such frame");
}

/* Radii positive; an axis of some length that is not along y, from which the first radius is measured. */
static bool limb_valid(const float s[LIMB_SHAPE])
{
    float const dx = s[3] - s[0], dy = s[4] - s[1], dz = s[5] - s[2];
    float const across = dx * dx + dz * dz, length = across + dy * dy;
    bool const axis = length > 1e-8f && across > 1e-4f * length;
    return axis && s[6] > 0.0f && s[7] > 0.0f && s[8] > 0.0f && s[9] > 0.0f;
}

static void read_limbs(reader *r, gait_model *m)
{
    m->limb_name = take_names(r, "LBNM", MODEL_MAX_LIMBS, &m->limbs);
    m->limb_info = take_ints(r, "LIMI", m->limbs, LIMB_INFO);
    m->limb_shape = take_table(r, "LIMF", m->limbs, LIMB_SHAPE);
    for (int32_t i = 0; r->status == GAIT_OK && i < m->limbs; i++) {
        int32_t const frame = m->limb_info[LIMB_INFO * i], shape = m->limb_info[LIMB_INFO * i + 1];
        require(r, frame >= 0 && frame < m->frames, "LIMI", "no such frame");
        require(r, shape == LIMB_CONE || shape == LIMB_ELLIPSOID, "LIMI", "has an unknown shape");
        require(r, limb_valid(m->limb_shape + LIMB_SHAPE * i), "LIMF",
                "has a radius that is not positive or an axis without length or along y");
    }
}

gait_status model_open(const void *data, size_t bytes, gait_model *m, gait_error *err)
{
    reader r = {.err = err};
    gait_model t = {0};
    r.status = blob_open(data, bytes, &r.b, err);
    read_channels(&r, &t);
    read_curves(&r, &t);
    read_statistics(&r, &t);
    read_frames(&r, &t);
    read_proportions(&r, &t);
    read_points(&r, &t);
    read_limbs(&r, &t);
    if (r.status != GAIT_OK)
        return r.status;
    t.digest = hash_fnv1a(HASH_INIT, data, bytes);
    *m = t;
    return GAIT_OK;
}

gait_model *model_layout(arena *a, const gait_model *m)
{
    gait_model *const self = TAKE(a, gait_model, 1);
    if (self)
        *self = *m;
    return self;
}
