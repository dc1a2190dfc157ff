/* pnm.h - binary PGM (P5) and PPM (P6) pictures of 8 bits. */
#ifndef TRACKD_PNM_H
#define TRACKD_PNM_H
#include "file.h"
#include "gait.h"

/* `out` points into `bytes`, which the caller frees. */
bool pnm_read(const char *path, file_bytes *bytes, gait_image *out, message *why);
#endif
