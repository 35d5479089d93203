/* From the scaled QP to the reduced one: elimination of the equalities, and the way back. */
#include <math.h>

#include "kinqp_qp_internal.h"

/* Writes the duals of E's rows to the caller's arrays. */
static void scatter_equalities(const kinqp_qp_work *k, const kinqp_qp *qp, kinqp_qp_solution *s) {
    for (int i = 0; i < k->equalities; ++i) {
        const double value = k->ey[i] * k->efactor[i];
        const int id = k->eid[i];
        KINQP_ASSERT(id >= 0 && id < k->limit);
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
        KINQP_ASSERT(id >= 0 && id < qp->m + n);
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
    double terms = 0.0;
    for (int j = 0; j < k->n; ++j) terms += fabs(k->eqmat[i * k->n + j] * x[j]);
    return fmax(KINQP_QP_RELATIVE * fmax(terms, fabs(k->e[i])), k->enoise[i]);
}

/* Equality `chosen` is the sum of others, by ey, and misses it by `share` of what all of their values may be off by: moves
 * each value by that share of its own, and x along. */
static void share_miss(kinqp_qp_work *k, int chosen, double share) {
    for (int i = 0; i < k->equalities; ++i) {
        if (i == chosen) k->e[i] -= share * equality_doubt(k, i, k->x);
        else if (k->ey[i] > 0.0) k->e[i] += share * equality_doubt(k, i, k->x);
        else if (k->ey[i] < 0.0) k->e[i] -= share * equality_doubt(k, i, k->x);
    }
    kinqp_qp_restore_equalities(k, k->x);
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
        if (fabs(miss) <= doubt) {
            share_miss(k, chosen, miss / doubt);
            continue;
        }
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
            if (!(outside > fmax(KINQP_QP_RELATIVE * fmax(bound, terms), k->noise[r]))) continue;
            k->rowz[r] = below > above ? -1.0 : 1.0;
            kinqp_qp_recover(k, qp, k->x, 1, s);
            if (kinqp_qp_proves_infeasible(qp, s)) return 1;
            k->rowz[r] = 0.0;
            continue; /* no proof: the residuals will say how far it is outside */
        }
        k->id[kept] = id; /* kept <= r */
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
