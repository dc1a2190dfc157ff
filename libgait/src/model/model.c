#include "model/model.h"

#include "base/fmath.h"
#include "base/hash.h"
#include "model/sections.h"

#include <string.h>

#define LARGEST_PACE       1.0f   /* a channel's coefficients: radians or statures per unit of kin_pace */
#define LARGEST_PROPORTION 0.1f   /* per standard deviation; a shift: statures */
#define LARGEST_CHANGE     100.0f /* of a rate of change between classes, per second */
#define LARGEST_FACTOR     50.0f  /* of its concentration and slope */

enum { TAG = 5 };           /* a tag and its NUL */
typedef struct class_tags { /* sections of one class */
    char curves[TAG], channel_stat[TAG], score_stat[TAG], gait[TAG], pace[TAG];
} class_tags;

static const float *take_table(sections *r, const char *tag, int32_t rows, uint32_t columns)
{
    return sections_floats(r, tag, 2, (uint32_t[4]){(uint32_t)rows, columns});
}

static const int32_t *take_ints(sections *r, const char *tag, int32_t rows, uint32_t columns)
{
    return sections_take(r, tag, BLOB_I32, columns ? 2 : 1, (uint32_t[4]){(uint32_t)rows, columns});
}

static void read_channels(sections *r, gait_model *m)
{
    static const char *const root[MODEL_ROOT_CHANNELS] = {"root_forward", "root_sway",  "root_height",
                                                          "root_roll",    "root_pitch", "root_yaw"};
    m->channel_name = sections_names(r, "CHNM", MODEL_MAX_CHANNELS, &m->channels);
    m->root_channel = m->angles = m->channels - MODEL_ROOT_CHANNELS;
    sections_require(r, m->angles >= 0, "CHNM", "does not end with the six root channels");
    for (int32_t i = 0; r->status == GAIT_OK && i < MODEL_ROOT_CHANNELS; i++)
        sections_require(r, strcmp(m->channel_name[m->root_channel + i], root[i]) == 0, "CHNM",
                         "does not end with the six root channels");
}

static void read_curves(sections *r, const class_tags *tag, gait_model *m)
{
    uint32_t dims[4] = {SECTION_ANY, SECTION_ANY, (uint32_t)m->channels};
    m->curves = sections_floats(r, tag->curves, 3, dims);
    if (!m->curves)
        return;
    sections_require(r, dims[0] > 0 && dims[1] >= MODEL_MIN_PHASES, tag->curves,
                     "needs a mean and at least 8 phases");
    if (dims[0] > 1 + GAIT_MAX_COMPONENTS || dims[1] > MODEL_MAX_PHASES)
        sections_refuse(r, GAIT_ERR_LIMIT, tag->curves,
                        "has more components or phases than this build can hold");
    m->components = (int32_t)dims[0] - 1;
    m->phases = (int32_t)dims[1];
}

static void read_statistics(sections *r, const class_tags *tag, gait_model *m)
{
    m->channel_stat = take_table(r, tag->channel_stat, m->channels, 4);
    m->score_stat = take_table(r, tag->score_stat, m->components, 3);
    const float *const g = sections_floats(r, tag->gait, 1, (uint32_t[4]){8});
    for (int32_t i = 0; r->status == GAIT_OK && i < m->channels; i++) {
        const float *const s = m->channel_stat + 4 * i;
        sections_require(r, s[0] >= 0.0f && s[1] <= s[2] && s[3] >= 0.0f, tag->channel_stat,
                         "negative sd or empty range");
    }
    for (int32_t i = 0; r->status == GAIT_OK && i < 3 * m->components; i++)
        sections_require(r, m->score_stat[i] >= 0.0f, tag->score_stat, "has a negative sd");
    if (r->status != GAIT_OK)
        return;
    m->stride_hz = g[0];
    m->stride_hz_sd = g[1];
    m->stride_cv = g[2];
    m->stride_length = g[3];
    m->stride_length_sd = g[4];
    m->stature_mean = g[6];
    m->stature_sd = g[7];
    sections_require(r, g[0] > 0.0f && g[3] >= 0.0f && g[6] > 0.0f, tag->gait,
                     "stride rate or stature not positive");
    sections_require(r, g[1] >= 0.0f && g[2] >= 0.0f && g[4] >= 0.0f && g[7] >= 0.0f, tag->gait,
                     "has a negative sd");
}

