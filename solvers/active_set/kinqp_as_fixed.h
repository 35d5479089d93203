/* The least-distance solver for sizes known at compile time: define both sizes, include, call kinqp_as_fixed_solve.
 *
 *   #define KINQP_AS_N 3
 *   #define KINQP_AS_M 7
 *   #include "kinqp_as_fixed.h"
 *
 * One instance per translation unit, unless KINQP_AS_FN and KINQP_AS_STATE are defined to other names before each
 * inclusion. Everything is static; the state lives wherever the caller puts it (about 1 kB for 3 x 7).
 */
#include <float.h>
#include <math.h>

#include "kinqp_as.h"

#if !defined(KINQP_AS_N) || !defined(KINQP_AS_M)
#error "define KINQP_AS_N (columns) and KINQP_AS_M (rows) before including kinqp_as_fixed.h"
#endif
#ifndef KINQP_AS_FN
#define KINQP_AS_FN(name) kinqp_as_fixed_##name
#define KINQP_AS_STATE kinqp_as_fixed_state
#endif
#define KINQP_AS_DIMS(s) enum { n = KINQP_AS_N, m = KINQP_AS_M }; (void)(s)

/* Why indices stay inside: at most KINQP_AS_N rows are active at once, since a row enters only if it is independent of
 * those that are, and the loops over rows end at KINQP_AS_M. Where k is compared with n (append, drop, enter) it says more. */
typedef struct {
    double q[KINQP_AS_N * KINQP_AS_N]; /* orthonormal basis of the active normals, by columns [-] */
    double r[(KINQP_AS_N + 1) * KINQP_AS_N]; /* upper triangle, signed active normals = Q R, by columns, and a spare
                                              column: compilers cannot see that n rows never get another [unit of M] */
    double rinv[KINQP_AS_N];           /* reciprocals of R's diagonal [1 / unit of M] */
    double u[KINQP_AS_N];              /* multipliers of the signed active rows, >= 0 [unit of z] */
    double d[KINQP_AS_N];              /* entering normal in the basis Q [unit of M] */
    double p[KINQP_AS_N];              /* signed entering normal [unit of M] */
    double e[KINQP_AS_N];              /* entering normal outside the basis [unit of M] */
    double t[KINQP_AS_N];              /* change of the multipliers per unit of the entering one [-] */
    double norm2[KINQP_AS_M];          /* squared norms of the rows [unit of M squared] */
    double weight[KINQP_AS_M];         /* 1 / norm2, or 0 while the row may not enter */
    double gap[KINQP_AS_M];            /* how far each row is outside; negative: inside [unit of M w] */
    int rows[KINQP_AS_N];              /* active rows in the order of Q's columns [index] */
    int signs[KINQP_AS_N];             /* -1: lower side, +1: upper side, per active row */
    int k;                             /* active rows [count] */
} KINQP_AS_STATE;

#include "kinqp_as_factor.inc"
#include "kinqp_as_steps.inc"
#include "kinqp_as_core.inc"
#ifdef KINQP_AS_WITH_PRIMAL
#include "kinqp_as_primal.inc"
#endif

#undef KINQP_AS_DIMS
#undef KINQP_AS_FN
#undef KINQP_AS_STATE
#undef KINQP_AS_N
#undef KINQP_AS_M
