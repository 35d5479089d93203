/* What ticks are given: random and adversarial states, hands, parameters and histories. It judges nothing. */
#ifndef KINQP_TESTS_DRAW_H
#define KINQP_TESTS_DRAW_H

#include <float.h>
#include <limits.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

static uint64_t seed_state;

/* splitmix64 */
static uint64_t draw_bits(void) {
    uint64_t z = seed_state += 0x9e3779b97f4a7c15u;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}
static int draw_below(int n) { return (int)(draw_bits() % (uint64_t)n); }
static double draw_unit(void) { return (double)(draw_bits() >> 11) * 0x1p-53; }
static double draw_signed(void) { return 2.0 * draw_unit() - 1.0; }
static double draw_power(double low, double high) { return pow(10.0, low + (high - low) * draw_unit()); }
static double draw_any(void) {
    const uint64_t bits = draw_bits();
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* Numbers at the ends of what a double can be, and those that are none. */
static double draw_special(void) {
    static const double ends[] = {0.0, -0.0, 5e-324, -5e-324, DBL_MIN, -DBL_MIN, 1e-300, 1e-17, 1e-9, 1e-5, 1e-3, 1.0, -1.0, 2.0, 10.0,
                                  1e8, 1e15, 1e22, 1e155, 1e308, -1e308, DBL_MAX, -DBL_MAX};
    const int n = (int)(sizeof ends / sizeof *ends), k = draw_below(n + 5);
    if (k < n) return ends[k];
    if (k == n) return INFINITY;
    if (k == n + 1) return -INFINITY;
    if (k == n + 2) return draw_any();
    const uint64_t bits = 0x7ff0000000000000u | (draw_bits() & 0x800fffffffffffffu) | 1u;
    double nan;
    memcpy(&nan, &bits, sizeof nan);
    return nan;
}

/* Another value instead of x. */
static double draw_instead(double x) {
    switch (draw_below(6)) {
    case 0: return nextafter(x, INFINITY);
    case 1: return nextafter(x, -INFINITY);
    case 2: return x * draw_power(-3.0, 3.0);
    case 3: return draw_any();
    default: return draw_special();
    }
}

/* Changes entries of one of n fields, each a good value only now and then. */
static void draw_fields(int n, const field *all, void *owner) {
    const field *f = all + draw_below(n);
    double *x = (double *)(void *)((char *)owner + f->offset);
    if (draw_below(3)) {
        const int i = draw_below(f->size);
        x[i] = draw_instead(x[i]);
        return;
    }
    const double one = draw_below(2) ? draw_special() : draw_instead(x[0]);
    for (int i = 0; i < f->size; ++i) x[i] = one;
}

/* Parameters that are accepted, yet unlike any arm's. */
static void draw_good(P(_parameters) *p, const double *q) {
    const int which = draw_below(8);
    for (int i = 0; i < NV; ++i) switch (which) {
        case 0: p->qd_max[i] *= draw_power(-6.0, 2.0); break;
        case 1: p->qdd_max[i] *= draw_power(-6.0, 4.0); break;
        case 2: p->qdd_max[i] = INFINITY; break;
        case 3: p->q_min[i] = -INFINITY; p->q_max[i] = INFINITY; break;
        case 4: p->q_min[i] = p->q_max[i] = isfinite(q[i]) ? q[i] : 0.0; break;
        case 5: p->q_max[i] = fmax(p->q_min[i], q[i] + draw_signed() * draw_power(-12.0, -1.0)); break;
        case 6: p->q_min[i] = fmin(p->q_max[i], q[i] + draw_signed() * draw_power(-12.0, -1.0)); break;
        default: break;
    }
    if (which == 7) p->dt = draw_power(-5.0, 0.0);
    if (which == 7 && draw_below(2)) p->dt = draw_below(2) ? 1e-5 : 1.0;
    if (!draw_below(4)) p->feasible = draw_below(2) ? 1 : -7;
    if (!draw_below(8)) p->max_iterations = draw_below(3);
}

static void draw_integers(P(_parameters) *p) {
    const int odd[] = {0, 1, 2, 3, -1, INT_MIN};
    if (draw_below(2)) p->max_iterations = odd[draw_below(6)];
    if (draw_below(2)) p->feasible = draw_below(2) ? draw_below(2) : (int)draw_bits();
}

/* Joint positions to begin with. */
static void draw_state(const P(_parameters) *p, double *q) {
    static const double offsets[] = {0.0, 1e-17, 1e-9, 1e-6, 1e-4, 1e-3, 1e-2, -1e-9, -1e-5, -1e-2};
    const int how = draw_below(16);
    for (int i = 0; i < NV; ++i) {
        const double low = fmax(p->q_min[i], -4.0), high = fmin(p->q_max[i], 4.0);
        q[i] = low + (high - low) * draw_unit();
        if (how >= 6 && how < 11 && draw_below(3))
            q[i] = draw_below(2) ? high - offsets[draw_below(10)] : low + offsets[draw_below(10)];
        if (how == 11) q[i] = 0.0;
        if (how == 12) q[i] = 1.5707963267948966 * (draw_below(5) - 2);
        if (how == 13) q[i] = draw_signed() * draw_power(-18.0, -3.0);
        if (how == 14) q[i] = 10.0 * draw_signed();
    }
    if (how == 15) q[draw_below(NV)] = draw_signed() * draw_power(0.0, 22.0);
}

/* The hand's next velocity or wrench, of n entries about `size`. */
static void draw_hand(int style, int n, double size, double *v) {
    if (style == 1 && draw_below(20)) return;
    if (style == 4 && draw_below(3)) return;
    for (int i = 0; i < n; ++i) switch (style) {
        case 0: break;                                                                   /* steady */
        case 1: v[i] = draw_below(2) ? size : -size; break;                              /* to and fro */
        case 2: v[i] += 0.1 * size * draw_signed(); break;                               /* wandering */
        case 3: v[i] = 0.0; break;                                                       /* not there */
        case 4: v[i] = draw_signed() * draw_power(-320.0, 308.0); break;                 /* broken */
        default: v[i] = size * draw_signed(); break;                                     /* trembling */
    }
}

/* Any bits in some of n doubles. */
static void draw_damage(int n, double *x) {
    for (int i = 1 + draw_below(2); i > 0 && n; --i) x[draw_below(n)] = draw_below(2) ? draw_special() : draw_any();
}

#endif