/* Optional: without it the curves do not depend on the stride rate. */
static void read_pace(sections *r, const class_tags *tags, gait_model *m)
{
    const char *const tag = tags->pace;
    m->pace_series = NULL;
    m->pace_terms = 0;
    if (r->status != GAIT_OK || !blob_has(&r->b, tag))
        return;
    uint32_t dims[4] = {SECTION_ANY, (uint32_t)m->channels};
    m->pace_series = sections_floats(r, tag, 2, dims);
    sections_require(r, m->stride_hz_sd > 0.0f, tag, "needs an sd of the stride rate in GAIT");
    sections_require(r, dims[0] % 2 == 1 && dims[0] < (uint32_t)m->phases, tag,
                     "its rows are not a Fourier series");
    for (int32_t c = 0; r->status == GAIT_OK && c < m->channels; c++) {
        float sum = 0.0f;
        for (uint32_t i = 0; i < dims[0]; i++)
            sum += fabsf(m->pace_series[i * dims[1] + (uint32_t)c]);
        sections_require(r, sum <= LARGEST_PACE, tag, "changes a channel by more than 1");
    }
    m->pace_terms = r->status == GAIT_OK ? (int32_t)dims[0] : 0;
}

/* True if the n pairs (axis, channel) of a frame are valid and the others 0. */
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

static void read_frames(sections *r, gait_model *m)
{
    int32_t const root = m->root_channel;
    const int32_t first[FRAME_INFO] = {-1, 3, 3, root + ROOT_YAW, 2, root + ROOT_PITCH, 1, root + ROOT_ROLL};
    m->frame_name = sections_names(r, "FRNM", MODEL_MAX_FRAMES, &m->frames);
    m->frame_info = take_ints(r, "FRMI", m->frames, FRAME_INFO);
    m->frame_origin = take_table(r, "FRMF", m->frames, 3);
    if (r->status != GAIT_OK)
        return;
    sections_require(r, memcmp(m->frame_info, first, sizeof first) == 0, "FRMI",
                     "frame 0 must be the root: +3 root_yaw, +2 root_pitch, +1 root_roll");
    for (int32_t k = 0; k < 3; k++)
        sections_require(r, m->frame_origin[k] == 0.0f, "FRMF", "the origin of frame 0 must be 0");
    for (int32_t f = 1; r->status == GAIT_OK && f < m->frames; f++) {
        const int32_t *const info = m->frame_info + FRAME_INFO * f;
        sections_require(r, info[0] >= 0 && info[0] < f, "FRMI", "a parent does not come before its child");
        sections_require(r, rotations_valid(m, info), "FRMI",
                         "has a rotation with a bad axis, channel or count");
    }
}

/* Optional: without it all people have the same proportions. */
static void read_proportions(sections *r, gait_model *m)
{
    uint32_t dims[4] = {SECTION_ANY, (uint32_t)m->frames + 1};
    if (r->status != GAIT_OK || !blob_has(&r->b, "PROP"))
        return;
    m->proportion = sections_floats(r, "PROP", 2, dims);
    if (dims[0] > GAIT_MAX_PROPORTIONS)
        sections_refuse(r, GAIT_ERR_LIMIT, "PROP", "has more rows than this build can hold");
    for (uint32_t i = 0; r->status == GAIT_OK && i < dims[0] * dims[1]; i++)
        sections_require(r, fabsf(m->proportion[i]) <= LARGEST_PROPORTION, "PROP",
                         "changes a length by more than 10 %");
    m->proportions = r->status == GAIT_OK ? (int32_t)dims[0] : 0;
}

/* Optional: without it proportions only scale lengths. */
static void read_shifts(sections *r, gait_model *m)
{
    uint32_t dims[4] = {(uint32_t)m->proportions, (uint32_t)m->frames, 3};
    if (r->status != GAIT_OK || !blob_has(&r->b, "SHFT"))
        return;
    sections_require(r, m->proportions > 0, "SHFT", "needs PROP");
    m->shift = sections_floats(r, "SHFT", 3, dims);
    for (uint32_t k = 0; r->status == GAIT_OK && k < dims[0]; k++)
        for (uint32_t i = 0; i < 3 * dims[1]; i++) {
            float const by = fabsf(m->shift[3 * dims[1] * k + i]);
            sections_require(r, by <= LARGEST_PROPORTION, "SHFT", "moves an origin by more than 10 %");
            sections_require(r, i >= 3 || by == 0.0f, "SHFT", "the origin of frame 0 must be 0");
        }
}

static void read_points(sections *r, gait_model *m)
{
    m->point_name = sections_names(r, "PTNM", GAIT_MAX_JOINTS, &m->points);
    m->point_frame = take_ints(r, "PTNI", m->points, 0);
    m->point_offset = take_table(r, "PTNF", m->points, 3);
    if (r->status == GAIT_OK)
        sections_require(r, strcmp(m->point_name[0], "pelvis") == 0, "PTNM",
                         "does not begin with the pelvis");
    for (int32_t i = 0; r->status == GAIT_OK && i < m->points; i++)
        sections_require(r, m->point_frame[i] >= 0 && m->point_frame[i] < m->frames, "PTNI", "no such frame");
}

