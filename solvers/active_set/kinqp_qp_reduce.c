/* From the caller's QP to the reduced one: scaling, elimination of equalities, and the way back. */
#include <float.h>
#include <math.h>

#include "kinqp_qp_internal.h"

#define KINQP_CONSISTENCY 1e-9 /* a dependent row may miss its bound by this, relative to its terms [-] */
#define KINQP_NO_CURVATURE 1e-10 /* a root of curvature below this, beside the largest, is none [-] */

static int finite_all(const double *a, int count) {
    int ok = 1;
    for (int i = 0; i < count; ++i) ok &= fabs(a[i]) <= DBL_MAX;
    return ok;
}

/* 0: fine; 1: crossed bounds; 2: not a pair of bounds. */
static int check_bounds(const double *l, const double *u, int count) {
    int crossed = 0;
    for (int i = 0; i < count; ++i) {
        const double low = l ? l[i] : -HUGE_VAL, high = u ? u[i] : HUGE_VAL;
        if (low != low || high != high || low > DBL_MAX || high < -DBL_MAX) return 2;
        crossed |= low > high;
    }
    return crossed;
}

static double largest_in_column(const kinqp_qp *qp, int j) {
    double largest = 0.0;
    for (int i = 0; i < qp->p; ++i) largest = fmax(largest, fabs(qp->A[i * qp->n + j]));
    for (int i = 0; i < qp->m; ++i) largest = fmax(largest, fabs(qp->C[i * qp->n + j]));
    return largest;
}

/* Scales of the variables: unit Hessian diagonal; unit columns of the rows where that is zero, or so small beside the
 * others', both as it stands and measured by these columns, that it says nothing of the variable's unit. */
static void scale_variables(kinqp_qp_work *k, const kinqp_qp *qp) {
    double largest = 0.0, steepest = 0.0;
    for (int j = 0; j < k->n; ++j) {
        const double root = sqrt(fmax(qp->H[j * k->n + j], 0.0)), column = largest_in_column(qp, j);
        largest = fmax(largest, root);
        if (column > 0.0) steepest = fmax(steepest, root / column);
    }
    for (int j = 0; j < k->n; ++j) {
        const double root = sqrt(fmax(qp->H[j * k->n + j], 0.0)), column = largest_in_column(qp, j);
        const int curved = root > KINQP_NO_CURVATURE * largest || root > KINQP_NO_CURVATURE * steepest * column;
        k->scale[j] = kinqp_qp_power(curved || column == 0.0 ? root : column);
    }
}

/* out := row of the caller in scaled variables, brought near unit length; returns the factor. */
static double scale_row(const kinqp_qp_work *k, const double *row, double *out) {
    for (int j = 0; j < k->n; ++j) out[j] = row[j] * k->scale[j];
    const double factor = kinqp_qp_power(sqrt(kinqp_qp_dot(out, out, k->n)));
    for (int j = 0; j < k->n; ++j) out[j] *= factor;
    return factor;
}

static double *new_equality(kinqp_qp_work *k, int id, double value, double factor) {
    const int i = k->equalities++;
    k->eid[i] = id;
    k->e[i] = value;
    k->efactor[i] = factor;
    return k->E + i * k->n;
}

static void new_row(kinqp_qp_work *k, int id, double low, double high) {
    const int i = k->rows++;
    k->id[i] = id;
    k->lower[i] = low;
    k->upper[i] = high;
}

kinqp_status kinqp_qp_scale(kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s) {
    const int n = qp->n, p = qp->p, m = qp->m;
    int ok = finite_all(qp->H, n * n) & finite_all(qp->g, n) & finite_all(qp->A, p * n) & finite_all(qp->b, p) &
             finite_all(qp->C, m * n);
    const int rows = check_bounds(qp->l, qp->u, m), box = check_bounds(qp->lb, qp->ub, n);
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
            k->H[i * n + j] = 0.5 * (qp->H[i * n + j] + qp->H[j * n + i]) * k->scale[i] * k->scale[j];
    }
    k->costless = 1;
    for (int i = 0; i < n; ++i) k->costless &= k->g[i] == 0.0;
    for (int i = 0; i < n * n; ++i) k->costless &= k->H[i] == 0.0;
    k->equalities = 0;
    k->rows = 0;
    for (int i = 0; i < p; ++i) {
        double *row = new_equality(k, i, 0.0, 1.0);
        const double factor = scale_row(k, qp->A + i * n, row);
        k->e[i] = factor * qp->b[i];
        k->efactor[i] = factor;
    }
    for (int i = 0; i < m; ++i) {
        const double low = qp->l ? qp->l[i] : -HUGE_VAL, high = qp->u ? qp->u[i] : HUGE_VAL;
        double *row = k->C + i * n;
        const double factor = scale_row(k, qp->C + i * n, row);
        k->cscale[i] = factor;
        if (low == high) {
            double *copy = new_equality(k, p + i, factor * low, factor);
            for (int j = 0; j < n; ++j) copy[j] = row[j];
        } else if (low >= -DBL_MAX || high <= DBL_MAX) {
            new_row(k, i, factor * low, factor * high);
        }
    }
    for (int i = 0; i < n; ++i) {
        const double low = qp->lb ? qp->lb[i] : -HUGE_VAL, high = qp->ub ? qp->ub[i] : HUGE_VAL;
        const double factor = 1.0 / k->scale[i];
        if (low == high) {
            double *row = new_equality(k, p + m + i, factor * low, factor);
            for (int j = 0; j < n; ++j) row[j] = 0.0;
            row[i] = 1.0;
        } else if (low >= -DBL_MAX || high <= DBL_MAX) {
            new_row(k, m + i, factor * low, factor * high);
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
    for (int i = 0; i < n; ++i) v[i] = certificate ? 0.0 : -k->g[i] - kinqp_qp_dot(k->H + i * n, x, n);
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
            for (int j = 0; j < n; ++j) v[j] -= k->C[id * n + j] * z;
        } else {
            s->z_box[id - qp->m] = z / k->scale[id - qp->m];
            v[id - qp->m] -= z;
        }
    }
    kinqp_qp_equality_duals(k, v, k->ey);
    scatter_equalities(k, qp, s);
}

