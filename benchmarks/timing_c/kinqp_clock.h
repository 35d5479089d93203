/* Times of a span by the monotonic clock, its own cost taken off. */
#ifndef KINQP_CLOCK_H
#define KINQP_CLOCK_H

#include <time.h>

static inline double kinqp_seconds_between(const struct timespec *from, const struct timespec *to) {
    return (double)(to->tv_sec - from->tv_sec) + 1e-9 * (double)(to->tv_nsec - from->tv_nsec);
}

/* Time that measuring nothing takes, at best [s]. */
static double kinqp_clock_cost(void) {
    double best = 1.0;
    for (int i = 0; i < 1000; ++i) {
        struct timespec start, end;
        clock_gettime(CLOCK_MONOTONIC, &start);
        clock_gettime(CLOCK_MONOTONIC, &end);
        const double taken = kinqp_seconds_between(&start, &end);
        if (taken < best) best = taken;
    }
    return best;
}

#endif
