/* Runs and judges the hand-guiding controller: driver TICKS SEED guiding BROKEN. The arm goes where it is sent; what is judged
 * is what it was sent, from this program's own record of it.
 *
 * BROKEN, for the test of the judge itself, is the kind of damage done to ticks before they are judged; 0: none.
 */
#include HEADER

#include "arm.h"
#include "judge.h"

#include "draw.h"

#include <stdlib.h>

#define SETTINGS ((int)(sizeof settings / sizeof *settings))

static P(_guiding_parameters) usual, parameters;
static P(_guiding_state) state;
static P(_guiding_input) input;
static P(_guiding_output) output;
static long usable_ticks, stopped_ticks;
static int broken;

/* What was sent last and where the arm was then; what was last good. */
static struct {
    double qd[NV], q[NV], dt, q_min[NV], q_max[NV], qdd_max[NV];
    int held, observed;
} record;

static void show(const char *name, int n, const double *x) {
    fprintf(stderr, "  %s:", name);
    for (int i = 0; i < n; ++i) fprintf(stderr, " %.17g", x[i]);
    fprintf(stderr, "\n");
}

static void show_tick(void) {
    fprintf(stderr, "  status %d stop %d unmet %d parameter %d held %d phase %d yielded %d iterations %d; mode %d of %d, stop %d, max_iterations %d, feasible %d\n",
            (int)output.status, output.stop, output.unmet, output.parameter, output.held, output.phase, output.yielded, output.iterations,
            output.mode, input.mode, input.stop, parameters.step.max_iterations, parameters.step.feasible);
    show("input q", NV, input.q), show("wrench", 6, input.wrench), show("last qd", NV, record.qd), show("qd", NV, output.qd);
    show("q in effect", NV, state.q_observed), show("qd_limit", NV, state.qd_limit), show("q before", NV, record.q);
    for (int k = 0; k < FIELDS; ++k) show(fields[k].name, fields[k].size, (const double *)(const void *)((const char *)&parameters.step + fields[k].offset));
    for (int k = 0; k < SETTINGS; ++k) show(settings[k].name, settings[k].size, (const double *)(const void *)((const char *)&parameters + settings[k].offset));
}

static int bad_settings(void) {
    int bad = parameters.max_failures < 1 || parameters.hold_ticks < 0;
    for (int k = 0; k < SETTINGS; ++k) bad |= !good_field(settings + k, (const double *)(const void *)((const char *)&parameters + settings[k].offset));
    return bad;
}

static void keep_limits(const P(_parameters) *p) {
    record.dt = p->dt;
    memcpy(record.q_min, p->q_min, sizeof record.q_min);
    memcpy(record.q_max, p->q_max, sizeof record.q_max);
    memcpy(record.qdd_max, p->qdd_max, sizeof record.qdd_max);
}

/* Locked rows move no faster than the drift compensation may ask for; where it gave way, not at all. */
static void judge_drift(int mode, const double *q, const double *qd) {
    double rows[6][NV], turning = 0.0;
    const double reach = locked_rows(mode, q, rows);
    long double squares[2] = {0.0L, 0.0L}, share = 1.0L;
    for (int j = 0; j < NV; ++j) turning += fabs(qd[j]);
    for (int i = 0; i < mode_m_fixed[mode]; ++i) {
        long double moved = 0.0L;
        for (int j = 0; j < NV; ++j) moved += (long double)rows[i][j] * qd[j], share += fabsl((long double)rows[i][j] * qd[j]);
        squares[mode_fixed[mode][i] >= 3] += moved * moved;
    }
    const double most[2] = {parameters.drift_speed, parameters.drift_turn};
    for (int kind = 0; kind < 2; ++kind) {
        const long double allowed = (output.yielded || !(parameters.drift_gain > 0.0) ? 0.0L : most[kind] * (1.0L + 1e-9L)) + 3e-9L * share + 16.0L * DBL_EPSILON * reach * turning;
        if (!(sqrtl(squares[kind]) <= allowed)) found(WRONG_LOCKED_ROWS, (double)sqrtl(squares[kind]), (double)allowed);
    }
}

