#include "tracker_options.h"

#include <math.h>
#include <string.h>

#define FIELD(f) offsetof(gait_tracker_config, f)

/* The ranges are those of the library (api_tracker.c), so that the usage error comes before any work. */
static const struct {
    const char *name;
    size_t offset;
    double low, high;
    const char *help;
} fields[] = {
    {"texture-weight", FIELD(term_weight[0]), 0, 1e6, "nats per unit cost of the previous frame's texture"},
    {"silhouette-weight", FIELD(term_weight[1]), 0, 1e6, "nats per unit cost of the silhouette"},
    {"edges-weight", FIELD(term_weight[2]), 0, 1e6, "nats per unit cost of the edges"},
    {"template-weight", FIELD(term_weight[3]), 0, 1e6, "nats per unit cost of the running template"},
    {"tracks-weight", FIELD(term_weight[4]), 0, 1e6, "nats per unit cost of joints found by a detector"},
    {"missed-weight", FIELD(missed_weight), 0, 1, "foreground outside the limbs against background inside"},
    {"girth", FIELD(girth), 0.5, 2, "limb radii against the model's (clothes)"},
    {"resample-ess", FIELD(resample_ess), 0, 1, "resample below this fraction of the particles"},
    {"evidence-time", FIELD(evidence_time), 0, 1e6,
     "seconds for which errors of the image terms last; 0: every frame counts in full"},
    {"rejuvenation-time", FIELD(rejuvenation_time), 0, 1e6,
     "seconds in which particles forget whom they descend from; 0: never"},
    {"max-dt", FIELD(max_dt), 1e-3, 10,
     "longest interval crossed by one prediction, seconds; a longer one, up to --max-gap, by several"},
    {"phase-noise", FIELD(phase_noise), 0, 10, "strides per sqrt(second)"},
    {"rate-noise", FIELD(rate_noise), 0, 10, "fraction of the mean stride rate per sqrt(second)"},
    {"settle-time", FIELD(settle_time), 0, 1e6, "seconds after the start in which stature settles"},
    {"rate-time", FIELD(rate_time), 0, 1e6,
     "time constant of the rate's return to the population's, seconds"},
    {"forward-noise", FIELD(forward_noise), 0, 100, "metres per sqrt(second)"},
    {"lateral-noise", FIELD(lateral_noise), 0, 100, "metres per sqrt(second)"},
    {"vertical-noise", FIELD(vertical_noise), 0, 100, "metres per sqrt(second)"},
    {"heading-noise", FIELD(heading_noise), 0, 100, "radians per sqrt(second)"},
    {"turn-sd", FIELD(turn_sd), 0, 100, "of the turn rates that walkers take, radians per second"},
    {"turn-time", FIELD(turn_time), 0, 1e6,
     "mean seconds until a walker takes another turn rate; 0: always straight on"},
    {"tilt-noise", FIELD(tilt_noise), 0, 100, "radians per sqrt(second)"},
    {"tilt-time", FIELD(tilt_time), 0, 1e6, "seconds in which tilt and height return to the model's"},
    {"coef-noise", FIELD(coef_noise), 0, 100, "score standard deviations per sqrt(second)"},
    {"coef-time", FIELD(coef_time), 0, 1e6, "seconds in which the scores return to the mean; 0: never"},
    {"stature-noise", FIELD(stature_noise), 0, 100, "deviations of stature at the start per sqrt(second)"},
    {"stature-noise-start", FIELD(stature_noise_start), 0, 100, "the same while settling"},
    {"proportion-noise", FIELD(proportion_noise), 0, 100,
     "standard deviations of the limbs' proportions per sqrt(second)"},
    {"joint-sd-model", FIELD(joint_sd_model), 0, 1, "what the model cannot express, fraction of stature"},
    {"offset-noise", FIELD(offset_noise), 0, 100, "deviations of posture among people per sqrt(second)"},
};

_Static_assert(sizeof fields / sizeof *fields == TRACKER_OPTIONS, "every field has a value");

void tracker_options_table(tracker_values *values, option *table)
{
    for (int i = 0; i < TRACKER_OPTIONS; i++) {
        values->value[i] = NAN;
        table[i] =
            (option){fields[i].name, 0, "X", fields[i].help, OPTION_FLOAT, &values->value[i], fields[i].low,
                     fields[i].high};
    }
}

void tracker_options_apply(const tracker_values *values, gait_tracker_config *config)
{
    for (int i = 0; i < TRACKER_OPTIONS; i++)
        if (!isnan(values->value[i]))
            memcpy((char *)config + fields[i].offset, &values->value[i], sizeof values->value[i]);
}
