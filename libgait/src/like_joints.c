/* Joints that somebody else has found in the image: robust distance to where the body would show them. */
#include "like.h"

#include "camera.h"
#include "fmath.h"

#define STRANGE 8.0f /* deviations at which a joint says as much as nobody would */
#define BEHIND  1e6f /* squared deviations of a joint behind the camera */

/* Student-t with 4 degrees of freedom in two dimensions: squared deviations to nats. */
static float cost(float square)
{
    return 3.0f * m_log(1.0f + 0.25f * square);
}

/* Mean cost of the joints seen. */
static float mean_cost(const like_body *b)
{
    const features_tracks *const tracks = &b->features->tracks;
    float sum = 0.0f;
    for (int32_t p = 0; p < GAIT_MAX_JOINTS; p++) {
        float const weight = tracks->inverse_sd[p];
        if (weight == 0.0f)
            continue;
        const float X[3] = {b->points[p][0][b->lane], b->points[p][1][b->lane], b->points[p][2][b->lane]};
        float uv[2] = {0.0f};
        float const depth = camera_project(b->camera, X, uv);
        float const du = weight * (uv[0] - tracks->u[p]), dv = weight * (uv[1] - tracks->v[p]);
        sum += cost(depth > CAMERA_NEAR ? f_min(du * du + dv * dv, BEHIND) : BEHIND);
    }
    return sum / (float)tracks->seen;
}

static float log_likelihood(const like_body *b)
{
    return b->features->tracks.seen ? -mean_cost(b) : 0.0f;
}

static float support(const like_body *b)
{
    return b->features->tracks.seen ? cost(STRANGE * STRANGE) - mean_cost(b) : 0.0f;
}

const like_term like_joints = {"tracks", GAIT_TERM_TRACKS, log_likelihood, support};
