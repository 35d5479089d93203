/* The exact sampled braking curve towards a limit `distance` ahead: see `viable_bound` in kinqp.formulations. */
KINQP_INLINE kinqp_part kinqp_viable_bound(kinqp_part distance, kinqp_part qd_max, kinqp_part step, kinqp_part per_step,
                                            kinqp_part far) {
    const kinqp_part zero = kinqp_part_fill(0.0), half = kinqp_part_fill(0.5), one = kinqp_part_fill(1.0);
    const kinqp_part shifter = kinqp_part_fill(6755399441055744.0); /* 1.5 * 2^52: adding it rounds to a whole number */
    const kinqp_part delta = kinqp_part_choose(distance, zero, distance, zero) * per_step;
    const kinqp_part capped = kinqp_part_choose(far, delta, delta, far);
    const kinqp_part periods = half * (kinqp_part_root(one + kinqp_part_fill(8.0) * capped) - one);
    const kinqp_part rounded = (periods + shifter) - shifter;
    const kinqp_part whole = kinqp_part_choose(rounded, periods, rounded - one, rounded);
    const kinqp_part value = step * (half * whole + capped / (whole + one));
    return kinqp_part_choose(qd_max, value, value, qd_max);
}

/* Joint velocity bounds of n joints towards both limits. */
KINQP_INLINE void kinqp_viable_bounds(int n, const double *q, const double *q_min, const double *q_max,
                                       const double *qd_max, const double *qdd_max, double dt, double *lo, double *hi) {
    const kinqp_part period = kinqp_part_fill(dt), half = kinqp_part_fill(0.5), one = kinqp_part_fill(1.0);
    double given[5][KINQP_WIDTH];
    /* As many joints at a time as a vector holds; the last ones overlap those before, so that nothing is left over. Fewer
     * joints than that go by way of `given`, since a whole vector is read and written. */
    for (int block = 0; block < n; block += KINQP_WIDTH) {
        const int first = block + KINQP_WIDTH <= n || n < KINQP_WIDTH ? block : n - KINQP_WIDTH;
        const double *fields[5] = {q + first, q_min + first, q_max + first, qd_max + first, qdd_max + first};
        if (n < KINQP_WIDTH) {
            for (int f = 0; f < 5; ++f) {
                for (int i = 0; i < KINQP_WIDTH; ++i) given[f][i] = i < n ? fields[f][i] : 1.0;
                fields[f] = given[f];
            }
        }
        const kinqp_part at = kinqp_part_load(fields[0]), most = kinqp_part_load(fields[3]);
        const kinqp_part taken = kinqp_part_load(fields[4]) * period, step = kinqp_part_choose(most, taken, taken, most);
        const kinqp_part per_step = one / (step * period);
        const kinqp_part periods = most * period * per_step, far = half * periods * (periods + one) + one;
        const kinqp_part below = kinqp_viable_bound(at - kinqp_part_load(fields[1]), most, step, per_step, far);
        const kinqp_part above = kinqp_viable_bound(kinqp_part_load(fields[2]) - at, most, step, per_step, far);
        if (n < KINQP_WIDTH) {
            kinqp_part_store(given[0], -below);
            kinqp_part_store(given[1], above);
            for (int i = 0; i < n; ++i) {
                lo[i] = given[0][i];
                hi[i] = given[1][i];
            }
        } else {
            kinqp_part_store(lo + first, -below);
            kinqp_part_store(hi + first, above);
        }
    }
}
