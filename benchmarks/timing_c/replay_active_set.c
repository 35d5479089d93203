/* Replays QPs of one size with the active set, each timed by itself. */
#define _POSIX_C_SOURCE 199309L
#include <stddef.h>
#include <string.h>

#include "kinqp_clock.h"
#include "kinqp_qp.h"

/* data (count, size): H, g, rows of A and C, their lower sides and the box's, the same of the upper sides.
 * fresh (count,): 1 where the problem is solved cold whatever `warm` says.
 * problem (size,), memory, x (n,), multipliers (p + m + n,), active (m + n,): room to work in.
 * seconds (count,), status (count,), answers (count, n): out. */
void kinqp_replay_active_set(long count, int n, int p, int m, const double *data, const unsigned char *fresh, int warm,
                             double tolerance, int max_iterations, double *problem, void *memory, double *multipliers,
                             int *active, double *seconds, int *status, double *answers) {
    const long rows = p + m, size = (long)n * n + n + rows * n + 2 * (rows + n);
    /* As a controller has it: every problem in the same place, and just written. */
    double *H = problem, *g = H + (long)n * n, *A = g + n, *lower = A + rows * n, *upper = lower + rows + n;
    const kinqp_qp qp = {n, p, m, H, g, A, lower, A + (long)p * n, lower + p, upper + p, lower + rows, upper + rows};
    kinqp_qp_options options = kinqp_qp_default_options(n, p, m);
    options.tolerance = tolerance;
    if (max_iterations > 0) options.max_iterations = max_iterations;
    const double cost = kinqp_clock_cost();
    for (long k = 0; k < count; ++k) {
        kinqp_qp_solution solution = {answers + k * n, multipliers, multipliers + p, multipliers + rows, active,
                                      0, 0, 0.0, 0.0, 0.0};
        struct timespec start, end;
        memcpy(problem, data + k * size, (size_t)size * sizeof(double));
        /* As Solver.solve does: after anything but success the last active set is not believed. */
        options.warm = warm && !fresh[k] && k > 0 && status[k - 1] == 0;
        clock_gettime(CLOCK_MONOTONIC, &start);
        status[k] = (int)kinqp_qp_solve(&qp, &options, memory, &solution);
        clock_gettime(CLOCK_MONOTONIC, &end);
        seconds[k] = kinqp_seconds_between(&start, &end) - cost;
    }
}