/* True if all radii are positive and the axis has a length and is not along y, from which the first radius
 * is measured. */
static bool limb_valid(const float s[LIMB_SHAPE])
{
    float const dx = s[3] - s[0], dy = s[4] - s[1], dz = s[5] - s[2];
    float const across = dx * dx + dz * dz, length = across + dy * dy;
    bool const axis = length > 1e-8f && across > 1e-4f * length;
    return axis && s[6] > 0.0f && s[7] > 0.0f && s[8] > 0.0f && s[9] > 0.0f;
}

static void read_limbs(sections *r, gait_model *m)
{
    m->limb_name = sections_names(r, "LBNM", MODEL_MAX_LIMBS, &m->limbs);
    m->limb_info = take_ints(r, "LIMI", m->limbs, LIMB_INFO);
    m->limb_shape = take_table(r, "LIMF", m->limbs, LIMB_SHAPE);
    for (int32_t i = 0; r->status == GAIT_OK && i < m->limbs; i++) {
        int32_t const frame = m->limb_info[LIMB_INFO * i], shape = m->limb_info[LIMB_INFO * i + 1];
        sections_require(r, frame >= 0 && frame < m->frames, "LIMI", "no such frame");
        sections_require(r, shape == LIMB_CONE || shape == LIMB_ELLIPSOID, "LIMI", "has an unknown shape");
        sections_require(r, limb_valid(m->limb_shape + LIMB_SHAPE * i), "LIMF",
                         "has a radius that is not positive or an axis without length or along y");
    }
}

static void read_motion(sections *r, const class_tags *tag, gait_model *m)
{
    read_curves(r, tag, m);
    read_statistics(r, tag, m);
    read_pace(r, tag, m);
}

static void read_cyclic(sections *r, gait_model *m)
{
    static const class_tags first = {"CURV", "CHST", "SCST", "GAIT", "PACE"};
    read_channels(r, m);
    read_motion(r, &first, m);
    read_frames(r, m);
    read_proportions(r, m);
    read_shifts(r, m);
    read_points(r, m);
    read_limbs(r, m);
}

/* ---- classes of motion ---- */
/* Class k is like its source, or has sections of its own. */
static void read_class(sections *r, gait_model *m, int32_t k)
{
    const int32_t *const info = m->class_info + CLASS_INFO * k;
    int32_t const source = info[CLASS_SOURCE];
    class_tags tag = {"CUR0", "CHS0", "SCS0", "GAI0", "PAC0"};
    tag.curves[3] = tag.channel_stat[3] = tag.score_stat[3] = tag.gait[3] = tag.pace[3] = (char)('0' + k);
    gait_model *const own = &m[k];
    *own = m[0];
    if (blob_has(&r->b, tag.curves)) {
        sections_require(r, source == k, "CLIN", "a class with curves must be its own source");
        read_motion(r, &tag, own);
    } else {
        sections_require(r, source < k && m->class_info[CLASS_INFO * source + CLASS_SOURCE] == source, "CLIN",
                         "a class without curves needs an earlier source");
        if (r->status == GAIT_OK)
            *own = m[source];
    }
    own->motion_class = k;
    own->direction = info[CLASS_DIRECTION];
}

static void read_changes(sections *r, gait_model *m)
{
    uint32_t const C = (uint32_t)m->classes;
    m->class_change = sections_floats(r, "CLSW", 3, (uint32_t[4]){C, C, CLASS_CHANGE});
    for (uint32_t i = 0; r->status == GAIT_OK && i < C * C; i++) {
        const float *const s = m->class_change + CLASS_CHANGE * i;
        bool const diagonal = i % (C + 1) == 0;
        bool ok = s[CHANGE_RATE] >= 0.0f && s[CHANGE_RATE] <= (diagonal ? 0.0f : LARGEST_CHANGE);
        ok &= s[CHANGE_CONCENTRATION] >= 0.0f && s[CHANGE_CONCENTRATION] <= LARGEST_FACTOR;
        ok &= s[CHANGE_PHASE] >= 0.0f && s[CHANGE_PHASE] < 1.0f && fabsf(s[CHANGE_SLOPE]) <= LARGEST_FACTOR;
        sections_require(r, ok, "CLSW", "holds a number outside its range");
    }
}

