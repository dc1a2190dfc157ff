/* toy_camera_message.h - the announcement of a camera, as on GAIT_CAMERA_<i>. */
#ifndef TOY_CAMERA_MESSAGE_H
#define TOY_CAMERA_MESSAGE_H

#include "gait.h"
#include "gaitmsg_camera_t.h"

static inline gaitmsg_camera_t toy_camera_message(const gait_camera *c, int64_t utime)
{
    gaitmsg_camera_t msg = {.utime = utime,
                            .width = c->width,
                            .height = c->height,
                            .fx = (double)c->fx,
                            .fy = (double)c->fy,
                            .cx = (double)c->cx,
                            .cy = (double)c->cy};
    for (int i = 0; i < 9; i++)
        msg.R[i] = (double)c->R[i];
    for (int i = 0; i < 3; i++)
        msg.t[i] = (double)c->t[i];
    return msg;
}

#endif
