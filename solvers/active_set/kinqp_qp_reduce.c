/* From the caller's QP to the reduced one: scaling, elimination of equalities, and the way back. */
#include <float.h>
#include <math.h>

#include "kinqp_qp_internal.h"

#define KINQP_SWEEPS 3            /* sweeps over rows and columns for the units of variables without curvature [count] */
#define KINQP_NO_CURVATURE 1e-10 /* a root of curvature below this, beside the largest, is none [-] */

static int finite_all(const double *a, int count) {
    int ok = 1;
    for (int i = 0; i < count; ++i) ok &= kinqp_qp_is_finite(a[i]);
    return ok;
}

/* Sum of the absolute entries. */
static double total(const double *row, int n) {
    double sum = 0.0;
    for (int j = 0; j < n; ++j) sum += fabs(row[j]);
    return sum;
}

/* 0: fine; 1: bounds that cross by more than noise; 2: not a pair of bounds. rows: NULL for a box. */
static int check_bounds(const double *rows, const double *l, const double *u, int count, int n) {
    int crossed = 0;
    for (int i = 0; i < count; ++i) {
        const double low = l ? l[i] : -HUGE_VAL, high = u ? u[i] : HUGE_VAL;
        if (kinqp_qp_is_nan(low) || (low > 0.0 && !kinqp_qp_is_finite(low))) return 2;
        if (kinqp_qp_is_nan(high) || (high < 0.0 && !kinqp_qp_is_finite(high))) return 2;
        if (low > high) crossed |= kinqp_qp_crossed(low, high, rows ? total(rows + i * n, n) : 1.0);
    }
    return crossed;
}

/* factors[i]: 1 / the largest entry of a row, its variables in their units so far; A's rows, then C's. */
static void level_rows(const kinqp_qp_work *k, const kinqp_qp *qp, double *factors) {
    for (int i = 0; i < qp->p + qp->m; ++i) {
        const double *row = i < qp->p ? qp->A + i * k->n : qp->C + (i - qp->p) * k->n;
        double largest = 0.0;
        for (int j = 0; j < k->n; ++j) largest = fmax(largest, fabs(row[j]) * k->scale[j]);
        factors[i] = largest > 0.0 && kinqp_qp_is_finite(1.0 / largest) ? 1.0 / largest : 0.0;
    }
}

/* out[j]: largest entry of column j, the rows multiplied by their factors. */
static void column_sizes(const kinqp_qp_work *k, const kinqp_qp *qp, const double *factors, double *out) {
    for (int j = 0; j < k->n; ++j) out[j] = 0.0;
    for (int i = 0; i < qp->p + qp->m; ++i) {
        const double *row = i < qp->p ? qp->A + i * k->n : qp->C + (i - qp->p) * k->n;
        for (int j = 0; j < k->n; ++j) out[j] = fmax(out[j], fabs(row[j]) * factors[i]);
    }
}

/* Scales of the variables: unit Hessian diagonal; unit columns of the rows where that is zero, or so small beside the
 * others', both as it stands and measured by these columns, that it says nothing of the variable's unit. The rows are
 * brought to one size for that, so that the unit in which a row is written does not matter. */
static void scale_variables(kinqp_qp_work *k, const kinqp_qp *qp) {
    double largest = 0.0, steepest = 0.0;
    double *root = k->v, *column = k->s, *factors = k->efactor; /* n, n and p + m + n: enough for p + m rows */
    int flat = 0;
    for (int j = 0; j < k->n; ++j) {
        root[j] = sqrt(fmax(qp->H[j * k->n + j], 0.0));
        largest = fmax(largest, root[j]);
    }
    for (int j = 0; j < k->n; ++j) flat |= !(root[j] > KINQP_NO_CURVATURE * largest);
    for (int j = 0; j < k->n; ++j) k->scale[j] = kinqp_qp_power(root[j]);
    if (!flat) return;
    for (int j = 0; j < k->n; ++j)
        if (!(root[j] > KINQP_NO_CURVATURE * largest)) k->scale[j] = 1.0;
    for (int sweep = 0; sweep < KINQP_SWEEPS; ++sweep) {
        level_rows(k, qp, factors);
        column_sizes(k, qp, factors, column);
        steepest = 0.0;
        for (int j = 0; j < k->n; ++j)
            if (column[j] > 0.0) steepest = fmax(steepest, root[j] / column[j]);
        for (int j = 0; j < k->n; ++j) {
            const int curved = root[j] > KINQP_NO_CURVATURE * largest ||
                               root[j] > KINQP_NO_CURVATURE * steepest * column[j];
            k->scale[j] = kinqp_qp_power(curved || column[j] == 0.0 ? root[j] : column[j]);
        }
    }
}

