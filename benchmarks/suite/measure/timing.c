/* Times the generated tick state by state, by its own clock, with nothing else in the loop.
 *
 * Included here: step.inc, the generated source with KINQP_HOLD and KINQP_MARK put between its stages, and batch.inc, the
 * loop that Python calls. P(name) is a symbol of that source.
 *   LEVEL 0: no marks; the clock is around the tick, called through a pointer.
 *   LEVEL 1: the QP alone, from its data to its solution.
 *   LEVEL 2: every stage.
 */
#define _POSIX_C_SOURCE 199309L
#include <time.h>

/* Serialised: nothing before may finish later, nothing behind may begin earlier. */
#if defined(__x86_64__)
#include <x86intrin.h>
static inline unsigned long long kinqp_now(void) {
    unsigned core;
    _mm_lfence();
    const unsigned long long now = __rdtscp(&core);
    _mm_lfence();
    return now;
}
#else
static inline unsigned long long kinqp_now(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (unsigned long long)now.tv_sec * 1000000000ull + (unsigned long long)now.tv_nsec;
}
#endif

enum { MARKS = 8 };
static unsigned long long kinqp_stamps[MARKS];

/* What is held has to be in memory by then, so that no stage's work slips into another. */
#if LEVEL == 0
#define KINQP_HOLD(array) ((void)0)
#define KINQP_MARK(level, index) ((void)0)
#else
#define KINQP_HOLD(array) __asm__ volatile("" : : "g"(array) : "memory")
#define KINQP_MARK(level, index) do { if ((level) <= LEVEL) kinqp_stamps[index] = kinqp_now(); } while (0)
#endif

#include "step.inc"
#include "batch.inc"

#define JOIN(a, b) a##b
#define JOINED(a, b) JOIN(a, b)
#define P(name) JOINED(PREFIX, name)

/* Nanoseconds per unit of the clock, over the given time [s]. */
double kinqp_clock_unit(double seconds);
/* Units of the clock that measuring nothing takes, at best. */
double kinqp_clock_cost(void);
/* Nanoseconds between two calls of clock_gettime, at best: in every time that is taken by it. */
double kinqp_gettime_cost(void);
/* One pass over the states [first, last). best (count, MARKS - 1): smallest time of each stage so far [clock units]. */
void kinqp_pass(long first, long last, const double *q, const double *v, double *best, double *qd, int *status,
                int *iterations);
/* The same ticks in a plain loop without clocks, as a controller would call them; returns the time of all [ns]. */
double kinqp_loop(long count, const double *q, const double *v, double *qd, double *eps, int *status);

static double kinqp_elapsed(const struct timespec *from) {
    struct timespec to;
    clock_gettime(CLOCK_MONOTONIC, &to);
    return (double)(to.tv_sec - from->tv_sec) * 1e9 + (double)(to.tv_nsec - from->tv_nsec);
}

double kinqp_clock_unit(double seconds) {
    struct timespec start;
    clock_gettime(CLOCK_MONOTONIC, &start);
    const unsigned long long first = kinqp_now();
    while (kinqp_elapsed(&start) < seconds * 1e9) {}
    const unsigned long long last = kinqp_now();
    return kinqp_elapsed(&start) / (double)(last - first);
}

double kinqp_clock_cost(void) {
    double best = 1e18;
    for (int i = 0; i < 100000; ++i) {
        const unsigned long long start = kinqp_now();
        const double taken = (double)(kinqp_now() - start);
        if (taken < best) best = taken;
    }
    return best;
}

double kinqp_gettime_cost(void) {
    double best = 1e18;
    for (int i = 0; i < 100000; ++i) {
        struct timespec start;
        clock_gettime(CLOCK_MONOTONIC, &start);
        const double taken = kinqp_elapsed(&start);
        if (taken < best) best = taken;
    }
    return best;
}

void kinqp_pass(long first, long last, const double *q, const double *v, double *best, double *qd, int *status,
                int *iterations) {
    static kinqp_status (*volatile step)(const P(_parameters) *, const P(_input) *, P(_output) *) = P(_step);
    P(_parameters) parameters;
    P(_input) input = {0};
    P(_output) output;
    enum { NV = sizeof input.q / sizeof *input.q, FREE = sizeof input.v / sizeof *input.v };
    P(_default_parameters)(&parameters);
    for (long tick = first; tick < last; ++tick) {
        for (int i = 0; i < NV; ++i) input.q[i] = q[tick * NV + i];
        for (int i = 0; i < FREE; ++i) input.v[i] = v[tick * FREE + i];
        for (int i = 0; i < MARKS; ++i) kinqp_stamps[i] = 0;
        const unsigned long long start = kinqp_now();
        status[tick] = (int)step(&parameters, &input, &output);
        const unsigned long long end = kinqp_now();
        kinqp_stamps[0] = start;
        kinqp_stamps[MARKS - 1] = end;
        iterations[tick] = output.iterations;
        for (int i = 0; i < NV; ++i) qd[tick * NV + i] = output.qd[i];
        /* A mark that wasn't passed leaves its stage out: the time counts for the next one that was. */
        unsigned long long before = start;
        for (int i = 1; i < MARKS; ++i) {
            if (!kinqp_stamps[i]) continue;
            const double taken = (double)(kinqp_stamps[i] - before);
            before = kinqp_stamps[i];
            if (taken < best[tick * (MARKS - 1) + i - 1]) best[tick * (MARKS - 1) + i - 1] = taken;
        }
    }
}

double kinqp_loop(long count, const double *q, const double *v, double *qd, double *eps, int *status) {
    P(_parameters) parameters;
    P(_input) input = {0};
    P(_output) output;
    enum { NV = sizeof input.q / sizeof *input.q, FREE = sizeof input.v / sizeof *input.v };
    P(_default_parameters)(&parameters);
    struct timespec start;
    clock_gettime(CLOCK_MONOTONIC, &start);
    for (long tick = 0; tick < count; ++tick) {
        for (int i = 0; i < NV; ++i) input.q[i] = q[tick * NV + i];
        for (int i = 0; i < FREE; ++i) input.v[i] = v[tick * FREE + i];
        status[tick] = (int)P(_step)(&parameters, &input, &output);
        for (int i = 0; i < NV; ++i) qd[tick * NV + i] = output.qd[i];
        for (int i = 0; i < FREE; ++i) eps[tick * FREE + i] = output.eps[i];
    }
    return kinqp_elapsed(&start);
}
