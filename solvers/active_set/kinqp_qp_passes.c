/* The outer passes on the reduced problem: the core, refinement, and what to do where one pass is not enough. */
#include <math.h>

#include "kinqp_qp_internal.h"

#define KINQP_PASSES_PER_WEIGHT 12  /* passes until the weight is lowered by 100 [count] */
#define KINQP_REFINEMENTS 4         /* refinements per pass at most [count] */
#define KINQP_MARGIN 0.01           /* proximal passes aim for this share of the tolerance [-] */
#define KINQP_MARGIN_PASSES 6       /* passes granted for that once the tolerance itself is met [count] */
#define KINQP_EXACT_PASSES 6        /* passes where none should be needed but the first [count] */
#define KINQP_PASSES_UNTIL_RELAXED 3 /* passes after which a row that is still outside is taken to contradict others [count] */
#define KINQP_RELAXATION 0.9        /* share of the noise in a bound by which it is moved then [-] */
#define KINQP_NEARLY 1e-3           /* residual below which a proximal pass goes on from the refined point [-] */
#define KINQP_SLACK 0.01            /* share of the tolerance that a row may be outside before it is taken up again [-] */
#define KINQP_GRADIENT_SHARE 0.01   /* of the gradient's length counts as length of the data [-] */

/* v := T'grad. */
static void whiten_vector(const kinqp_qp_work *k, const double *grad, double *v) {
    for (int c = 0; c < k->free; ++c) v[c] = 0.0;
    for (int i = 0; i < k->n; ++i)
        for (int c = 0; c < k->free; ++c) v[c] += k->white[i * k->free + c] * grad[i];
}

static double row_value(const kinqp_qp_work *k, int row, int m, const double *x) {
    const int id = k->id[row];
    KINQP_ASSERT(row >= 0 && row < k->rows && id >= 0 && id < m + k->n);
    return id < m ? kinqp_qp_dot(k->rowmat + id * k->n, x, k->n) : x[id - m];
}

/* v := T'(H x + g + rows' duals): what stationarity still misses, in whitened coordinates. The equalities' duals have no
 * share in it but for rounding: they are put in so that large terms cancel entry by entry, before T mixes the entries. */
static void whitened_residual(kinqp_qp_work *k, int m, const double *x, double *v) {
    for (int i = 0; i < k->n; ++i) k->grad[i] = k->g[i] + kinqp_qp_dot(k->hess + i * k->n, x, k->n);
    for (int j = 0; j < k->state.k; ++j) {
        const int row = k->state.rows[j], id = k->id[row];
        if (id >= m) k->grad[id - m] += k->rowz[row];
        else for (int i = 0; i < k->n; ++i) k->grad[i] += k->rowmat[id * k->n + i] * k->rowz[row];
    }
    for (int i = 0; i < k->n; ++i) k->s[i] = -k->grad[i];
    kinqp_qp_equality_duals(k, k->s, k->ey);
    for (int r = 0; r < k->equalities; ++r)
        for (int i = 0; i < k->n; ++i) k->grad[i] += k->eqmat[r * k->n + i] * k->ey[r];
    whiten_vector(k, k->grad, v);
}

/* x += a Newton step on the face of the core's active set, duals likewise; both as corrections of residuals. */
static void refine(kinqp_qp_work *k, int m, double *x) {
    const int f = k->free, active = k->state.k; /* active <= f: see the core */
    KINQP_ASSERT(active >= 0 && active <= f);
    double *v = k->v, *e = k->state.u, *d = k->state.d;
    whitened_residual(k, m, x, v);
    for (int j = 0; j < active; ++j) {
        const int row = k->state.rows[j];
        const double value = row_value(k, row, m, x);
        e[j] = k->state.signs[j] < 0 ? k->lower[row] - value : value - k->upper[row];
    }
    for (int j = 0; j < active; ++j) { /* e := R^-T e, d := Q'v */
        for (int i = 0; i < j; ++i) e[j] -= k->state.r[j * f + i] * e[i];
        e[j] *= k->state.rinv[j];
        d[j] = kinqp_qp_dot(k->state.q + j * f, v, f);
    }
    for (int i = 0; i < f; ++i) k->w[i] = active < f ? -v[i] : 0.0;
    for (int j = 0; j < active; ++j)
        for (int i = 0; i < f; ++i) k->w[i] += k->state.q[j * f + i] * (active < f ? d[j] + e[j] : e[j]);
    for (int i = 0; i < k->n; ++i) x[i] += kinqp_qp_dot(k->white + i * f, k->w, f);
    kinqp_qp_restore_equalities(k, x);
    whitened_residual(k, m, x, v);
    for (int j = 0; j < active; ++j) d[j] = kinqp_qp_dot(k->state.q + j * f, v, f);
    for (int j = active - 1; j >= 0; --j) {
        d[j] *= k->state.rinv[j];
        for (int i = 0; i < j; ++i) d[i] -= k->state.r[j * f + i] * d[j];
    }
    for (int j = 0; j < active; ++j) {
        const double sign = k->state.signs[j], dual = sign * k->rowz[k->state.rows[j]] + d[j];
        k->rowz[k->state.rows[j]] = dual > 0.0 ? sign * dual : 0.0;
    }
}