/* out := row of the caller in scaled variables, brought near unit length; returns the factor. */
static double scale_row(const kinqp_qp_work *k, const double *row, double *out) {
    for (int j = 0; j < k->n; ++j) out[j] = row[j] * k->scale[j];
    const double factor = kinqp_qp_power(sqrt(kinqp_qp_dot(out, out, k->n)));
    for (int j = 0; j < k->n; ++j) out[j] *= factor;
    return factor;
}

/* There are at most p + m + n equalities: each of A's p rows, of C's m rows and of the n variables makes one at most, and
 * likewise at most m + n other rows. */
static double *new_equality(kinqp_qp_work *k, int id, double value, double factor, double noise) {
    const int i = k->equalities++;
    k->enoise[i] = KINQP_QP_NOISE * factor * noise;
    k->eid[i] = id;
    k->e[i] = value;
    k->efactor[i] = factor;
    return k->eqfactor + i * k->n;
}

static void new_row(kinqp_qp_work *k, int id, double low, double high, double noise) {
    const int i = k->rows++;
    k->noise[i] = KINQP_QP_NOISE * noise;
    k->sign[i] = 0;
    k->id[i] = id;
    k->lower[i] = low;
    k->upper[i] = high;
}

/* What the noise of a row is relative to; a row of zeros, whose unit nothing tells, counts absolutely. */
static double span(const double *row, int n) {
    const double entries = total(row, n);
    return entries > 0.0 ? entries : 1.0;
}

static double middle(double low, double high) { return low == high ? low : 0.5 * low + 0.5 * high; }

kinqp_status kinqp_qp_scale(kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s) {
    const int n = qp->n, p = qp->p, m = qp->m;
    int ok = finite_all(qp->H, n * n) & finite_all(qp->g, n) & finite_all(qp->A, p * n) & finite_all(qp->b, p) &
             finite_all(qp->C, m * n);
    const int rows = check_bounds(qp->C, qp->l, qp->u, m, n);
    const int box = check_bounds(NULL, qp->lb, qp->ub, n, n);
    if (!ok || rows == 2 || box == 2) return KINQP_FAILED;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < i; ++j) {
            const double a = qp->H[i * n + j], b = qp->H[j * n + i];
            ok &= fabs(a - b) <= 1e-9 * (fabs(a) + fabs(b)) + 1e-14 * sqrt(fabs(qp->H[i * n + i] * qp->H[j * n + j]));
        }
    if (!ok) return KINQP_FAILED;
    if (rows || box) return KINQP_PRIMAL_INFEASIBLE;
    scale_variables(k, qp);
    for (int i = 0; i < n; ++i) {
        k->g[i] = k->scale[i] * qp->g[i];
        for (int j = 0; j < n; ++j)
            k->hess[i * n + j] = 0.5 * (qp->H[i * n + j] + qp->H[j * n + i]) * k->scale[i] * k->scale[j];
    }
    k->costless = 1;
    for (int i = 0; i < n; ++i) k->costless &= k->g[i] == 0.0;
    for (int i = 0; i < n * n; ++i) k->costless &= k->hess[i] == 0.0;
    k->equalities = 0;
    k->rows = 0;
    for (int i = 0; i < p; ++i) {
        double *row = k->eqfactor + i * n;
        const double factor = scale_row(k, qp->A + i * n, row);
        (void)new_equality(k, i, factor * qp->b[i], factor, span(qp->A + i * n, n));
    }
    for (int i = 0; i < m; ++i) {
        const double low = qp->l ? qp->l[i] : -HUGE_VAL, high = qp->u ? qp->u[i] : HUGE_VAL;
        double *row = k->rowmat + i * n;
        const double factor = scale_row(k, qp->C + i * n, row);
        k->cscale[i] = factor;
        if (low >= high) { /* the same, or crossed by noise */
            double *copy = new_equality(k, p + i, factor * middle(low, high), factor, span(qp->C + i * n, n));
            for (int j = 0; j < n; ++j) copy[j] = row[j];
        } else if (kinqp_qp_is_finite(low) || kinqp_qp_is_finite(high)) {
            new_row(k, i, factor * low, factor * high, factor * span(qp->C + i * n, n));
        }
    }
    for (int i = 0; i < n; ++i) {
        const double low = qp->lb ? qp->lb[i] : -HUGE_VAL, high = qp->ub ? qp->ub[i] : HUGE_VAL;
        const double factor = 1.0 / k->scale[i];
        if (low >= high) {
            double *row = new_equality(k, p + m + i, factor * middle(low, high), factor, 1.0);
            for (int j = 0; j < n; ++j) row[j] = 0.0;
            row[i] = 1.0;
        } else if (kinqp_qp_is_finite(low) || kinqp_qp_is_finite(high)) {
            new_row(k, m + i, factor * low, factor * high, factor);
        }
    }
    (void)s;
    return KINQP_SOLVED;
}

