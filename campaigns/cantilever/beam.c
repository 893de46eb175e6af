/* A cantilever beam under a horizontal and a vertical load at its tip: reads beam.in, writes beam.out.
 *
 * area          width times thickness, in²
 * displacement  of the tip, in
 * overstress    the stress at the root less the yield strength, psi: above 0 the beam yields */

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static const double length = 100.0; /* in */
static const double horizontal_mean = 500.0, vertical_mean = 1000.0, load_sd = 100.0; /* lb */
static const double modulus_mean = 2.9e7, modulus_sd = 1.45e6;                        /* psi */

static uint64_t state;

/* A uniform number in (0, 1): Marsaglia's xorshift with Vigna's multiplier. */
static double uniform(void) {
    state ^= state >> 12;
    state ^= state << 25;
    state ^= state >> 27;
    return ((state * 2685821657736338717u >> 11) + 0.5) / 9007199254740992.0;
}

/* Box and Muller. */
static double normal(double mean, double sd) {
    double radius = sqrt(-2.0 * log(uniform()));
    return mean + sd * radius * cos(6.283185307179586 * uniform());
}

static double displacement_of(double width, double thickness, double horizontal, double vertical,
                              double modulus) {
    double sideways = horizontal / (width * width);
    double downwards = vertical / (thickness * thickness);
    return 4.0 * length * length * length / (modulus * width * thickness) *
           sqrt(sideways * sideways + downwards * downwards);
}

int main(void) {
    double width, thickness;
    unsigned long seed;
    FILE *in = fopen("beam.in", "r");
    if (!in || fscanf(in, " width %lf thickness %lf seed %lu", &width, &thickness, &seed) != 3) {
        fprintf(stderr, "beam.in is not of the form width … thickness … seed …\n");
        return 2;
    }
    fclose(in);

    double horizontal = horizontal_mean, vertical = vertical_mean, modulus = modulus_mean;
    double strength = 40000.0; /* psi */
    if (seed != 0) {
        state = seed * 11400714819323198485u;
        for (int i = 0; i < 8; i++) uniform();
        horizontal = normal(horizontal, load_sd);
        vertical = normal(vertical, load_sd);
        modulus = normal(modulus, modulus_sd);
        strength = normal(strength, 2000.0);
    }

    FILE *out = fopen("beam.out", "w");
    if (!out) return 3;
    fprintf(out, "area = %.17g\ndisplacement = %.17g\noverstress = %.17g\n", width * thickness,
            displacement_of(width, thickness, horizontal, vertical, modulus),
            6.0 * length * (vertical / (width * thickness * thickness) +
                            horizontal / (width * width * thickness)) - strength);
    return fclose(out) ? 3 : 0;
}
