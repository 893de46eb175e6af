/* Displacement and area of a cantilever beam: reads beam.in, writes beam.out. */

#include <math.h>
#include <stdint.h>
#include <stdio.h>

static const double length = 100.0; /* in */

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

int main(void) {
    double width, thickness;
    unsigned long seed;
    FILE *in = fopen("beam.in", "r");
    if (!in || fscanf(in, " width %lf thickness %lf seed %lu", &width, &thickness, &seed) != 3) {
        fprintf(stderr, "beam.in is not of the form width … thickness … seed …\n");
        return 2;
    }
    fclose(in);

    double horizontal = 500.0, vertical = 1000.0, modulus = 2.9e7; /* lb, lb, psi */
    if (seed != 0) {
        state = seed * 11400714819323198485u;
        for (int i = 0; i < 8; i++) uniform();
        horizontal = normal(horizontal, 100.0);
        vertical = normal(vertical, 100.0);
        modulus = normal(modulus, 1.45e6);
    }
    double sideways = horizontal / (width * width);
    double downwards = vertical / (thickness * thickness);
    double displacement = 4.0 * length * length * length / (modulus * width * thickness) *
                          sqrt(sideways * sideways + downwards * downwards);

    FILE *out = fopen("beam.out", "w");
    if (!out) return 3;
    fprintf(out, "area = %.17g\ndisplacement = %.17g\n", width * thickness, displacement);
    return fclose(out) ? 3 : 0;
}