/* Certificate from a dependent equality that misses its value; 0 if all hold. */
static int inconsistent(kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s) {
    double *t = k->s;
    const double size = sqrt(kinqp_qp_dot(k->x, k->x, k->n));
    for (int i = 0; i < k->n; ++i) t[i] = k->x[i];
    kinqp_qp_apply_transposed(k, t);
    for (int c = k->rank; c < k->equalities; ++c) {
        const int chosen = k->pivot[c];
        const double *row = k->E + chosen * k->n;
        const double miss = k->e[chosen] - kinqp_qp_dot(row, t, k->rank);
        if (fabs(miss) <= KINQP_CONSISTENCY * (fabs(k->e[chosen]) + size)) continue;
        for (int i = 0; i < k->n; ++i) t[i] = i < k->rank ? row[i] : 0.0;
        kinqp_qp_apply(k, t);
        kinqp_qp_equality_duals(k, t, k->ey);
        for (int i = 0; i < k->equalities; ++i) k->ey[i] *= miss > 0.0 ? 1.0 : -1.0;
        k->ey[chosen] = miss > 0.0 ? -1.0 : 1.0;
        scatter_equalities(k, qp, s);
        return 1;
    }
    return 0;
}

/* Removes rows that the equalities fix; a fixed row outside its bounds leaves its certificate in rowz and returns 1. */
static int remove_fixed(kinqp_qp_work *k, int m) {
    int kept = 0;
    const double size = sqrt(kinqp_qp_dot(k->x, k->x, k->n));
    for (int r = 0; r < k->rows; ++r) k->rowz[r] = 0.0;
    for (int r = 0; r < k->rows; ++r) {
        const int id = k->id[r];
        double left = 0.0, length = 1.0, value;
        for (int c = 0; c < k->free; ++c) {
            double part = 0.0;
            if (id >= m) part = k->Z[(id - m) * k->free + c];
            else for (int j = 0; j < k->n; ++j) part += k->C[id * k->n + j] * k->Z[j * k->free + c];
            left += part * part;
        }
        if (id < m) length = kinqp_qp_dot(k->C + id * k->n, k->C + id * k->n, k->n);
        if (left <= 1e-22 * length) {
            value = id < m ? kinqp_qp_dot(k->C + id * k->n, k->x, k->n) : k->x[id - m];
            const double reach = sqrt(length) * size;
            const int below = k->lower[r] - value > KINQP_CONSISTENCY * (fabs(k->lower[r]) + reach);
            const int above = value - k->upper[r] > KINQP_CONSISTENCY * (fabs(k->upper[r]) + reach);
            if (!below && !above) continue;
            k->rowz[r] = below ? -1.0 : 1.0;
            return 1;
        }
        k->id[kept] = id;
        k->lower[kept] = k->lower[r];
        k->upper[kept] = k->upper[r];
        ++kept;
    }
    k->rows = kept;
    return 0;
}

kinqp_status kinqp_qp_reduce(kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s) {
    const int n = k->n;
    for (int i = 0; i < k->equalities * n; ++i) k->E0[i] = k->E[i];
    kinqp_qp_factor_equalities(k);
    const int f = k->free = n - k->rank;
    for (int i = 0; i < n; ++i) k->x[i] = 0.0;
    kinqp_qp_restore_equalities(k, k->x);
    if (inconsistent(k, qp, s)) return KINQP_PRIMAL_INFEASIBLE;
    for (int c = 0; c < f; ++c) {
        for (int i = 0; i < n; ++i) k->s[i] = i == k->rank + c ? 1.0 : 0.0;
        kinqp_qp_apply(k, k->s);
        for (int i = 0; i < n; ++i) k->Z[i * f + c] = k->s[i];
    }
    if (remove_fixed(k, qp->m)) {
        kinqp_qp_recover(k, qp, k->x, 1, s);
        return KINQP_PRIMAL_INFEASIBLE;
    }
    for (int i = 0; i < f * f; ++i) k->K[i] = 0.0;
    for (int i = 0; i < n; ++i) {
        for (int c = 0; c < f; ++c) k->s[c] = 0.0; /* row i of H Z */
        for (int j = 0; j < n; ++j)
            if (k->H[i * n + j] != 0.0)
                for (int c = 0; c < f; ++c) k->s[c] += k->H[i * n + j] * k->Z[j * f + c];
        for (int a = 0; a < f; ++a)
            for (int c = 0; c <= a; ++c)
                k->K[a * f + c] += 0.5 * (k->Z[i * f + a] * k->s[c] + k->Z[i * f + c] * k->s[a]);
    }
    for (int a = 0; a < f; ++a)
        for (int c = 0; c < a; ++c) k->K[c * f + a] = k->K[a * f + c];
    return KINQP_SOLVED;
}
