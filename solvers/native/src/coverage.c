/* Coverage (4.34): the samples nearest to each cell, the soft minimum of their excesses, and its convex majoriser.
 *
 * A cell that is owed r looks has r terms: of its nearest samples the first, the r+1st, ... belong to the first look, the
 * second, the r+2nd, ... to the second, and so on.
 */
#include <math.h>
#include "problem.h"

enum { BOX_STEPS = 16 };                      /* steps whose samples are bounded together: plain choice */
static const double BOX_ROUNDING = 1.0 - 1e-9; /* of squared distances to boxes, relatively */

/* Room to look for nearest samples, within the workspace's scratch. */
typedef struct {
    int total, boxes, between;
    double *square, *part_of, *by_axis, *limit, *excess, *part, *corner, *away;
    int32_t *index;
} Nearest;

/* Doubles that it takes. */
long nearest_doubles(const Problem *p, int widest) {
    const long m = p->agents, total = (p->steps + 1L) * m, boxes = (p->steps / BOX_STEPS + 1L) * m;
    return (2L + p->dimension) * total + m + 2L * widest + (2L * p->dimension + 1L) * boxes;
}

static Nearest nearest_workspace(const Problem *p, const Workspace *w) {
    Nearest g = {.total = (p->steps + 1) * p->agents, .boxes = (p->steps / BOX_STEPS + 1) * p->agents};
    g.between = p->parts > 1 || p->continuous;
    g.square = w->scratch;
    g.part_of = g.square + g.total;
    g.by_axis = g.part_of + g.total;
    g.limit = g.by_axis + (long)p->dimension * g.total;
    g.excess = g.limit + p->agents;
    g.part = g.excess + w->widest;
    g.corner = g.part + w->widest;
    g.away = g.corner + 2L * p->dimension * g.boxes;
    g.index = w->index;
    return g;
}

/* Insert an excess into the `most` smallest so far, sorted. */
static inline int insert(double *excess, int32_t *index, double *part, int held, int most, double e, int32_t k, double s) {
    int j = held < most ? held : most - 1;
    while (j > 0 && excess[j - 1] > e) {
        excess[j] = excess[j - 1];
        index[j] = index[j - 1];
        part[j] = part[j - 1];
        j--;
    }
    excess[j] = e;
    index[j] = k;
    part[j] = s;
    return held < most ? held + 1 : held;
}

/* The part of an interval whose point is nearest to a cell: Newton steps from the best of a few instants. */
static double nearest_part(int d, const double *off, const double *v0, const double *v1, double s, double apart) {
    const double low = MAX(s - apart, 0.0), high = MIN(s + apart, 1.0);
    for (int it = 0; it < 6; it++) {
        double first = 0.0, second = 0.0, gauss = 0.0;
        for (int a = 0; a < d; a++) {
            const double bend = 0.5 * (v1[a] - v0[a]), here = off[a] + s * v0[a] + s * s * bend;
            const double rate = v0[a] + 2.0 * s * bend;
            first += here * rate;
            gauss += rate * rate;
            second += rate * rate + 2.0 * here * bend;
        }
        const double steep = second > 0.0 ? second : gauss;
        if (!(steep > 0.0)) break;
        s = MIN(MAX(s - first / steep, low), high);
    }
    return s;
}

static double distance_at(int d, const double *off, const double *v0, const double *v1, double s) {
    double square = 0.0;
    for (int a = 0; a < d; a++) {
        const double e = off[a] + s * v0[a] + 0.5 * s * s * (v1[a] - v0[a]);
        square += e * e;
    }
    return sqrt(square);
}

/* How far an interval leads from its sample, at most. */
static double reach(int d, const double *v0, const double *v1) {
    double most = 0.0;
    for (int a = 0; a < d; a++) most += fabs(v0[a]) + 0.5 * fabs(v1[a] - v0[a]);
    return most;
}

/* Squared distances of a cell to the nearest point of each of the intervals `from` to `to` (the sample itself at the last),
 * and the parts. Intervals that cannot be among the nearest, whose excess is at most `worst`, keep their sample's. */
