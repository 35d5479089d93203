/* The continuous braking curve towards both limits of n joints: see `thesis_bound` in kinqp.formulations. */
KINQP_INLINE void kinqp_thesis_bounds(int n, const double *q, const double *q_min, const double *q_max,
                                       const double *qd_max, const double *qdd_max, double dt, double *lo, double *hi) {
    double distance[2 * KINQP_MOST], bound[2 * KINQP_MOST], most[2 * KINQP_MOST], twice[2 * KINQP_MOST];
    KINQP_ASSERT(n <= KINQP_MOST);
    for (int i = 0; i < n; ++i) {
        distance[i] = q[i] - q_min[i];
        distance[n + i] = q_max[i] - q[i];
        twice[i] = twice[n + i] = 2.0 * (qdd_max[i] < qd_max[i] / dt ? qdd_max[i] : qd_max[i] / dt);
        most[i] = most[n + i] = qd_max[i];
    }
    for (int i = 0; i < 2 * n; ++i) {
        const double ahead = distance[i] > 0.0 ? distance[i] : 0.0, sampled = ahead / dt;
        const double braking = sqrt(twice[i] * ahead), least = sampled < most[i] ? sampled : most[i];
        bound[i] = least < braking ? least : braking;
    }
    for (int i = 0; i < n; ++i) {
        lo[i] = -bound[i];
        hi[i] = bound[n + i];
    }
}