static void judge_state(const P(_guiding_state) *before, int bad) {
    int finite = all_finite(12, state.anchor) && all_finite(M_FREE, state.hand_velocity) && all_finite(NV, state.qd) && all_finite(NV, state.q_observed) &&
                 all_finite(NV, state.qd_limit) && all_finite(6, state.wrench) && all_finite(1, &state.dt);
#if HAS_QDD_PREV
    finite = finite && all_finite(NV, state.qdd);
#endif
    for (int i = 0; i < NV; ++i) finite = finite && state.q_min[i] <= state.q_max[i] && state.qdd_max[i] > 0.0;
    if (!finite) found(WRONG_STATE, NAN, 0.0);
    if (memcmp(state.qd, output.qd, sizeof state.qd)) found(WRONG_STATE, state.qd[0], output.qd[0]);
    if (!bad) return;
    /* Nothing but the command, where the arm is, and what it leaves of the hand's velocity. */
    P(_guiding_state) expected = *before;
    memcpy(expected.qd, state.qd, sizeof state.qd);
    memcpy(expected.q_observed, state.q_observed, sizeof state.q_observed);
    memcpy(expected.hand_velocity, state.hand_velocity, sizeof state.hand_velocity);
#if HAS_QDD_PREV
    memcpy(expected.qdd, state.qdd, sizeof state.qdd);
#endif
    if (memcmp(&expected, &state, sizeof state)) found(WRONG_STATE, 1.0, 0.0);
}

/* Where the tick is judged: measured, or where the arm must be by what was sent. */
static void effective_position(int bad, int sampled, double *q) {
    for (int i = 0; i < NV; ++i) {
        const double expected = record.q[i] + record.dt * record.qd[i], measured = input.q[i];
        q[i] = expected;
        if (bad && all_finite(NV, input.q)) q[i] = measured;
        if (bad || !sampled) continue;
        q[i] = state.q_observed[i];
        const double low = record.observed && parameters.observer_gain < 1.0 ? fmin(expected, measured) : measured;
        const double high = record.observed && parameters.observer_gain < 1.0 ? fmax(expected, measured) : measured;
        const double rounding = parameters.observer_gain < 1.0 ? 4.0 * DBL_EPSILON * (fabs(low) + fabs(high)) : 0.0;
        if (!(q[i] >= low - rounding && q[i] <= high + rounding)) found(WRONG_STATE, q[i], measured);
    }
    if (all_finite(NV, q))
        for (int i = 0; i < NV; ++i)
            if (fabs(state.q_observed[i] - q[i]) > 4.0 * DBL_EPSILON * fabs(q[i])) found(WRONG_STATE, state.q_observed[i], q[i]);
}

static void judge(const P(_guiding_state) *before) {
    const unsigned long long bad_step = bad_parameters(&parameters.step);
    const int bad = bad_step || bad_settings(), sampled = all_finite(NV, input.q) && all_finite(6, input.wrench);
    double q[NV];
    if (bad != (output.status == KINQP_BAD_PARAMETER) || (bad_step && !(output.parameter > 0 && bad_step >> output.parameter & 1)) || !output.parameter != !bad)
        found(WRONG_PARAMETER, output.parameter, (double)bad_step);
    if (!bad) keep_limits(&parameters.step);
    effective_position(bad, sampled, q);
    if (!bad) record.held = sampled ? 0 : record.held <= parameters.hold_ticks ? record.held + 1 : record.held;
    if (!bad && output.held != record.held) found(WRONG_STATUS, output.held, record.held);
    const limits at = {q, record.q_min, record.q_max, state.qd_limit, record.qdd_max, record.dt};
    if (output.stop == KINQP_STOP_NONE) {
        ++usable_ticks;
        const int may = output.status == KINQP_SOLVED || (output.status == KINQP_MAX_ITERATIONS && parameters.step.feasible);
        if (!may || output.unmet || record.held > parameters.hold_ticks) found(WRONG_STATUS, output.status, output.stop);
        judge_usable(&at, output.mode, output.qd, NULL, record.qd);
        if (output.mode >= 0 && output.mode < MODES && all_finite(NV, output.qd)) judge_drift(output.mode, q, output.qd);
    } else {
        ++stopped_ticks;
        judge_stop(&at, output.qd, record.qd, 0);
        /* What still moves when the hand's velocity is zero is braked and called solved: limits are kept, even then. */
        if (output.status == KINQP_SOLVED) {
            if (output.phase == 0 || output.iterations) found(WRONG_STATUS, output.status, output.stop);
            judge_usable(&at, output.mode, output.qd, NULL, record.qd);
        }
    }
    /* Velocity limits are on their way to those that are set. */
    for (int i = 0; i < NV && !bad; ++i) {
        const double from = before->qd_limit[i], to = parameters.step.qd_max[i];
        if (!(state.qd_limit[i] >= fmin(from, to) && state.qd_limit[i] <= fmax(from, to))) found(WRONG_STATE, state.qd_limit[i], to);
    }
    if (!all_finite(M_FREE, output.v) || !all_finite(M_FREE, output.v_actual) || !all_finite(2, output.drift)) found(WRONG_EPS, NAN, 0.0);
    judge_state(before, bad);
    memcpy(record.qd, output.qd, sizeof record.qd);
    memcpy(record.q, q, sizeof record.q);
    if (!bad && sampled) record.observed = 1;
}

