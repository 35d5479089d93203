/* Replays QPs of one size with the C that CasADi generates of QRQP (qrqp.inc), each timed by itself. */
#define _POSIX_C_SOURCE 199309L
#include "qrqp.inc"

#include <stddef.h>
#include <string.h>

#include "kinqp_clock.h"

/* data (count, size): H, g, rows of A and C by columns, their lower sides and the box's, the same of the upper sides.
 * fresh (count,): 1 where the problem is solved cold whatever `warm` says.
 * problem (size,), arg, res, iw, w, lam (2, rows + n): room to work in.
 * seconds (count,), status (count,), answers (count, n): out. */
void kinqp_replay_qrqp(long count, int n, int rows, const double *data, const unsigned char *fresh, int warm,
                       double *problem, const double **arg, double **res, int *iw, double *w, double *lam,
                       double *seconds, int *status, double *answers) {
    const long size = (long)n * n + n + (long)rows * n + 2 * (rows + n);
    double *H = problem, *g = H + (long)n * n, *A = g + n, *lower = A + (long)rows * n, *upper = lower + rows + n;
    const double cost = kinqp_clock_cost();
    for (long k = 0; k < count; ++k) {
        struct timespec start, end;
        const int guess = warm && !fresh[k] && k > 0 && status[k - 1] == 0;
        double *now = lam + (k % 2) * (rows + n), *last = lam + ((k + 1) % 2) * (rows + n);
        memcpy(problem, data + k * size, (size_t)size * sizeof(double));
        arg[0] = H;
        arg[1] = g;
        arg[2] = A;
        arg[3] = lower;
        arg[4] = upper;
        arg[5] = lower + rows;
        arg[6] = upper + rows;
        arg[7] = guess ? answers + (k - 1) * n : NULL;
        arg[8] = guess ? last + rows : NULL;
        arg[9] = guess ? last : NULL;
        arg[10] = arg[11] = NULL;
        res[0] = answers + k * n;
        res[1] = NULL;
        res[2] = now;
        res[3] = now + rows;
        clock_gettime(CLOCK_MONOTONIC, &start);
        status[k] = kinqp_qrqp(arg, res, iw, w, 0);
        clock_gettime(CLOCK_MONOTONIC, &end);
        seconds[k] = kinqp_seconds_between(&start, &end) - cost;
    }
}
