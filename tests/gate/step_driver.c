/* Runs and judges steps: driver TICKS SEED HOW BROKEN, where HOW is step, batch or guide (blended modes).
 *
 * BROKEN, for the test of the judge itself, is the kind of damage done to ticks before they are judged; 0: none.
 */
#include HEADER

#include "arm.h"
#include "judge.h"

#include "draw.h"

#include <stdlib.h>

#define BATCH 16

static P(_parameters) usual, parameters;
static P(_input) input;
static P(_output) output;
static long usable_ticks, stopped_ticks;
static int broken;

static void show_tick(void) {
    fprintf(stderr, "  status %d stop %d unmet %d parameter %d mode %d max_iterations %d feasible %d\n", (int)output.status, output.stop,
            output.unmet, output.parameter, input.mode, parameters.max_iterations, parameters.feasible);
    const double *words = (const double *)(const void *)input.q;
    fprintf(stderr, "  input:");
    for (size_t i = 0; i < (sizeof input - offsetof(P(_input), q)) / sizeof(double); ++i) fprintf(stderr, " %.17g", words[i]);
    fprintf(stderr, "\n  qd:");
    for (int i = 0; i < NV; ++i) fprintf(stderr, " %.17g", output.qd[i]);
    fprintf(stderr, "\n  parameters:");
    for (int k = 0; k < FIELDS; ++k) {
        fprintf(stderr, " %s", fields[k].name);
        for (int i = 0; i < fields[k].size; ++i) fprintf(stderr, " %.17g", ((const double *)(const void *)((const char *)&parameters + fields[k].offset))[i]);
    }
    fprintf(stderr, "\n");
}

static int input_is_finite(void) {
    if (input.mode < 0 || input.mode >= MODES) return 0;
#if HAS_V_FIXED
    if (!all_finite(mode_m_fixed[input.mode], input.v_fixed)) return 0;
#endif
    return all_finite(NV, input.q) && all_finite(mode_m_free[input.mode], input.v);
}

/* `last`: what a stop must brake from, NULL: nothing; `rows`: whether locked rows are judged. */
static void judge(const double *last, int rows) {
    const unsigned long long bad = bad_parameters(&parameters);
    const double none[6] = {0}, *asked = none;
#if HAS_V_FIXED
    asked = input.v_fixed;
#endif
    const double *qd_prev = NULL;
#if BRAKES
    qd_prev = input.qd_prev;
#endif
    const int may = output.status == KINQP_SOLVED || (output.status == KINQP_MAX_ITERATIONS && parameters.feasible);
    if (!!bad != (output.status == KINQP_BAD_PARAMETER) || (bad && !(output.parameter > 0 && bad >> output.parameter & 1)) || (!bad && output.parameter))
        found(WRONG_PARAMETER, output.parameter, (double)bad);
    if (output.stop == KINQP_STOP_NONE) {
        ++usable_ticks;
        if (!may || output.unmet) found(WRONG_STATUS, output.status, output.stop);
        if (!input_is_finite()) found(WRONG_INPUT, NAN, 0.0);
        const limits at = limits_of(&parameters, input.q);
        judge_usable(&at, input.mode, output.qd, rows ? asked : NULL, qd_prev);
    } else {
        ++stopped_ticks;
        const int knows = last && all_finite(NV, last);
        if (output.status == KINQP_SOLVED || output.stop != (knows ? KINQP_STOP_BRAKING : KINQP_STOP_ZERO)) found(WRONG_STATUS, output.status, output.stop);
        const limits at = limits_of(bad ? &usual : &parameters, input.q);
        judge_stop(&at, output.qd, knows ? last : NULL, 1);
    }
    /* Products of numbers as large as these may be infinite. */
    for (int i = 0; i < M_FREE; ++i)
        if (!all_finite(1, output.eps + i) && !(fabs(input.v[i]) > 1e300) && all_finite(NV, output.qd)) {
            double most = 0.0;
            for (int j = 0; j < NV; ++j) most = fmax(most, fmax(fabs(output.qd[j]), fabs(input.q[j])));
            if (most < 1e150) found(WRONG_EPS, output.eps[i], most);
        }
}