static void between_samples(const Problem *p, const double *c, const Motion *o, const double *radius, double worst, int from, int to, double *square, double *part) {
    const int m = p->agents, d = p->dimension;
    for (int k = from; k < to; k++) {
        double off[MAX_DIMENSION];
        const double *v0 = o->v + k * d, *v1 = v0 + m * d;
        for (int a = 0; a < d; a++) off[a] = o->q[k * d + a] - c[a];
        double best = 0.0, least = 0.0;
        for (int a = 0; a < d; a++) least += off[a] * off[a];
        least = sqrt(least);
        if (k < p->steps * m && least - reach(d, v0, v1) - radius[k % m] <= worst) {
            for (int j = 1; j < p->parts; j++) {
                const double s = (double)j / p->parts, there = distance_at(d, off, v0, v1, s);
                if (there < least) least = there, best = s;
            }
            if (p->continuous) {
                const double s = nearest_part(d, off, v0, v1, best, 1.0 / p->parts);
                const double there = distance_at(d, off, v0, v1, s);
                if (there < least) least = there, best = s;
            }
        }
        square[k] = least * least;
        part[k] = best;
    }
}

/* Squared distances of a cell to the samples `from` to `to`, from coordinates axis by axis, which vectorises. */
FOR_THIS_MACHINE
static void squared(int total, int from, int to, int d, const double *restrict by_axis, const double *c, double *restrict square) {
    const double *x = by_axis, *y = by_axis + total, *z = by_axis + 2 * (long)total;
    if (d == 2)
        for (int k = from; k < to; k++) square[k] = (x[k] - c[0]) * (x[k] - c[0]) + (y[k] - c[1]) * (y[k] - c[1]);
    else if (d == 3)
        for (int k = from; k < to; k++)
            square[k] = (x[k] - c[0]) * (x[k] - c[0]) + (y[k] - c[1]) * (y[k] - c[1]) + (z[k] - c[2]) * (z[k] - c[2]);
    else
        for (int k = from; k < to; k++) square[k] = (x[k] - c[0]) * (x[k] - c[0]);
}

/* Boxes around BOX_STEPS successive samples of each agent, where they lead included: low corners, then high ones, axis by
 * axis, for `boxes` = blocks of steps times agents. */
static void bound_samples(const Problem *p, const Motion *o, int boxes, double *corner) {
    const int m = p->agents, d = p->dimension, between = p->parts > 1 || p->continuous;
    for (int a = 0; a < d; a++)
        for (int b = 0; b < boxes; b++) {
            double low = INFINITY, high = -INFINITY;
            const int first = b / m * BOX_STEPS, last = MIN(first + BOX_STEPS - 1, p->steps);
            for (int n = first; n <= last; n++) {
                const long k = (long)n * m + b % m;
                const double *v = o->v + k * d;
                const double room = between && n < p->steps ? reach(d, v, v + m * d) : 0.0, x = o->q[k * d + a];
                low = MIN(low, x - room);
                high = MAX(high, x + room);
            }
            corner[(long)a * boxes + b] = low;
            corner[(long)(d + a) * boxes + b] = high;
        }
}

/* Squared distances of a cell to the boxes. */
FOR_THIS_MACHINE
static void to_boxes(int boxes, int d, const double *restrict corner, const double *c, double *restrict square) {
    for (int a = 0; a < d; a++) {
        const double *low = corner + (long)a * boxes, *high = corner + (long)(d + a) * boxes, here = c[a];
        for (int b = 0; b < boxes; b++) {
            const double under = low[b] - here, over = here - high[b], out = MAX(MAX(under, over), 0.0);
            square[b] = (a ? square[b] : 0.0) + out * out;
        }
    }
}

/* Squared distance up to which a sample of each agent is among the nearest so far. */
static void thresholds(int m, const double *radius, double worst, double *limit) {
    for (int i = 0; i < m; i++) {
        const double far = worst + radius[i];
        limit[i] = far > 0.0 ? far * far : -1.0;
    }
}

