/* service_send.h - what the service publishes. */
#ifndef TRACKD_SERVICE_SEND_H
#define TRACKD_SERVICE_SEND_H
#include "service.h"

/* GAIT_ESTIMATE, and GAIT_PARTICLES when asked for; `received` is when the frame had arrived. */
void service_send_estimate(service *s, const image_view *v, const gait_estimate *e, int64_t received,
                           int64_t step_us);
#endif