/* Makes a tick wrong that was right; the judge must see it. */
static void damage(const double *last) {
    const int solved = output.status == KINQP_SOLVED;
    if (broken == 1 && solved) output.qd[NV - 1] = NAN;
    if (broken == 2 && solved) output.qd[0] = copysign(parameters.qd_max[0] + 1e-8 + 1e-6, output.qd[0]);
    if (broken == 3 && solved) input.q[0] = parameters.q_max[0], output.qd[0] = 1e-8 + 1e-6;
    if (broken == 4 && solved) output.qd[1] += 1e-6;
    if (broken == 5 && solved) parameters.dt = 0.0;
    if (broken == 6 && output.stop == KINQP_STOP_BRAKING && last && last[0] > 0.0) output.qd[0] = fmin(last[0], parameters.qd_max[0]) - parameters.qdd_max[0] * parameters.dt - 1e-6;
    if (broken == 7 && output.stop != KINQP_STOP_NONE) output.status = KINQP_SOLVED, output.stop = KINQP_STOP_NONE;
    if (broken == 8 && output.stop != KINQP_STOP_NONE) output.qd[0] = 1e-6;
    if (broken == 9 && solved) parameters.qd_max[0] = INFINITY;
    if (broken == 10 && solved) input.q[0] = NAN;
}

static void batch_of_states(void) {
    static double q[BATCH * NV], v[BATCH * M_FREE], qd_prev[BATCH * NV], v_fixed[BATCH * 6], qdd_prev[BATCH * NV], qd[BATCH * NV], eps[BATCH * M_FREE];
    static int status[BATCH], iterations[BATCH], active[BATCH * ROWS];
    const double size = draw_power(-3.0, 1.0);
    parameters = usual;
    draw_state(&usual, q);
    if (draw_below(3)) draw_good(&parameters, q);
    if (!draw_below(4)) draw_fields(FIELDS, fields, &parameters);
    parameters.feasible = 0;
    for (int t = 0; t < BATCH; ++t) {
        draw_state(&usual, q + t * NV);
        draw_hand(5, M_FREE, size, v + t * M_FREE);
        for (int i = 0; i < NV; ++i) qd_prev[t * NV + i] = usual.qd_max[i] * draw_signed(), qdd_prev[t * NV + i] = usual.qdd_max[i] * draw_signed();
        for (int i = 0; i < 6; ++i) v_fixed[t * 6 + i] = draw_below(4) ? 0.0 : 0.01 * draw_signed();
    }
    if (!draw_below(3)) draw_damage(BATCH * NV, q);
    if (!draw_below(3)) draw_damage(BATCH * M_FREE, v);
    if (!draw_below(3)) draw_damage(BATCH * NV, qd_prev);
    (void)qdd_prev;
    P(_batch)(&parameters, 0, BATCH, q, v, BATCH_ARGUMENTS qd, eps, status, iterations, active);
    for (int t = 0; t < BATCH; ++t) {
        input.mode = 0;
        memcpy(input.q, q + t * NV, sizeof input.q);
        memcpy(input.v, v + t * M_FREE, sizeof input.v);
#if HAS_V_FIXED
        memcpy(input.v_fixed, v_fixed + t * V_FIXED, sizeof input.v_fixed);
#endif
#if BRAKES
        memcpy(input.qd_prev, qd_prev + t * NV, sizeof input.qd_prev);
#endif
        P(_parameters) own = parameters;
#if HAS_QDD_PREV
        memcpy(parameters.qdd_prev, qdd_prev + t * NV, sizeof own.qdd_prev);
#endif
        /* What a batch does not tell, a step does: it must be the same tick. */
        P(_step)(&parameters, &input, &output);
        if ((int)output.status != status[t] || memcmp(output.qd, qd + t * NV, sizeof output.qd) || memcmp(output.eps, eps + t * M_FREE, sizeof output.eps))
            found(WRONG_STATUS, status[t], output.status);
        memcpy(output.qd, qd + t * NV, sizeof output.qd);
        memcpy(output.eps, eps + t * M_FREE, sizeof output.eps);
        judge(BRAKES ? qd_prev + t * NV : NULL, 1);
        parameters = own;
    }
}

