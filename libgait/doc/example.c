/* example.c - follow somebody through a sequence of PGM pictures, in memory known when this is compiled.
 *
 *   cc example.c $(pkg-config --cflags --libs gait) -o example
 *   ./example walk.gait empty.pgm frame*.pgm
 *
 * The camera stands 1.4 m over the ground, looks along +y and sees 640 x 480 pixels 30 times a second; a person enters
 * at x = -1 m on a path 8 m away and walks along +x. */
#include <gait.h>
#include <stdio.h>

enum { WIDTH = 640, HEIGHT = 480 };
static const gait_camera camera = {WIDTH,        HEIGHT, 800, 800, 320, 240, {1, 0, 0, 0, 0, -1, 0, 1, 0},
                                   {0, 1.4f, 8}, {0}};
static _Alignas(GAIT_ALIGN) unsigned char blob[1 << 19], model_memory[1 << 16], memory[16 << 20];
static uint8_t empty[HEIGHT][WIDTH], picture[HEIGHT][WIDTH];

static size_t read_file(const char *name, void *to, size_t room)
{
    FILE *f = fopen(name, "rb");
    size_t n = f ? fread(to, 1, room, f) : 0;
    if (f)
        fclose(f);
    return n;
}

/* A grey picture of 640 x 480, without comments in its header; 0 if it is none. */
static int read_pgm(const char *name, uint8_t to[HEIGHT][WIDTH])
{
    FILE *f = fopen(name, "rb");
    int w = 0, h = 0, most = 0;
    int ok = f && fscanf(f, "P5 %d %d %d", &w, &h, &most) == 3 && fgetc(f) != EOF && w == WIDTH &&
             h == HEIGHT && most == 255 && fread(to, WIDTH, HEIGHT, f) == HEIGHT;
    if (f)
        fclose(f);
    return ok ? 1 : (fprintf(stderr, "%s: not a binary PGM of %d x %d\n", name, WIDTH, HEIGHT), 0);
}

int main(int argc, char **argv)
{
    const gait_image plate = {empty[0], WIDTH, HEIGHT, WIDTH, GAIT_GREY8};
    gait_frame frame = {.image = {{picture[0], WIDTH, HEIGHT, WIDTH, GAIT_GREY8}}};
    gait_tracker_config cfg;
    gait_state mean, sd;
    gait_estimate now;
    gait_tracker *t;
    gait_model *model;
    gait_error err;

    if (argc < 4)
        return fprintf(stderr, "usage: example MODEL.gait EMPTY.pgm FRAME.pgm...\n"), 2;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    cfg.camera[0] = camera;
    if (gait_model_init(model_memory, sizeof model_memory, blob, read_file(argv[1], blob, sizeof blob),
                        &model, &err) < 0 ||
        gait_tracker_init(memory, sizeof memory, model, &cfg, &t, &err) < 0)
        return fprintf(stderr, "%s: %s\n", argv[1], err.text), 1;
    if (!read_pgm(argv[2], empty) || gait_tracker_set_background(t, 0, &plate) < 0)
        return 1;
    gait_tracker_prior(model, &mean, &sd);
    mean.pelvis[0] = -1;
    sd.pelvis[0] = sd.pelvis[1] = sd.heading = 0.1f; /* the rest is as in anybody */
    gait_tracker_start(t, &mean, &sd, 0, NULL);
    for (int i = 3; i < argc; i++, frame.utime += 33333) {
        if (!read_pgm(argv[i], picture))
            return 1;
        if (gait_tracker_step(t, &frame, &now, &err) < 0)
            return fprintf(stderr, "%s: %s\n", argv[i], err.text), 1;
        printf("%3d  pelvis %6.3f %6.3f %6.3f m  phase %.3f  %.3f strides/s  status %d\n", i - 3,
               (double)now.mean.pelvis[0], (double)now.mean.pelvis[1], (double)now.mean.pelvis[2],
               (double)now.mean.phase, (double)now.mean.stride_hz, (int)now.status);
        if (i == argc - 1)
            printf("digest %016llx\n", (unsigned long long)gait_tracker_digest(t));
    }
    return 0;
}