static double worst_residual(const kinqp_qp_solution *s) { return fmax(s->primal, fmax(s->dual, s->gap)); }

/* Refines x until the residuals stall; leaves the answer in s and returns its worst residual. */
static double polish(kinqp_qp_work *k, const kinqp_qp *qp, double *x, kinqp_qp_solution *s) {
    double before = HUGE_VAL;
    for (int i = 0; i < KINQP_REFINEMENTS; ++i) {
        refine(k, qp->m, x);
        kinqp_qp_recover(k, qp, x, 0, s);
        kinqp_qp_measure(qp, k->scale, KINQP_QP_ROUNDING, s);
        const double now = worst_residual(s);
        if (s->primal <= 1e-12 && s->dual <= 1e-13 && s->gap <= 1e-13) return now; /* rounding of rows at small x */
        if (!(now < 0.5 * before)) return now;
        before = now;
    }
    return before;
}

double kinqp_qp_curvature(const kinqp_qp_work *k) {
    double largest = 0.0, reach = 1.0, slope = 0.0;
    for (int i = 0; i < k->free; ++i) largest = fmax(largest, k->curv[i * k->free + i]);
    if (largest > 1e-12) return largest; /* the scaled Hessian has a unit diagonal or none */
    for (int r = 0; r < k->rows; ++r) {
        if (kinqp_qp_is_finite(k->lower[r])) reach = fmax(reach, fabs(k->lower[r]));
        if (kinqp_qp_is_finite(k->upper[r])) reach = fmax(reach, fabs(k->upper[r]));
    }
    for (int i = 0; i < k->n; ++i) slope = fmax(slope, fabs(k->g[i]));
    return slope > 0.0 ? slope / reach : 1.0;
}

/* Bounds of the whitened rows and the target (in centre) about the iterate; returns the iterate's whitened length. */
static double recentre(kinqp_qp_work *k, int m, double shift) {
    double size = 0.0;
    for (int i = 0; i < k->n; ++i) {
        const double pull = kinqp_qp_dot(k->hess + i * k->n, k->x, k->n);
        k->grad[i] = k->g[i] + pull;
        size += k->x[i] * (pull + shift * k->x[i]);
    }
    whiten_vector(k, k->grad, k->centre);
    for (int c = 0; c < k->free; ++c) k->centre[c] = -k->centre[c];
    for (int r = 0; r < k->rows; ++r) {
        const double value = row_value(k, r, m, k->x);
        k->lo[r] = k->lower[r] - value;
        k->hi[r] = k->upper[r] - value;
    }
    return size > 0.0 ? sqrt(size) : 0.0;
}

/* What each row may be outside at the iterate before the core takes it up, and what its bound may be off by. */
static void set_tolerances(kinqp_qp_work *k, int m, double tolerance, int relaxed) {
    for (int r = 0; r < k->rows; ++r) {
        const int id = k->id[r];
        double terms = 0.0;
        if (id >= m) terms = fabs(k->x[id - m]);
        else
            for (int j = 0; j < k->n; ++j) terms += fabs(k->rowmat[id * k->n + j] * k->x[j]);
        if (kinqp_qp_is_finite(k->lower[r])) terms = fmax(terms, fabs(k->lower[r]));
        if (kinqp_qp_is_finite(k->upper[r])) terms = fmax(terms, fabs(k->upper[r]));
        k->slack[r] = KINQP_SLACK * tolerance * fmax(terms, k->noise[r] * (KINQP_QP_ROUNDING / KINQP_QP_NOISE));
        k->doubt[r] = (relaxed ? 0.5 * (1.0 - KINQP_RELAXATION) : 1.0) * fmax(KINQP_QP_RELATIVE * terms, k->noise[r]);
    }
    k->state.slack = k->slack;
    k->state.noise = k->doubt;
}

/* Moves every bound out by what it may be off by at most. What contradicts itself by noise then has a solution, and each
 * row is out by no more than its own share; without this one of them would be out by the sum. */
static void relax(kinqp_qp_work *k, int m, double tolerance) {
    set_tolerances(k, m, tolerance, 0);
    for (int r = 0; r < k->rows; ++r) {
        const double doubt = KINQP_RELAXATION * tolerance / KINQP_QP_RELATIVE * k->doubt[r];
        k->lower[r] -= doubt;
        k->upper[r] += doubt;
    }
}

/* Makes the refined point the iterate. Its duals become the core's offset: what is left for it to do is small, and so is
 * the rounding that it adds, however far away the unconstrained minimiser is. */