/* Makes a tick wrong that was right; the judge must see it. */
static void damage(void) {
    const int moves = output.status == KINQP_SOLVED;
    if (broken == 1 && moves) output.qd[0] = state.qd[0] = NAN;
    if (broken == 2 && output.stop == KINQP_STOP_BRAKING && record.qd[0] > 0.0) output.qd[0] = state.qd[0] = record.qd[0] - state.qdd_max[0] * state.dt - 1e-6;
    if (broken == 3 && !moves) state.wrench[3] = NAN;
    if (broken == 4 && output.status == KINQP_BAD_PARAMETER) state.qd_limit[0] = 0.5 * state.qd_limit[0];
    if (broken == 5 && moves) output.qd[1] = state.qd[1] = copysign(state.qd_limit[1] + 1e-6, record.qd[1]);
    if (broken == 6 && output.held > parameters.hold_ticks) output.status = KINQP_SOLVED, output.stop = KINQP_STOP_NONE;
}

static long history(void) {
    const int length = 1 + draw_below(1500), kind = draw_below(8), style = draw_below(8);
    const double size = draw_power(-1.0, 2.5), noise = draw_below(2) ? 0.0 : draw_power(-7.0, -4.0);
    double q[NV], wrench[6] = {0};
    int without = 0;
    parameters = usual;
    draw_state(&parameters.step, q);
    if (kind == 4) draw_good(&parameters.step, q);
    P(_start_guiding)(&parameters, &state);
    memset(&record, 0, sizeof record);
    keep_limits(bad_parameters(&parameters.step) ? &usual.step : &parameters.step);
    input.mode = draw_below(MODES);
    input.stop = 0;
    for (int i = 0; i < 6; ++i) wrench[i] = size * draw_signed();
    for (int t = 0; t < length; ++t) {
        const P(_guiding_parameters) own = parameters;
        draw_hand(style, 6, size, wrench);
        if (!draw_below(300)) input.mode = draw_below(MODES);
        if (!draw_below(input.stop ? 50 : 500)) input.stop = !input.stop;
        if (state.fault && !draw_below(30)) state.fault = 0;
        for (int i = 0; i < NV; ++i) input.q[i] = q[i] + noise * draw_signed();
        memcpy(input.wrench, wrench, sizeof wrench);
        const int mode = input.mode;
        if ((kind == 2 || kind == 7) && !draw_below(100)) without = 1 + draw_below(draw_below(2) ? 6 : 40);
        if (without > 0) --without, *(draw_below(2) ? input.q + draw_below(NV) : input.wrench + draw_below(6)) = draw_below(2) ? NAN : INFINITY;
        if (kind >= 6 && !draw_below(20)) draw_damage(NV + 6, input.q);
        if (kind >= 6 && !draw_below(50)) input.mode = draw_below(2) ? (int)draw_bits() : MODES;
        if (kind >= 5 && !draw_below(20)) draw_fields(FIELDS, fields, &parameters.step);
        if (kind >= 5 && !draw_below(20)) draw_fields(SETTINGS, settings, &parameters);
        if (kind >= 6 && !draw_below(50)) draw_integers(&parameters.step);
        if (kind >= 6 && !draw_below(50)) parameters.hold_ticks = draw_below(3) - 1, parameters.max_failures = draw_below(4);
        P(_guiding_parameters) kept = own;
        if ((kind == 3 || kind == 7) && !draw_below(100)) {
            /* Limits that are lowered, or raised again, and stay so. */
            if (draw_below(3)) draw_good(&parameters.step, q);
            else parameters.step = usual.step;
            kept = parameters;
        }
        const P(_guiding_state) before = state;
        memset(&output, 0xff, sizeof output);
        P(_guiding_tick)(&parameters, &state, &input, &output);
        damage();
        judge(&before);
        for (int i = 0; i < NV; ++i)
            if (fabs(q[i] + record.dt * output.qd[i]) < 1e6) q[i] += record.dt * output.qd[i];
        parameters = kept;
        input.mode = mode;
    }
    return length;
}

int main(int count, char **arguments) {
    if (count != 5) return 2;
    const long ticks = atol(arguments[1]);
    long done = 0;
    broken = atoi(arguments[4]);
    seed_state = (uint64_t)strtoull(arguments[2], NULL, 10);
    P(_default_guiding)(&usual);
    while (done < ticks) done += history();
    return report(done, usable_ticks, stopped_ticks);
}
