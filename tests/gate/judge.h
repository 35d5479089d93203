/* The judge of single ticks: it knows the robot, the modes and what is promised, and nothing of how a command is found.
 *
 * Its kinematics are its own: joint placements and axes from `arm.h`, sines and cosines from the C library. Sums that
 * decide are taken in long double. What it allows beyond the contract is rounding, and said where it is allowed.
 */
#ifndef KINQP_TESTS_JUDGE_H
#define KINQP_TESTS_JUDGE_H

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#define JOIN(a, b) a##b
#define JOINED(a, b) JOIN(a, b)
#define P(name) JOINED(PREFIX, name)

/* What a tick may be found guilty of. */
enum {
    WRONG_NOT_FINITE,        /* a command that is not finite */
    WRONG_SPEED,             /* usable, and beyond a velocity limit */
    WRONG_POSITION,          /* usable, and the joint can't stop before its limit */
    WRONG_LOCKED_ROWS,       /* usable, and a locked row does not move as asked */
    WRONG_ACCELERATION,      /* usable, and beyond an acceleration limit that is promised */
    WRONG_PARAMETER,         /* usable with a bad parameter, or a good one called bad */
    WRONG_STATUS,            /* status, stop and `feasible` contradict each other */
    WRONG_INPUT,             /* usable, although an input is not finite or the mode does not exist */
    WRONG_STOP_SPEED,        /* a safe stop beyond a velocity limit */
    WRONG_STOP_ACCELERATION, /* a safe stop beyond an acceleration limit */
    WRONG_STOP_DIRECTION,    /* a safe stop that turns a joint round, or moves one that stands */
    WRONG_EPS,               /* an error or velocity in the output that is not finite */
    WRONG_STATE,             /* a remembered number that is not finite, or is not what it must be */
    WRONG_KINDS
};
static const char *const wrong_names[WRONG_KINDS] = {
    "not-finite", "speed", "position", "locked-rows", "acceleration", "parameter", "status", "input",
    "stop-speed", "stop-acceleration", "stop-direction", "eps", "state"};
static long wrong[WRONG_KINDS];

/* Counts a finding; `show_tick` prints the first ones of each kind to stderr. */
static void show_tick(void);
static void found(int kind, double is, double allowed) {
    if (++wrong[kind] > 2) return;
    fprintf(stderr, "%s: is %.17g, allowed %.17g\n", wrong_names[kind], is, allowed);
    show_tick();
}

/* By the bits, as a test of the same flags must be able to. */
static int all_finite(int n, const double *x) {
    for (int i = 0; i < n; ++i) {
        unsigned long long bits;
        memcpy(&bits, x + i, sizeof bits);
        if ((bits >> 52 & 0x7ff) == 0x7ff) return 0;
    }
    return 1;
}

/* The limits that count for a tick. */
typedef struct {
    const double *q, *q_min, *q_max, *qd_max, *qdd_max;
    double dt;
} limits;

static void times(const double *a, const double *b, double *product) {
    for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) {
            product[3 * i + j] = 0.0;
            for (int k = 0; k < 3; ++k) product[3 * i + j] += a[3 * i + k] * b[3 * k + j];
        }
}

static void turn(const double *rotation, const double *x, double *turned) {
    for (int i = 0; i < 3; ++i) turned[i] = rotation[3 * i] * x[0] + rotation[3 * i + 1] * x[1] + rotation[3 * i + 2] * x[2];
}

static void cross(const double *a, const double *b, double *product) {
    product[0] = a[1] * b[2] - a[2] * b[1];
    product[1] = a[2] * b[0] - a[0] * b[2];
    product[2] = a[0] * b[1] - a[1] * b[0];
}

