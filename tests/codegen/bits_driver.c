/* Runs generated code over ticks of any bits: driver TICKS. Nothing is judged here, a sanitizer watches.
 *
 * Includes the generated header by the name given as HEADER; PREFIX is that library's. A tick is a row of doubles: mode,
 * max_iterations (negative: the default), feasible, two parameters by their place among the doubles (negative: none) and
 * their values, then all of the input behind its mode. GUIDE runs the blend of modes beside the step, GUIDING the
 * hand-guiding controller, whose input has a stop flag and a wrench, and whose state lives on from tick to tick. All
 * structs stand in blocks of their own on the heap, of exactly their size.
 */
#include HEADER

#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define JOIN(a, b) a##b
#define JOINED(a, b) JOIN(a, b)
#define P(name) JOINED(PREFIX, name)
#define CHANGES 2

int main(int count, char **arguments) {
    if (count != 2) return 2;
    FILE *in = fopen(arguments[1], "rb");
#ifdef GUIDING
    P(_guiding_parameters) *parameters = malloc(sizeof *parameters);
    P(_guiding_input) *input = calloc(1, sizeof *input);
    P(_guiding_output) *output = malloc(sizeof *output);
    P(_guiding_state) *state = malloc(sizeof *state);
    P(_parameters) *step = &parameters->step;
#else
    P(_parameters) *parameters = malloc(sizeof *parameters), *step = parameters;
    P(_input) *input = calloc(1, sizeof *input);
    P(_output) *output = malloc(sizeof *output);
#endif
    if (!in || !parameters || !input || !output) return 3;
    const size_t front = offsetof(P(_parameters), max_iterations);
    const size_t size = sizeof *input - ((char *)input->q - (char *)input);
    double tick[3 + 2 * CHANGES], *values = malloc(size);
#ifdef GUIDING
    P(_default_guiding)(parameters);
    P(_start_guiding)(parameters, state);
#else
    P(_default_parameters)(parameters);
#endif
#ifdef GUIDE
    P(_guide_state) *state = malloc(sizeof *state);
    P(_start_guide)(state);
#endif
    const int most = step->max_iterations;
    while (fread(tick, sizeof tick, 1, in) == 1 && fread(values, size, 1, in) == 1) {
        input->mode = (int)tick[0];
        step->max_iterations = tick[1] < 0.0 ? most : (int)tick[1];
        step->feasible = (int)tick[2];
        memcpy(input->q, values, size);
        double before[CHANGES], *changed[CHANGES];
        for (int i = 0; i < CHANGES; ++i) {
            changed[i] = tick[3 + i] < 0.0 ? NULL : (double *)step + (size_t)tick[3 + i] % (front / sizeof(double));
            if (!changed[i]) continue;
            before[i] = *changed[i];
            *changed[i] = tick[3 + CHANGES + i];
        }
#ifdef GUIDING
        input->stop = tick[1] > 1.0;
        P(_guiding_tick)(parameters, state, input, output);
#else
        P(_step)(parameters, input, output);
#endif
#ifdef GUIDE
        P(_guide)(parameters, state, input, output);
#endif
        for (int i = CHANGES - 1; i >= 0; --i)
            if (changed[i]) *changed[i] = before[i];
    }
#if defined(GUIDE) || defined(GUIDING)
    free(state);
#endif
    free(values);
    free(parameters);
    free(input);
    free(output);
    return fclose(in);
}