/* An excess that M samples do not exceed, from those that were nearest before; infinity where they are not known. */
static double known_worst(int d, int M, int m, const double *c, const double *radius, const double *q, const int32_t *near) {
    double worst = -INFINITY;
    for (int j = 0; j < M; j++) {
        if (near[j] < 0) return INFINITY;
        double square = 0.0;
        for (int a = 0; a < d; a++) square += (q[near[j] * d + a] - c[a]) * (q[near[j] * d + a] - c[a]);
        worst = MAX(worst, sqrt(square) - radius[near[j] % m]);
    }
    return worst + 1e-9 * (1.0 + fabs(worst));
}

/* Samples nearest to one cell: the `most` with the least excess up to `worst`, sorted; how many there are. */
static int nearest_to(const Problem *p, const Motion *o, const Nearest *g, const double *c, const double *radius, int most, double worst) {
    const int m = p->agents, d = p->dimension, blocks = g->boxes / m;
    int held = 0;
    thresholds(m, radius, worst, g->limit);
    for (int block = 0; block < blocks; block++) {
        const double *away = g->away + (long)block * m;
        int near = 0;
        for (int i = 0; i < m; i++) near |= away[i] * BOX_ROUNDING < g->limit[i];
        if (!near) continue;
        const int from = block * BOX_STEPS * m, to = MIN(from + BOX_STEPS * m, g->total);
        if (g->between) between_samples(p, c, o, radius, worst, from, to, g->square, g->part_of);
        else squared(g->total, from, to, d, g->by_axis, c, g->square);
        for (int k = from; k < to;)
            for (int i = 0; i < m; i++, k++)
                if (g->square[k] < g->limit[i]) {
                    held = insert(g->excess, g->index, g->part, held, most, sqrt(g->square[k]) - radius[i], k, g->part_of[k]);
                    if (held == most) thresholds(m, radius, g->excess[most - 1], g->limit);
                }
    }
    return held;
}

/* Excesses change by no more than the distance between two cells: what the last one needed bounds what this one needs. */
static double moved_worst(int d, const double *c, const double *last, double worst) {
    double square = 0.0;
    for (int a = 0; a < d; a++) square += (c[a] - last[a]) * (c[a] - last[a]);
    worst += sqrt(square);
    return worst + 1e-9 * (1.0 + fabs(worst));
}

void find_nearest(const Problem *p, const Workspace *w, int M, Motion *o) {
    const int m = p->agents, d = p->dimension;
    const Nearest g = nearest_workspace(p, w);
    int held = 0, before = -1; /* demand that was looked at before, if its excesses hold for this one, and cell */
    for (int k = 0; k < g.total; k++) {
        g.part_of[k] = 0.0;
        for (int a = 0; a < d; a++) g.by_axis[(long)a * g.total + k] = o->q[k * d + a];
    }
    bound_samples(p, o, g.boxes, g.corner);
    for (int e = 0; e < p->demands; e++) {
        const int looks = p->demand_looks[e], most = looks * M;
        const double *radius = p->radius + (long)p->demand_magnitude[e] * m, *c = p->cell + (long)p->demand_cell[e] * d;
        double *excess = g.excess, *part = g.part, worst = INFINITY;
        if (looks == 1) worst = known_worst(d, M, m, c, radius, o->q, o->near + (long)w->term_first[e] * M);
        if (before >= 0 && held == most && p->demand_looks[before] == looks && p->demand_magnitude[before] == p->demand_magnitude[e])
            worst = MIN(worst, moved_worst(d, c, p->cell + (long)p->demand_cell[before] * d, excess[most - 1]));
        before = e;
        to_boxes(g.boxes, d, g.corner, c, g.away);
        held = nearest_to(p, o, &g, c, radius, most, worst);
        if (held < most && worst < INFINITY) held = nearest_to(p, o, &g, c, radius, most, INFINITY);
        for (int look = 0; look < looks; look++) {
            const long first = (long)(w->term_first[e] + look) * M;
            for (int j = 0; j < M; j++) {
                const int rank = look + looks * j, there = rank < held;
                o->near[first + j] = there ? g.index[rank] : -1;
                o->near_excess[first + j] = there ? excess[rank] : INFINITY;
                o->near_part[first + j] = there ? part[rank] : 0.0;
                o->near_distance[first + j] = there ? excess[rank] + radius[g.index[rank] % m] : INFINITY;
            }
        }
    }
}