/* Rows of the locked directions at q; also the length that all positions in it are rounded to. */
static double locked_rows(int mode, const double *q, double rows[6][NV]) {
    double rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1}, place[3] = {0}, axes[NV][3], places[NV][3], reach = 1.0;
    for (int joint = 0; joint <= NV; ++joint) {
        double offset[3], next[9];
        turn(rotation, placement_position[joint], offset);
        for (int i = 0; i < 3; ++i) place[i] += offset[i], reach += fabs(offset[i]);
        times(rotation, placement_rotation[joint], next);
        memcpy(rotation, next, sizeof next);
        if (joint == NV) break;
        const double *axis = joint_axis[joint];
        turn(rotation, axis, axes[joint]);
        memcpy(places[joint], place, sizeof place);
        if (prismatic[joint]) {
            for (int i = 0; i < 3; ++i) place[i] += q[joint] * axes[joint][i];
            reach += fabs(q[joint]);
            continue;
        }
        const double s = sin(q[joint]), c = cos(q[joint]), x = axis[0], y = axis[1], z = axis[2];
        const double about[9] = {c + x * x * (1 - c),     x * y * (1 - c) - z * s, x * z * (1 - c) + y * s,
                                 y * x * (1 - c) + z * s, c + y * y * (1 - c),     y * z * (1 - c) - x * s,
                                 z * x * (1 - c) - y * s, z * y * (1 - c) + x * s, c + z * z * (1 - c)};
        times(rotation, about, next);
        memcpy(rotation, next, sizeof next);
    }
    /* The point whose velocity counts, and the axes that it is counted along. */
    double point[3], directions[3][3];
    for (int i = 0; i < 3; ++i) point[i] = place[i] + mode_depth[mode] * rotation[3 * i + 2];
    for (int row = 0; row < 3; ++row)
        if (mode_in_tool[mode]) turn(rotation, mode_axes[mode] + 3 * row, directions[row]);
        else memcpy(directions[row], mode_axes[mode] + 3 * row, sizeof directions[row]);
    for (int joint = 0; joint < NV; ++joint) {
        double lever[3], twist[6] = {0};
        for (int i = 0; i < 3; ++i) lever[i] = point[i] - places[joint][i];
        if (prismatic[joint]) memcpy(twist, axes[joint], sizeof axes[joint]);
        else cross(axes[joint], lever, twist), memcpy(twist + 3, axes[joint], sizeof axes[joint]);
        for (int row = 0; row < mode_m_fixed[mode]; ++row) {
            const int which = mode_fixed[mode][row];
            const double *along = directions[which % 3], *part = twist + (which < 3 ? 0 : 3);
            rows[row][joint] = along[0] * part[0] + along[1] * part[1] + along[2] * part[2];
        }
    }
    return reach + fabs(mode_depth[mode]);
}

/* Promise 2 and 3 of one joint. */
static void judge_joint(const limits *at, int i, double qd) {
    const long double speed = fabsl(qd), rounding = 4.0L * DBL_EPSILON;
    if (!(speed <= (long double)at->qd_max[i] + 1e-8L + rounding * speed)) found(WRONG_SPEED, qd, at->qd_max[i]);
    const long double counted = speed - 1e-8L;
    if (counted <= 0.0L) return;
    const long double limit = qd > 0.0 ? at->q_max[i] : at->q_min[i];
    const long double distance = qd > 0.0 ? limit - at->q[i] : at->q[i] - limit;
    const long double taken = (long double)at->qdd_max[i] * at->dt, most = at->qd_max[i];
    const long double step = taken < most ? taken : most, periods = floorl(counted / step);
    /* The distance is a difference of two rounded numbers. */
    const long double allowed = isinf(limit) ? distance : distance + rounding * (fabsl(limit) + fabsl(at->q[i]));
    long double way = at->dt * (periods + 1.0L) * (counted - 0.5L * step * periods);
    if (!SAMPLED) way = fmaxl(counted * at->dt, counted * counted * at->dt / (2.0L * step));
    if (!(way * (1.0L - 1e-12L) <= allowed)) found(WRONG_POSITION, (double)way, (double)distance);
}

/* Promise 4. */
static void judge_rows(int mode, const double *q, const double *qd, const double *asked) {
    if (!mode_m_fixed[mode]) return;
    double rows[6][NV], turning = 0.0;
    const double reach = locked_rows(mode, q, rows);
    for (int j = 0; j < NV; ++j) turning += fabs(qd[j]);
    for (int i = 0; i < mode_m_fixed[mode]; ++i) {
        long double moved = -(long double)asked[i], share = fabsl(asked[i]);
        for (int j = 0; j < NV; ++j) moved += (long double)rows[i][j] * qd[j], share += fabsl((long double)rows[i][j] * qd[j]);
        const long double allowed = 1e-9L * fmaxl(1.0L, share) * (1.0L + 1e-5L) + 16.0L * DBL_EPSILON * reach * turning;
        if (!(fabsl(moved) <= allowed)) found(WRONG_LOCKED_ROWS, (double)moved, (double)allowed);
    }
}

