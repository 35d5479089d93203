/* The least-distance solver for sizes known at run time. */
#include "kinqp_as.h"

#include <float.h>
#include <math.h>

#define KINQP_AS_FN(name) kinqp_as_any_##name
#define KINQP_AS_STATE kinqp_as_state
#define KINQP_AS_DIMS(s) const int n = (s)->n, m = (s)->m; (void)n; (void)m

#include "kinqp_as_factor.inc"
#include "kinqp_as_steps.inc"
#include "kinqp_as_core.inc"
#include "kinqp_as_primal.inc"

kinqp_as_options kinqp_as_default_options(int n, int m) {
    kinqp_as_options o;
    o.violation = 1e-12;
    o.dependence = 1e-10;
    o.inconsistent = 1e-9;
    o.scale = 0.0;
    o.max_iterations = 10 * (m + n) + 50;
    o.warm = 0;
    o.polish = 1;
    return o;
}

size_t kinqp_as_workspace_size(int n, int m) {
    if (n < 0 || m < 0) return 0;
    const size_t a = (size_t)n, b = (size_t)m;
    return (2 * a * a + 6 * a + 3 * b) * sizeof(double) + 2 * a * sizeof(int) + sizeof(double);
}

void kinqp_as_setup(kinqp_as_state *state, int n, int m, void *memory) {
    double *next = memory;
    state->n = n;
    state->m = m;
    state->k = 0;
    state->q = next;
    next += n * n;
    state->r = next;
    next += n * n;
    state->rinv = next;
    next += n;
    state->u = next;
    next += n;
    state->d = next;
    next += n;
    state->p = next;
    next += n;
    state->e = next;
    next += n;
    state->t = next;
    next += n;
    state->norm2 = next;
    next += m;
    state->weight = next;
    next += m;
    state->gap = next;
    next += m;
    state->rows = (int *)(void *)next;
    state->signs = state->rows + n;
    state->slack = state->noise = state->offset = NULL;
}

kinqp_status kinqp_as_solve(kinqp_as_state *state, const double *matrix, const double *lo, const double *hi,
                            const double *target, const double *admissible, const kinqp_as_options *options, double *w,
                            double *z, int *active, kinqp_as_result *result) {
    return kinqp_as_any_solve(state, matrix, lo, hi, target, admissible, options, w, z, active, result);
}

kinqp_status kinqp_as_primal(kinqp_as_state *state, const double *matrix, const double *lo, const double *hi,
                             const double *admissible, const kinqp_as_options *options, double *w, double *z,
                             int *active, kinqp_as_result *result) {
    return kinqp_as_any_primal(state, matrix, lo, hi, admissible, options, w, z, active, result);
}
