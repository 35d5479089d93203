/* The canonical QP: layout of the workspace, and the order of the parts. */
#include "kinqp_qp.h"

#include <math.h>

#include "kinqp_qp_internal.h"

#define KINQP_CONVEX_TOLERANCE 1e-9 /* a pivot below minus this, relative to the largest: not convex [-] */
#define KINQP_FLAT 1e-11            /* a pivot below this, relative to the largest: flat, proximal passes [-] */
#define KINQP_PROXIMAL 1e-6         /* first proximal weight, relative to the largest curvature [-] */

kinqp_qp_options kinqp_qp_default_options(int n, int p, int m) {
    kinqp_qp_options o;
    (void)p;
    o.tolerance = 1e-9;
    o.max_iterations = 50 * (m + n) + 200;
    o.max_passes = 60;
    o.warm = 0;
    return o;
}

/* Lays out `size` doubles at *next; returns their address. */
static double *take(double **next, int size) {
    double *at = *next;
    *next += size;
    return at;
}

static int *take_int(int **next, int size) {
    int *at = *next;
    *next += size;
    return at;
}

static size_t core_doubles(int n, int rows) { return kinqp_as_workspace_size(n, rows) / sizeof(double) + 1; }

size_t kinqp_qp_workspace_size(int n, int p, int m) {
    if (n < 0 || p < 0 || m < 0) return 0;
    const size_t a = (size_t)n, c = (size_t)m, e = (size_t)p + c + a;
    const size_t doubles = 5 * a * a + c * a + 2 * e * a + (c + a) * a + 13 * a + c + 4 * e + 9 * (c + a);
    const size_t ints = 2 * e + 2 * (c + a) + a;
    return (doubles + core_doubles(n, m + n)) * sizeof(double) + ints * sizeof(int) + 2 * sizeof(double);
}

static void lay_out(kinqp_qp_work *k, int n, int p, int m, void *memory) {
    double *d = memory;
    const int e = p + m + n, rows = m + n;
    k->n = n;
    k->limit = e;
    k->hess = take(&d, n * n);
    k->basis = take(&d, n * n);
    k->curv = take(&d, n * n);
    k->chol = take(&d, n * n);
    k->white = take(&d, n * n);
    k->rowmat = take(&d, m * n);
    k->eqfactor = take(&d, e * n);
    k->eqmat = take(&d, e * n);
    k->whiterows = take(&d, rows * n);
    k->scale = take(&d, n);
    k->g = take(&d, n);
    k->tau = take(&d, n);
    k->diagonal = take(&d, n);
    k->x = take(&d, n);
    k->centre = take(&d, n);
    k->trial = take(&d, n);
    k->last = take(&d, n);
    k->grad = take(&d, n);
    k->w = take(&d, n);
    k->v = take(&d, n);
    k->s = take(&d, n);
    k->cscale = take(&d, m);
    k->e = take(&d, e);
    k->efactor = take(&d, e);
    k->ey = take(&d, e);
    k->lo = take(&d, rows);
    k->hi = take(&d, rows);
    k->lower = take(&d, rows);
    k->upper = take(&d, rows);
    k->rowz = take(&d, rows);
    k->noise = take(&d, rows);
    k->slack = take(&d, rows);
    k->doubt = take(&d, rows);
    k->offset = take(&d, rows);
    k->enoise = take(&d, e);
    k->core = d;
    d += core_doubles(n, rows);
    int *i = (int *)(void *)d;
    k->eid = take_int(&i, e);
    k->pivot = take_int(&i, e);
    k->id = take_int(&i, rows);
    k->sign = take_int(&i, rows);
    k->kpivot = take_int(&i, n);
    /* The sizes taken are those that kinqp_qp_workspace_size adds up. */
    KINQP_ASSERT((char *)i <= (char *)memory + kinqp_qp_workspace_size(n, p, m));
}

static void clear(const kinqp_qp *qp, kinqp_qp_solution *s) {
    for (int i = 0; i < qp->n; ++i) s->x[i] = s->z_box[i] = 0.0;
    for (int i = 0; i < qp->p; ++i) s->y[i] = 0.0;
    for (int i = 0; i < qp->m; ++i) s->z[i] = 0.0;
}

kinqp_status kinqp_qp_solve(const kinqp_qp *qp, const kinqp_qp_options *o, void *memory, kinqp_qp_solution *s) {
    kinqp_qp_work work, *k = &work;
    kinqp_status status;
    double shift = 0.0;
    s->iterations = s->passes = 0;
    s->primal = s->dual = s->gap = 0.0;
    clear(qp, s);
    if (qp->n < 1 || qp->p < 0 || qp->m < 0) return KINQP_FAILED;
    lay_out(k, qp->n, qp->p, qp->m, memory);
    status = kinqp_qp_scale(k, qp, s);
    if (status == KINQP_SOLVED) status = kinqp_qp_reduce(k, qp, s);
    if (status != KINQP_SOLVED) return status;
    for (int r = 0; r < k->rows; ++r) k->sign[r] = o->warm ? s->active[k->id[r]] : 0;
    KINQP_ASSERT(k->rank >= 0 && k->rank <= k->n && k->rank <= k->equalities && k->free == k->n - k->rank);
    KINQP_ASSERT(k->rows >= 0 && k->rows <= qp->m + qp->n && k->equalities + k->rows <= k->limit);
    kinqp_as_setup(&k->state, k->free, k->rows, k->core); /* in memory for n columns and m + n rows: enough for fewer */
    const double ratio = kinqp_qp_cholesky(k, 0.0);
    if (!(ratio >= -KINQP_CONVEX_TOLERANCE)) return KINQP_FAILED;
    if (ratio < KINQP_FLAT) {
        shift = KINQP_PROXIMAL * kinqp_qp_curvature(k);
        if (!(kinqp_qp_cholesky(k, shift) > 0.0)) return KINQP_FAILED;
    }
    kinqp_qp_whiten(k, qp->m);
    status = kinqp_qp_passes(k, qp, o, shift, s);
    if (status == KINQP_FAILED) clear(qp, s);
    return status;
}
