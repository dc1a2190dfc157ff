#include "tracker/features_step.h"
#include "image/camera.h"

static const float CENTRE_HEIGHT = 0.52f; /* of the region above the ground, statures */
static const float NEAREST = 0.1f;        /* metres in front of the camera at which a person can be seen */

/* Centre one camera's region on the person; false if they are behind the camera. */
static bool move_region(gait_tracker *t, int32_t c, const particle_state *p)
{
    const gait_camera *const cam = &t->cfg.camera[c];
    float const stature = p->f[F_STATURE];
    float const centre[3] = {p->f[F_X], p->f[F_Y], p->f[F_Z] + CENTRE_HEIGHT * stature};
    float uv[2];
    float const depth = camera_project(cam, centre, uv);
    if (!(depth > NEAREST))
        return false;
    float const tall = stature * f_max(cam->fx, cam->fy) / depth;
    if (view_follow(&t->core->map[c], uv, tall))
        t->camera[c].plate_stale = true;
    return true;
}

/* Resample the background if the region moved or the frames changed between grey and colour: a grey frame is compared
 * with a grey plate. */
static void refresh_plate(gait_tracker *t, int32_t c, const gait_image *empty, bool grey)
{
    camera_state *const s = &t->camera[c];
    bool const colour = empty->format != GAIT_GREY8;
    if (!s->plate_stale && s->plate.channels == (colour && !grey ? 3 : 1))
        return;
    view_sample(t->like->run, &s->features.map, &t->cfg.camera[c], empty, &s->plate);
    if (colour && grey) {
        t->like->run->view_grey(&s->plate, 0, VIEW_SIZE, s->plate.channel[0]);
        s->plate.channels = 1;
    }
    s->plate_stale = false;
}

static bool keypoint_given(const gait_keypoint *k)
{
    return k->sd > 0.0f && k->sd <= FLT_MAX && f_finite(&k->u, 1) && f_finite(&k->v, 1);
}

/* One camera's keypoints, undistorted. */
static void take_keypoints(const gait_tracker *t, int32_t c, const gait_keypoint *keypoints,
                           features_keypoints *out)
{
    *out = (features_keypoints){0};
    for (int32_t p = 0; keypoints && (t->cfg.terms & GAIT_TERM_KEYPOINTS) && p < t->model->points; p++) {
        const gait_keypoint *const k = &keypoints[p];
        double ideal[2];
        if (!keypoint_given(k))
            continue;
        camera_ideal(&t->cfg.camera[c], (const double[2]){(double)k->u, (double)k->v}, ideal);
        out->u[p] = (float)ideal[0];
        out->v[p] = (float)ideal[1];
        out->inverse_sd[p] = 1.0f / k->sd;
        out->count++;
    }
}

typedef struct features_job { /* one camera's frame */
    gait_tracker *t;
    int32_t c;
    gait_image image;
    const view_planes *plate;
} features_job;

static void sample_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    const features_job *const j = ctx;
    gait_tracker *const t = j->t;
    (void)task;
    for (int32_t band = begin; band < end; band++)
        features_sample(t->like->run, &t->camera[j->c].features, band, &t->cfg.camera[j->c], &j->image,
                        &t->planes);
}

static void map_range(void *ctx, int32_t begin, int32_t end, int32_t task)
{
    const features_job *const j = ctx;
    gait_tracker *const t = j->t;
    (void)task;
    for (int32_t map = begin; map < end; map++)
        features_map(t->like->run, &t->camera[j->c].features, map, &t->cfg.camera[j->c], j->plate,
                     t->like->paper, &t->planes);
}

static void camera_features(gait_tracker *t, int32_t c, const gait_frame *frame,
                            const particle_state *predicted)
{
    camera_state *const s = &t->camera[c];
    features_job j = {.t = t, .c = c, .image = frame->image[c]};
    bool const own = frame->background[c].data != NULL; /* a background for this frame alone */
    const gait_image *const empty = own ? &frame->background[c] : &s->background;
    if (!move_region(t, c, predicted))
        j.image.data = NULL;
    s->features.map = t->core->map[c];
    s->plate_stale |= own;
    if (s->plate.channel[0] && empty->data && (own || !s->moved) && j.image.data) {
        refresh_plate(t, c, empty, j.image.format == GAIT_GREY8);
        j.plate = &s->plate;
        s->plate_stale = own;
    }
    features_begin(&s->features, &j.image, &t->planes);
    s->features.people = frame->people[c].data ? &frame->people[c] : NULL;
    s->features.person = frame->person;
    if (s->features.has_image) {
        task_run(&t->cfg.exec, t->cfg.tasks, FEATURES_BANDS, 1, sample_range, &j);
        task_run(&t->cfg.exec, t->cfg.tasks, FEATURES_MAPS, 1, map_range, &j);
    }
    take_keypoints(t, c, frame->keypoints[c], &s->features.keypoints);
}

/* Set a camera to its pose in this frame. */
static void place_camera(gait_tracker *t, int32_t c, const gait_camera_pose *pose)
{
    camera_state *const s = &t->camera[c];
    gait_camera *const cam = &t->cfg.camera[c], *const home = &t->home[c];
    *cam = pose ? camera_placed(home, pose->R, pose->t) : *home;
    s->moved = memcmp(cam, home, sizeof *cam) != 0;
    s->turn_sd = pose ? pose->turn_sd : 0.0f;
    s->place_sd = pose ? pose->place_sd : 0.0f;
    s->shift_sd = 0.0f;
}

int32_t features_step(gait_tracker *t, const gait_frame *frame, const particle_state *predicted)
{
    int32_t count = 0;
    for (int32_t c = 0; c < t->cfg.cameras; c++) {
        place_camera(t, c, frame->pose[c]);
        camera_features(t, c, frame, predicted);
        count += t->camera[c].features.has_image;
    }
    return count;
}
