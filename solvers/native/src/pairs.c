/* Separation (4.18) as a half-space per pair and interval; connectivity (4.20) by the edges of minimum spanning trees. */
#include <math.h>
#include <string.h>
#include "problem.h"

static void difference(const Problem *p, const double *q, int n, int i, int j, double *e) {
    const int d = p->dimension;
    const double *a = q + ((long)n * p->agents + i) * d, *b = q + ((long)n * p->agents + j) * d;
    for (int k = 0; k < d; k++) e[k] = a[k] - b[k];
}

/* Prim's algorithm on the active agents; ties go to the lower pair. */
static void spanning_tree(const Problem *p, const double *weight, uint8_t *tree) {
    const int m = p->agents;
    uint8_t inside[1024] = {0};
    int size = 0, active = 0;
    memset(tree, 0, p->pairs);
    for (int i = 0; i < m; i++) {
        if (!p->active[i]) continue;
        if (active++ == 0) inside[i] = 1;
    }
    for (size = 1; size < active; size++) {
        int best = -1, pair = 0, new_agent = -1;
        for (int i = 0; i < m; i++)
            for (int j = i + 1; j < m; j++, pair++) {
                if (!p->active[i] || !p->active[j] || inside[i] == inside[j]) continue;
                if (best < 0 || weight[pair] < weight[best]) best = pair, new_agent = inside[i] ? j : i;
            }
        if (best < 0) break;
        tree[best] = inside[new_agent] = 1;
    }
    if (p->link)
        for (int k = 0; k < p->pairs; k++) tree[k] |= p->link[k];
}

/* Distances at samples and their extremes within intervals, trees, and the violations of both constraints. */
void measure_pairs(const Problem *p, Motion *o) {
    const int m = p->agents, d = p->dimension, P = p->pairs;
    for (int n = 0; n <= p->steps; n++)
        for (int i = 0, pair = 0; i < m; i++)
            for (int j = i + 1; j < m; j++, pair++) {
                double e[MAX_DIMENSION];
                difference(p, o->q, n, i, j, e);
                o->sampled[(long)n * P + pair] = norm(d, e);
            }
    for (int n = 0; n < p->steps; n++) {
        for (int i = 0, pair = 0; i < m; i++)
            for (int j = i + 1; j < m; j++, pair++) {
                const long k = (long)n * P + pair;
                double e[MAX_DIMENSION], v[MAX_DIMENSION], bend[MAX_DIMENSION], there[MAX_DIMENSION];
                difference(p, o->q, n, i, j, e);
                difference(p, o->v, n, i, j, v);
                difference(p, o->v, n + 1, i, j, bend);
                double low = MIN(o->sampled[k], o->sampled[k + P]), high = MAX(o->sampled[k], o->sampled[k + P]);
                for (int a = 0; a < d; a++) bend[a] = 0.5 * (bend[a] - v[a]);
                for (int part = 1; part < WITHIN; part++) {
                    const double s = (double)part / WITHIN;
                    for (int a = 0; a < d; a++) there[a] = e[a] + s * v[a] + s * s * bend[a];
                    const double x = norm(d, there);
                    low = MIN(low, x);
                    high = MAX(high, x);
                }
                o->least[k] = low;
                o->most[k] = high;
                const double close = p->separation[pair] - low;
                if (p->separation[pair] > 0.0 && close > 0.0) {
                    o->violation = MAX(o->violation, close);
                    o->penalty += close;
                }
            }
        if (!p->linked) continue;
        uint8_t *tree = o->tree + (long)n * P;
        spanning_tree(p, o->most + (long)n * P, tree);
        for (int k = 0; k < P; k++) {
            const double far = tree[k] ? o->most[(long)n * P + k] - p->range : 0.0;
            if (far > 0.0) o->violation = MAX(o->violation, far), o->penalty += far;
        }
    }
}

/* Entries of sign * n.(x_i - x_j); at control points q + v/2 also of velocities. */
static void pair_entries(const Problem *p, Workspace *w, int n, int i, int j, const double *normal, double sign, int control) {
    const int d = p->dimension, m = p->agents;
    for (int a = 0; a < d; a++) {
        const int one = (n * m + i) * d + a, two = (n * m + j) * d + a;
        rows_entry(&w->rows, one, sign * normal[a]);
        rows_entry(&w->rows, two, -sign * normal[a]);
        if (control) {
            rows_entry(&w->rows, w->half + one, 0.5 * sign * normal[a]);
            rows_entry(&w->rows, w->half + two, -0.5 * sign * normal[a]);
        }
    }
}

/* A row with these entries and a level. */
static void pair_row(const Problem *p, Workspace *w, int slot, double level, double cost, int n, int i, int j,
                     const double *normal, double sign, int control) {
    if (rows_add(&w->rows, slot, level, cost)) pair_entries(p, w, n, i, j, normal, sign, control);
}

