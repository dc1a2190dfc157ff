#include "tracker/features_step.h"
#include "image/camera.h"

/* Aim one camera's region at the walker; false if the walker is behind it. */
static bool aim(gait_tracker *t, int32_t c, const particle_state *w)
{
    const gait_camera *const cam = &t->cfg.camera[c];
    float const H = w->f[F_STATURE], middle[3] = {w->f[F_X], w->f[F_Y], w->f[F_Z] + 0.52f * H};
    float uv[2];
    float const depth = camera_project(cam, middle, uv);
    if (!(depth > 0.1f))
        return false;
    float const tall = H * f_max(cam->fx, cam->fy) / depth;
    if (view_follow(&t->core->map[c], uv, tall))
        t->camera[c].plate_stale = true;
    return true;
}

/* Resample the background where the region moved or the frames changed between grey and colour: a grey
 * frame is compared with a grey plate. */
static void refresh_plate(gait_tracker *t, int32_t c, bool grey)
{
    camera_state *const s = &t->camera[c];
    bool const colour = s->background.format != GAIT_GREY8;
    if (!s->plate_stale && s->plate.channels == (colour && !grey ? 3 : 1))
        return;
    view_sample(t->like->run, &s->features.map, &t->cfg.camera[c], &s->background, &s->plate);
    if (colour && grey) {
        t->like->run->view_grey(&s->plate, 0, VIEW_SIZE, s->plate.channel[0]);
        s->plate.channels = 1;
    }
    s->plate_stale = false;
}

/* Tracks of one camera without the lens's distortion. */
static void take_keypoints(const gait_tracker *t, int32_t c, const gait_keypoint *track, features_keypoints *out)
{
    *out = (features_keypoints){0};
    for (int32_t p = 0; track && (t->cfg.terms & GAIT_TERM_KEYPOINTS) && p < t->model->points; p++) {
        const gait_keypoint *const one = &track[p];
        bool const seen =
            one->sd > 0.0f && one->sd <= FLT_MAX && f_finite(&one->u, 1) && f_finite(&one->v, 1);
        if (!seen)
            continue;
        double ideal[2];
        camera_ideal(&t->cfg.camera[c], (const double[2]){(double)one->u, (double)one->v}, ideal);
        out->u[p] = (float)ideal[0];
        out->v[p] = (float)ideal[1];
        out->inverse_sd[p] = 1.0f / one->sd;
        out->count++;
    }
}

typedef struct job { /* one camera's frame */
    gait_tracker *t;
    int32_t c;
    gait_image im;
    const view_planes *plate;
} job;

static void sample_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    const job *const j = ctx;
    gait_tracker *const t = j->t;
    (void)task;
    for (int32_t i = begin; i < end; i++)
        features_sample(t->like->run, &t->camera[j->c].features, i, &t->cfg.camera[j->c], &j->im, &t->scratch);
}

static void map_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    const job *const j = ctx;
    gait_tracker *const t = j->t;
    (void)task;
    for (int32_t i = begin; i < end; i++)
        features_map(t->like->run, &t->camera[j->c].features, i, &t->cfg.camera[j->c], j->plate, t->like->paper,
                     &t->scratch);
}

/* One camera's features. */
static void look(gait_tracker *t, int32_t c, const gait_frame *frame, const particle_state *predicted)
{
    camera_state *const s = &t->camera[c];
    job j = {.t = t, .c = c, .im = frame->image[c]};
    if (!aim(t, c, predicted))
        j.im.data = NULL;
    s->features.map = t->core->map[c];
    if (s->plate.channel[0] && s->background.data && j.im.data) {
        refresh_plate(t, c, j.im.format == GAIT_GREY8);
        j.plate = &s->plate;
    }
    features_begin(&s->features, &j.im, &t->scratch);
    if (s->features.has_image) {
        task_run(&t->cfg.exec, t->cfg.tasks, FEATURES_BANDS, 1, sample_range, &j);
        task_run(&t->cfg.exec, t->cfg.tasks, FEATURES_MAPS, 1, map_range, &j);
    }
    take_keypoints(t, c, frame->keypoints[c], &s->features.keypoints);
}

int32_t features_step(gait_tracker *t, const gait_frame *frame, const particle_state *predicted)
{
    int32_t count = 0;
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        look(t, c, frame, predicted);
        count += t->camera[c].features.has_image;
    }
    return count;
}
