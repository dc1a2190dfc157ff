/* example.c - follow somebody through a sequence of PGM pictures, in memory known when this is compiled.
 *   cc example.c $(pkg-config --cflags --libs gait) -o example
 *   ./example walk.gait empty.pgm frame*.pgm
 * The camera stands 1.4 m over the ground, looks along +y and sees 640 x 480 pixels 30 times a second; a person enters
 * at x = -1 m on a path 8 m away and walks along +x. */
#include <gait.h>
#include <stdio.h>

enum { W = 640, H = 480 }; /* pixels */
static _Alignas(GAIT_ALIGN) unsigned char blob[1 << 19], model_memory[1 << 16], memory[4 << 20];
static uint8_t empty[H][W], picture[H][W];

/* A picture of that size, without comments in its header; 0 if it is none. */
static int read_pgm(const char *name, uint8_t to[H][W])
{
    FILE *f = fopen(name, "rb");
    int w = 0, h = 0, most = 0;
    int ok = f && fscanf(f, "P5 %d %d %d", &w, &h, &most) == 3 && fgetc(f) != EOF && w == W && h == H &&
             most == 255 && fread(to, W, H, f) == H;
    if (f)
        fclose(f);
    return ok ? 1 : (fprintf(stderr, "%s: not a binary PGM of %d x %d\n", name, W, H), 0);
}

int main(int argc, char **argv)
{
    gait_image plate = {empty[0], W, H, W, GAIT_GREY8};
    gait_frame frame = {.image = {{picture[0], W, H, W, GAIT_GREY8}}};
    gait_tracker_config cfg;
    gait_state mean, sd;
    gait_estimate now;
    gait_model *model;
    gait_tracker *t;
    gait_error err;
    FILE *f = argc < 4 ? NULL : fopen(argv[1], "rb");
    size_t size = f ? fread(blob, 1, sizeof blob, f) : 0;

    if (argc < 4)
        return fprintf(stderr, "usage: example MODEL.gait EMPTY.pgm FRAME.pgm...\n"), 2;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    cfg.camera[0] = (gait_camera){W, H, 800, 800, 320, 240, {1, 0, 0, 0, 0, -1, 0, 1, 0}, {0, 1.4f, 8}, {0}};
    if (gait_model_init(model_memory, sizeof model_memory, blob, size, &model, &err) < 0 ||
        gait_tracker_init(memory, sizeof memory, model, &cfg, &t, &err) < 0)
        return fprintf(stderr, "%s: %s\n", argv[1], err.text), 1;
    if (!read_pgm(argv[2], empty) || gait_tracker_set_background(t, 0, &plate) < 0)
        return 1;
    gait_tracker_prior(model, &mean, &sd); /* anybody, */
    mean.pelvis[0] = -1;                   /* there, give or take 0.1 m and radians */
    sd.pelvis[0] = sd.pelvis[1] = sd.heading = 0.1f;
    gait_tracker_start(t, &mean, &sd, 0, NULL);
    for (int i = 3; i < argc; i++, frame.utime += 33333) {
        if (!read_pgm(argv[i], picture))
            return 1;
        if (gait_tracker_step(t, &frame, &now, &err) < 0)
            return fprintf(stderr, "%s: %s\n", argv[i], err.text), 1;
        printf("%3d  pelvis %6.3f %6.3f %6.3f m  phase %.3f  status %d\n", i - 3, now.mean.pelvis[0],
               now.mean.pelvis[1], now.mean.pelvis[2], now.mean.phase, now.status);
    }
    return printf("digest %016llx\n", (unsigned long long)gait_tracker_digest(t)) < 0;
}