/* J (4.34), J_beta, and the levels and shares of the soft minimum. A term that nobody can measure costs nothing. */
void coverage_levels(const Problem *p, const Workspace *w, const Options *t, double beta, Motion *o) {
    const int M = t->samples;
    const double margin = t->margin / beta;
    o->hard = o->soft = 0.0;
    for (int e = 0; e < p->demands; e++)
        for (int look = 0; look < p->demand_looks[e]; look++) {
            const int k = w->term_first[e] + look;
            const double *excess = o->near_excess + (long)k * M, least = excess[0];
            double *share = o->share + (long)k * M, total = 0.0;
            if (o->near[(long)k * M] < 0) {
                o->level[k] = -INFINITY;
                continue;
            }
            for (int j = 0; j < M; j++) {
                const double gap = beta * (excess[j] - least);
                share[j] = gap < 40.0 ? exp(-gap) : 0.0;
                total += share[j];
            }
            for (int j = 0; j < M; j++) share[j] /= total;
            o->level[k] = least - log(total) / beta + margin;
            if (least > t->tie) o->hard += p->demand_weight[e] * least;
            if (o->level[k] > 0.0) o->soft += p->demand_weight[e] * o->level[k];
        }
}

/* Rows of the terms that a step may bring to the edge of coverage, and the curvature of the distances. */
void coverage_rows(const Problem *p, Workspace *w, const Options *t, const Motion *o) {
    const int M = t->samples, d = p->dimension, half = w->half, st = w->stage;
    const double reach = 2.0 * t->step_max;
    for (int e = 0; e < p->demands; e++)
        for (int look = 0; look < p->demand_looks[e]; look++) {
            const int k = w->term_first[e] + look;
            if (!(o->level[k] > -reach) || !rows_add(&w->rows, k, o->level[k], p->demand_weight[e])) continue;
            const double z = row_multiplier(&w->rows, w->rows.count - 1);
            const double *c = p->cell + p->demand_cell[e] * d;
            for (int j = 0; j < M; j++) {
                const double share = o->share[(long)k * M + j];
                if (share < 1e-3) continue;
                const int sample = o->near[(long)k * M + j], at = sample * d;
                const double s = o->near_part[(long)k * M + j], b = 0.5 * s * s, a0 = s - b;
                const double far = MAX(o->near_distance[(long)k * M + j], 1e-9), f = z * share / MAX(far, 0.3);
                double r[MAX_DIMENSION];
                for (int a = 0; a < d; a++) {
                    double point = o->q[at + a];
                    if (s > 0.0) point += a0 * o->v[at + a] + b * o->v[at + st + a];
                    r[a] = (point - c[a]) / far;
                    rows_entry(&w->rows, at + a, share * r[a]);
                    if (s > 0.0) {
                        rows_entry(&w->rows, half + at + a, a0 * share * r[a]);
                        rows_entry(&w->rows, half + at + st + a, b * share * r[a]);
                    }
                }
                for (int a = 0; a < d; a++)
                    for (int c2 = 0; c2 < d; c2++) {
                        const double h = f * ((a == c2) - r[a] * r[c2]);
                        add_entry(w, w->Hqq, at + a, at + c2, h);
                        if (s > 0.0) { /* the point is q + a0 v + b v+ */
                            const int one = at + a, two = at + c2;
                            add_entry(w, w->Hqv, one, two, a0 * h);
                            add_entry(w, w->Hqv, one, two + st, b * h);
                            add_entry(w, w->Hvv, one, two, a0 * a0 * h);
                            add_entry(w, w->Hvv, one, two + st, a0 * b * h);
                            add_entry(w, w->Hvv, one + st, two, a0 * b * h);
                            add_entry(w, w->Hvv, one + st, two + st, b * b * h);
                        }
                    }
            }
        }
}
