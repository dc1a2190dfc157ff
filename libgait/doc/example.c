/* example.c - track a person through PGM pictures of 640 x 480 at 30 per second, in memory known at compile time.
 *   cc example.c $(pkg-config --cflags --libs gait) -o example
 *   ./example walk.gait scene.txt empty.pgm frame*.pgm
 * scene.txt: fx fy cx cy, R by rows and t of the camera (x_cam = R x_world + t), then where the person is in the
 * first picture: x y (metres) and heading (radians, 0 = along +x).  example_clip.py writes such files. */
#include <gait.h>
#include <stdio.h>
#include <string.h>

enum { W = 640, H = 480 };
static _Alignas(GAIT_ALIGN) unsigned char blob[1 << 19], model_memory[1 << 16], memory[6 << 20];
static uint8_t empty[H][W], picture[H][W];

static int fail(const char *name, const char *why)
{
    return fprintf(stderr, "%s: %s\n", name, why), 1;
}

/* Read the pixels of a PGM file without comments, or 19 numbers; 0 if the file does not hold them. */
static int take(const char *name, uint8_t pixels[H][W], float number[19])
{
    FILE *f = fopen(name, "rb");
    int w = 0, h = 0, is = f != NULL, ok = is;
    for (int i = 0; i < 19 && number; i++)
        ok = ok && fscanf(f, "%f", &number[i]) == 1;
    if (ok && pixels)
        ok = fscanf(f, "P5 %d %d 255%*c", &w, &h) == 2 && w == W && h == H && fread(pixels, W, H, f) == H;
    ok = f && fclose(f) == 0 && ok;
    return ok || !fail(name, !is ? "unreadable" : pixels ? "no binary PGM of 640 x 480" : "not 19 numbers");
}

int main(int argc, char **argv)
{
    gait_frame frame = {.image = {{picture[0], W, H, W, GAIT_GREY8}}};
    gait_tracker_config cfg;
    gait_state mean, sd;
    gait_estimate now;
    gait_model *model;
    gait_tracker *t;
    gait_error err;
    float s[19];
    FILE *f = argc < 5 ? NULL : fopen(argv[1], "rb");
    size_t size = f ? fread(blob, 1, sizeof blob, f) : 0;
    if (argc < 5)
        return fail("usage", "example MODEL.gait SCENE.txt EMPTY.pgm FRAME.pgm..."), 2;
    if (gait_model_init(model_memory, sizeof model_memory, blob, size, &model, &err) < 0)
        return fail(argv[1], f ? err.text : "cannot be read");
    if (!take(argv[2], NULL, s) || !take(argv[3], empty, NULL))
        return 1;
    gait_tracker_default(&cfg, GAIT_MODE_DEFAULT);
    cfg.camera[0] = (gait_camera){.width = W, .height = H, .fx = s[0], .fy = s[1], .cx = s[2], .cy = s[3]};
    memcpy(cfg.camera[0].R, s + 4, sizeof cfg.camera[0].R);
    memcpy(cfg.camera[0].t, s + 13, sizeof cfg.camera[0].t);
    gait_tracker_prior(model, &mean, &sd,
                       NULL); /* any person, within about 0.1 m and rad of the given start */
    mean.pelvis[0] = s[16], mean.pelvis[1] = s[17], mean.heading = s[18];
    sd.pelvis[0] = sd.pelvis[1] = sd.heading = 0.1f;
    if (gait_tracker_init(memory, sizeof memory, model, &cfg, &t, &err) < 0)
        return fail(argv[2], err.text);
    gait_tracker_set_background(t, 0, &(gait_image){empty[0], W, H, W, GAIT_GREY8}, NULL);
    gait_tracker_start(t, &mean, &sd, 0, NULL);
    for (int i = 4; i < argc; i++, frame.utime += 33333) {
        if (!take(argv[i], picture, NULL))
            return 1;
        if (gait_tracker_step(t, &frame, &now, &err) < 0)
            return fail(argv[i], err.text);
        printf("%3d  pelvis %6.3f %6.3f %6.3f m  phase %.3f  status %d\n", i - 4, now.mean.pelvis[0],
               now.mean.pelvis[1], now.mean.pelvis[2], now.mean.phase, now.status);
    }
    return printf("digest %016llx\n", 0ull + gait_tracker_digest(t)), fflush(stdout) && fail("disk", "full");
}