/* A command that is said to be usable; `asked` NULL: locked rows are not judged here. */
static void judge_usable(const limits *at, int mode, const double *qd, const double *asked, const double *qd_prev) {
    if (mode < 0 || mode >= MODES || !all_finite(NV, at->q)) {
        found(WRONG_INPUT, mode, MODES);
        return;
    }
    if (!all_finite(NV, qd)) {
        found(WRONG_NOT_FINITE, NAN, 0.0);
        return;
    }
    for (int i = 0; i < NV; ++i) judge_joint(at, i, qd[i]);
    for (int i = 0; LIMITS_ACCELERATION && qd_prev && i < NV; ++i) {
        const long double change = fabsl((long double)qd[i] - qd_prev[i]), most = (long double)at->qdd_max[i] * at->dt + 1e-8L;
        if (!(change <= most * (1.0L + 1e-12L))) found(WRONG_ACCELERATION, (double)change, (double)most);
    }
    if (asked) judge_rows(mode, at->q, qd, asked);
}

/* A safe stop: braking from `last`; NULL: zero. `clamped`: the last command counts up to the velocity limit only. */
static void judge_stop(const limits *at, const double *qd, const double *last, int clamped) {
    if (!all_finite(NV, qd)) {
        found(WRONG_NOT_FINITE, NAN, 0.0);
        return;
    }
    for (int i = 0; i < NV; ++i) {
        const double most = at->qd_max[i], before = last ? last[i] : 0.0;
        const double from = !clamped ? before : before > most ? most : before < -most ? -most : before;
        const long double change = fabsl((long double)qd[i] - from), step = (long double)at->qdd_max[i] * at->dt;
        const long double rounding = DBL_EPSILON * fabsl(from);
        if (clamped && !(fabs(qd[i]) <= most)) found(WRONG_STOP_SPEED, qd[i], most);
        if (last && !(change <= step * (1.0L + 1e-9L) + rounding)) found(WRONG_STOP_ACCELERATION, (double)change, (double)step);
        if (!(qd[i] == 0.0 || (qd[i] > 0.0) == (from > 0.0)) || !(fabs(qd[i]) <= fabs(from))) found(WRONG_STOP_DIRECTION, qd[i], from);
    }
}

/* Whether a parameter, numbered from 1, is good; the ranges that matter most are the contract's own, not the code's. */
static int good_field(const field *f, const double *x) {
    for (int i = 0; i < f->size; ++i) {
        if (isnan(x[i]) || !(x[i] >= f->least && x[i] <= f->most)) return 0;
        if (!strcmp(f->name, "dt") && !(x[i] >= 1e-5 && x[i] <= 1.0)) return 0;
        if (!strcmp(f->name, "qd_max") && !(x[i] > 0.0 && !isinf(x[i]))) return 0;
        if (!strcmp(f->name, "qdd_max") && !(x[i] > 0.0)) return 0;
    }
    return 1;
}

/* Which are bad, a bit for each number. */
static unsigned long long bad_parameters(const P(_parameters) *p) {
    unsigned long long bad = 0;
    for (int k = 0; k < FIELDS; ++k)
        if (!good_field(fields + k, (const double *)(const void *)((const char *)p + fields[k].offset))) bad |= 1ull << (k + 1);
    for (int i = 0; i < NV; ++i)
        if (!(p->q_min[i] <= p->q_max[i])) bad |= 1ull << P_Q_MIN | 1ull << P_Q_MAX;
    if (BLENDS && !good_field(&transition_field, TRANSITION(p))) bad |= 1ull << (FIELDS + 1);
    return p->max_iterations < 0 ? bad | 1ull << (FIELDS + 2) : bad;
}

static limits limits_of(const P(_parameters) *p, const double *q) {
    const limits at = {q, p->q_min, p->q_max, p->qd_max, p->qdd_max, p->dt};
    return at;
}

static int report(long ticks, long usable, long stops) {
    long total = 0;
    printf("{\"ticks\": %ld, \"usable\": %ld, \"stops\": %ld, \"wrong\": {", ticks, usable, stops);
    for (int kind = 0; kind < WRONG_KINDS; ++kind)
        if (wrong[kind]) printf("%s\"%s\": %ld", total ? ", " : "", wrong_names[kind], wrong[kind]), total += wrong[kind];
    printf("}}\n");
    return 0;
}

#endif
