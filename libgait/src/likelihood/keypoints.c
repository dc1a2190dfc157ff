/* The keypoint term: robust distance between the joints that a detector found in the image and the projected
 * joints of the body. */
#include "likelihood/term.h"

#include "image/camera.h"
#include "base/fmath.h"

#define STRANGE           8.0f /* standard deviations at which a keypoint is as likely as without a person */
#define BEHIND_CAMERA     1e6f /* squared standard deviations of a joint behind the camera */
#define OTHER_PERSON_NATS 4.0f /* nats: minus the log probability that the keypoints are not of this person */
/* Nats: log odds (3 to 1) that the detector names left and right of the legs, or of the arms, correctly.  In small pictures
 * of people seen from the side it confuses the legs in a quarter of the frames. */
#define CORRECT_NATS 1.1f

/* Student-t with 4 degrees of freedom in two dimensions: squared standard deviations to nats. */
static float cost(float square)
{
    return 3.0f * m_log(1.0f + 0.25f * square);
}

/* Cost of a keypoint that shows this joint. */
static float joint_cost(const like_body *b, int32_t keypoint, int32_t joint)
{
    const features_keypoints *const found = &b->features->keypoints;
    const float X[3] = {b->points[joint][0][b->lane], b->points[joint][1][b->lane],
                        b->points[joint][2][b->lane]};
    float uv[2] = {0.0f};
    float const weight = found->inverse_sd[keypoint], depth = camera_project(b->camera, X, uv);
    float const du = weight * (uv[0] - found->u[keypoint]), dv = weight * (uv[1] - found->v[keypoint]);
    return cost(depth > CAMERA_NEAR ? f_min(du * du + dv * dv, BEHIND_CAMERA) : BEHIND_CAMERA);
}

/* Mean cost of the joints that were found.  Left and right of a part are as the detector names them, or swapped if that is
 * more probable.  It has an upper limit, because the detector may have found another person or be wrong altogether:
 * keypoints that are so far from a body do not attract it. */
static float mean_cost(const like_body *b)
{
    const like_setup *const s = b->setup;
    const features_keypoints *const found = &b->features->keypoints;
    float const count = (float)found->count, weight = s->weight[LIKE_KEYPOINTS];
    float of[LIKE_PARTS][2] = {{0.0f}}; /* as named, swapped */
    for (int32_t p = 0; p < GAIT_MAX_JOINTS; p++)
        for (int32_t k = 0; k < 2 && found->inverse_sd[p] != 0.0f; k++)
            of[s->part[p]][k] += joint_cost(b, p, k ? s->opposite[p] : p);
    float sum = 0.0f;
    for (int32_t k = 0; k < LIKE_PARTS; k++)
        sum += f_min(of[k][0], of[k][1] + CORRECT_NATS * count / weight);
    return f_min(sum / count, cost(STRANGE * STRANGE) + OTHER_PERSON_NATS / weight);
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
