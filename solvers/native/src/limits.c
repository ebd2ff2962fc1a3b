/* Limits of speed and input as discs or balls, hard rows; and the motion box, elastic. */
#include <math.h>
#include "problem.h"

static void input(const Problem *p, const Motion *o, int n, int i, double *u) {
    const int d = p->dimension, at = (n * p->agents + i) * d, st = p->agents * d;
    for (int a = 0; a < d; a++) u[a] = o->v[at + st + a] - o->v[at + a];
}

static void over(Motion *o, double excess, double share) {
    if (excess > 0.0) o->violation = MAX(o->violation, excess * share), o->penalty += excess;
}

/* The violations; those of speed and input count in the units in which feasibility is judged. */
void measure_limits(const Problem *p, const Options *t, Motion *o) {
    const int m = p->agents, d = p->dimension;
    for (int n = 0; n <= p->steps; n++)
        for (int i = 0; i < m; i++) {
            const int at = (n * m + i) * d;
            double u[MAX_DIMENSION];
            if (n >= p->first) over(o, norm(d, o->v + at) - p->speed_limit[i], t->feasibility / t->limit_feasibility);
            if (n == p->steps) continue;
            input(p, o, n, i, u);
            over(o, norm(d, u) - p->input_limit[i], t->feasibility / t->input_feasibility);
            for (int a = 0; a < d; a++) {
                const double v0 = o->v[at + a], v1 = v0 + u[a], q0 = o->q[at + a], q1 = o->q[at + m * d + a];
                double low = MIN(q0, q1), high = MAX(q0, q1);
                if (v0 * v1 < 0.0) {
                    const double vertex = q0 - v0 * v0 / (2.0 * u[a]);
                    low = MIN(low, vertex);
                    high = MAX(high, vertex);
                }
                over(o, high - p->box_high[i * d + a], 1.0);
                over(o, p->box_low[i * d + a] - low, 1.0);
            }
        }
}

/* A disc as a level set: (|e|^2 - bound^2) / (2 bound) <= 0, with its own curvature. */
static void disc(Workspace *w, int d, int slot, double bound, const double *e, int plus, int minus) {
    const double far = norm(d, e);
    const double level = 0.5 * (far * far / bound - bound);
    if (!rows_add(&w->rows, slot, level, HARD)) return;
    rows_disc(&w->rows, plus, minus, bound);
    const double h = row_multiplier(&w->rows, w->rows.count - 1) / bound;
    const int half = w->half;
    for (int a = 0; a < d; a++) {
        rows_entry(&w->rows, half + plus + a, e[a] / bound);
        add_entry(w, w->Hvv, plus + a, plus + a, h);
        if (minus < 0) continue;
        rows_entry(&w->rows, half + minus + a, -e[a] / bound);
        add_entry(w, w->Hvv, minus + a, minus + a, h);
        add_entry(w, w->Hvv, plus + a, minus + a, -h);
        add_entry(w, w->Hvv, minus + a, plus + a, -h);
    }
}

/* Level of a wall: a point in the margin may stay where it is, one outside must come back. */
static double wall(double beyond, double aside) { return beyond > 0.0 ? beyond : MIN(beyond + aside, 0.0); }

static void box(const Problem *p, Workspace *w, const Options *t, const Motion *o, int n, int i, int slot) {
    const int d = p->dimension, at = (n * p->agents + i) * d;
    const double aside = p->long_steps ? 0.0 : p->box_aside[i];
    for (int a = 0; a < d; a++)
        for (int side = 0; side < 2; side++)
            for (int control = 0; control <= (p->long_steps && n < p->steps); control++) {
                const double sign = side ? 1.0 : -1.0, edge = side ? p->box_high[i * d + a] : p->box_low[i * d + a];
                const double point = o->q[at + a] + (control ? 0.5 * o->v[at + a] : 0.0);
                const double level = wall(sign * (point - edge), control ? 0.0 : aside);
                if (level < -2.5 * t->step_max || (!control && n < p->first)) continue;
                if (!rows_add(&w->rows, slot + 4 * a + 2 * side + control, level, t->penalty)) return;
                rows_entry(&w->rows, at + a, sign);
                if (control) rows_entry(&w->rows, w->half + at + a, 0.5 * sign);
            }
}

void limit_rows(const Problem *p, Workspace *w, const Options *t, const Motion *o) {
    const int m = p->agents, d = p->dimension, st = w->stage;
    const int begin = w->terms + 5 * (p->steps + 1) * p->pairs, each = 2 + 4 * MAX_DIMENSION;
    for (int n = 0; n <= p->steps; n++)
        for (int i = 0; i < m; i++) {
            const int at = (n * m + i) * d, slot = begin + each * (n * m + i);
            double u[MAX_DIMENSION];
            if (!p->active[i]) continue;
            if (n >= p->first) disc(w, d, slot, p->speed_max[i], o->v + at, at, NONE);
            if (n < p->steps) {
                input(p, o, n, i, u);
                disc(w, d, slot + 1, p->input_max[i], u, at + st, at);
            }
            box(p, w, t, o, n, i, slot + 2);
        }
}
