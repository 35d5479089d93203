/* What the gate looks at. It works on the numbers that leave a tick, the state and the parameters, and trusts nothing
 * else; whatever is not a number fails every comparison here. */
#define KINQP_BOUND_TOLERANCE {{ bound_tolerance }} /* what a joint may exceed its velocity bound by [rad/s or m/s] */
#define KINQP_FIXED_TOLERANCE {{ fixed_tolerance }} /* what a locked row may be off by, relative to what joints do in it, at least 1 [-] */

/* Not zero anywhere if some of n >= KINQP_WIDTH numbers is outside of [least, most]; NaN is outside of everything. As
 * many at a time as a vector holds; the last ones overlap those before, so that nothing is left over. */
KINQP_INLINE kinqp_bits kinqp_outside(int n, const double *x, double least, double most) {
    kinqp_bits outside = kinqp_bits_none;
    for (int block = 0; block < n; block += KINQP_WIDTH) {
        const kinqp_part part = kinqp_part_load(x + (block + KINQP_WIDTH <= n ? block : n - KINQP_WIDTH));
        outside |= kinqp_part_misses(part, kinqp_part_fill(least), kinqp_part_fill(most));
    }
    return outside;
}

/* The same where low[i] <= high[i] does not hold. */
KINQP_INLINE kinqp_bits kinqp_crossed(int n, const double *low, const double *high) {
    kinqp_bits crossed = kinqp_bits_none;
    for (int block = 0; block < n; block += KINQP_WIDTH) {
        const int first = block + KINQP_WIDTH <= n ? block : n - KINQP_WIDTH;
        const kinqp_part part = kinqp_part_load(low + first);
        crossed |= kinqp_part_misses(part, part, kinqp_part_load(high + first));
    }
    return crossed;
}

/* 1 if least <= x[i] <= most for all n. */
KINQP_INLINE int kinqp_within(int n, const double *x, double least, double most) {
    int within = 1;
    for (int i = 0; i < n; ++i) within &= x[i] >= least && x[i] <= most;
    return within;
}

/* 1 if low[i] <= high[i] for all n. */
KINQP_INLINE int kinqp_ordered(int n, const double *low, const double *high) {
    int ordered = 1;
    for (int i = 0; i < n; ++i) ordered &= low[i] <= high[i];
    return ordered;
}

/* The promise that one joint's command does not keep, if any. With `sampled` it can stop before the limit that it moves
 * towards, in sampled time with at most qdd_max; without, it is below the continuous braking curve. A joint that stands
 * still keeps every limit: the way back in is not asked for. */
KINQP_INLINE int kinqp_joint_unmet(int sampled, double q, double q_min, double q_max, double qd_max, double qdd_max,
                                   double dt, double qd) {
    const double speed = fabs(qd), counted = speed - KINQP_BOUND_TOLERANCE;
    const double taken = qdd_max * dt, step = taken < qd_max ? taken : qd_max;
    const double distance = qd > 0.0 ? q_max - q : q - q_min;
    if (!kinqp_finite(1, &qd)) return KINQP_UNMET_FINITE;
    if (!(counted <= qd_max)) return KINQP_UNMET_SPEED;
    if (!kinqp_finite(1, &q)) return KINQP_UNMET_POSITION;
    if (counted <= 0.0) return KINQP_UNMET_NONE;
    if (sampled) {
        const double periods = kinqp_floor(counted / step);
        if (!(dt * ((periods + 1.0) * counted - 0.5 * step * periods * (periods + 1.0)) <= distance)) return KINQP_UNMET_POSITION;
    } else if (!(counted * dt <= distance && counted * counted * dt <= 2.0 * step * distance)) {
        return KINQP_UNMET_POSITION;
    }
    return KINQP_UNMET_NONE;
}

/* The same of n joints, as many at a time as a vector holds. Of all whole numbers of periods the right one makes the way
 * to a stop longest, so that of two neighbours either may be taken where they are equal. */
