/* Status codes shared by the least-distance core and the QP front end. */
#ifndef KINQP_STATUS_H
#define KINQP_STATUS_H

/* The code's own assumptions, above all that indices are within their arrays: checked where KINQP_DEBUG is defined, and
 * not there otherwise. */
#ifndef KINQP_ASSERT
#ifdef KINQP_DEBUG
#include <assert.h>
#define KINQP_ASSERT(condition) assert(condition)
#else
#define KINQP_ASSERT(condition) ((void)0)
#endif
#endif

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    KINQP_SOLVED = 0,            /* optimal within the tolerances */
    KINQP_MAX_ITERATIONS = 1,    /* stopped at the cap; see the solver for what the point is worth */
    KINQP_PRIMAL_INFEASIBLE = 2, /* no point satisfies the constraints; the duals hold the certificate */
    KINQP_DUAL_INFEASIBLE = 3,   /* unbounded below; x holds the direction */
    KINQP_INACCURATE = 4,        /* an answer, but its residuals miss the tolerance */
    KINQP_FAILED = 5,            /* not solvable as given: NaN, non-convex, impossible sizes */
    KINQP_BAD_PARAMETER = 6      /* of a generated step: a parameter out of its range; nothing was computed with it */
} kinqp_status;

#ifdef __cplusplus
}
#endif
#endif