static void continue_from_trial(kinqp_qp_work *k, int m) {
    for (int r = 0; r < k->rows; ++r) k->offset[r] = k->rowz[r];
    for (int i = 0; i < k->n; ++i) k->x[i] = k->trial[i];
    whitened_residual(k, m, k->x, k->centre);
    for (int c = 0; c < k->free; ++c) k->centre[c] = -k->centre[c];
    for (int r = 0; r < k->rows; ++r) {
        const double value = row_value(k, r, m, k->x);
        k->lo[r] = k->lower[r] - value;
        k->hi[r] = k->upper[r] - value;
    }
    k->state.offset = k->offset;
}

kinqp_status kinqp_qp_passes(kinqp_qp_work *k, const kinqp_qp *qp, const kinqp_qp_options *o, double shift,
                             kinqp_qp_solution *s) {
    const int n = k->n, m = qp->m;
    const double aim = fmin(o->tolerance, KINQP_QP_RELATIVE);
    kinqp_as_options core = kinqp_as_default_options(k->free, k->rows);
    kinqp_as_result result;
    int met = 0;     /* passes that met the tolerance, but without margin */
    int refined = 0; /* 1: the iterate is the refined point of the last pass */
    int relaxed = 0;  /* 1: the bounds are moved out by their noise */
    int strict = 0;   /* 1: rows go by their own terms, since the longest x let the last pass stop too early */
    int disputed = 0; /* 1: the last pass found the rows contradictory, which could not be proved */
    core.warm = o->warm;
    for (s->passes = 1; s->passes <= o->max_passes; ++s->passes) {
        if (refined) {
            continue_from_trial(k, m);
            core.scale = 0.0;
        } else {
            k->state.offset = NULL;
            core.scale = recentre(k, m, shift);
            /* The target is T'grad: what the equalities leave of a large gradient is exact to rounding of the whole. */
            core.scale = fmax(core.scale, KINQP_GRADIENT_SHARE * sqrt(kinqp_qp_dot(k->grad, k->grad, n)));
        }
        if (refined || strict) set_tolerances(k, m, aim, relaxed);
        core.max_iterations = o->max_iterations - s->iterations;
        const kinqp_status status = kinqp_as_solve(&k->state, k->whiterows, k->lo, k->hi, k->centre, NULL, &core, k->w,
                                                   k->rowz, k->sign, &result);
        s->iterations += result.iterations;
        core.warm = 1;
        if (status == KINQP_FAILED) return status;
        if (status == KINQP_PRIMAL_INFEASIBLE) {
            kinqp_qp_recover(k, qp, k->x, 1, s);
            if (kinqp_qp_proves_infeasible(qp, s)) return status;
            if (disputed) {
                s->primal = HUGE_VAL; /* neither a point nor a proof */
                return KINQP_INACCURATE;
            }
            disputed = strict = 1;
            core.warm = 0;
            refined = 0;
            continue;
        }
        disputed = 0;
        for (int i = 0; i < n; ++i) {
            k->last[i] = k->x[i];
            k->x[i] += kinqp_qp_dot(k->white + i * k->free, k->w, k->free);
            k->trial[i] = k->x[i];
        }
        if (status == KINQP_MAX_ITERATIONS) {
            kinqp_qp_recover(k, qp, k->x, 0, s);
            kinqp_qp_residuals(qp, k->scale, s);
            return status;
        }
        const double worst = polish(k, qp, k->trial, s);
        const double share = shift > 0.0 && met < KINQP_MARGIN_PASSES ? KINQP_MARGIN : 1.0;
        if (worst <= share * o->tolerance) return KINQP_SOLVED;
        met += worst <= o->tolerance;
        /* Beside noise only from the second pass on: the first may have stopped where a better point is near. */
        kinqp_qp_measure(qp, k->scale, KINQP_QP_UNITS, s);
        if (s->passes > 1 && s->primal <= o->tolerance && fmax(s->dual, s->gap) <= share * o->tolerance)
            return KINQP_SOLVED;
        strict |= s->primal > o->tolerance;
        const int nearly = worst_residual(s) <= KINQP_NEARLY;
        if (s->passes >= KINQP_PASSES_UNTIL_RELAXED && !relaxed && s->primal > o->tolerance && nearly) {
            for (int i = 0; i < n; ++i) k->x[i] = k->trial[i];
            relax(k, m, aim);
            relaxed = 1;
        }
        if (shift <= 0.0) {
            if (s->passes >= KINQP_EXACT_PASSES) return KINQP_INACCURATE;
            refined = 1;
            continue;
        }
        refined = nearly;
        if (s->passes > 1) {
            for (int i = 0; i < n; ++i) k->s[i] = k->scale[i] * (k->x[i] - k->last[i]);
            if (kinqp_qp_proves_unbounded(qp, k->s)) {
                for (int i = 0; i < n; ++i) s->x[i] = k->s[i];
                return KINQP_DUAL_INFEASIBLE;
            }
        }
        if (s->passes % KINQP_PASSES_PER_WEIGHT == 0) {
            shift *= 0.01;
            if (!(kinqp_qp_cholesky(k, shift) > 0.0)) return KINQP_INACCURATE;
            kinqp_qp_whiten(k, m);
        }
    }
    s->passes = o->max_passes;
    return KINQP_INACCURATE;
}