/* Optional: without it there is one class. */
static void read_classes(sections *r, gait_model *m)
{
    m->classes = m->direction = 1;
    if (r->status != GAIT_OK || !blob_has(&r->b, "CLNM"))
        return;
    m->class_name = sections_names(r, "CLNM", GAIT_MAX_CLASSES, &m->classes);
    m->class_info = take_ints(r, "CLIN", m->classes, CLASS_INFO);
    for (int32_t k = 0; r->status == GAIT_OK && k < m->classes; k++) {
        const int32_t *const info = m->class_info + CLASS_INFO * k;
        bool ok = info[CLASS_DIRECTION] >= -1 && info[CLASS_DIRECTION] <= 1 && info[CLASS_CYCLES] >= 0;
        ok &= info[CLASS_SOURCE] >= 0 && info[CLASS_SOURCE] < m->classes && info[CLASS_RECORDINGS] >= 0;
        sections_require(r, ok, "CLIN", "holds a number outside its range");
    }
    if (r->status == GAIT_OK)
        sections_require(r, m->class_info[CLASS_DIRECTION] == 1 && m->class_info[CLASS_SOURCE] == 0, "CLIN",
                         "the first class must walk forwards and be its own source");
    if (r->status == GAIT_OK)
        read_changes(r, m);
    for (int32_t k = 1; r->status == GAIT_OK && k < m->classes; k++)
        read_class(r, m, k);
}

gait_result model_open(const void *data, size_t bytes, gait_model *m, gait_error *err)
{
    sections r = {.what = "model", .err = err};
    gait_model t[GAIT_MAX_CLASSES] = {0};
    r.status = blob_open(data, bytes, &r.b, err);
    if (r.status == GAIT_OK && blob_has(&r.b, "SGNM"))
        r.status = segment_open(&r.b, &t->segments, err);
    t->cyclic = t->segments.markers == 0 || blob_has(&r.b, "CHNM");
    if (t->cyclic)
        read_cyclic(&r, t);
    t->digest = hash_fnv1a(HASH_INIT, data, bytes);
    read_classes(&r, t);
    for (int32_t k = 0; r.status == GAIT_OK && k < t->classes; k++) {
        m[k] = t[k];
        for (int32_t of = 0; of < t->classes; of++)
            m[k].of_class[of] = &m[of];
    }
    return r.status;
}

gait_result model_need_cyclic(const gait_model *m, gait_error *err)
{
    if (m->cyclic)
        return GAIT_OK;
    return base_fail(
        err, GAIT_ERR_ARG, -1,
        "the model has no cyclic part, which tracking needs: learn it without `--segments only`");
}

int32_t model_find_angle(const gait_model *m, const char *name, size_t length)
{
    for (int32_t a = 0; a < m->angles; a++)
        if (strlen(m->channel_name[a]) == length && memcmp(m->channel_name[a], name, length) == 0)
            return a;
    return -1;
}

int32_t model_other_side(const char (*name)[MODEL_NAME], int32_t names, int32_t i)
{
    char const side = name[i][0];
    if ((side != 'l' && side != 'r') || name[i][1] != '_')
        return i;
    for (int32_t k = 0; k < names; k++)
        if (name[k][0] == (side == 'l' ? 'r' : 'l') && strcmp(name[k] + 1, name[i] + 1) == 0)
            return k;
    return i;
}

uint32_t model_posture_angles(const gait_model *m)
{
    static const char names[][20] = {
        "torso_x",         "torso_y",        "l_shoulder_flexion", "r_shoulder_flexion",
        "l_elbow_flexion", "r_elbow_flexion"};
    uint32_t mask = 0;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        int32_t const a = model_find_angle(m, names[i], strlen(names[i]));
        mask |= a < 0 ? 0u : 1u << a;
    }
    return mask;
}

/* The series at the phases of the mean curves, T x M, summed from the constant term up. */
static void unfold_pace(const gait_model *m, float *curve)
{
    int32_t const T = m->phases, M = m->channels;
    for (int32_t j = 0; j < T; j++) {
        float *const at = curve + j * M;
        memcpy(at, m->pace_series, (size_t)M * sizeof(float));
        for (int32_t h = 1; 2 * h < m->pace_terms; h++) {
            const float *const a = m->pace_series + (2 * h - 1) * M;
            float s, c;
            m_sincos_one(TWO_PI_F * (float)(h * j % T) / (float)T, &s, &c);
            for (int32_t i = 0; i < M; i++)
                at[i] += c * a[i] + s * a[M + i];
        }
    }
}

gait_model *model_layout(arena *a, const gait_model *m)
{
    gait_model *const self = TAKE(a, gait_model, m->classes);
    float *curve[GAIT_MAX_CLASSES];
    for (int32_t k = 0; k < m->classes; k++)
        curve[k] = m[k].pace_terms ? TAKE(a, float, m[k].phases *m[k].channels) : NULL;
    if (!self)
        return NULL;
    memcpy(self, m, (size_t)m->classes * sizeof *self);
    for (int32_t k = 0; k < m->classes; k++) {
        self[k].pace_curve = curve[k];
        if (curve[k])
            unfold_pace(&m[k], curve[k]);
        for (int32_t of = 0; of < m->classes; of++)
            self[k].of_class[of] = &self[of];
    }
    return self;
}
