/* example.c - follow somebody through a sequence of PGM pictures, in memory known when this is compiled.
 *   cc example.c $(pkg-config --cflags --libs gait) -o example
 *   ./example walk.gait scene.txt empty.pgm frame*.pgm
 * 640 x 480 pixels 30 times a second; scene.txt: fx fy cx cy, R by rows and t of the camera (x_cam = R x_world + t), then
 * where somebody is in the first picture: x y (metres) and the heading (radians, 0 along +x).  example_clip.py writes such
 * files. */
#include <gait.h>
#include <stdio.h>

enum { W = 640, H = 480 }; /* pixels */
static _Alignas(GAIT_ALIGN) unsigned char blob[1 << 19], model_memory[1 << 16], memory[6 << 20];
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

/* Camera and start: 19 numbers; 0 if they are not there. */
static int read_scene(const char *name, gait_camera *c, gait_state *start)
{
    float *const to[] = {&c->fx, &c->fy, &c->cx, &c->cy, c->R, c->t, start->pelvis, &start->heading};
    const int count[] = {1, 1, 1, 1, 9, 3, 2, 1};
    FILE *f = fopen(name, "r");
    int ok = f != NULL;
    *c = (gait_camera){.width = W, .height = H};
    for (int i = 0; i < 8; i++)
        for (int k = 0; k < count[i]; k++)
            ok = ok && fscanf(f, "%f", &to[i][k]) == 1;
    if (f)
        fclose(f);
    return ok ? 1 : (fprintf(stderr, "%s: not 19 numbers\n", name), 0);
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
    FILE *f = argc < 5 ? NULL : fopen(argv[1], "rb");
    size_t size = f ? fread(blob, 1, sizeof blob, f) : 0;

    if (argc < 5)
        return fprintf(stderr, "usage: example MODEL.gait SCENE.txt EMPTY.pgm FRAME.pgm...\n"), 2;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    if (gait_model_init(model_memory, sizeof model_memory, blob, size, &model, &err) < 0)
        return fprintf(stderr, "%s: %s\n", argv[1], err.text), 1;
    gait_tracker_prior(model, &mean, &sd); /* anybody */
    if (!read_scene(argv[2], &cfg.camera[0], &mean) || !read_pgm(argv[3], empty))
        return 1;
    if (gait_tracker_init(memory, sizeof memory, model, &cfg, &t, &err) < 0)
        return fprintf(stderr, "%s\n", err.text), 1;
    gait_tracker_set_background(t, 0, &plate);
    /* there, give or take 0.1 m and radians */
    sd.pelvis[0] = sd.pelvis[1] = sd.heading = 0.1f;
    gait_tracker_start(t, &mean, &sd, 0, NULL);
    for (int i = 4; i < argc; i++, frame.utime += 33333) {
        if (!read_pgm(argv[i], picture))
            return 1;
        if (gait_tracker_step(t, &frame, &now, &err) < 0)
            return fprintf(stderr, "%s: %s\n", argv[i], err.text), 1;
        printf("%3d  pelvis %6.3f %6.3f %6.3f m  phase %.3f  status %d\n", i - 4, now.mean.pelvis[0],
               now.mean.pelvis[1], now.mean.pelvis[2], now.mean.phase, now.status);
    }
    return printf("digest %016llx\n", (unsigned long long)gait_tracker_digest(t)) < 0;
}
