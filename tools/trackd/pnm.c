#include "pnm.h"

#include <stdlib.h>

enum { MAX_PIXELS = 1 << 14 };

/* Next number of the header; space and comments before it are skipped.  -1: none. */
static int32_t header_number(const unsigned char **at)
{
    const unsigned char *s = *at;
    int32_t value = 0;
    while (*s == ' ' || *s == '\t' || *s == '\r' || *s == '\n' || *s == '#') {
        if (*s == '#')
            while (s[1] && s[1] != '\n')
                s++;
        s++;
    }
    if (*s < '0' || *s > '9')
        return -1;
    for (; *s >= '0' && *s <= '9'; s++)
        value = value > MAX_PIXELS ? value : value * 10 + (*s - '0');
    *at = s;
    return value;
}

static bool parse(const char *path, const file_bytes *bytes, gait_image *out, message *why)
{
    const unsigned char *at = bytes->data + 2;
    if (bytes->data[0] != 'P' || (bytes->data[1] != '5' && bytes->data[1] != '6'))
        return message_set(why, "%s: not a binary PGM or PPM file; convert it (magick plate.png plate.ppm)",
                           path);
    out->format = bytes->data[1] == '5' ? GAIT_GREY8 : GAIT_RGB8;
    out->width = header_number(&at);
    out->height = header_number(&at);
    if (header_number(&at) != 255 || out->width < 1 || out->height < 1 || out->width > MAX_PIXELS ||
        out->height > MAX_PIXELS)
        return message_set(why, "%s: damaged header or not 8 bits a sample; write it anew", path);
    out->data = at + 1;
    out->stride = out->width * (out->format == GAIT_GREY8 ? 1 : 3);
    size_t const wanted = (size_t)out->stride * (size_t)out->height;
    return bytes->size >= wanted + (size_t)(out->data - bytes->data) ||
           message_set(why, "%s: shorter than its header says; write it anew", path);
}

bool pnm_read(const char *path, file_bytes *bytes, gait_image *out, message *why)
{
    if (!file_read(path, "background", bytes, why))
        return false;
    if (bytes->size > 2 && parse(path, bytes, out, why))
        return true;
    if (bytes->size <= 2)
        message_set(why, "%s: not a binary PGM or PPM file; convert it (magick plate.png plate.ppm)", path);
    free(bytes->data);
    *bytes = (file_bytes){0};
    return false;
}
