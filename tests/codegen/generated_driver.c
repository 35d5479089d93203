/* Runs a generated step over a file of ticks: driver TICKS ANSWERS.
 *
 * Includes the generated header by the name given as HEADER; P(name) is a symbol of that library. A tick is a row of
 * doubles: mode, max_iterations, feasible, then NV positions and FREE velocities. An answer: status, iterations, NV, FREE
 * doubles. Input and output stand in blocks of their own on the heap, of exactly their size.
 */
#include HEADER

#include <stdio.h>
#include <stdlib.h>

#define JOIN(a, b) a##b
#define JOINED(a, b) JOIN(a, b)
#define P(name) JOINED(PREFIX, name)

int main(int count, char **arguments) {
    if (count != 3) return 2;
    FILE *in = fopen(arguments[1], "rb"), *out = fopen(arguments[2], "wb");
    P(_parameters) *parameters = malloc(sizeof *parameters);
    P(_input) *input = calloc(1, sizeof *input);
    P(_output) *output = malloc(sizeof *output);
    if (!in || !out || !parameters || !input || !output) return 3;
    enum { NV = sizeof input->q / sizeof *input->q, FREE = sizeof input->v / sizeof *input->v };
    double tick[3 + NV + FREE], answer[2 + NV + FREE];
    P(_default_parameters)(parameters);
    const int most = parameters->max_iterations;
    while (fread(tick, sizeof tick, 1, in) == 1) {
        input->mode = (int)tick[0];
        parameters->max_iterations = tick[1] < 0.0 ? most : (int)tick[1];
        parameters->feasible = (int)tick[2];
        for (int i = 0; i < NV; ++i) input->q[i] = tick[3 + i];
        for (int i = 0; i < FREE; ++i) input->v[i] = tick[3 + NV + i];
        answer[0] = (double)P(_step)(parameters, input, output);
        answer[1] = (double)output->iterations;
        for (int i = 0; i < NV; ++i) answer[2 + i] = output->qd[i];
        for (int i = 0; i < FREE; ++i) answer[2 + NV + i] = output->eps[i];
        if (fwrite(answer, sizeof answer, 1, out) != 1) return 4;
    }
    free(parameters);
    free(input);
    free(output);
    fclose(in);
    return fclose(out) ? 4 : 0;
}