/* Curvature of ||x_i - x_j|| times the row's multiplier, across the edge; at control points also by velocities. */
static void edge_curvature(const Problem *p, Workspace *w, int n, int i, int j, const double *normal, double far, int control) {
    const int d = p->dimension;
    const double f = row_multiplier(&w->rows, w->rows.count - 1) / MAX(far, 0.3);
    double across[MAX_DIMENSION][MAX_DIMENSION] = {{0}};
    if (d == 2) {
        across[0][0] = -normal[1];
        across[0][1] = normal[0];
    } else if (d == 3) { /* any two directions that complete the normal */
        const int least = fabs(normal[0]) < fabs(normal[1]) ? (fabs(normal[0]) < fabs(normal[2]) ? 0 : 2) : (fabs(normal[1]) < fabs(normal[2]) ? 1 : 2);
        double *u = across[0], *v = across[1], size;
        for (int a = 0; a < 3; a++) u[a] = (a == least) - normal[least] * normal[a];
        size = norm(3, u);
        for (int a = 0; a < 3; a++) u[a] /= size;
        for (int a = 0; a < 3; a++) v[a] = normal[(a + 1) % 3] * u[(a + 2) % 3] - normal[(a + 2) % 3] * u[(a + 1) % 3];
    }
    for (int k = 0; k < d - 1; k++)
        if (rows_curve(&w->rows, f)) pair_entries(p, w, n, i, j, across[k], 1.0, control);
}

static void separate(const Problem *p, Workspace *w, const Options *t, const Motion *o, int n, int i, int j, int pair, int slot) {
    const int d = p->dimension, P = p->pairs;
    const double required = p->separation[pair], bow = p->long_steps ? 2.0 * p->pair_aside[pair] : 0.0;
    const double least = o->least[(long)n * P + pair];
    if (!(required > 0.0) || least > required + bow + 2.5 * t->step_max) return;
    double here[MAX_DIMENSION], there[MAX_DIMENSION], normal[MAX_DIMENSION], control[MAX_DIMENSION];
    difference(p, o->q, n, i, j, here);
    difference(p, o->q, n + 1, i, j, there);
    for (int a = 0; a < d; a++) normal[a] = here[a] + there[a];
    double size = norm(d, normal);
    if (size <= 1e-6) {
        for (int a = 0; a < d; a++) normal[a] = there[a];
        size = norm(d, normal);
    }
    for (int a = 0; a < d; a++) normal[a] = size > 1e-9 ? normal[a] / size : (a == 0);
    double reached[2] = {0.0, 0.0};
    for (int a = 0; a < d; a++) reached[0] += normal[a] * here[a], reached[1] += normal[a] * there[a];
    /* how much nearer the pair comes between the samples than at them */
    const double dip = p->long_steps ? 0.0 : MAX(MIN(reached[0], reached[1]) - least, 0.0);
    for (int end = 0; end < 2; end++)
        if (n + end >= p->first) pair_row(p, w, slot + end, required + dip - reached[end], t->penalty, n + end, i, j, normal, -1.0, 0);
    if (!p->long_steps) return;
    difference(p, o->v, n, i, j, control);
    double between = 0.0;
    for (int a = 0; a < d; a++) between += normal[a] * (here[a] + 0.5 * control[a]);
    pair_row(p, w, slot + 2, MIN(required - between, 0.0), t->penalty, n, i, j, normal, -1.0, 1);
}

/* ||x_i - x_j|| + bow <= range, with bow the part by which the edge becomes longer between samples. */
static void hold_edge(const Problem *p, Workspace *w, const Options *t, const Motion *o, int n, int i, int j, int slot, double bow, int control) {
    const int d = p->dimension;
    double e[MAX_DIMENSION], v[MAX_DIMENSION];
    difference(p, o->q, n, i, j, e);
    if (control) {
        difference(p, o->v, n, i, j, v);
        for (int a = 0; a < d; a++) e[a] += 0.5 * v[a];
    }
    const double far = norm(d, e), level = control ? MIN(far - p->range, 0.0) : far + bow - p->range;
    if (level < -2.5 * t->step_max) return;
    for (int a = 0; a < d; a++) e[a] = far > 1e-9 ? e[a] / far : (a == 0);
    const int before = w->rows.count;
    pair_row(p, w, slot, level, t->penalty, n, i, j, e, 1.0, control);
    if (w->rows.count > before) edge_curvature(p, w, n, i, j, e, far, control);
}

/* How much longer a pair's distance becomes within interval n than at its ends. */
static double bow_of(const Problem *p, const Motion *o, long k) {
    return p->long_steps ? 0.0 : o->most[k] - MAX(o->sampled[k], o->sampled[k + p->pairs]);
}

/* Slots: for each sample and pair, after those of terms: ends and control point of separation, edge and its control. */
void pair_rows(const Problem *p, Workspace *w, const Options *t, const Motion *o) {
    const int m = p->agents, P = p->pairs;
    for (int n = 0; n <= p->steps; n++)
        for (int i = 0, pair = 0; i < m; i++)
            for (int j = i + 1; j < m; j++, pair++) {
                const long k = (long)n * P + pair;
                const int slot = w->terms + 5 * (int)k;
                if (n < p->steps) separate(p, w, t, o, n, i, j, pair, slot);
                if (!p->linked) continue;
                const int kept = n < p->steps && o->tree[k], before = n > 0 && o->tree[k - P];
                const double bow = MAX(kept ? bow_of(p, o, k) : 0.0, before ? bow_of(p, o, k - P) : 0.0);
                if ((kept || before) && n >= p->first) hold_edge(p, w, t, o, n, i, j, slot + 3, bow, 0);
                if (kept && p->long_steps) hold_edge(p, w, t, o, n, i, j, slot + 4, 0.0, 1);
            }
}
