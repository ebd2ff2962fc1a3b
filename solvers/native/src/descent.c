/* The descent: one interior-point step per linearisation of the whole coverage problem, with a soft minimum that sharpens.
 *
 * The best motion is kept by the exact cost J and the exact violations, whatever the interior point believes.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "problem.h"

/* Plain choices, by J after descents of box-3 from 16 guesses. */
#define LONG 0.3           /* part of a whole step from which on a small step means convergence */
#define SHRINK 0.5         /* of the trust region after a step by which the merit increases, */
#define GROW 1.2           /* and after one by which it decreases */
#define LEAST_REGION 0.01
#define CONVERGED_STEP 0.02 /* part of a small step at which the last stage ends */

static double now_s(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int motion_allocate(Motion *o, const Problem *p, const Workspace *w, int M) {
    const long pairs = MAX(p->pairs, 1), all = (long)w->terms * M + 1, times = (p->steps + 1) * pairs;
    memset(o, 0, sizeof(*o));
    o->x = malloc(sizeof(double) * w->variables);
    o->q = malloc(sizeof(double) * w->half);
    o->near = malloc(sizeof(int32_t) * all);
    double **floats[] = {&o->near_distance, &o->near_part, &o->near_excess, &o->share};
    for (int k = 0; k < 4; k++) *floats[k] = malloc(sizeof(double) * all);
    o->level = malloc(sizeof(double) * (w->terms + 1));
    o->least = malloc(sizeof(double) * times);
    o->most = malloc(sizeof(double) * times);
    o->sampled = malloc(sizeof(double) * times);
    o->tree = calloc(times, 1);
    if (o->x) o->v = o->x + w->stage;
    for (long k = 0; o->near && k < all; k++) o->near[k] = NONE;
    return o->x && o->q && o->near && o->near_distance && o->near_part && o->near_excess && o->share && o->level &&
           o->least && o->most && o->sampled && o->tree;
}

static void motion_free(Motion *o) {
    void *all[] = {o->x, o->q, o->near, o->near_distance, o->near_part, o->near_excess, o->share, o->level, o->least, o->most, o->sampled, o->tree};
    for (unsigned k = 0; k < sizeof(all) / sizeof(*all); k++) free(all[k]);
}

/* Divide the variables into blocks, and number the reduced variables and all entries block by block. */
static int divide(const Problem *p, Workspace *w) {
    const int whole = w->variables <= p->dense_max, d = p->dimension, N = p->steps;
    w->blocks = whole ? 1 : p->agents;
    w->block = calloc(w->blocks, sizeof(Block));
    w->block_of = malloc(sizeof(int32_t) * w->half);
    w->local = malloc(sizeof(int32_t) * w->half);
    w->row_of = malloc(sizeof(long) * w->half);
    if (!w->block || !w->block_of || !w->local || !w->row_of) return 0;
    long hessian = 0, condensed = 0, factor = 0;
    for (int k = 0; k < w->blocks; k++) {
        Block *b = w->block + k;
        b->first = whole ? 0 : k * d;
        b->stage = whole ? w->stage : d;
        b->half = (N + 1) * b->stage;
        b->variables = b->half + b->stage;
        b->hessian = hessian;
        b->condensed = condensed;
        b->factor = factor;
        b->free_first = w->free;
        b->equality_first = w->equalities;
        for (int s = 0; s < N + 2; s++)
            for (int j = 0; j < b->stage; j++) {
                const int i = s * w->stage + b->first + j;
                w->free_of[i] = p->fixed[i] ? NONE : w->free++;
                /* the last velocities of a closed motion are the first */
                if (s == N + 1 && p->closed) {
                    if (w->free_of[i] >= 0) w->free--;
                    w->free_of[i] = w->free_of[w->stage + b->first + j];
                }
                if (s == 0) continue;
                const int column = i - w->stage, local = (s - 1) * b->stage + j;
                w->block_of[column] = k;
                w->local[column] = local;
                w->row_of[column] = hessian + (long)local * b->half;
            }
        b->free = w->free - b->free_first;
        for (int j = 0; j < b->stage; j++) w->equalities += p->end_fixed && p->active[(b->first + j) / d];
        b->equalities = w->equalities - b->equality_first;
        hessian += (long)b->half * b->half;
        condensed += (long)b->variables * b->variables;
        factor += (long)b->free * b->free;
    }
    return 1;
}

/* Sizes and what evaluation needs; `linearise` adds Hessians and rows. */
static int workspace_allocate(Workspace *w, const Problem *p, const Options *t, int with_hessian) {
    const int st = p->agents * p->dimension, N = p->steps, pairs = p->pairs, m = p->agents;
    memset(w, 0, sizeof(*w));
    w->stage = st;
    w->half = (N + 1) * st;
    w->variables = w->half + st;
    w->free_of = malloc(sizeof(int32_t) * w->variables);
    w->term_first = malloc(sizeof(int32_t) * (p->demands + 1));
    if (!w->free_of || !w->term_first) return 0;
    for (int e = 0; e < p->demands; e++) {
        w->term_first[e] = w->terms;
        w->terms += p->demand_looks[e];
        w->widest = MAX(w->widest, p->demand_looks[e] * t->samples);
    }
    w->has_velocity_columns = p->parts > 1 || p->continuous || p->long_steps || p->instants > 0;
    const long half = w->half, nx = w->variables;
    const long scratch = MAX(nx, nearest_doubles(p, w->widest)) + 8;
    if (!(w->index = malloc(sizeof(int32_t) * (w->widest + 1))) || !(w->scratch = malloc(sizeof(double) * scratch))) return 0;
    if (!with_hessian) return 1;
    if (!divide(p, w)) return 0;
    const Block *last = w->block + w->blocks - 1;
    const long hessian = last->hessian + (long)last->half * last->half, condensed = last->condensed + (long)last->variables * last->variables;
    const long factor = last->factor + (long)last->free * last->free, nf = MAX(w->free, 1), ne = w->equalities + 1;
    struct { double **place; long count; } blocks[] = {
        {&w->Hqq, hessian}, {&w->Hqv, hessian}, {&w->Hvv, hessian}, {&w->B, (long)last->variables * last->half}, {&w->M, condensed},
        {&w->R, factor}, {&w->E, 2 * ne * nf}, {&w->S, ne * ne}, {&w->gradient_q, half}, {&w->gradient_v, half},
        {&w->g, nx}, {&w->rhs, nf}, {&w->dx, nx}, {&w->dq, half}, {&w->dv, half}, {&w->tmp, half + ne}, {&w->diagonal, nf},
        {&w->residual, nf}, {&w->direction, nf}, {&w->product, nf}, {&w->solution, nf}, {&w->part, w->blocks},
    };
    w->hessian = hessian;
    for (unsigned k = 0; k < sizeof(blocks) / sizeof(*blocks); k++)
        if (!(*blocks[k].place = malloc(sizeof(double) * (blocks[k].count + 1)))) return 0;
    const long slots = w->terms + 5L * (N + 1) * pairs + (2 + 6L * MAX_DIMENSION) * (N + 1) * m + 2L * p->instants * (N + 1) * pairs;
    const long more = 4L * (N + 1) * pairs;
    const long entries = (long)w->terms * t->samples * p->dimension * 3 + 80L * (N + 1) * pairs + 40L * (N + 1) * m +
                         24L * 2 * p->instants * (N + 1) * pairs + 128;
    return rows_allocate(&w->rows, slots + more, entries, slots);
}

static void workspace_free(Workspace *w) {
    void *all[] = {w->free_of, w->term_first, w->index, w->block, w->block_of, w->local, w->row_of, w->diagonal, w->residual,
                   w->direction, w->product, w->solution, w->part, w->Hqq, w->Hqv, w->Hvv, w->B, w->M, w->R, w->E, w->S, w->gradient_q,
                   w->gradient_v, w->g, w->rhs, w->dx, w->dq, w->dv, w->tmp, w->scratch};
    for (unsigned k = 0; k < sizeof(all) / sizeof(*all); k++) free(all[k]);
    rows_free(&w->rows);
}

/* Everything that judge and linearisation need of a motion, once. */
static void evaluate(const Problem *p, const Workspace *w, const Options *t, double beta, Motion *o) {
    o->violation = o->penalty = 0.0;
    roll_out(p, o->x, o->q);
    find_nearest(p, w, t->samples, o);
    coverage_levels(p, w, t, beta, o);
    measure_limits(p, t, o);
    if (p->agents > 1) measure_pairs(p, o);
    measure_stopping(p, o);
}

static double merit_of(const Options *t, double cost, double braking) {
    return cost + t->braking_cost * MAX(braking - t->braking_tolerance, 0.0);
}

/* Keep the motion if it is better than the best: feasible first, then by cost; else by violation. */
static void keep_better(const Options *t, const Workspace *w, const Motion *o, double *x, Result *best) {
    const int feasible = o->violation <= t->feasibility, was = best->violation <= t->feasibility;
    int better = feasible;
    if (feasible == was)
        better = feasible ? merit_of(t, o->hard, o->braking) < merit_of(t, best->cost, best->braking) : o->violation < best->violation;
    if (!better) return;
    best->cost = o->hard;
    best->violation = o->violation;
    best->braking = o->braking;
    memcpy(x, o->x, sizeof(double) * w->variables);
}

static int complete(const Options *t, const Result *r) {
    return r->violation <= t->feasibility && r->cost == 0.0 && r->braking <= t->braking_tolerance;
}

static void linearise(const Problem *p, Workspace *w, const Options *t, const Motion *o) {
    const size_t size = sizeof(double) * w->hessian;
    memset(w->Hqq, 0, size);
    memset(w->Hvv, 0, size);
    if (w->has_velocity_columns) memset(w->Hqv, 0, size);
    memset(w->gradient_q, 0, sizeof(double) * w->half);
    memset(w->gradient_v, 0, sizeof(double) * w->half);
    rows_begin(&w->rows);
    coverage_rows(p, w, t, o);
    limit_rows(p, w, t, o);
    if (p->agents > 1) pair_rows(p, w, t, o);
    stopping_rows(p, w, t, o);
}

/* J_beta and what its motion violates: it decides how far the next step may go. */
static double merit_of_step(const Options *t, const Motion *o) { return o->soft + t->penalty * (o->penalty + o->braking_sum); }

static int descend(const Problem *p, const Options *t, Workspace *w, Motion *o, double *x, Result *best) {
    const double deadline = now_s() + t->deadline_s;
    int stage = 0, within = 0;
    memcpy(o->x, x, sizeof(double) * w->variables);
    evaluate(p, w, t, t->sharpness[0], o);
    best->cost = o->hard;
    best->violation = o->violation;
    best->braking = o->braking;
    w->rows.mu = t->barrier;
    w->rows.least_room = t->least_room;
    w->region = 1.0;
    for (best->iterations = 0; best->iterations < t->iterations; best->iterations++) {
        double step = 0.0, length = 1.0;
        if (complete(t, best)) return COMPLETE;
        if (now_s() >= deadline) return DEADLINE;
        if (w->free == 0) return CONVERGED;
        w->rows.overshoot = w->region * t->overshoot[stage];
        linearise(p, w, t, o);
        if (!newton_step(p, w, t, t->floor[stage], &step, &length)) return NUMERICAL;
        for (int i = 0; i < w->variables; i++) o->x[i] += w->dx[i];
        within++;
        const int last = stage == t->stages - 1;
        const int next = !last && (within >= t->stage_iterations || (length > LONG && step < t->small_step));
        const double before = merit_of_step(t, o);
        if (next) stage++, within = 0;
        evaluate(p, w, t, t->sharpness[stage], o);
        if (next) w->region = MIN(1.0, 2.0 * w->region);
        else w->region = merit_of_step(t, o) > before ? MAX(SHRINK * w->region, LEAST_REGION) : MIN(1.0, GROW * w->region);
        keep_better(t, w, o, x, best);
        best->stage = stage;
        if (last && within > 3 && length > LONG && step < CONVERGED_STEP * t->small_step && o->violation <= t->feasibility)
            return complete(t, best) ? COMPLETE : CONVERGED;
    }
    return complete(t, best) ? COMPLETE : MAX_ITERATIONS;
}

/* Decrease J from the variables `x`, which become those of the best motion found. */
int coverage_descent(const Problem *p, const Options *t, double *x, Result *best) {
    Workspace w;
    Motion o;
    memset(&o, 0, sizeof(o));
    best->outcome = OUT_OF_MEMORY;
    if (workspace_allocate(&w, p, t, 1) && motion_allocate(&o, p, &w, t->samples)) best->outcome = descend(p, t, &w, &o, x, best);
    motion_free(&o);
    workspace_free(&w);
    return best->outcome;
}

/* J, violations and braking violation of a motion, as the descent sees them. */
int coverage_evaluate(const Problem *p, const Options *t, const double *x, Result *found) {
    Workspace w;
    Motion o;
    memset(&o, 0, sizeof(o));
    found->outcome = OUT_OF_MEMORY;
    if (workspace_allocate(&w, p, t, 0) && motion_allocate(&o, p, &w, t->samples)) {
        memcpy(o.x, x, sizeof(double) * w.variables);
        evaluate(p, &w, t, t->sharpness[0], &o);
        found->cost = o.hard;
        found->violation = o.violation;
        found->braking = o.braking;
        found->outcome = CONVERGED;
    }
    motion_free(&o);
    workspace_free(&w);
    return found->outcome;
}
