/* The keypoint term: robust distance between the joints that a detector found in the image and the projected
 * joints of the body. */
#include "likelihood/term.h"

#include "image/camera.h"
#include "base/fmath.h"

#define STRANGE           8.0f /* standard deviations at which a keypoint is as likely as without a person */
#define BEHIND_CAMERA     1e6f /* squared standard deviations of a joint behind the camera */
#define OTHER_PERSON_NATS 4.0f /* nats: minus the log probability that the keypoints are not of this person */

/* Student-t with 4 degrees of freedom in two dimensions: squared standard deviations to nats. */
static float cost(float square)
{
    return 3.0f * m_log(1.0f + 0.25f * square);
}

/* Mean cost of the joints that were found.  It has an upper limit, because the detector may have found another person or
 * be wrong altogether: keypoints that are so far from a body do not attract it. */
static float mean_cost(const like_body *b)
{
    const features_keypoints *const found = &b->features->keypoints;
    float sum = 0.0f;
    for (int32_t p = 0; p < GAIT_MAX_JOINTS; p++) {
        float const weight = found->inverse_sd[p];
        if (weight == 0.0f)
            continue;
        const float X[3] = {b->points[p][0][b->lane], b->points[p][1][b->lane], b->points[p][2][b->lane]};
        float uv[2] = {0.0f};
        float const depth = camera_project(b->camera, X, uv);
        float const du = weight * (uv[0] - found->u[p]), dv = weight * (uv[1] - found->v[p]);
        sum += cost(depth > CAMERA_NEAR ? f_min(du * du + dv * dv, BEHIND_CAMERA) : BEHIND_CAMERA);
    }
    return f_min(sum / (float)found->count,
                 cost(STRANGE * STRANGE) + OTHER_PERSON_NATS / b->setup->weight[LIKE_KEYPOINTS]);
}

static float log_likelihood(const like_body *b)
{
    return b->features->keypoints.count ? -mean_cost(b) : 0.0f;
}

static float support(const like_body *b)
{
    return b->features->keypoints.count ? cost(STRANGE * STRANGE) - mean_cost(b) : 0.0f;
}

const like_term like_keypoints = {GAIT_TERM_KEYPOINTS, log_likelihood, support};