KINQP_INLINE int kinqp_unmet_limit(int n, int sampled, const double *q, const double *q_min, const double *q_max,
                                   const double *qd_max, const double *qdd_max, double dt, const double *qd) {
    if (n >= KINQP_WIDTH) {
        const kinqp_part zero = kinqp_part_fill(0.0), half = kinqp_part_fill(0.5), one = kinqp_part_fill(1.0);
        const kinqp_part period = kinqp_part_fill(dt), finite = kinqp_part_fill(DBL_MAX);
        const kinqp_part shifter = kinqp_part_fill(6755399441055744.0); /* 1.5 * 2^52: adding it rounds to a whole number */
        const kinqp_part most_periods = kinqp_part_fill(1e15);
        kinqp_bits unmet = kinqp_bits_none;
        for (int block = 0; block < n; block += KINQP_WIDTH) {
            const int first = block + KINQP_WIDTH <= n ? block : n - KINQP_WIDTH;
            const kinqp_part at = kinqp_part_load(q + first), rate = kinqp_part_load(qd + first), back = -rate;
            const kinqp_part most = kinqp_part_load(qd_max + first), taken = kinqp_part_load(qdd_max + first) * period;
            const kinqp_part step = kinqp_part_choose(most, taken, taken, most);
            const kinqp_part counted = kinqp_part_choose(rate, zero, rate, back) - kinqp_part_fill(KINQP_BOUND_TOLERANCE);
            const kinqp_part above = kinqp_part_load(q_max + first) - at, below = at - kinqp_part_load(q_min + first);
            const kinqp_part distance = kinqp_part_choose(rate, zero, above, below);
            unmet |= kinqp_part_misses(counted, -finite, most) | kinqp_part_misses(at, -finite, finite);
            kinqp_part way = counted * period;
            if (sampled) {
                const kinqp_part share = counted * (one / step) - half, periods = (share + shifter) - shifter;
                way = (periods + one) * (counted - half * step * periods) * period;
                unmet |= kinqp_part_misses(share, -finite, most_periods);
            } else {
                unmet |= kinqp_part_misses(kinqp_part_choose(counted, zero, counted * way, -finite), -finite, (step + step) * distance);
            }
            unmet |= kinqp_part_misses(kinqp_part_choose(counted, zero, way, -finite), -finite, distance);
        }
        if (!kinqp_bits_any(unmet)) return KINQP_UNMET_NONE;
    }
    for (int i = 0; i < n; ++i) {
        const int unmet = kinqp_joint_unmet(sampled, q[i], q_min[i], q_max[i], qd_max[i], qdd_max[i], dt, qd[i]);
        if (unmet) return unmet;
    }
    return KINQP_UNMET_NONE;
}

/* 1 if m locked rows, padded to `stride`, move as they are asked to. */
KINQP_INLINE int kinqp_keeps_rows(int m, int stride, const double *rows, const double *asked, const double *qd) {
    /* All together first: one comparison, and nearly always the last. */
    double all = 0.0;
    for (int i = 0; i < m; ++i) all += fabs(kinqp_dot_padded(stride, rows + i * stride, qd) - asked[i]);
    if (all <= KINQP_FIXED_TOLERANCE) return 1;
    for (int i = 0; i < m; ++i) {
        const double *row = rows + i * stride;
        const double left = kinqp_dot_padded(stride, row, qd) - asked[i];
        if (fabs(left) <= KINQP_FIXED_TOLERANCE) continue;
        double share = fabs(asked[i]);
        for (int j = 0; j < stride; ++j) share += fabs(row[j] * qd[j]);
        if (!(fabs(left) <= KINQP_FIXED_TOLERANCE * share)) return 0;
    }
    return 1;
}

/* Where a joint is sent that brakes on its own: as fast as its acceleration limit allows, from the last command. */
KINQP_INLINE double kinqp_braked(double last, double step) {
    if (last > 0.0) return last > step ? last - step : 0.0;
    return last < -step ? last + step : 0.0;
}