/* Writes the duals of E's rows to the caller's arrays. */
static void scatter_equalities(const kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s) {
    for (int i = 0; i < k->equalities; ++i) {
        const double value = k->ey[i] * k->efactor[i];
        const int id = k->eid[i];
        if (id < qp->p) s->y[id] = value;
        else if (id < qp->p + qp->m) s->z[id - qp->p] = value;
        else s->z_box[id - qp->p - qp->m] = value;
        if (id >= qp->p) s->active[id - qp->p] = value < 0.0 ? -1 : 1;
    }
}

void kinqp_qp_recover(kinqp_qp_work *k, const kinqp_qp *qp, const double *x, int certificate, kinqp_qp_solution *s) {
    const int n = k->n;
    double *v = k->s;
    for (int i = 0; i < n; ++i) s->x[i] = certificate ? 0.0 : k->scale[i] * x[i];
    for (int i = 0; i < n; ++i) v[i] = certificate ? 0.0 : -k->g[i] - kinqp_qp_dot(k->hess + i * n, x, n);
    for (int i = 0; i < qp->m; ++i) s->z[i] = 0.0;
    for (int i = 0; i < n; ++i) s->z_box[i] = 0.0;
    for (int i = 0; i < qp->m + n; ++i) s->active[i] = 0;
    for (int r = 0; r < k->rows; ++r) {
        const int id = k->id[r];
        const double z = k->costless && !certificate ? 0.0 : k->rowz[r];
        s->active[id] = k->sign[r];
        if (z == 0.0) continue;
        if (id < qp->m) {
            s->z[id] = z * k->cscale[id];
            for (int j = 0; j < n; ++j) v[j] -= k->rowmat[id * n + j] * z;
        } else {
            s->z_box[id - qp->m] = z / k->scale[id - qp->m];
            v[id - qp->m] -= z;
        }
    }
    kinqp_qp_equality_duals(k, v, k->ey);
    scatter_equalities(k, qp, s);
}

/* What equality i may miss at x, in its scaled unit. */
static double equality_doubt(const kinqp_qp_work *k, int i, const double *x) {
    double terms = fabs(k->e[i]);
    for (int j = 0; j < k->n; ++j) terms += fabs(k->eqmat[i * k->n + j] * x[j]);
    return KINQP_QP_RELATIVE * terms + k->enoise[i];
}

/* Certificate from a dependent equality that misses its value by more than noise in it and in those it depends on; 0 if
 * there is none. */
static int inconsistent(kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s) {
    double *t = k->s;
    for (int c = k->rank; c < k->equalities; ++c) {
        const int chosen = k->pivot[c];
        const double *row = k->eqfactor + chosen * k->n;
        const double miss = k->e[chosen] - kinqp_qp_dot(k->eqmat + chosen * k->n, k->x, k->n);
        double doubt = equality_doubt(k, chosen, k->x);
        if (fabs(miss) <= doubt) continue;
        for (int i = 0; i < k->n; ++i) t[i] = i < k->rank ? row[i] : 0.0;
        kinqp_qp_apply(k, t);
        kinqp_qp_equality_duals(k, t, k->ey);
        for (int i = 0; i < k->equalities; ++i)
            if (k->ey[i] < 0.0 || k->ey[i] > 0.0) doubt += fabs(k->ey[i]) * equality_doubt(k, i, k->x);
        if (fabs(miss) <= doubt) continue;
        for (int i = 0; i < k->equalities; ++i) k->ey[i] *= miss > 0.0 ? 1.0 : -1.0;
        k->ey[chosen] = miss > 0.0 ? -1.0 : 1.0;
        scatter_equalities(k, qp, s);
        if (kinqp_qp_proves_infeasible(qp, s)) return 1;
        for (int i = 0; i < qp->p; ++i) s->y[i] = 0.0;
        for (int i = 0; i < qp->m; ++i) s->z[i] = 0.0;
        for (int i = 0; i < k->n; ++i) s->z_box[i] = 0.0;
    }
    return 0;
}