static long history(int guide) {
    const int length = 1 + draw_below(400), kind = draw_below(8), style = draw_below(8), free_tool = draw_below(3);
    const double size = draw_power(-3.0, 1.0), fixed = draw_below(3) ? 0.0 : draw_power(-6.0, -1.0);
    double q[NV], last[NV], before[NV], v[M_FREE], blending = 0.0;
    int known = 0, engaged = -1;
#if BLENDS
    static P(_guide_state) state;
    P(_start_guide)(&state);
#endif
    parameters = usual;
    draw_state(&parameters, q);
    if (kind == 3 || kind == 4) draw_good(&parameters, q);
    if (kind == 5) draw_fields(FIELDS, fields, &parameters);
    for (int i = 0; i < NV; ++i) last[i] = before[i] = draw_below(2) ? 0.0 : usual.qd_max[i] * draw_signed() * 0.3;
    for (int i = 0; i < M_FREE; ++i) v[i] = size * draw_signed();
    input.mode = draw_below(MODES);
    for (int t = 0; t < length; ++t) {
        const P(_parameters) own = parameters;
        draw_hand(style, M_FREE, size, v);
        if (MODES > 1 && !draw_below(40)) input.mode = draw_below(MODES);
        const int mode = input.mode;
        memcpy(input.q, q, sizeof q);
        memcpy(input.v, v, sizeof v);
#if HAS_V_FIXED
        for (int i = 0; i < V_FIXED; ++i) input.v_fixed[i] = fixed * draw_signed();
        if (!draw_below(97)) draw_hand(4, V_FIXED, 1.0, input.v_fixed);
#endif
#if BRAKES
        for (int i = 0; i < NV; ++i) input.qd_prev[i] = free_tool ? last[i] : last[i] * (1.0 + 0.1 * draw_signed());
        if (!draw_below(50)) for (int i = 0; i < NV; ++i) input.qd_prev[i] = draw_signed() * draw_power(-20.0, 3.0);
#endif
#if HAS_QDD_PREV
        for (int i = 0; i < NV; ++i) parameters.qdd_prev[i] = draw_below(8) ? (last[i] - before[i]) / usual.dt : usual.qdd_max[i] * draw_signed();
#endif
        (void)free_tool;
        if (kind >= 6 && !draw_below(8)) draw_fields(FIELDS, fields, &parameters);
        if (kind >= 6 && !draw_below(20)) draw_integers(&parameters);
        if (kind == 6 && !draw_below(20)) draw_good(&parameters, q);
#if BLENDS
        if (kind >= 6 && !draw_below(30)) parameters.transition = draw_instead(parameters.transition);
#endif
        if (kind == 7 && !draw_below(6)) draw_damage((int)((sizeof input - offsetof(P(_input), q)) / sizeof(double)), input.q);
        if (kind == 7 && !draw_below(30)) input.mode = draw_below(2) ? (int)draw_bits() : draw_below(2) ? -1 : MODES;
        memset(&output, 0xff, sizeof output);
        const double *from = NULL;
#if BRAKES
        from = input.qd_prev;
#endif
        if (guide) {
#if BLENDS
            const int usable = !bad_parameters(&parameters) && input_is_finite();
            if (usable && known && input.mode != engaged) blending = parameters.transition;
            if (known) from = last;
            P(_guide)(&parameters, &state, &input, &output);
            damage(from);
            judge(from, !(blending > 0.0));
            if (usable) known = 1, engaged = input.mode, blending -= parameters.dt;
            if (!all_finite(NV, state.qd) || !all_finite(NV, state.q) || !all_finite(1, &state.remaining) || !all_finite(M_FREE, state.left_v))
                found(WRONG_STATE, NAN, 0.0);
#endif
        } else {
            P(_step)(&parameters, &input, &output);
            damage(from);
            judge(from, 1);
        }
        const double dt = bad_parameters(&parameters) ? usual.dt : parameters.dt;
        for (int i = 0; i < NV; ++i) {
            before[i] = last[i];
            last[i] = output.qd[i];
            if (fabs(q[i] + dt * last[i]) < 1e6) q[i] += dt * last[i];
        }
        input.mode = mode;
        parameters = own;
    }
    (void)known;
    (void)engaged;
    (void)blending;
    return length;
}

int main(int count, char **arguments) {
    if (count != 5) return 2;
    const long ticks = atol(arguments[1]);
    long done = 0;
    broken = atoi(arguments[4]);
    seed_state = (uint64_t)strtoull(arguments[2], NULL, 10);
    P(_default_parameters)(&usual);
    while (done < ticks)
        if (arguments[3][0] == 'b') batch_of_states(), done += BATCH;
        else done += history(arguments[3][0] == 'g');
    return report(done, usable_ticks, stopped_ticks);
}
