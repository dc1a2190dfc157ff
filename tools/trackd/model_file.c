#include "model_file.h"

#include <stdlib.h>

bool model_file_open(model_file *m, const char *path, message *why)
{
    gait_error err = {.text = ""};
    size_t bytes = 0;
    *m = (model_file){0};
    if (!file_read(path, "model", &m->blob, why))
        return false;
    gait_result status = gait_model_bytes(m->blob.data, m->blob.size, &bytes, &err);
    if (status == GAIT_OK) {
        m->memory = aligned_alloc(GAIT_ALIGN, (bytes + GAIT_ALIGN - 1) / GAIT_ALIGN * GAIT_ALIGN);
        if (!m->memory)
            return message_set(why, "%s: not enough memory for %zu bytes", path, bytes);
        status = gait_model_init(m->memory, bytes, m->blob.data, m->blob.size, &m->model, &err);
    }
    m->bytes = m->blob.size + bytes;
    return status == GAIT_OK ||
           message_set(why, "%.100s: not a usable model: %s (%s); learn it anew or give another", path, err.text,
                       gait_result_name(status));
}

void model_file_close(model_file *m)
{
    free(m->memory);
    free(m->blob.data);
    *m = (model_file){0};
}