/* Removes rows that the equalities fix; one outside its bounds by more than noise leaves its certificate in s, 1. */
static int remove_fixed(kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s) {
    const int m = qp->m;
    int kept = 0;
    for (int r = 0; r < k->rows; ++r) k->rowz[r] = 0.0;
    for (int r = 0; r < k->rows; ++r) {
        const int id = k->id[r];
        double left = 0.0, length = 1.0;
        for (int c = 0; c < k->free; ++c) {
            double part = 0.0;
            if (id >= m) part = k->basis[(id - m) * k->free + c];
            else for (int j = 0; j < k->n; ++j) part += k->rowmat[id * k->n + j] * k->basis[j * k->free + c];
            left += part * part;
        }
        if (id < m) length = kinqp_qp_dot(k->rowmat + id * k->n, k->rowmat + id * k->n, k->n);
        if (left <= 1e-22 * length) {
            double value = 0.0, terms = 0.0;
            for (int j = 0; j < k->n; ++j) {
                const double term = id < m ? k->rowmat[id * k->n + j] * k->x[j] : (j == id - m ? k->x[j] : 0.0);
                value += term;
                terms += fabs(term);
            }
            const double below = k->lower[r] - value, above = value - k->upper[r], outside = fmax(below, above);
            const double bound = fabs(below > above ? k->lower[r] : k->upper[r]);
            if (!(outside > KINQP_QP_RELATIVE * (bound + terms) + k->noise[r])) continue;
            k->rowz[r] = below > above ? -1.0 : 1.0;
            kinqp_qp_recover(k, qp, k->x, 1, s);
            if (kinqp_qp_proves_infeasible(qp, s)) return 1;
            k->rowz[r] = 0.0;
            continue; /* no proof: the residuals will say how far it is outside */
        }
        k->id[kept] = id;
        k->lower[kept] = k->lower[r];
        k->upper[kept] = k->upper[r];
        k->noise[kept] = k->noise[r];
        ++kept;
    }
    k->rows = kept;
    return 0;
}

kinqp_status kinqp_qp_reduce(kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s) {
    const int n = k->n;
    for (int i = 0; i < k->equalities * n; ++i) k->eqmat[i] = k->eqfactor[i];
    kinqp_qp_factor_equalities(k);
    const int f = k->free = n - k->rank;
    for (int i = 0; i < n; ++i) k->x[i] = 0.0;
    kinqp_qp_restore_equalities(k, k->x);
    if (inconsistent(k, qp, s)) return KINQP_PRIMAL_INFEASIBLE;
    for (int c = 0; c < f; ++c) {
        for (int i = 0; i < n; ++i) k->s[i] = i == k->rank + c ? 1.0 : 0.0;
        kinqp_qp_apply(k, k->s);
        for (int i = 0; i < n; ++i) k->basis[i * f + c] = k->s[i];
    }
    if (remove_fixed(k, qp, s)) return KINQP_PRIMAL_INFEASIBLE;
    for (int i = 0; i < f * f; ++i) k->curv[i] = 0.0;
    for (int i = 0; i < n; ++i) {
        for (int c = 0; c < f; ++c) k->s[c] = 0.0; /* row i of H Z */
        for (int j = 0; j < n; ++j)
            if (k->hess[i * n + j] != 0.0)
                for (int c = 0; c < f; ++c) k->s[c] += k->hess[i * n + j] * k->basis[j * f + c];
        for (int a = 0; a < f; ++a)
            for (int c = 0; c <= a; ++c)
                k->curv[a * f + c] += 0.5 * (k->basis[i * f + a] * k->s[c] + k->basis[i * f + c] * k->s[a]);
    }
    for (int a = 0; a < f; ++a)
        for (int c = 0; c < a; ++c) k->curv[c * f + a] = k->curv[a * f + c];
    return KINQP_SOLVED;
}
